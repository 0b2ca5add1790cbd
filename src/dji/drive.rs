//! A bus as an owner of motors for a chassis.

use super::{AnyHandle, Bus, Handle, Model};
use crate::motor::{AngleDrive, Capabilities, Link, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

impl<M: Model, B, const N: usize> VelocityDrive<Handle<M, B>> for Bus<B, N> {
    fn velocity(&self, motor: Handle<M, B>) -> Option<AngularVelocity> {
        velocity(self, motor.into())
    }

    fn capabilities(&self, motor: Handle<M, B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: Handle<M, B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<B, const N: usize> VelocityDrive<AnyHandle<B>> for Bus<B, N> {
    fn velocity(&self, motor: AnyHandle<B>) -> Option<AngularVelocity> {
        velocity(self, motor)
    }

    fn capabilities(&self, motor: AnyHandle<B>) -> Capabilities {
        Self::capabilities(self, motor)
    }

    fn set_velocity(
        &mut self,
        motor: AnyHandle<B>,
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        Self::set_velocity(self, motor, target)
    }
}

impl<M: Model, B, const N: usize> AngleDrive<Handle<M, B>> for Bus<B, N> {
    fn angle(&self, motor: Handle<M, B>) -> Option<Angle> {
        angle(self, motor.into())
    }

    fn set_angle(&mut self, motor: Handle<M, B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}

impl<B, const N: usize> AngleDrive<AnyHandle<B>> for Bus<B, N> {
    fn angle(&self, motor: AnyHandle<B>) -> Option<Angle> {
        angle(self, motor)
    }

    fn set_angle(&mut self, motor: AnyHandle<B>, target: Angle) -> Result<(), TargetError> {
        Self::set_angle(self, motor, target)
    }
}

/// Returns the measured velocity of a motor that is online.
fn velocity<B, const N: usize>(bus: &Bus<B, N>, motor: AnyHandle<B>) -> Option<AngularVelocity> {
    let slot = bus.motors.get(motor.key())?;
    (slot.guard.link() == Link::Online).then(|| slot.velocity())
}

/// Returns the measured angle of a motor that is online, if its absolute angle is known.
fn angle<B, const N: usize>(bus: &Bus<B, N>, motor: AnyHandle<B>) -> Option<Angle> {
    let state = bus.motors.get(motor.key())?.state()?;
    (state.link == Link::Online && state.homing.is_known()).then(|| state.position.angle())
}
