//! Wheels and steered modules by the owners of their motors.

use super::{Chassis, Kinematics, ModuleState, Swerve};
use crate::motor::{AngleDrive, TargetError, VelocityDrive};
use crate::time::Tick;
use crate::units::{Angle, AngularVelocity};

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

impl<K: Kinematics<Speed = AngularVelocity>> Chassis<K> {
    /// Reads the motors of all wheels, sets their targets, and returns the targets.
    ///
    /// `owner` is a bus, a motor of the application, or a tuple or array of these; the handle of a wheel is that of its motor. For
    /// motors on two buses, with a runner each, `owner` is the tuple of both buses and a handle names its bus
    /// ([`OneOf`](crate::motor::OneOf)); each runner keeps its own `due` and `tick`.
    ///
    /// If a motor refuses its target, [`status`](Self::status) counts the refusal and keeps the first error; all other
    /// wheels are driven, on the same device and on other devices. If all wheels of all devices refuse, the chassis starts
    /// over: it discards the angles to hold, and when a motor takes its target again, the command is approached from the
    /// measured motion. An application that stops a chassis with a lost wheel disarms its devices.
    ///
    /// Costs 1125 instructions on a Cortex-M4F, for four M3508 and mecanum wheels (`docs/figures.md`).
    ///
    /// # Examples
    /// Front wheels on one bus, rear wheels on another:
    /// ```
    /// use drivetrain::chassis::{Chassis, Mecanum, MecanumWheels};
    /// use drivetrain::control::PidConfig;
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::motor::{OneOf, TargetError};
    /// use drivetrain::{geometry::{Twist, Vec2}, time::{Instant, Tick}};
    ///
    /// let (mut front, mut rear) = (Bus::new(), Bus::new());
    /// let wheel = |id| Config::<M3508>::new(id).speed_loop(PidConfig::new(1.9, 2.4, 0.0));
    /// let wheels = MecanumWheels {
    ///     front_left: OneOf::First(front.attach(wheel(1))?),
    ///     front_right: OneOf::First(front.attach(wheel(2).reversed())?),
    ///     rear_left: OneOf::Second(rear.attach(wheel(1))?),
    ///     rear_right: OneOf::Second(rear.attach(wheel(2).reversed())?),
    /// };
    /// let mut chassis = Chassis::new(Mecanum::new(0.1, Vec2::new(0.2, 0.2))?);
    ///
    /// // Each millisecond; with runners, `&mut (front.device_mut(), rear.device_mut())`:
    /// chassis.set_body(Twist::new(1.0, 0.0, 0.0));
    /// let targets = chassis.drive(&mut (&mut front, &mut rear), wheels, Tick::new(Instant::from_micros(1_000), 0.001));
    /// assert!((targets.rear_left.as_rad_per_s() - 10.0).abs() < 1e-4);
    /// assert_eq!(chassis.status().refused, 4);
    /// assert_eq!(chassis.status().refusal, Some(TargetError::Disarmed));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn drive<H: Copy, D: VelocityDrive<H> + ?Sized>(
        &mut self,
        owner: &mut D,
        wheels: K::Wheels<H>,
        tick: Tick,
    ) -> K::Wheels<AngularVelocity> {
        self.drive_by(owner, wheels, tick, D::velocity, D::set_velocity)
    }
}

impl<const N: usize> Chassis<Swerve<N>> {
    /// Reads the motors of all modules, sets their targets, and returns the targets: as for plain wheels, with an `owner` of both
    /// motors of each module.
    ///
    /// If a steering motor refuses its target, the target of its drive motor is zero at once, without the limit of the acceleration.
    pub fn drive<D: Copy, S: Copy, O: VelocityDrive<D> + AngleDrive<S> + ?Sized>(
        &mut self,
        owner: &mut O,
        modules: [ModuleMotors<D, S>; N],
        tick: Tick,
    ) -> [ModuleState; N] {
        self.drive_by(owner, modules, tick, measured, command)
    }
}

/// The velocity is NaN while the angle alone is known.
fn measured<D: Copy, S: Copy, O: VelocityDrive<D> + AngleDrive<S> + ?Sized>(
    owner: &O,
    module: ModuleMotors<D, S>,
) -> Option<ModuleState> {
    let angle = owner.angle(module.steering)? - module.zero;
    let unknown = AngularVelocity::from_rad_per_s(f32::NAN);
    Some(ModuleState::new(owner.velocity(module.drive).unwrap_or(unknown), angle))
}

fn command<D: Copy, S: Copy, O: VelocityDrive<D> + AngleDrive<S> + ?Sized>(
    owner: &mut O,
    module: ModuleMotors<D, S>,
    target: ModuleState,
) -> Result<(), TargetError> {
    let steered = owner.set_angle(module.steering, target.angle + module.zero);
    let velocity = if steered.is_ok() { target.velocity } else { AngularVelocity::ZERO };
    steered.and(owner.set_velocity(module.drive, velocity))
}
