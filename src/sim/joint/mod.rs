//! Joint motors: drives with a position loop of their own.

mod drive;

pub(crate) use drive::Drive;

use super::{Line, MotorKey, SimError, Simulation};
use crate::time::Duration;

/// A joint of a snake robot to attach to a [`Simulation`].
///
/// A joint speaks the protocol of [`snake`](crate::snake). **Its behaviour is an estimate**: the joint moves to its target
/// with the speed, acceleration and deceleration of its registers, its shaft 2 ms behind; it answers 150 to 250 µs after a
/// request; disabled, friction stops the shaft; without a command the joint continues for ever; without a supply, every
/// register and the zero are lost.
///
/// # Examples
/// ```
/// use drivetrain::sim::{JointConfig, Simulation};
/// use drivetrain::snake::{Command, Register};
/// use drivetrain::time::Duration;
/// use embedded_can::nb::Can;
///
/// let world = Simulation::new(7);
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
/// let state = world.motor(neck).ok_or("not attached")?;
/// assert!((state.velocity.as_rpm() - 60.0).abs() < 0.1 && state.is_enabled);
/// world.advance(Duration::from_millis(400));
/// let state = world.motor(neck).ok_or("not attached")?;
/// assert_eq!((state.encoder_counts, state.command), (32_768, 32_768));
/// assert!((state.position.as_turns() - 0.5).abs() < 1e-5);
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
    /// Takes the id of the joint: 1 to 12.
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

    /// Sets the least time until an answer; 150 µs at first.
    #[must_use]
    pub const fn with_latency(self, latency: Duration) -> Self {
        Self { latency, ..self }
    }
}

impl Simulation {
    /// Puts a joint on a bus. Two with the same id are possible, as in reality.
    ///
    /// # Errors
    /// When there is no such id, or when there are 12 joints already.
    pub fn attach_joint(&self, config: JointConfig) -> Result<MotorKey, SimError> {
        self.with(|engine| engine.attach_joint(config))
    }
}
