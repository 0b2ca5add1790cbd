//! The control of a drive in impedance mode, and our own loops on torque.

use super::{Impedance, Order, Target};
use crate::control::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::math::{limited, wrap_pi};
use crate::motor::{Capabilities, Capability};
use crate::units::{Angle, AngularVelocity};

/// Angle and velocity of the output shaft; no angle if unknown.
pub(crate) type Shaft = (Option<Angle>, AngularVelocity);

/// The control of a drive that follows an [`Impedance`], as in MIT mode: any target becomes an impedance with a torque that keeps
/// within a limit.
///
/// The limit holds at the last reported angle and velocity: the torque beside is limited first, then the spring,
/// then the damper, so far from its target a joint turns at most at the limit divided by the damping. Angle and velocity are sent
/// near enough for gains times the remaining way to keep within the limit. Until the next command the drive follows its own
/// measurements: a shaft blocked while turning at `v` feels up to `damping * v` more.
/// At the end of the velocity's range, where the drive may turn faster than it reports, a damper and its spring are sent as a torque alone.
/// Stiffness and damping are scaled by the [share](Order::share) of the order, and lowered where a count of the angle or of the
/// velocity, times the gain, is more than an eighth of the limit.
///
/// # Examples
/// ```
/// use drivetrain::time::TimeStep;
/// use drivetrain::motor::{Impedance, ImpedanceControl, Order, Target};
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let mut joint = ImpedanceControl::new(3.0)?.with_gains(20.0, 0.6)?; // Nm, Nm/rad, Nm s/rad
/// let fastest = AngularVelocity::from_rad_per_s(30.0);
/// let most = Impedance { angle: Angle::from_radians(12.5), velocity: fastest, stiffness: 500.0, damping: 5.0, torque_nm: 10.0 };
/// let count = Impedance { stiffness: 500.0 / 4095.0, damping: 5.0 / 4095.0, ..Impedance::FREE };
/// let order = Order { target: Target::Angle(Angle::from_radians(1.0)), share: 1.0, step: TimeStep::of(0.001) };
/// let sent = joint.step(order, Some(Angle::ZERO), AngularVelocity::ZERO, &most, &count).ok_or("at rest")?;
/// assert!((sent.angle.as_radians() * sent.stiffness - 3.0).abs() < 0.01); // 3 Nm, not 20
/// assert!((joint.effort() - 1.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct ImpedanceControl {
    torque_limit_nm: f32,
    gains: Option<(f32, f32)>,
    loops: Option<TorqueLoops>,
    torque_nm: f32,
}

impl ImpedanceControl {
    /// Limits the torque, in Nm. Takes torques and [`Impedance`] as targets.
    ///
    /// # Errors
    /// [`ConfigError::NotPositive`] for a limit that is zero, negative or not finite.
    pub const fn new(torque_limit_nm: f32) -> Result<Self, ConfigError> {
        if torque_limit_nm > 0.0 && torque_limit_nm.is_finite() {
            Ok(Self { torque_limit_nm, gains: None, loops: None, torque_nm: 0.0 })
        } else {
            Err(ConfigError::NotPositive("torque_limit"))
        }
    }

    /// Has the drive itself follow velocities with a damping in Nm s/rad, and angles with a stiffness in Nm/rad beside it;
    /// no angles with a stiffness of 0.
    ///
    /// # Errors
    /// [`ConfigError::Negative`] for a value that is negative or not finite.
    pub const fn with_gains(self, stiffness: f32, damping: f32) -> Result<Self, ConfigError> {
        if !(stiffness >= 0.0 && stiffness.is_finite()) {
            return Err(ConfigError::Negative("stiffness"));
        }
        if !(damping >= 0.0 && damping.is_finite()) {
            return Err(ConfigError::Negative("damping"));
        }
        Ok(Self { gains: Some((stiffness, damping)), ..self })
    }

