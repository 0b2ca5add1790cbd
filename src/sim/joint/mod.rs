//! Joint motors: drives that hold their own position loop.

mod drive;

pub(crate) use drive::Drive;

use super::{AttachError, Line, World};
use crate::snake::PULSES_PER_TURN;
use crate::time::Duration;
use crate::units::AngularVelocity;

/// A joint of a snake robot to attach to a [`World`].
///
/// It speaks the protocol of [`snake`](crate::snake). **Its behaviour is an estimate**: it goes to its target with the
/// speed, acceleration and deceleration of its registers, its shaft 2 ms behind; it answers 150 to 250 µs after a request;
/// disabled, friction stops it; without a command it goes on for ever; without a supply it forgets every register and
/// where its zero was.
///
/// # Examples
/// ```
/// use drivetrain::sim::{JointConfig, World};
/// use drivetrain::snake::{Command, Register};
/// use drivetrain::time::Duration;
/// use embedded_can::nb::Can;
///
/// let world = World::new(7);
/// let neck = world.attach_joint(JointConfig::new(3).with_position(0))?;
/// let mut can = world.controller();
/// let setup = [Register::Mode, Register::Current, Register::Enable].map(|register| (register, 1));
/// let motion = [
///     (Register::Acceleration, 1_092_266),
///     (Register::Deceleration, 1_092_266),
///     (Register::Speed, 65_536), // a turn a second
///     (Register::Position, 32_768), // half a turn
/// ];
/// for (register, value) in motion.into_iter().chain(setup) {
///     let frame = Command::Write(register, value).frame(3).ok_or("id")?;
///     can.transmit(&frame).map_err(|_| "refused")?;
///     world.advance(Duration::from_millis(1));
/// }
/// world.advance(Duration::from_millis(300)); // 60 ms to speed up, then in uniform motion
/// let state = world.joint(neck).ok_or("not attached")?;
/// assert!((state.velocity.as_rpm() - 60.0).abs() < 0.1 && state.is_enabled);
/// world.advance(Duration::from_millis(400));
/// assert_eq!(world.joint(neck).map(|joint| joint.pulses), Some(32_768));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JointConfig {
    pub(crate) id: u8,
    pub(crate) line: Line,
    pub(crate) position: Option<i32>,
    pub(crate) latency: Duration,
}

impl JointConfig {
    /// Takes the id that is set on the joint: 1 to 12.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        Self { id, line: Line::Can1, position: None, latency: Duration::from_micros(150) }
    }

    /// Puts the joint on a bus other than the first.
    #[must_use]
    pub const fn with_line(self, line: Line) -> Self {
        Self { line, ..self }
    }

    /// Sets where its counter stands at the start, in pulses; by default the seed chooses within half a turn.
    #[must_use]
    pub const fn with_position(self, pulses: i32) -> Self {
        Self { position: Some(pulses), ..self }
    }

    /// Sets the least time until it answers; 150 µs at first.
    #[must_use]
    pub const fn with_latency(self, latency: Duration) -> Self {
        Self { latency, ..self }
    }
}

/// A joint of a [`World`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct JointKey(pub(crate) u8);

impl JointKey {
    /// The number of joints in a world.
    pub const CAPACITY: usize = 12;

    pub(crate) fn new(index: usize) -> Option<Self> {
        u8::try_from(index).ok().filter(|_| index < Self::CAPACITY).map(Self)
    }
}

/// The true state of a simulated joint.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct JointState {
    /// Where the shaft is, in pulses since the start, whatever its drive forgot.
    pub pulses: i32,
    /// What the drive's own counter shows: the same, until it forgot where its zero was.
    pub counter: i32,
    /// How fast it turns.
    pub velocity: AngularVelocity,
    /// Whether its drive moves it, or holds it.
    pub is_enabled: bool,
    /// The target in the drive's register, in pulses.
    pub target: i32,
    /// Requests that it answered.
    pub replies: u32,
    /// How often a frame of the controller with its id began in the same bit as its reply: on a real bus both would have
    /// been destroyed. Here the controller goes first.
    pub collisions: u32,
}

impl JointState {
    /// Returns where the shaft is, in degrees since the start.
    #[must_use]
    pub fn degrees(&self) -> f32 {
        self.pulses as f32 * (360.0 / PULSES_PER_TURN as f32)
    }
}

impl World {
    /// Puts a joint on a bus. Two with the same id are possible, as in reality.
    ///
    /// # Errors
    /// When there is no such id, or when there are 12 joints already.
    pub fn attach_joint(&self, config: JointConfig) -> Result<JointKey, AttachError> {
        self.with(|engine| engine.attach_joint(config))
    }

    /// Returns the true state of a joint; `None` for a key of another world.
    #[must_use]
    pub fn joint(&self, joint: JointKey) -> Option<JointState> {
        self.with(|engine| engine.joint(joint))
    }
}
