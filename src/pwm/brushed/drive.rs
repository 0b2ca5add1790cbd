use super::{Brushed, Target};
use crate::motor::{Capabilities, Capability, Link, TargetError, VelocityDrive};
use crate::pwm::Direction;
use crate::units::AngularVelocity;
use embedded_hal::pwm::SetDutyCycle;

impl<P: SetDutyCycle, D: Direction> VelocityDrive<()> for Brushed<P, D> {
    fn velocity(&self, (): ()) -> Option<AngularVelocity> {
        let fresh = self.config.counts_per_turn.is_some() && self.guard.link() == Link::Online;
        fresh.then(|| AngularVelocity::from_rad_per_s(self.rad_per_s))
    }

    fn capabilities(&self, (): ()) -> Capabilities {
        let set = Capabilities::of(&[Capability::Raw]);
        let set = if self.speed.is_some() { set.with(Capability::Velocity) } else { set };
        let listens = self.config.counts_per_turn.is_some();
        if listens { set.with(Capability::Feedback) } else { set }
    }

    fn set_velocity(&mut self, (): (), target: AngularVelocity) -> Result<(), TargetError> {
        if self.speed.is_none() {
            return Err(TargetError::NoLoop);
        }
        self.admit(target.as_rad_per_s().is_finite())?;
        self.target = Target::Velocity(target.as_rad_per_s());
        Ok(())
    }
}