    /// Has our own loops follow velocities and angles by a torque: from rad to rad/s, and from rad/s to Nm. The drive's own gains
    /// do not apply then.
    ///
    /// # Errors
    /// As [`Pid::new`](crate::control::Pid::new).
    pub fn with_loops(self, position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        let limit = self.torque_limit_nm;
        let loops = TorqueLoops::new(position, speed.with_output_limit(limit))?;
        Ok(Self { loops: Some(loops), ..self })
    }

    /// Changes our own loops, also while the motor is driven. Each goes on as after
    /// [`Pid::set_config`](crate::control::Pid::set_config): an integral carries the change of its loop, and without one the output is that of
    /// the new gains at once.
    ///
    /// # Errors
    /// As [`with_loops`](Self::with_loops), and [`ConfigError::Unsupported`] without such loops. Nothing is changed then.
    pub fn set_loops(&mut self, position: PidConfig, speed: PidConfig) -> Result<(), ConfigError> {
        let loops = self.loops.as_mut().ok_or(ConfigError::Unsupported("loops"))?;
        loops.set_config(position, speed.with_output_limit(self.torque_limit_nm))
    }

    /// Returns the torque limit in Nm.
    #[must_use]
    pub const fn torque_limit_nm(&self) -> f32 {
        self.torque_limit_nm
    }

    /// Returns the torque of the last step as a share of the limit, -1 to 1.
    #[must_use]
    pub const fn effort(&self) -> f32 {
        self.torque_nm / self.torque_limit_nm
    }

    /// Returns the accepted targets.
    #[must_use]
    pub fn capabilities(&self) -> Capabilities {
        const ALWAYS: Capabilities = Capabilities::of(&[Capability::Torque, Capability::Impedance]);
        match (self.gains, &self.loops) {
            (None, None) => ALWAYS,
            (Some((stiffness, _)), None) if stiffness <= 0.0 => ALWAYS.with(Capability::Velocity),
            _ => ALWAYS.with(Capability::Velocity).with(Capability::Angle),
        }
    }

    /// Returns the command to the drive; `None` to rest: an angle is needed and not known, or the target is not
    /// [accepted](Self::capabilities). `most` is the largest value of each field, and `count` the value of a count of the field, 0 if
    /// exact. Gains above zero are whole counts and a quarter, for a drive that truncates.
    pub fn step(
        &mut self,
        order: Order,
        angle: Option<Angle>,
        velocity: AngularVelocity,
        most: &Impedance,
        count: &Impedance,
    ) -> Option<Impedance> {
        let shaft = (angle, velocity);
        match self.torque_alone(&order, || shaft) {
            Some(torque_nm) => Some(Impedance::torque(torque_nm)),
            None => self.spring(order, shaft, most, count),
        }
    }

    /// Returns the torque of a target that needs neither spring nor damper: a torque, or a velocity or an angle by our own loops.
    #[inline(always)]
    pub(crate) fn torque_alone(
        &mut self,
        order: &Order,
        shaft: impl FnOnce() -> Shaft,
    ) -> Option<f32> {
        let limit = self.torque_limit_nm * order.share;
        let looped = self.loops.as_mut().and_then(|loops| loops.step(order, shaft, limit));
        let wanted = match order.target {
            Target::Torque(torque_nm) => torque_nm,
            _ => looped?,
        };
        self.torque_nm = limited(wanted, -limit, limit);
        Some(self.torque_nm)
    }

