use super::ModuleState;
use crate::motor::{AngleDrive, Capabilities, TargetError, VelocityDrive};
use crate::units::{Angle, AngularVelocity};

/// An owner of the motors of wheels: what [`Chassis::drive`](super::Chassis::drive) reads and tells.
///
/// `H` names the motors of one wheel, `S` is what the wheel does. Whoever is a [`VelocityDrive`] drives plain wheels,
/// and whoever is an [`AngleDrive`] too drives the modules of a [`Swerve`](super::Swerve).
///
/// # Examples
/// ```
/// use drivetrain::chassis::{Chassis, Differential, DifferentialGeometry, DifferentialWheels};
/// use drivetrain::motor::{TargetError, VelocityDrive};
/// use drivetrain::{geometry::Twist, time::{Instant, Tick}, units::AngularVelocity};
///
/// /// Two motors that do at once what they are told.
/// struct Motors([AngularVelocity; 2]);
///
/// impl VelocityDrive<usize> for Motors {
///     fn velocity(&self, motor: usize) -> Option<AngularVelocity> {
///         self.0.get(motor).copied()
///     }
///     fn set_velocity(&mut self, motor: usize, target: AngularVelocity) -> Result<(), TargetError> {
///         *self.0.get_mut(motor).ok_or(TargetError::Detached)? = target;
///         Ok(())
///     }
/// }
///
/// let geometry = DifferentialGeometry { wheel_radius_m: 0.1, half_track_m: 0.25 };
/// let mut chassis = Chassis::new(Differential::new(geometry)?);
/// let mut motors = Motors([AngularVelocity::ZERO; 2]);
/// chassis.set_body(Twist::new(1.0, 0.0, 0.0));
/// let tick = Tick::new(Instant::from_micros(1_000), 0.001);
/// chassis.drive(&mut motors, DifferentialWheels { left: 0, right: 1 }, tick);
/// assert!((motors.0[1].as_rad_per_s() - 10.0).abs() < 1e-5);
/// # Ok::<(), drivetrain::chassis::GeometryError>(())
/// ```
pub trait WheelDrive<H: Copy, S> {
    /// Returns what the wheel does; `None` when it is not heard.
    fn measured(&self, wheel: H) -> Option<S>;

    /// Tells the wheel what to do.
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

/// The two motors of a swerve module.
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
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ModuleMotors<D, S> {
    /// The motor that rolls the wheel.
    pub drive: D,
    /// The motor that turns the module; seen from above, counter-clockwise positive.
    pub steering: S,
    /// What the steering motor shows when the module points forward.
    pub zero: Angle,
}

impl<D, S> ModuleMotors<D, S> {
    /// Takes the motor that rolls, the one that steers, and what that one shows when the module points forward.
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

    /// A wheel whose module cannot be steered is told to stand.
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

/// Two owners as one: the motors that roll on one bus, those that steer on another.
///
/// Four modules have eight motors, too many for one bus at 1 kHz. Make it for the call, from two `&mut`; a robot with
/// another division implements [`VelocityDrive`] and [`AngleDrive`] for a type of its own.
///
/// # Examples
/// ```
/// use drivetrain::chassis::SwerveBuses;
/// use drivetrain::dji::{AttachError, Bus, Config, M2006};
/// use drivetrain::{control::PidConfig, motor::{TargetError, VelocityDrive}, units::AngularVelocity};
///
/// let (mut rolling, mut steering) = (Bus::new(), Bus::new());
/// let wheel = rolling.attach(Config::<M2006>::new(1).speed_loop(PidConfig::new(1.0, 0.0, 0.0)))?;
/// let mut both = SwerveBuses { drives: &mut rolling, steerings: &mut steering };
/// assert_eq!(both.set_velocity(wheel, AngularVelocity::ZERO), Err(TargetError::Disarmed));
/// # Ok::<(), AttachError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SwerveBuses<D, S> {
    /// Owns the motors that roll.
    pub drives: D,
    /// Owns the motors that steer.
    pub steerings: S,
}

impl<H: Copy, D: VelocityDrive<H>, S> VelocityDrive<H> for SwerveBuses<D, S> {
    fn velocity(&self, motor: H) -> Option<AngularVelocity> {
        self.drives.velocity(motor)
    }

    fn capabilities(&self, motor: H) -> Capabilities {
        self.drives.capabilities(motor)
    }

    fn set_velocity(&mut self, motor: H, target: AngularVelocity) -> Result<(), TargetError> {
        self.drives.set_velocity(motor, target)
    }
}

impl<H: Copy, D, S: AngleDrive<H>> AngleDrive<H> for SwerveBuses<D, S> {
    fn angle(&self, motor: H) -> Option<Angle> {
        self.steerings.angle(motor)
    }

    fn set_angle(&mut self, motor: H, target: Angle) -> Result<(), TargetError> {
        self.steerings.set_angle(motor, target)
    }
}
