//! The devices that are held to the reference.

mod bus;
mod drives;
mod guard;
mod joints;
mod lk;
mod odrive;
#[cfg(feature = "hal")]
pub(super) mod pins;

use super::reference::{Opens, Refusal, Rivals, Rules, Setup};
pub(super) use bus::{Both, Wheel};
pub(super) use drives::{Damiao, RobStride, Vesc};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    ArmError, Claim, Condition, Conditions, HealthConfig, Link, MotorName, Reaction, TargetError,
};
use drivetrain::time::{Edge, Instant, Tick};
pub(super) use guard::Bare;
pub(super) use joints::Snake;
pub(super) use lk::{Lk, Rmd};
pub(super) use odrive::Odrive;

/// A device of `N` motors that all hear, and are set, together.
pub(super) trait Subject<const N: usize> {
    const RULES: [Rules; N];

    fn hear(&mut self, now: Instant);
    fn link(&self) -> [Link; N];
    fn arm(&mut self, now: Instant) -> Result<(), Refusal>;
    fn is_armed(&self) -> [bool; N];
    /// Sets a target that is this share of the full output.
    fn set(&mut self, value: f32) -> [Result<(), TargetError>; N];
    /// Tells for which motors there is such a call.
    fn relax(&mut self) -> [bool; N];
    fn disarm(&mut self);
    fn stop(&mut self);
    fn clear_stop(&mut self);
    /// Runs an update and takes every frame; returns the output of each motor as a share of the full one, 0 for a motor that is not driven.
    fn outputs(&mut self, tick: Tick) -> [f64; N];
    /// Tells whether the last update gave a command, or the drive takes none.
    fn has_commanded(&self) -> bool {
        true
    }
    fn conditions(&self) -> [Conditions; N];
    /// Returns an unread edge, with the place of its motor.
    fn next_edge(&mut self) -> Option<(usize, Edge<Condition, MotorName>)>;

    /// Returns a command of a motor as another controller sends it.
    fn command(&self, motor: usize) -> Option<CanFrame> {
        _ = motor;
        None
    }
    fn ingest(&mut self, frame: &CanFrame, now: Instant) {
        _ = (frame, now);
    }
    fn second_master(&self) -> [Option<Claim>; N] {
        [const { None }; N]
    }
    /// Returns how many commands of another controller the device has counted, if it does.
    fn counted(&self) -> Option<u32> {
        None
    }
}

const BUS: Rules = Rules {
    late_us: Some(10_000),
    resumes: false,
    has_steps: true,
    takes_turns: true,
    arms_later: false,
    is_prepared: false,
    room: 12,
    loses_zero: false,
    opens: Opens::Clamps,
    opens_again: false,
    resolution: 1e-4,
    rivals: Rivals::Configured,
};
const OWN: Rules = Rules { takes_turns: false, room: 6, ..BUS };
const ACTUATOR: Rules = Rules { opens_again: true, ..OWN };
/// A drive whose own loop follows the target, with the resolution of its frames.
const PREPARED: Rules = Rules { is_prepared: true, resolution: 0.013, ..ACTUATOR };
const FOLLOWING: Rules = Rules { opens: Opens::Scales, resolution: 0.002, ..PREPARED };

/// No motor here turns: that one stands in spite of its output is not looked for. Feedback comes beside the answers too, as of a second drive.
const STANDS: HealthConfig = HealthConfig::new()
    .with_reaction(Condition::DuplicateId, Reaction::Ignore)
    .with_reaction(Condition::Stalled, Reaction::Ignore)
    .with_reaction(Condition::Frozen, Reaction::Ignore);

fn health(setup: Setup) -> &'static HealthConfig {
    static IGNORES: HealthConfig = STANDS.with_reaction(Condition::SecondMaster, Reaction::Ignore);
    static REPORTS: HealthConfig = STANDS;
    static RELAXES: HealthConfig = STANDS.with_reaction(Condition::SecondMaster, Reaction::Relax);
    match setup.on_rival {
        Reaction::Ignore => &IGNORES,
        Reaction::Report => &REPORTS,
        Reaction::Relax => &RELAXES,
    }
}

fn refusal(error: ArmError) -> Refusal {
    match error {
        ArmError::Stopped => Refusal::Stopped,
        ArmError::Missing(_) => Refusal::Missing,
        ArmError::SecondMaster(_) => Refusal::SecondMaster,
        ArmError::Setting(_) => Refusal::Setting,
        ArmError::NotReleased => Refusal::NotReleased,
        error => panic!("refused: {error}"),
    }
}

/// The calls of all devices on a bus.
macro_rules! stops {
    ($self:ident => $device:expr) => {
        fn arm(&mut $self, now: Instant) -> Result<(), Refusal> {
            Devices::arm(&mut $device, now).map_err(refusal)
        }
        fn disarm(&mut $self) {
            Devices::disarm(&mut $device);
        }
        fn stop(&mut $self) {
            Devices::emergency_stop(&mut $device);
        }
        fn clear_stop(&mut $self) {
            Devices::clear_emergency_stop(&mut $device);
        }
        fn ingest(&mut $self, frame: &CanFrame, now: Instant) {
            _ = Devices::ingest(&mut $device, frame, now);
        }
    };
}
use stops;

/// The calls of an actuator.
macro_rules! own {
    ($self:ident => $motor:expr) => {
        stops!($self => $motor);

        fn link(&$self) -> [Link; 1] {
            [$motor.guard().link()]
        }
        fn is_armed(&$self) -> [bool; 1] {
            [$motor.guard().is_armed()]
        }
        fn relax(&mut $self) -> [bool; 1] {
            [false]
        }
        fn conditions(&$self) -> [Conditions; 1] {
            [$motor.guard().conditions()]
        }
        fn next_edge(&mut $self) -> Option<(usize, Edge<Condition, MotorName>)> {
            Devices::next_edge(&mut $motor).map(|edge| (0, edge))
        }
        fn second_master(&$self) -> [Option<Claim>; 1] {
            [CanDevice::second_master(&$motor)]
        }
    };
}
use own;
