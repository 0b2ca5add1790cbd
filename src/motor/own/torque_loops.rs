//! Our own loops on torque.

use super::{Order, Shaft, Target};
use crate::control::{Cascade, PidConfig, limited};
use crate::error::ConfigError;
use crate::math::wrap_pi;

/// A loop from the way to an angle, in rad, to a velocity, and a loop from a velocity, in rad/s, to a torque in Nm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TorqueLoops {
    loops: Cascade,
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
    /// As [`Cascade::new`].
    pub(crate) fn new(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        Ok(Self { loops: Cascade::new(position, speed)?, before: Before::Rest })
    }

    /// Returns the torque for a velocity or an angle, possibly more than the limit; `None` for another target, and for an angle
    /// target without a measured angle. The integral keeps within the limit. The loops take over from a torque without a jump, and
    /// begin anew after an impedance.
    #[inline]
    pub(crate) fn step(
        &mut self,
        order: Order,
        (angle, velocity): Shaft,
        limit_nm: f32,
    ) -> Option<f32> {
        let velocity = velocity.as_rad_per_s();
        let torque_nm = match order.target {
            Target::Velocity(target) => {
                if !matches!(self.before, Before::Velocity) {
                    self.take_over(Before::Velocity, velocity);
                }
                self.loops.speed_mut().step(target.as_rad_per_s(), velocity, &order.step)
            }
            Target::Angle(target) => {
                let way = wrap_pi((target - angle?).as_radians());
                if !matches!(self.before, Before::Angle) {
                    self.take_over(Before::Angle, velocity);
                }
                self.loops.step(way, velocity, &order.step)
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
        self.loops.speed_mut().keep_integral_between(-limit_nm, limit_nm);
        Some(torque_nm)
    }

    /// Continues from the output of the target before, so that a change of the kind of target does not jump.
    #[cold]
    fn take_over(&mut self, now: Before, velocity: f32) {
        match core::mem::replace(&mut self.before, now) {
            Before::Rest => self.loops.reset(),
            Before::Torque(torque_nm) => {
                self.loops.position_mut().reset_to(velocity);
                self.loops.speed_mut().reset_to(torque_nm);
            }
            Before::Velocity => self.loops.position_mut().reset_to(velocity),
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
            loops.step(order, (Some(Angle::ZERO), AngularVelocity::ZERO), LIMIT_NM)
        };
        (loops, step)
    }

    fn velocity(rad_per_s: f32) -> Target {
        Target::Velocity(AngularVelocity::from_rad_per_s(rad_per_s))
    }

    /// A blocked shaft fills the integral. This integral must not drive the shaft after another kind of target.
    #[test]
    fn nothing_of_an_integral_is_left_after_another_kind_of_target() {
        let (mut loops, step) = driven();
        for between in [Target::Torque(0.0), Target::Impedance(Impedance::FREE)] {
            for _ in 0..200 {
                step(&mut loops, velocity(1.0));
            }
            assert!(loops.loops.speed().terms().i > 2.0);
            assert_eq!(step(&mut loops, between), None);
            assert_eq!(step(&mut loops, velocity(0.0)), Some(0.0), "{between:?}");
            assert_eq!(step(&mut loops, between), None);
            assert_eq!(step(&mut loops, Target::Angle(Angle::ZERO)), Some(0.0), "{between:?}");
        }
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
