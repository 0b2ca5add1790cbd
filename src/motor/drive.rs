use super::{Capabilities, Capability};
use crate::units::{Angle, AngularVelocity};

/// An owner of motors whose output shafts follow a velocity.
///
/// `H` is the owner's handle type. A chassis needs no more than this from its wheels.
pub trait VelocityDrive<H: Copy> {
    /// Returns the measured velocity of the output shaft; `None` when there is no fresh feedback.
    fn velocity(&self, motor: H) -> Option<AngularVelocity>;

    /// Returns what a motor offers as it is configured; at least velocities, unless said otherwise.
    fn capabilities(&self, motor: H) -> Capabilities {
        let _ = motor;
        Capabilities::of(&[Capability::Velocity])
    }

    /// Sets the velocity that the output shaft is to follow.
    ///
    /// # Errors
    /// Says why the motor cannot take the target now. The value is then not kept for later.
    fn set_velocity(&mut self, motor: H, target: AngularVelocity) -> Result<(), TargetError>;

    /// Sets the velocities of several motors: of all wheels of a chassis, say.
    ///
    /// # Errors
    /// The first error. The motors after it are set all the same.
    fn drive(
        &mut self,
        targets: impl IntoIterator<Item = (H, AngularVelocity)>,
    ) -> Result<(), TargetError> {
        let mut outcome = Ok(());
        for (motor, target) in targets {
            let set = self.set_velocity(motor, target);
            outcome = outcome.and(set);
        }
        outcome
    }
}

impl<H: Copy, D: VelocityDrive<H>> VelocityDrive<H> for &mut D {
    fn velocity(&self, motor: H) -> Option<AngularVelocity> {
        (**self).velocity(motor)
    }

    fn capabilities(&self, motor: H) -> Capabilities {
        (**self).capabilities(motor)
    }

    fn set_velocity(&mut self, motor: H, target: AngularVelocity) -> Result<(), TargetError> {
        (**self).set_velocity(motor, target)
    }
}

/// An owner of motors whose output shafts go to an angle, by the shortest way: those that steer a wheel, say.
///
/// `H` is the owner's handle type. The motors have [`Capability::Angle`].
pub trait AngleDrive<H: Copy> {
    /// Returns the measured angle of the output shaft; `None` when there is no fresh feedback, or it is not homed.
    fn angle(&self, motor: H) -> Option<Angle>;

    /// Sets the angle that the output shaft is to go to; how many turns it has does not matter.
    ///
    /// # Errors
    /// Says why the motor cannot take the target now. The value is then not kept for later.
    fn set_angle(&mut self, motor: H, target: Angle) -> Result<(), TargetError>;
}

impl<H: Copy, D: AngleDrive<H>> AngleDrive<H> for &mut D {
    fn angle(&self, motor: H) -> Option<Angle> {
        (**self).angle(motor)
    }

    fn set_angle(&mut self, motor: H, target: Angle) -> Result<(), TargetError> {
        (**self).set_angle(motor, target)
    }
}

/// Why a motor does not take a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TargetError {
    /// The handle's motor was detached.
    Detached,
    /// The target is NaN or infinite. The motor goes to its safe output at once.
    NotFinite,
    /// The device is not armed.
    Disarmed,
    /// There is no fresh feedback from the motor.
    NoFeedback,
    /// The motor was relaxed by a fault and waits to be armed again.
    Relaxed,
    /// The motor was attached without the control loop that this kind of target needs.
    NoLoop,
    /// The position of a geared output shaft is relative to power-on until it is zeroed.
    NotHomed,
    /// This motor does not offer this kind of target.
    Unsupported,
    /// The measurement that the target goes with is too old, or lies ahead. The motor goes to its safe output at once.
    StaleMeasurement,
}

impl core::fmt::Display for TargetError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Detached => "the motor was detached",
            Self::NotFinite => "the target is NaN or infinite",
            Self::Disarmed => "the device is not armed",
            Self::NoFeedback => "no fresh feedback from the motor",
            Self::Relaxed => "the motor was relaxed by a fault: arm it again",
            Self::NoLoop => "the motor was attached without the loop for this target",
            Self::NotHomed => "the output angle is unknown until the position is zeroed",
            Self::Unsupported => "the motor does not offer this kind of target",
            Self::StaleMeasurement => "the measurement is too old",
        })
    }
}

impl core::error::Error for TargetError {}
