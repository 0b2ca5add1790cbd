//! The control mode, with its parameters.

use super::Model;
use super::codec::Command;
use crate::control::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::math::{limited, wrap_tau};
use crate::motor::{Capabilities, Capability, Order, Target, TorqueLoops};
use crate::units::{Angle, AngularVelocity};

/// A control mode of the drive.
///
/// # Examples
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::vesc::{Mode, Rest};
///
/// let speed = PidConfig::new(0.02, 0.2, 0.0); // rad/s to Nm
/// let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0); // rad to rad/s
/// let wheel = Mode::current_with_speed_loop(speed)?;
/// let joint = Mode::current_with_loops(position, speed)?;
/// let braked = Mode::velocity_with_standstill(Rest::Brake(5.0)); // a target of 0 brakes
/// # let _ = (wheel, joint, braked);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Mode(Kind);

#[derive(Debug, Clone, Copy)]
enum Kind {
    Current(CurrentControl),
    Duty(DutyControl),
    /// The effect of a target of exactly 0.
    Velocity(Rest),
    Position,
}

/// Where the output shaft is, by the last feedback.
pub(super) struct At<'a> {
    pub(super) model: &'a Model,
    pub(super) velocity: AngularVelocity,
    pub(super) angle: Option<Angle>,
    pub(super) duty: f32,
}

/// Rest: the command of a motor that is not driven. In each mode a disarmed motor gets this command, and so does a motor without a target.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Rest {
    /// A current of 0: the shaft turns freely.
    #[default]
    Release,
    /// A current in A that brakes the shaft while the shaft turns. A brake cannot hold a weight.
    Brake(f32),
    /// A current in A through standing phases: the rotor is held in the nearest of its electrical turns, and gets warm. A fast
    /// shaft is shaken by the handbrake, not stopped. Of the kinds of control only FOC has a handbrake; others brake as with `Brake`.
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
        ConfigError::check_limit("current of rest in A", current, model.current_limit_a)
    }
}

/// The loops of current control, run here.
#[derive(Debug, Clone, Copy)]
struct CurrentControl {
    loops: Option<TorqueLoops>,
    has_angle: bool,
}

impl CurrentControl {
    fn command(&mut self, order: Order, at: &At) -> Option<(Command, Option<f32>)> {
        let (model, share) = (at.model, order.share);
        let most = model.torque_limit_nm();
        let limit = most * share;
        let wanted = match (order.target, &mut self.loops) {
            (Target::Torque(torque), loops) => {
                if let Some(loops) = loops {
                    loops.step(&order, || (at.angle, at.velocity), limit);
                }
                torque
            }
            (Target::Angle(_), _) if !self.has_angle => return None,
            (_, loops) => loops.as_mut()?.step(&order, || (at.angle, at.velocity), limit)?,
        };
        let torque = limited(wanted, -limit, limit);
        // Rounding of the quotient must not take it past the limit.
        let most_current = model.current_limit_a * share;
        let current = limited(model.current_of(torque), -most_current, most_current);
        Some((Command::Current(current), Some(torque / most)))
    }
}

/// The loop of duty control, run here, and the largest duty.
#[derive(Debug, Clone, Copy)]
struct DutyControl {
    limit: f32,
    speed: Pid,
}

impl DutyControl {
    fn command(&mut self, order: Order, at: &At) -> Option<(Command, Option<f32>)> {
        let Order { target: Target::Velocity(target), share, step } = order else { return None };
        let reported = limited(at.duty, -self.limit, self.limit);
        let near = self.limit * share;
        let lowest = (reported - near).max(-self.limit);
        let highest = (reported + near).min(self.limit);
        let wanted = self.speed.step(target.as_rad_per_s(), at.velocity.as_rad_per_s(), &step);
        self.speed.keep_integral_between(lowest, highest);
        let duty = wanted.min(highest).max(lowest);
        Some((Command::Duty(duty), Some(duty / self.limit)))
    }
}

impl Mode {
    /// Current control: a torque becomes a current by the torque constant.
    #[must_use]
    pub const fn current() -> Self {
        Self(Kind::Current(CurrentControl { loops: None, has_angle: false }))
    }

    /// Current control for velocities too, by a loop of ours from rad/s to Nm.
    ///
    /// # Errors
    /// As [`Pid::new`](crate::control::Pid::new).
    pub fn current_with_speed_loop(speed: PidConfig) -> Result<Self, ConfigError> {
        let loops = TorqueLoops::new(PidConfig::new(0.0, 0.0, 0.0), speed)?;
        Ok(Self(Kind::Current(CurrentControl { loops: Some(loops), has_angle: false })))
    }

    /// Current control for velocities and angles too, by loops of ours from rad to rad/s and from rad/s to Nm. The tachometer has
    /// six steps for an electrical turn, so a fine angle needs [`Motor::with_encoder`](super::Motor::with_encoder).
    ///
    /// # Errors
    /// As [`Pid::new`](crate::control::Pid::new).
    pub fn current_with_loops(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        let loops = TorqueLoops::new(position, speed)?;
        Ok(Self(Kind::Current(CurrentControl { loops: Some(loops), has_angle: true })))
    }

