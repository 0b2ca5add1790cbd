//! The motors of a log, of each family.

use drivetrain::dji::{AnyHandle, Bus, Config, Model};
use drivetrain::encoder::{GearRatio, Position};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    CanDevice, Claim, ImpedanceControl, Ingest, Malformed, MotorName, Own, OwnMotor, Role,
};
use drivetrain::time::Instant;
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, odrive, robstride, vesc};
use embedded_can::{Frame, StandardId};
use std::fmt::{self, Debug};

/// The state of a motor after a frame.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// Of the output shaft; `None` before a frame that tells them.
    pub(crate) turns: Option<f64>,
    pub(crate) rpm: f32,
    pub(crate) amperes: Option<f32>,
    pub(crate) temperature_c: Option<i16>,
    pub(crate) error: Option<String>,
    pub(crate) rotor_counts: Option<i64>,
    /// The number of gaps after which the turns are a guess.
    pub(crate) ambiguous_gaps: u16,
}

/// A motor that takes frames and is never driven.
pub(crate) trait Listener {
    fn name(&self) -> MotorName;

    /// Takes a frame, as a device does.
    fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest;

    fn reading(&self) -> Option<Reading>;

    /// Lists the ids of its feedback.
    fn feedback(&self) -> Vec<Claim>;
}

impl Debug for dyn Listener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Debug::fmt(&self.name(), f)
    }
}

/// A motor of DJI on a bus of its own.
struct Dji {
    bus: Bus,
    motor: AnyHandle,
    name: MotorName,
}

impl Listener for Dji {
    fn name(&self) -> MotorName {
        self.name
    }

    fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        self.bus.ingest(frame, now)
    }

    fn reading(&self) -> Option<Reading> {
        let state = self.bus.state(self.motor)?;
        Some(Reading {
            turns: Some(all_turns(state.position)),
            rpm: state.velocity.as_rpm(),
            amperes: Some(state.current.as_amperes()),
            temperature_c: state.temperature_c,
            error: state.error.map(|error| error.to_string()),
            rotor_counts: Some(state.rotor_counts),
            ambiguous_gaps: state.ambiguous_gaps,
        })
    }

    fn feedback(&self) -> Vec<Claim> {
        CanDevice::claims(&self.bus).filter(|claim| claim.role() == Role::Feedback).collect()
    }
}

impl<M: OwnMotor> Listener for Own<M> {
    fn name(&self) -> MotorName {
        self.motor().name()
    }

    fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        CanDevice::ingest(self, frame, now)
    }

    fn reading(&self) -> Option<Reading> {
        let (motor, vitals) = (self.motor(), self.motor().vitals());
        Some(Reading {
            turns: motor.angle().map(|angle| angle.as_turns().into()),
            rpm: motor.velocity().as_rpm(),
            amperes: None,
            temperature_c: vitals.temperature_c,
            error: vitals.error.map(|_| format!("error {}", vitals.error_code)),
            rotor_counts: None,
            ambiguous_gaps: 0,
        })
    }

    fn feedback(&self) -> Vec<Claim> {
        CanDevice::claims(self).filter(|claim| claim.role() == Role::Feedback).collect()
    }
}

/// A motor on a VESC, which reports its turns and its current beside the rest.
struct Vesc(Own<vesc::Motor>);

impl Listener for Vesc {
    fn name(&self) -> MotorName {
        self.0.motor().name()
    }

    fn take(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        self.0.take(frame, now)
    }

    fn reading(&self) -> Option<Reading> {
        let (motor, reading) = (self.0.motor(), self.0.reading()?);
        let turns = motor.position().map(all_turns);
        Some(Reading { turns, amperes: motor.feedback().current_a, ..reading })
    }

    fn feedback(&self) -> Vec<Claim> {
        self.0.feedback()
    }
}

/// A motor of LK-TECH in whatever control mode: commands and answers have one id and the same first bytes.
struct Lk {
    model: lk::Model,
    id: u8,
    drive: Option<lk::Feedback>,
    state: Option<lk::State>,
    /// In 1/65536 of a turn.
    rotor: i64,
}

impl Lk {
    /// Returns the angle of the rotor in 1/65536 of a turn; `None` if the encoder has fewer bits.
    fn phase(&self, feedback: &lk::Feedback) -> Option<u16> {
        let spare = 16 - u32::from(self.model.encoder_bits());
        feedback.encoder.checked_mul(1 << spare)
    }
}

impl Listener for Lk {
    fn name(&self) -> MotorName {
        MotorName::new(self.model.name(), self.id)
    }

    /// Byte 1 of a command is 0. It is a temperature of 0 °C in feedback, which so is left out at exactly 0 °C.
    fn take(&mut self, frame: &CanFrame, _: Instant) -> Ingest {
        if !frame.is_data_frame() || self.feedback().iter().all(|claim| !claim.covers(frame.id())) {
            return Ingest::Unrelated;
        }
        if frame.length() != 8 {
            return Ingest::Malformed(Malformed::Length(frame.length()));
        }
        let data = frame.bytes();
        if let Some(state) = lk::State::decode(data) {
            self.state = Some(state);
            return Ingest::Taken;
        }
        let Some(feedback) = lk::Feedback::decode(data).filter(|_| data[1] != 0) else {
            return Ingest::Unrelated;
        };
        let Some(phase) = self.phase(&feedback) else { return Ingest::Malformed(Malformed::Field) };
        self.rotor = match self.drive.and_then(|before| self.phase(&before)) {
            Some(before) => self.rotor + i64::from(phase.wrapping_sub(before).cast_signed()),
            None => phase.into(),
        };
        self.drive = Some(feedback);
        Ingest::Taken
    }

