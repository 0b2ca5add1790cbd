//! Wheels and steered modules by the owners of their motors.

use super::ModuleState;
use crate::motor::{AngleDrive, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

/// An owner of the motors of wheels, with handles `H`, for [`Chassis::drive`](super::Chassis::drive).
///
/// Each [`VelocityDrive`] drives plain wheels, and each that is also an [`AngleDrive`] drives modules: a bound on these is
/// the bound of a generic program.
pub trait WheelDrive<H: Copy, S> {
    /// Returns the measured speed of the wheel; `None` without fresh feedback.
    fn measured(&self, wheel: H) -> Option<S>;

    /// Sets the target of the wheel.
    ///
    /// # Errors
    /// Says why a motor of the wheel cannot take its target now.
    fn command(&mut self, wheel: H, target: S) -> Result<(), TargetError>;
}

impl<H: Copy, D: VelocityDrive<H> + ?Sized> WheelDrive<H, AngularVelocity> for D {
    fn measured(&self, wheel: H) -> Option<AngularVelocity> {
        self.velocity(wheel)
    }

    fn command(&mut self, wheel: H, target: AngularVelocity) -> Result<(), TargetError> {
        self.set_velocity(wheel, target)
    }
}

/// The handles of the two motors of a swerve module.
///
/// Four modules have eight motors, too many for one CAN bus at 1 kHz. With the drive motors on one bus and the steering motors
/// on another, the owner is the tuple of both buses, and both handles are a [`OneOf`](crate::motor::OneOf).
///
/// # Examples
/// ```
/// use drivetrain::chassis::ModuleMotors;
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{Bus, Config, Gm6020Voltage, M3508};
/// use drivetrain::units::Angle;
///
/// let mut bus = Bus::new();
/// let speed = PidConfig::new(2.4, 6.0, 0.0);
/// let drive = bus.attach(Config::<M3508>::new(1).speed_loop(speed))?;
/// let angle = PidConfig::new(50.0, 0.0, 0.0);
/// let steering = bus.attach(Config::<Gm6020Voltage>::new(1).position_loop(angle, speed))?;
/// let front = ModuleMotors::new(drive, steering, Angle::from_degrees(12.0));
/// assert_eq!(front.zero.as_degrees(), 12.0); // the encoder shows 12 degrees when the module points forward
/// # Ok::<(), drivetrain::dji::AttachError>(())
/// ```
///
/// On two buses:
/// ```
/// use drivetrain::chassis::ModuleMotors;
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508};
/// use drivetrain::{motor::OneOf, units::Angle};
///
/// type Motor = OneOf<Handle<M3508>, Handle<Gm6020Voltage>>;
///
/// let (mut drives, mut steerings) = (Bus::new(), Bus::new());
/// let speed = PidConfig::new(2.4, 6.0, 0.0);
/// let drive = drives.attach(Config::<M3508>::new(1).speed_loop(speed))?;
/// let angle = PidConfig::new(50.0, 0.0, 0.0);
/// let steering = steerings.attach(Config::<Gm6020Voltage>::new(1).position_loop(angle, speed))?;
/// let front: ModuleMotors<Motor> =
///     ModuleMotors::new(OneOf::First(drive), OneOf::Second(steering), Angle::from_degrees(12.0));
/// // chassis.drive(&mut (&mut drives, &mut steerings), [front, rear], tick);
/// # assert_eq!(front.drive, OneOf::First(drive));
/// # Ok::<(), drivetrain::dji::AttachError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ModuleMotors<D, S = D> {
    /// Handle of the drive motor of the wheel.
    pub drive: D,
    /// Handle of the steering motor of the module; seen from above, counter-clockwise positive.
    pub steering: S,
    /// Angle of the steering motor at which the module points forward.
    pub zero: Angle,
}

impl<D, S> ModuleMotors<D, S> {
    /// Takes the handles of drive and steering motor, and the angle of the steering motor at which the module points forward.
    #[must_use]
    pub const fn new(drive: D, steering: S, zero: Angle) -> Self {
        Self { drive, steering, zero }
    }
}

impl<D, S, O> WheelDrive<ModuleMotors<D, S>, ModuleState> for O
where
    D: Copy,
    S: Copy,
    O: VelocityDrive<D> + AngleDrive<S> + ?Sized,
{
    /// The velocity is NaN while the angle alone is known.
    fn measured(&self, module: ModuleMotors<D, S>) -> Option<ModuleState> {
        let angle = self.angle(module.steering)? - module.zero;
        let unknown = AngularVelocity::from_rad_per_s(f32::NAN);
        Some(ModuleState::new(self.velocity(module.drive).unwrap_or(unknown), angle))
    }

    /// If the steering motor refuses its target, the target of the drive motor is zero.
    fn command(
        &mut self,
        module: ModuleMotors<D, S>,
        target: ModuleState,
    ) -> Result<(), TargetError> {
        let steered = self.set_angle(module.steering, target.angle + module.zero);
        let velocity = if steered.is_ok() { target.velocity } else { AngularVelocity::ZERO };
        steered.and(self.set_velocity(module.drive, velocity))
    }
}