    /// Duty control: our own loop follows a velocity by the share of the supply voltage. Takes the largest duty, above 0 and at most 1,
    /// and a loop from rad/s to duty: 1 is the whole supply.
    ///
    /// A duty of 0 shorts the phases, so this mode brakes with the whole current of the drive. The duty keeps near the duty reported
    /// by the drive: within the share of the order times the limit, so a motor armed while turning is not braked at once.
    ///
    /// # Errors
    /// Names the value outside its limits.
    pub fn duty(limit: f32, speed: PidConfig) -> Result<Self, ConfigError> {
        ConfigError::check_limit("duty limit", limit, 1.0)?;
        Ok(Self(Kind::Duty(DutyControl { limit, speed: Pid::new(speed)? })))
    }

    /// Velocity control by the drive's own loop. A target of 0 lets the shaft go, as the drive does.
    #[must_use]
    pub const fn velocity() -> Self {
        Self(Kind::Velocity(Rest::Release))
    }

    /// As [`velocity`](Self::velocity), with the effect of a target of exactly 0.
    #[must_use]
    pub const fn velocity_with_standstill(standstill: Rest) -> Self {
        Self(Kind::Velocity(standstill))
    }

    /// Position control by the drive's own loop, which needs an encoder.
    ///
    /// Status 4 has the angle. The angle is of the output shaft if the position angle division in VESC Tool is the gear ratio.
    #[must_use]
    pub const fn position() -> Self {
        Self(Kind::Position)
    }

    /// The drive itself controls the position, so status 4 has its angle.
    pub(super) const fn has_position(&self) -> bool {
        matches!(self.0, Kind::Position)
    }

    /// # Errors
    /// A value outside its limits.
    pub(super) fn check(&self, model: &Model) -> Result<(), ConfigError> {
        if let Kind::Velocity(standstill) = self.0 { standstill.check(model) } else { Ok(()) }
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        let torque = Capabilities::of(&[Capability::Torque]);
        match &self.0 {
            Kind::Current(CurrentControl { loops: None, .. }) => torque,
            Kind::Current(CurrentControl { has_angle: false, .. }) => {
                torque.with(Capability::Velocity)
            }
            Kind::Current(_) => torque.with(Capability::Velocity).with(Capability::Angle),
            Kind::Duty(_) | Kind::Velocity(_) => Capabilities::of(&[Capability::Velocity]),
            Kind::Position => Capabilities::of(&[Capability::Angle]),
        }
    }

    /// Tells whether a target needs the angle of the shaft.
    pub(super) const fn needs_angle(&self) -> bool {
        match &self.0 {
            Kind::Current(control) => control.has_angle,
            Kind::Duty(_) | Kind::Velocity(_) => false,
            Kind::Position => true,
        }
    }

    /// Returns the command and its share of the largest effort, unless controlled by the drive; `None` to rest.
    pub(super) fn command(&mut self, order: Order, at: &At) -> Option<(Command, Option<f32>)> {
        let target = match order.target {
            Target::Velocity(velocity) => {
                let limit = at.model.max_velocity.as_rad_per_s();
                let velocity = limited(velocity.as_rad_per_s(), -limit, limit);
                Target::Velocity(AngularVelocity::from_rad_per_s(velocity))
            }
            target => target,
        };
        let order = Order { target, ..order };
        match &mut self.0 {
            Kind::Current(control) => control.command(order, at),
            Kind::Duty(control) => control.command(order, at),
            Kind::Velocity(standstill) => velocity(*standstill, order, at),
            Kind::Position => position(order, at),
        }
    }

    /// The loop of duty control is the speed loop.
    pub(super) fn set_loops(
        &mut self,
        position: PidConfig,
        speed: PidConfig,
    ) -> Result<(), ConfigError> {
        match &mut self.0 {
            Kind::Current(CurrentControl { loops: Some(loops), .. }) => {
                loops.set_config(position, speed)
            }
            Kind::Duty(control) => control.speed.set_config(speed),
            _ => Err(ConfigError::Unsupported("loops")),
        }
    }

    pub(super) fn reset(&mut self) {
        match &mut self.0 {
            Kind::Current(CurrentControl { loops: Some(loops), .. }) => loops.reset(),
            Kind::Duty(control) => control.speed.reset(),
            Kind::Current(_) | Kind::Velocity(_) | Kind::Position => {}
        }
    }
}

fn velocity(standstill: Rest, order: Order, at: &At) -> Option<(Command, Option<f32>)> {
    let Order { target: Target::Velocity(target), share, .. } = order else { return None };
    let speed = at.model.erpm_of(target);
    // Less than a whole number on the wire is a speed of 0.
    let stands = speed.abs() < 1.0;
    Some((if stands { standstill.command(share) } else { Command::Speed(speed) }, None))
}

fn position(order: Order, at: &At) -> Option<(Command, Option<f32>)> {
    let Order { target: Target::Angle(target), .. } = order else { return None };
    at.angle?;
    let angle = Angle::from_radians(wrap_tau(target.as_radians()));
    Some((Command::Position(angle.as_degrees()), None))
}
