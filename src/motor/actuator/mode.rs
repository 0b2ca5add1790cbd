//! The control mode of a drive: an impedance, or a loop of the drive's own. The frames in the place of commands: questions, and limits
//! that a drive is told.

use super::{Impedance, ImpedanceControl, Order, Shaft, Target};
use crate::control::PidConfig;
use crate::error::ConfigError;
use crate::math::{limited, wrap_pi};
use crate::motor::{Capabilities, Capability};
use crate::units::AngularVelocity;
use crate::wire::mit::Ranges;

/// Each so many commands the questions begin anew: 32 ms at 1 kHz.
const ROUND: u8 = 32;

/// A goal of the output shaft for one step, within the limits of the mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goal {
    /// The impedance for a drive in MIT mode.
    Impedance(Impedance),
    /// A torque in Nm.
    Torque(f32),
    /// A velocity in rad/s.
    Velocity(f32),
    /// An angle so many rad away.
    Way(f32),
}

/// A control mode: the number of the protocol, the followed quantity, and the limits of the program.
///
/// `number` decides the frames of a family; a limit given here is also sent to the drive where the family has a frame for the limit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ControlMode {
    pub(crate) number: u8,
    follows: Follows,
    velocity_limit: Option<AngularVelocity>,
    torque_limit_nm: Option<f32>,
}

#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "a motor has one, and there is no heap")]
enum Follows {
    Impedance(ImpedanceControl),
    /// With the last goal as a share of the limit.
    Torque(f32),
    Velocity,
    Angle,
}

impl ControlMode {
    pub(crate) const fn impedance(number: u8, control: ImpedanceControl) -> Self {
        let torque_limit_nm = Some(control.torque_limit_nm());
        let follows = Follows::Impedance(control);
        Self { number, follows, velocity_limit: None, torque_limit_nm }
    }

    /// The drive follows the torques of the program.
    pub(crate) const fn torque(number: u8, torque_limit_nm: f32) -> Self {
        let torque_limit_nm = Some(torque_limit_nm);
        Self { number, follows: Follows::Torque(0.0), velocity_limit: None, torque_limit_nm }
    }

    /// The drive's own loop follows velocities.
    pub(crate) const fn velocity(
        number: u8,
        velocity_limit: Option<AngularVelocity>,
        torque_limit_nm: Option<f32>,
    ) -> Self {
        Self { number, follows: Follows::Velocity, velocity_limit, torque_limit_nm }
    }

    /// The drive's own loops go to angles.
    pub(crate) const fn angle(
        number: u8,
        velocity_limit: Option<AngularVelocity>,
        torque_limit_nm: Option<f32>,
    ) -> Self {
        Self { number, follows: Follows::Angle, velocity_limit, torque_limit_nm }
    }

    /// Limits the velocities of the drive's own loop, and of a held target.
    pub(crate) fn within(self, velocity_limit: AngularVelocity) -> Self {
        Self { velocity_limit: Some(velocity_limit), ..self }
    }

    pub(crate) const fn is_impedance(&self) -> bool {
        matches!(self.follows, Follows::Impedance(_))
    }

    pub(crate) const fn is_angle(&self) -> bool {
        matches!(self.follows, Follows::Angle)
    }

    /// Returns the velocity limit in rad/s; infinite without a limit.
    pub(crate) const fn most_velocity(&self) -> f32 {
        match self.velocity_limit {
            Some(limit) => limit.as_rad_per_s(),
            None => f32::INFINITY,
        }
    }

    pub(crate) const fn torque_limit_nm(&self) -> Option<f32> {
        self.torque_limit_nm
    }

    /// # Errors
    /// A limit that is not above 0 and within so many rad/s, or not from `least_nm` to so many Nm.
    pub(crate) fn check(
        &self,
        most_velocity: f32,
        least_nm: f32,
        most_nm: f32,
    ) -> Result<(), ConfigError> {
        if let Some(limit) = self.velocity_limit {
            let limit = limit.as_rad_per_s();
            ConfigError::check_limit("velocity limit in rad/s", limit, most_velocity)?;
        }
        match self.torque_limit_nm {
            Some(limit) if least_nm > 0.0 => {
                ConfigError::check_range("torque limit in Nm", limit, least_nm, most_nm)
            }
            Some(limit) => ConfigError::check_limit("torque limit in Nm", limit, most_nm),
            None => Ok(()),
        }
    }

    /// Returns the capabilities: the accepted targets, and feedback.
    pub(crate) fn capabilities(&self) -> Capabilities {
        let capabilities = match &self.follows {
            Follows::Impedance(control) => control.capabilities(),
            Follows::Torque(_) => Capabilities::of(&[Capability::Torque]),
            Follows::Velocity => Capabilities::of(&[Capability::Velocity]),
            Follows::Angle => Capabilities::of(&[Capability::Angle]),
        };
        capabilities.with(Capability::Feedback)
    }

    pub(crate) fn set_loops(
        &mut self,
        position: PidConfig,
        speed: PidConfig,
    ) -> Result<(), ConfigError> {
        match &mut self.follows {
            Follows::Impedance(control) => control.set_loops(position, speed),
            _ => Err(ConfigError::Unsupported("loops")),
        }
    }

    /// Returns the goal of a drive that follows torques; `None` to rest. The velocity of the shaft is known up to so many rad/s.
    #[inline]
    pub(crate) fn goal(
        &mut self,
        order: Order,
        shaft: impl Fn() -> Shaft,
        known: f32,
    ) -> Option<Goal> {
        match &mut self.follows {
            Follows::Impedance(control) => control.torque(&order, shaft, known).map(Goal::Torque),
            _ => self.own_goal(order, shaft()),
        }
    }