    /// Returns the command of a target that is no [torque alone](Self::torque_alone), as [`step`](Self::step).
    #[inline(never)]
    pub(crate) fn spring(
        &mut self,
        order: Order,
        shaft: Shaft,
        most: &Impedance,
        count: &Impedance,
    ) -> Option<Impedance> {
        self.torque_nm = 0.0;
        let (limit, share, (angle, velocity)) =
            (self.torque_limit_nm * order.share, order.share, shaft);
        let wanted = self.wanted(&order, angle)?;
        let torque_nm = limited(wanted.torque_nm, -limit, limit);
        if wanted.stiffness <= 0.0 && wanted.damping <= 0.0 {
            self.torque_nm = torque_nm;
            return Some(Impedance::torque(torque_nm));
        }
        let (per_count, per_count_s) = (count.angle.as_radians(), count.velocity.as_rad_per_s());
        let stiffness = share * wanted.stiffness.min(most.stiffness);
        let damping = share * wanted.damping.min(most.damping);
        let at = match angle {
            Some(angle) => angle.as_radians(),
            None if stiffness > 0.0 => return None,
            None => 0.0,
        };
        let end = most.angle.as_radians();
        let way = limited(wanted.angle.as_radians(), -end, end) - at;
        let end = most.velocity.as_rad_per_s();
        let change = limited(wanted.velocity.as_rad_per_s(), -end, end) - velocity.as_rad_per_s();
        // A velocity at the end of its range is there or beyond: a damper of the drive could pass the limit, a torque cannot.
        if damping > 0.0 && velocity.as_rad_per_s().abs() >= end - 0.5 * per_count_s {
            let spring_nm = limited(torque_nm + stiffness * way, -limit, limit);
            let torque_nm = limited(spring_nm + damping * change, -limit, limit);
            self.torque_nm = torque_nm;
            return Some(Impedance { torque_nm, ..Impedance::FREE });
        }
        let stiffness = whole(stiffness, per_count, limit, count.stiffness);
        let damping = whole(damping, per_count_s, limit, count.damping);
        // Angle and velocity are truncated, by the drive that reports them and in the command.
        let limit = limit - 2.0 * (stiffness * per_count + damping * per_count_s);
        let way = within(way, torque_nm, stiffness, limit);
        let spring_nm = torque_nm + stiffness * way;
        let change = within(change, spring_nm, damping, limit);
        self.torque_nm = spring_nm + damping * change;
        Some(Impedance {
            angle: Angle::from_radians(at + way),
            velocity: velocity + AngularVelocity::from_rad_per_s(change),
            stiffness: stiffness + 0.25 * count.stiffness,
            damping: damping + 0.25 * count.damping,
            torque_nm,
        })
    }

    /// Returns the torque in Nm for a drive that follows torques; `None` to rest. Only the velocity has an end.
    #[inline]
    pub(crate) fn torque(
        &mut self,
        order: &Order,
        shaft: impl Fn() -> Shaft,
        most_velocity: f32,
    ) -> Option<f32> {
        if self.torque_alone(order, &shaft).is_none() {
            self.spring_alone(*order, shaft(), most_velocity)?;
        }
        let limit = self.torque_limit_nm * order.share;
        Some(limited(self.torque_nm, -limit, limit))
    }

    fn spring_alone(
        &mut self,
        order: Order,
        shaft: Shaft,
        most_velocity: f32,
    ) -> Option<Impedance> {
        let most = Impedance {
            angle: Angle::from_radians(UNLIMITED),
            velocity: AngularVelocity::from_rad_per_s(most_velocity),
            stiffness: UNLIMITED,
            damping: UNLIMITED,
            torque_nm: self.torque_limit_nm,
        };
        self.spring(order, shaft, &most, &Impedance::FREE)
    }

    /// Brings the loops to rest.
    pub const fn reset(&mut self) {
        self.torque_nm = 0.0;
        if let Some(loops) = &mut self.loops {
            loops.reset();
        }
    }

    /// Returns the impedance of a target.
    fn wanted(&self, order: &Order, angle: Option<Angle>) -> Option<Impedance> {
        match (order.target, self.gains.filter(|_| self.loops.is_none())) {
            (Target::Impedance(impedance), _) => Some(impedance),
            (Target::Velocity(velocity), Some((_, damping))) => {
                Some(Impedance { velocity, damping, ..Impedance::FREE })
            }
            (Target::Angle(target), Some((stiffness, damping))) => {
                let angle = angle?;
                let angle = angle + Angle::from_radians(wrap_pi((target - angle).as_radians()));
                Some(Impedance { angle, stiffness, damping, ..Impedance::FREE })
            }
            _ => None,
        }
    }
}

