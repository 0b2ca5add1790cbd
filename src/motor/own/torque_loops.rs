//! Our own loops on torque.

use super::{Order, Shaft, Target};
use crate::control::{Cascade, PidConfig};
use crate::error::ConfigError;
use crate::math::wrap_pi;

/// A loop from the way to an angle, in rad, to a velocity, and a loop from a velocity, in rad/s, to a torque in Nm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TorqueLoops(Cascade);

impl TorqueLoops {
    /// # Errors
    /// As [`Cascade::new`].
    pub(crate) fn new(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        Ok(Self(Cascade::new(position, speed)?))
    }

    /// Returns the torque for a velocity or an angle, possibly more than the limit; `None` for another target, and for an angle
    /// target without a measured angle. The integral keeps within the limit.
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
                self.0.speed_mut().step(target.as_rad_per_s(), velocity, &order.step)
            }
            Target::Angle(target) => {
                let way = wrap_pi((target - angle?).as_radians());
                self.0.step(way, velocity, &order.step)
            }
            Target::Torque(_) | Target::Impedance(_) => return None,
        };
        self.0.speed_mut().keep_integral_between(-limit_nm, limit_nm);
        Some(torque_nm)
    }

    pub(crate) const fn reset(&mut self) {
        self.0.reset();
    }
}
