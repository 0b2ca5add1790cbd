//! The control modes, with what a user chooses for each.

use super::command::Command;
use super::{ConfigError, Feedback, Model};
use crate::control::{Cascade, Pid, PidConfig};
use crate::math::{wrap_pi, wrap_tau};
use crate::motor::{Capabilities, Capability, Order, Target};
use crate::units::{Angle, AngularVelocity};

/// A control mode: [`CurrentControl`], [`Duty`], [`Velocity`] or [`Position`].
pub trait Mode: sealed::Mode {}

impl<M: sealed::Mode> Mode for M {}

pub(super) mod sealed {
    use super::{Angle, Capabilities, Command, ConfigError, Feedback, Model, Order};

    pub trait Mode: core::fmt::Debug + Copy {
        /// The drive itself controls the position, so its angle is that of status 4.
        const HAS_POSITION: bool = false;

        /// # Errors
        /// A value that is not allowed.
        fn check(&self, _model: &Model) -> Result<(), ConfigError> {
            Ok(())
        }

        fn capabilities(&self) -> Capabilities;

        /// Tells whether a target needs the angle of the shaft.
        fn needs_angle(&self) -> bool {
            Self::HAS_POSITION
        }

        /// Returns the command and its share of the largest effort, 0 where that is not known; `None` to rest.
        fn command(
            &mut self,
            order: Order,
            drive: &Feedback,
            angle: Option<Angle>,
            model: &Model,
        ) -> Option<(Command, f32)>;

        fn reset(&mut self) {}
    }
}

/// Rest: the command of a motor that is not driven. In each mode it is what a disarmed motor gets, and one without a target.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Rest {
    /// A current of 0: the shaft turns freely.
    Release,
    /// A current in A that brakes the shaft while it turns. It cannot hold a weight.
    Brake(f32),
    /// A current in A through phases that stand: the rotor is held in the nearest of its electrical turns, and gets warm. A shaft that
    /// turns fast is shaken by it, not stopped. Of the kinds of control only FOC has it; others take it for `Brake`.
    Handbrake(f32),
}

impl Rest {
    /// Returns the command, with a share of its current.
    pub(super) fn command(self, share: f32) -> Command {
        match self {
            Self::Release => Command::RELEASE,
            Self::Brake(current) => Command::Brake(current * share),
            Self::Handbrake(current) => Command::Handbrake(current * share),
        }
    }

    pub(super) fn check(self, model: &Model) -> Result<(), ConfigError> {
        let (Self::Brake(current) | Self::Handbrake(current)) = self else { return Ok(()) };
        let is_valid = current > 0.0 && current <= model.current_limit_a;
        if is_valid {
            Ok(())
        } else {
            Err(ConfigError::CurrentLimit(current, model.current_limit_a))
        }
    }
}

/// Current control: a torque becomes a current by the torque constant, and our own loops follow velocities and angles by a torque.
///
/// # Examples
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::vesc::CurrentControl;
///
/// let speed = PidConfig::new(0.02, 0.2, 0.0); // rad/s to Nm
/// let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0); // rad to rad/s
/// let wheel = CurrentControl::new().with_speed_loop(speed)?;
/// let joint = CurrentControl::new().with_loops(position, speed)?;
/// # Ok::<(), drivetrain::control::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct CurrentControl {
    loops: Loops,
}

#[derive(Debug, Clone, Copy)]
enum Loops {
    None,
    Speed(Pid),
    Both(Cascade),
}

impl CurrentControl {
    /// Takes torques.
    #[must_use]
    pub const fn new() -> Self {
        Self { loops: Loops::None }
    }

    /// Takes velocities too, by a loop from rad/s to Nm.
    ///
    /// # Errors
    /// As [`Pid::new`].
    pub fn with_speed_loop(self, speed: PidConfig) -> Result<Self, crate::control::ConfigError> {
        Ok(Self { loops: Loops::Speed(Pid::new(speed)?) })
    }

    /// Takes velocities and angles too, by loops from rad to rad/s and from rad/s to Nm.
    ///
    /// # Errors
    /// As [`Cascade::new`].
    pub fn with_loops(
        self,
        position: PidConfig,
        speed: PidConfig,
    ) -> Result<Self, crate::control::ConfigError> {
        Ok(Self { loops: Loops::Both(Cascade::new(position, speed)?) })
    }
}

impl Default for CurrentControl {
    fn default() -> Self {
        Self::new()
    }
}

impl sealed::Mode for CurrentControl {
    fn capabilities(&self) -> Capabilities {
        let torque = Capabilities::of(&[Capability::Torque]);
        match self.loops {
            Loops::None => torque,
            Loops::Speed(_) => torque.with(Capability::Velocity),
            Loops::Both(_) => torque.with(Capability::Velocity).with(Capability::Angle),
        }
    }

    fn needs_angle(&self) -> bool {
        matches!(self.loops, Loops::Both(_))
    }