/// The largest angle, stiffness and damping of a torque calculated here.
const UNLIMITED: f32 = 1e9;

/// Returns a gain in whole counts. A count of the multiplied value times the gain is at most an eighth of the limit.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(gain: f32, per_count: f32, limit: f32, count: f32) -> f32 {
    let gain = if per_count > 0.0 { gain.min(limit / (8.0 * per_count)) } else { gain };
    if count > 0.0 { (gain / count) as u32 as f32 * count } else { gain }
}

/// Returns the part of a difference whose torque, beside so much, keeps within the limit.
fn within(difference: f32, beside_nm: f32, gain: f32, limit: f32) -> f32 {
    if gain <= 0.0 {
        return 0.0;
    }
    difference.min((limit - beside_nm) / gain).max((-limit - beside_nm) / gain)
}

/// A loop from the way to an angle, in rad, to a velocity, and a loop from a velocity, in rad/s, to a torque in Nm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TorqueLoops {
    speed: Pid,
    position: Pid,
    before: Before,
}

/// The target of the step before.
#[derive(Debug, Clone, Copy)]
enum Before {
    /// Or an impedance, which has no loops: they begin anew.
    Rest,
    /// In Nm, within the limit.
    Torque(f32),
    Velocity,
    Angle,
}

impl TorqueLoops {
    /// # Errors
    /// As [`Pid::new`] of a loop.
    pub(crate) fn new(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        let (position, speed) = (Pid::new(position)?, Pid::new(speed)?);
        Ok(Self { speed, position, before: Before::Rest })
    }

    /// # Errors
    /// As [`Pid::new`] of a loop. Nothing is changed then.
    pub(crate) fn set_config(
        &mut self,
        position: PidConfig,
        speed: PidConfig,
    ) -> Result<(), ConfigError> {
        position.validate()?;
        self.speed.set_config(speed)?;
        self.position.set_config(position)
    }