    /// `None` before the first feedback: a state says nothing of the shaft.
    fn reading(&self) -> Option<Reading> {
        let drive = self.drive?;
        let errors = self.state.map_or(0, |state| state.errors);
        Some(Reading {
            turns: Some(self.rotor as f64 / 65_536.0 / f64::from(self.model.gear())),
            rpm: AngularVelocity::from_rad_per_s(drive.velocity_rad_per_s(&self.model)).as_rpm(),
            amperes: Some(f32::from(drive.current) * self.model.series().amperes_per_count()),
            temperature_c: Some(drive.temperature_c.into()),
            error: (errors != 0).then(|| format!("error {errors}")),
            rotor_counts: None,
            ambiguous_gaps: 0,
        })
    }

    fn feedback(&self) -> Vec<Claim> {
        let id = StandardId::new(0x140 + u16::from(self.id)).unwrap_or(StandardId::MAX);
        vec![Claim::new(id, Role::Feedback, self.name())]
    }
}

type Outcome = Result<Box<dyn Listener>, String>;

pub(crate) fn dji<M: Model>(id: u8) -> Outcome {
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M>::new(id)).map_err(text)?.erase();
    Ok(Box::new(Dji { bus, motor, name: MotorName::new(M::FACTS.name, id) }))
}

/// Makes a motor of another family; `None` if no family has a model of this name.
pub(crate) fn of_family(name: &str, id: u8) -> Option<Outcome> {
    [damiao, lk, robstride, odrive, vesc].iter().find_map(|family| family(name, id))
}

/// A motor of Damiao with a name such as `damiao4310` or `damiaoh6215`, that answers to the master id 0x10 above its own.
fn damiao(name: &str, id: u8) -> Option<Outcome> {
    let number = name.strip_prefix("damiao")?.to_ascii_uppercase();
    let is_called = |model: &&damiao::Model| {
        let name = model.name().trim_start_matches("DM-");
        name == number || name.trim_start_matches('J') == number
    };
    let model = *damiao::Model::ALL.iter().find(is_called)?;
    // Feedback is the same in each control mode.
    let mode = ImpedanceControl::new(model.tmax_nm()).map_err(text);
    let motor = mode.and_then(|mode| damiao::Motor::new(model, id, mode).map_err(text));
    Some(motor.map(|motor| Box::new(Own::new(motor)) as _))
}

/// A motor of LK-TECH by its name, such as `mg4005e-i10`.
fn lk(name: &str, id: u8) -> Option<Outcome> {
    let model = *lk::Model::ALL.iter().find(|model| model.name().eq_ignore_ascii_case(name))?;
    // Refuses an id that is none.
    let motor =
        lk::Motor::new(model, id, lk::Mode::position_velocity(AngularVelocity::from_rpm(1.0)));
    let listener = Lk { model, id, drive: None, state: None, rotor: 0 };
    Some(motor.map(|_| Box::new(listener) as _).map_err(text))
}

/// A motor of RobStride, such as `rs02`, or `cybergear`, with the host id 0xFD.
fn robstride(name: &str, id: u8) -> Option<Outcome> {
    let models = robstride::Model::ALL.iter();
    let model = *models.into_iter().find(|model| model.name().eq_ignore_ascii_case(name))?;
    let mode = ImpedanceControl::new(model.tmax_nm()).map_err(text);
    let motor = mode.and_then(|mode| robstride::Motor::new(model, id, mode).map_err(text));
    Some(motor.map(|motor| Box::new(Own::new(motor)) as _))
}

/// A motor at an ODrive, `odrive0.5` or `odrive0.6`: the shaft is that of the motor.
fn odrive(name: &str, id: u8) -> Option<Outcome> {
    use odrive::{Firmware, Mode, Model, Motor};
    let firmware = match name {
        "odrive0.5" => Firmware::V0_5,
        "odrive0.6" => Firmware::V0_6,
        _ => return None,
    };
    // The motor and its limits count for commands only.
    let model = Model::new("ODrive", 100.0).map_err(text);
    let fastest = AngularVelocity::from_rpm(1.0);
    let motor = model.and_then(|model| {
        Motor::new(model, firmware, id, fastest, Mode::velocity(1.0)).map_err(text)
    });
    Some(motor.map(|motor| Box::new(Own::new(motor)) as _))
}

/// A motor on a VESC, by its pole pairs, as in `vesc7`: the shaft is that of the motor.
fn vesc(name: &str, id: u8) -> Option<Outcome> {
    let model = vesc::Model {
        name: "VESC",
        pole_pairs: name.strip_prefix("vesc")?.parse().ok()?,
        gear: GearRatio::DIRECT,
        // What follows counts for commands only.
        torque_constant_nm_per_a: 1.0,
        current_limit_a: 1.0,
        max_velocity: AngularVelocity::from_rpm(1.0),
        is_reversed: false,
    };
    let motor = vesc::Motor::new(model, id, vesc::Mode::velocity()).map_err(text);
    Some(motor.map(|motor| Box::new(Vesc(Own::new(motor))) as _))
}

fn all_turns(position: Position) -> f64 {
    position.turns() as f64 + f64::from(position.angle().as_turns())
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