    fn command(
        &mut self,
        Order { target, share, step }: Order,
        drive: &Feedback,
        angle: Option<Angle>,
        model: &Model,
    ) -> Option<(Command, f32)> {
        let velocity = model.velocity_of(drive.erpm?).as_rad_per_s();
        let limit = model.torque_limit_nm() * share;
        let (loops, wanted) = match (&mut self.loops, target) {
            (_, Target::Torque(torque)) => (None, torque),
            (Loops::Speed(speed), Target::Velocity(target)) => {
                let torque = speed.step(target.as_rad_per_s(), velocity, &step);
                (Some(speed), torque)
            }
            (Loops::Both(both), Target::Velocity(target)) => {
                let torque = both.speed_mut().step(target.as_rad_per_s(), velocity, &step);
                (Some(both.speed_mut()), torque)
            }
            (Loops::Both(both), Target::Angle(target)) => {
                let error = wrap_pi((target - angle?).as_radians());
                let torque = both.step(error, velocity, &step);
                (Some(both.speed_mut()), torque)
            }
            _ => return None,
        };
        if let Some(speed) = loops {
            speed.keep_integral_between(-limit, limit);
        }
        let torque = wanted.min(limit).max(-limit);
        // Rounding of the quotient must not take it past the limit.
        let most = model.current_limit_a * share;
        let current = model.current_of(torque).min(most).max(-most);
        Some((Command::Current(current), torque / model.torque_limit_nm()))
    }

    fn reset(&mut self) {
        match &mut self.loops {
            Loops::None => {}
            Loops::Speed(speed) => speed.reset(),
            Loops::Both(both) => both.reset(),
        }
    }
}

/// Duty control: our own loop follows a velocity by the share of the supply voltage.
///
/// A duty of 0 shorts the phases, so this mode brakes with all that the drive allows. The duty keeps near the one that the drive reports:
/// within the share of the order times the limit, so a motor that turns when it is armed is not braked at once.
#[derive(Debug, Clone, Copy)]
pub struct Duty {
    limit: f32,
    speed: Pid,
}

impl Duty {
    /// Takes the largest duty, above 0 and at most 1, and a loop from rad/s to duty: 1 is the whole supply.
    ///
    /// # Errors
    /// Names the value that is not allowed.
    pub fn new(limit: f32, speed: PidConfig) -> Result<Self, ConfigError> {
        if limit > 0.0 && limit <= 1.0 {
            Ok(Self { limit, speed: Pid::new(speed)? })
        } else {
            Err(ConfigError::Duty(limit))
        }
    }
}

impl sealed::Mode for Duty {
    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn command(
        &mut self,
        Order { target, share, step }: Order,
        drive: &Feedback,
        _angle: Option<Angle>,
        model: &Model,
    ) -> Option<(Command, f32)> {
        let Target::Velocity(target) = target else { return None };
        let target = within(target, model.max_velocity).as_rad_per_s();
        let velocity = model.velocity_of(drive.erpm?).as_rad_per_s();
        let reported = model.signed(drive.duty?).min(self.limit).max(-self.limit);
        let near = self.limit * share;
        let (lowest, highest) =
            ((reported - near).max(-self.limit), (reported + near).min(self.limit));
        let wanted = self.speed.step(target, velocity, &step);
        self.speed.keep_integral_between(lowest, highest);
        let duty = wanted.min(highest).max(lowest);
        Some((Command::Duty(model.signed(duty)), duty / self.limit))
    }

    fn reset(&mut self) {
        self.speed.reset();
    }
}

/// Velocity control by the drive's own loop.
///
/// # Examples
/// ```
/// use drivetrain::vesc::{Rest, Velocity};
///
/// let wheel = Velocity::new().with_standstill(Rest::Brake(5.0)); // a target of 0 brakes
/// # let _ = wheel;
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Velocity {
    standstill: Rest,
}

impl Velocity {
    /// A target of 0 lets the shaft go, as the drive does.
    #[must_use]
    pub const fn new() -> Self {
        Self { standstill: Rest::Release }
    }

    /// Sets what a target of exactly 0 does.
    #[must_use]
    pub const fn with_standstill(self, standstill: Rest) -> Self {
        Self { standstill }
    }
}

impl Default for Velocity {
    fn default() -> Self {
        Self::new()
    }
}

impl sealed::Mode for Velocity {
    fn check(&self, model: &Model) -> Result<(), ConfigError> {
        self.standstill.check(model)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Velocity])
    }

    fn command(
        &mut self,
        Order { target, share, step: _ }: Order,
        _drive: &Feedback,
        _angle: Option<Angle>,
        model: &Model,
    ) -> Option<(Command, f32)> {
        let Target::Velocity(target) = target else { return None };
        let speed = model.erpm_of(within(target, model.max_velocity));
        // Less than a whole number on the wire is a speed of 0.
        let command =
            if speed.abs() < 1.0 { self.standstill.command(share) } else { Command::Speed(speed) };
        Some((command, 0.0))
    }
}

/// Position control by the drive's own loop, which needs an encoder.
///
/// The angle is that of status 4. It is the angle of the output shaft if the position angle division in VESC Tool is the gear ratio.
#[derive(Debug, Clone, Copy)]
pub struct Position;

impl sealed::Mode for Position {
    const HAS_POSITION: bool = true;

    fn capabilities(&self) -> Capabilities {
        Capabilities::of(&[Capability::Angle])
    }

    fn command(
        &mut self,
        Order { target, share: _, step: _ }: Order,
        _drive: &Feedback,
        angle: Option<Angle>,
        model: &Model,
    ) -> Option<(Command, f32)> {
        let Target::Angle(target) = target else { return None };
        angle?;
        let angle = Angle::from_radians(wrap_tau(model.signed(target.as_radians())));
        Some((Command::Position(angle.as_degrees()), 0.0))
    }
}

fn within(target: AngularVelocity, limit: AngularVelocity) -> AngularVelocity {
    let limit = limit.as_rad_per_s();
    AngularVelocity::from_rad_per_s(target.as_rad_per_s().min(limit).max(-limit))
}