    /// Returns the torque for a velocity or an angle, possibly more than the limit; `None` for another target, and for an angle
    /// target without a measured angle. The integral keeps within the limit. The loops take over from a torque without a jump, and
    /// begin anew after an impedance.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        order: &Order,
        shaft: impl FnOnce() -> Shaft,
        limit_nm: f32,
    ) -> Option<f32> {
        let torque_nm = match order.target {
            Target::Velocity(target) => {
                let velocity = shaft().1.as_rad_per_s();
                if !matches!(self.before, Before::Velocity) {
                    self.take_over(Before::Velocity, velocity);
                }
                self.speed.step(target.as_rad_per_s(), velocity, &order.step)
            }
            Target::Angle(target) => {
                let (angle, velocity) = shaft();
                let (way, velocity) = ((target - angle?).as_radians(), velocity.as_rad_per_s());
                if !matches!(self.before, Before::Angle) {
                    self.take_over(Before::Angle, velocity);
                }
                let wanted = self.position.step_error(wrap_pi(way), velocity, &order.step);
                self.speed.step(wanted, velocity, &order.step)
            }
            Target::Torque(torque_nm) => {
                self.before = Before::Torque(limited(torque_nm, -limit_nm, limit_nm));
                return None;
            }
            Target::Impedance(_) => {
                self.before = Before::Rest;
                return None;
            }
        };
        self.speed.keep_integral_between(-limit_nm, limit_nm);
        Some(torque_nm)
    }

    /// Continues from the output of the target before, so that a change of the kind of target does not jump.
    #[cold]
    fn take_over(&mut self, now: Before, velocity: f32) {
        match core::mem::replace(&mut self.before, now) {
            Before::Rest => {
                self.position.reset();
                self.speed.reset();
            }
            Before::Torque(torque_nm) => {
                self.position.reset_to(velocity);
                self.speed.reset_to(torque_nm);
            }
            Before::Velocity => self.position.reset_to(velocity),
            Before::Angle => {}
        }
    }

    pub(crate) const fn reset(&mut self) {
        self.before = Before::Rest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::Impedance;
    use crate::time::TimeStep;
    use crate::units::{Angle, AngularVelocity};

    const LIMIT_NM: f32 = 3.0;

    fn driven() -> (TorqueLoops, impl Fn(&mut TorqueLoops, Target) -> Option<f32>) {
        let position = PidConfig::new(10.0, 1.0, 0.0).with_output_limit(8.0);
        let loops = TorqueLoops::new(position, PidConfig::new(0.5, 20.0, 0.0)).unwrap();
        let step = |loops: &mut TorqueLoops, target| {
            let order = Order { target, share: 1.0, step: TimeStep::of(0.001) };
            loops.step(&order, || (Some(Angle::ZERO), AngularVelocity::ZERO), LIMIT_NM)
        };
        (loops, step)
    }

    fn velocity(rad_per_s: f32) -> Target {
        Target::Velocity(AngularVelocity::from_rad_per_s(rad_per_s))
    }

    #[test]
    fn new_gains_change_the_torque_of_the_next_change_alone() {
        let (mut loops, step) = driven();
        for _ in 0..100 {
            step(&mut loops, velocity(1.0));
        }
        let before = step(&mut loops, velocity(1.0)).unwrap();
        let position = PidConfig::new(20.0, 0.0, 0.0).with_output_limit(8.0);
        let speed = PidConfig::new(1.5, 0.0, 0.0).with_incremental_form();
        loops.set_config(position, speed).unwrap();
        assert!((step(&mut loops, velocity(1.0)).unwrap() - before).abs() < 1e-6);
        let more = step(&mut loops, velocity(2.0)).unwrap();
        assert!((more - before - 1.5).abs() < 1e-6, "{more} Nm after {before} Nm");
        let bad = PidConfig::new(f32::NAN, 0.0, 0.0);
        for (position, speed) in [(bad, speed), (position, bad)] {
            assert!(loops.set_config(position, speed).is_err());
            assert_eq!(step(&mut loops, velocity(2.0)), Some(more));
        }
    }

    /// A blocked shaft fills the integral. This integral must not drive the shaft after another kind of target.
    #[test]
    fn nothing_of_an_integral_is_left_after_another_kind_of_target() {
        let (mut loops, step) = driven();
        for between in [Target::Torque(0.0), Target::Impedance(Impedance::FREE)] {
            for _ in 0..200 {
                step(&mut loops, velocity(1.0));
            }
            assert!(loops.speed.terms().i > 2.0);
            assert_eq!(step(&mut loops, between), None);
            assert_eq!(step(&mut loops, velocity(0.0)), Some(0.0), "{between:?}");
            assert_eq!(step(&mut loops, between), None);
            assert_eq!(step(&mut loops, Target::Angle(Angle::ZERO)), Some(0.0), "{between:?}");
        }
    }

    #[test]
    fn a_spring_without_stiffness_takes_no_angles() {
        let control = ImpedanceControl::new(LIMIT_NM).unwrap();
        let position = PidConfig::new(10.0, 0.0, 0.0);
        let takes = |control: ImpedanceControl| {
            let capabilities = control.capabilities();
            [Capability::Velocity, Capability::Angle].map(|kind| capabilities.has(kind))
        };
        assert_eq!(takes(control), [false, false]);
        let damper = control.with_gains(0.0, 1.0).unwrap();
        assert_eq!(takes(damper), [true, false]);
        assert_eq!(takes(damper.with_loops(position, position).unwrap()), [true, true]);
        assert_eq!(takes(control.with_gains(20.0, 1.0).unwrap()), [true, true]);
    }

    #[test]
    fn a_velocity_after_a_torque_begins_with_this_torque_within_the_limit() {
        let (mut loops, step) = driven();
        for (torque_nm, begins) in [(1.5, 1.5), (-2.0, -2.0), (9.0, LIMIT_NM)] {
            step(&mut loops, Target::Torque(torque_nm));
            let first = step(&mut loops, velocity(0.0)).unwrap();
            assert!((first - begins).abs() < 1e-6, "{first} Nm after {torque_nm} Nm");
        }
    }
}