    /// Returns the goal of a drive that follows an impedance in fields of these ranges, with counts to `top`, of the position to
    /// 65535; a torque alone without the other fields. `None` to rest.
    #[inline(always)]
    pub(crate) fn impedance_goal(
        &mut self,
        order: Order,
        shaft: impl Fn() -> Shaft,
        ranges: &Ranges,
        top: u16,
    ) -> Option<Goal> {
        match &mut self.follows {
            Follows::Impedance(control) => match control.torque_alone(&order, &shaft) {
                Some(torque_nm) => Some(Goal::Torque(torque_nm)),
                None => {
                    let (most, count) = (Impedance::most(ranges), Impedance::count(ranges, top));
                    control.spring(order, shaft(), &most, &count).map(Goal::Impedance)
                }
            },
            _ => self.own_goal(order, shaft()),
        }
    }

    fn own_goal(&mut self, order: Order, (angle, _): Shaft) -> Option<Goal> {
        match (&mut self.follows, order.target) {
            (Follows::Torque(effort), Target::Torque(torque_nm)) => {
                let most = self.torque_limit_nm?;
                let limit = most * order.share;
                let torque_nm = limited(torque_nm, -limit, limit);
                *effort = torque_nm / most;
                Some(Goal::Torque(torque_nm))
            }
            (Follows::Velocity, Target::Velocity(velocity)) => {
                let limit = self.most_velocity();
                Some(Goal::Velocity(limited(velocity.as_rad_per_s(), -limit, limit)))
            }
            (Follows::Angle, Target::Angle(target)) => {
                Some(Goal::Way(wrap_pi((target - angle?).as_radians())))
            }
            _ => None,
        }
    }

    /// Returns the goal of a shaft that is to keep its present velocity in rad/s, within the limit.
    pub(crate) fn stay(&self, velocity: f32) -> Goal {
        let limit = self.most_velocity();
        match self.follows {
            Follows::Impedance(_) | Follows::Torque(_) => Goal::Torque(0.0),
            Follows::Velocity => Goal::Velocity(limited(velocity, -limit, limit)),
            Follows::Angle => Goal::Way(0.0),
        }
    }

    /// Returns the torque of the last command as a share of the largest; 0 if unknown.
    pub(crate) fn effort(&self) -> f32 {
        match &self.follows {
            Follows::Impedance(control) => control.effort(),
            Follows::Torque(effort) => *effort,
            Follows::Velocity | Follows::Angle => 0.0,
        }
    }

    pub(crate) const fn reset(&mut self) {
        match &mut self.follows {
            Follows::Impedance(control) => control.reset(),
            Follows::Torque(effort) => *effort = 0.0,
            Follows::Velocity | Follows::Angle => {}
        }
    }
}

/// Returns the angle so far away from a position, within the range of a drive. A position at the very end counts as unknown.
pub(crate) fn inside(position: f32, way: f32, range: f32) -> f32 {
    let end = range * 0.9995;
    limited(position + way, -end, end)
}

/// The order of commands and questions. The drive goes on with the command before while answering a question, so a new command
/// goes first, once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Questions<C> {
    /// The place within the round.
    place: u8,
    /// The last command that was no question; `None` if not sent, so that the drive goes on with one before.
    last: Option<C>,
    /// A question has waited for a new command.
    has_waited: bool,
}

impl<C: Copy + PartialEq> Questions<C> {
    /// Takes the command of a drive at rest.
    pub(crate) const fn new(rest: C) -> Self {
        Self { place: 1, last: Some(rest), has_waited: false }
    }

    /// Returns a command, or the question due in its place.
    pub(crate) fn next(&mut self, command: C, due: impl FnOnce(u8) -> Option<C>) -> C {
        let due = due(self.place);
        let question = due.filter(|_| self.has_waited || self.last == Some(command));
        self.has_waited = question.is_none() && due.is_some();
        if !self.has_waited {
            self.place = (self.place + 1) % ROUND;
        }
        if question.is_none() {
            self.last = Some(command);
        }
        question.unwrap_or(command)
    }

    /// A frame was not sent: the next command goes first, also before a question that has waited.
    pub(crate) const fn unsent(&mut self) {
        (self.last, self.has_waited) = (None, false);
    }
}

/// The share of a limit, sent to a drive between commands: on a change with every second command at most, and again after so many, for
/// a frame may be lost.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Told {
    share: f32,
    /// Commands since then.
    since: u8,
}

impl Told {
    /// Steps of the share, one at least unless the share is zero: coarse for a drive whose commands shall rarely give way to limits.
    pub(crate) const COARSE: f32 = 16.0;
    pub(crate) const FINE: f32 = 4_096.0;

    /// The drive was told zero, or one step, before the first command.
    pub(crate) const ZERO: Self = Self { share: 0.0, since: 1 };

    /// Counts a command, and returns the share that takes its place, in whole steps.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    pub(crate) fn due(&mut self, share: f32, steps: f32, period: u8) -> Option<f32> {
        self.since = self.since.saturating_add(1);
        let whole = ((share.min(1.0) * steps) as u16).max(u16::from(share > 0.0));
        let share = f32::from(whole) / steps;
        let has_changed = share.to_bits() != self.share.to_bits();
        let is_due = self.since > if has_changed { 1 } else { period };
        if is_due {
            *self = Self { share, since: 0 };
        }
        is_due.then_some(share)
    }

    pub(crate) const fn share(self) -> f32 {
        self.share
    }

    /// Returns how many commands were counted since the drive was told.
    pub(crate) const fn since(self) -> u8 {
        self.since
    }

    /// The frame was not sent, and is due.
    pub(crate) const fn repeat(&mut self) {
        self.since = u8::MAX;
    }
}
