//! The motors of a log, of each family.

use drivetrain::damiao;
use drivetrain::dji::{AnyHandle, Bus, Config, Model};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    CanDevice, Claim, ImpedanceControl, Ingest, MotorName, Own, OwnMotor, Role,
};
use drivetrain::time::Instant;
use std::fmt::{self, Debug};

/// The state of a motor after a frame.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// Of the output shaft.
    pub(crate) turns: f64,
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
            turns: state.position.turns() as f64 + f64::from(state.position.angle().as_turns()),
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
            turns: motor.angle().map_or(0.0, |angle| angle.as_turns().into()),
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

type Outcome = Result<Box<dyn Listener>, String>;

pub(crate) fn dji<M: Model>(id: u8) -> Outcome {
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M>::new(id)).map_err(|error| error.to_string())?.erase();
    Ok(Box::new(Dji { bus, motor, name: MotorName::new(M::FACTS.name, id) }))
}

/// A motor of Damiao that answers to the master id 0x10 above its own.
pub(crate) fn damiao(model: damiao::Model, id: u8) -> Outcome {
    // Feedback is the same in each control mode.
    let mode = ImpedanceControl::new(model.tmax_nm()).map_err(|error| error.to_string())?;
    let motor = damiao::Motor::new(model, id, mode).map_err(|error| error.to_string())?;
    Ok(Box::new(Own::new(motor)))
}

/// Returns the model of Damiao with a name such as `damiao4310` or `damiaoh6215`.
pub(crate) fn damiao_model(name: &str) -> Option<damiao::Model> {
    let number = name.strip_prefix("damiao")?.to_ascii_uppercase();
    let is_called = |model: &&damiao::Model| {
        let name = model.name().trim_start_matches("DM-");
        name == number || name.trim_start_matches('J') == number
    };
    damiao::Model::ALL.iter().find(is_called).copied()
}
