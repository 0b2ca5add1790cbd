//! The motors of a log, of each family.

use super::motors::{Model, Spec};
use drivetrain::dji::{self, AnyHandle, Bus, Config, Gm6020Current, Gm6020Voltage, M2006, M3508};
use drivetrain::encoder::{GearRatio, Position};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, CanDevice, Claim, DriveProtocol, ImpedanceControl, Ingest, MotorName,
};
use drivetrain::time::Instant;
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};
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
        CanDevice::claims(&self.bus).filter(|claim| claim.is_feedback()).collect()
    }
}

impl<M: DriveProtocol> Listener for Actuator<M> {
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
            error: (vitals.has_fault || vitals.has_warning)
                .then(|| format!("error {}", vitals.error_code)),
            rotor_counts: None,
            ambiguous_gaps: 0,
        })
    }

    fn feedback(&self) -> Vec<Claim> {
        CanDevice::claims(self).filter(|claim| claim.is_feedback()).collect()
    }
}

/// A motor on a VESC, which reports its turns and its current beside the rest.
struct Vesc(Actuator<vesc::Motor>);

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
            return Ingest::WrongLength(frame.length());
        }
        let data = frame.bytes();
        if let Some(state) = lk::State::decode(data) {
            self.state = Some(state);
            return Ingest::Taken;
        }
        let Some(feedback) = lk::Feedback::decode(data).filter(|_| data[1] != 0) else {
            return Ingest::Unrelated;
        };
        let Some(phase) = self.phase(&feedback) else { return Ingest::WrongField };
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
        vec![Claim::feedback(id, self.name())]
    }
}

/// Makes the motor that the command line names.
pub(crate) fn listener(spec: Spec) -> Result<Box<dyn Listener>, String> {
    let Spec { id, host, .. } = spec;
    // Limits and control modes count for commands only, and feedback is the same in each of them.
    let (any_nm, any_speed) = (1.0, AngularVelocity::from_rpm(1.0));
    let impedance = || ImpedanceControl::new(any_nm).map_err(text);
    match spec.model {
        Model::M3508 => dji::<M3508>(id),
        Model::M2006 => dji::<M2006>(id),
        Model::Gm6020 => dji::<Gm6020Voltage>(id),
        Model::Gm6020Current => dji::<Gm6020Current>(id),
        Model::Damiao(model) => {
            let motor = damiao::Motor::new(model, id, impedance()?).map_err(text)?;
            own(match host {
                Some(master) => motor.with_master_id(master).map_err(text)?,
                None => motor,
            })
        }
        Model::Lk(model) => {
            // Refuses an id that is none.
            lk::Motor::new(model, id, lk::Mode::position_velocity(any_speed)).map_err(text)?;
            Ok(Box::new(Lk { model, id, drive: None, state: None, rotor: 0 }))
        }
        Model::Rmd(model) => {
            let mode = lk::Mode::position_velocity(any_speed);
            own(rmd::Motor::new(model, id, mode).map_err(text)?)
        }
        Model::RobStride(model) => {
            let motor = robstride::Motor::new(model, id, impedance()?).map_err(text)?;
            own(match host.map(u8::try_from) {
                Some(Ok(host)) => motor.with_host_id(host).map_err(text)?,
                Some(Err(_)) => return Err("a host id of RobStride is at most 255".into()),
                None => motor,
            })
        }
        Model::Odrive(firmware) => {
            let model = odrive::Model::new("ODrive", 100.0).map_err(text)?;
            let mode = odrive::Mode::velocity(any_nm);
            own(odrive::Motor::new(model, firmware, id, any_speed, mode).map_err(text)?)
        }
        Model::Vesc(pole_pairs) => {
            let model = vesc::Model {
                name: "VESC",
                pole_pairs,
                gear: GearRatio::DIRECT,
                torque_constant_nm_per_a: 1.0,
                current_limit_a: 1.0,
                max_velocity: any_speed,
            };
            let motor = vesc::Motor::new(model, id, vesc::Mode::velocity()).map_err(text)?;
            Ok(Box::new(Vesc(Actuator::new(motor))))
        }
    }
}

fn own<M: DriveProtocol + 'static>(motor: M) -> Result<Box<dyn Listener>, String> {
    Ok(Box::new(Actuator::new(motor)))
}

fn dji<M: dji::Model>(id: u8) -> Result<Box<dyn Listener>, String> {
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M>::new(id)).map_err(text)?.erase();
    Ok(Box::new(Dji { bus, motor, name: MotorName::new(M::FACTS.name, id) }))
}

fn all_turns(position: Position) -> f64 {
    position.turns() as f64 + f64::from(position.angle().as_turns())
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
