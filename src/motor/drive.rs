//! Owners of motors: velocities, angles and measured targets, and the handle of a motor of one of several owners.

use super::{Capabilities, Capability};
use crate::encoder::Position;
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};
use core::convert::Infallible;
use core::fmt::{self, Debug};

/// An owner of motors whose output shafts follow a velocity.
///
/// `H` is the owner's handle type. A chassis needs no more than this from its wheels.
///
/// A tuple or array of owners and `&mut D` are owners. The handle of a motor then tells its owner too: [`OneOf`] for a tuple,
/// `(index, handle)` for an array.
///
/// # Examples
/// ```
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{AttachError, Bus, Config, M3508};
/// use drivetrain::motor::{TargetError, VelocityDrive};
/// use drivetrain::units::AngularVelocity;
///
/// let (mut front, mut rear) = (Bus::new(), Bus::new());
/// let wheel = Config::<M3508>::new(1).speed_loop(PidConfig::new(1.9, 2.4, 0.0));
/// let wheels = [(0, front.attach(wheel)?), (1, rear.attach(wheel)?)];
/// let stop = wheels.map(|wheel| (wheel, AngularVelocity::ZERO));
/// assert_eq!([&mut front, &mut rear].drive(stop), Err(TargetError::Disarmed));
/// # Ok::<(), AttachError>(())
/// ```
pub trait VelocityDrive<H: Copy> {
    /// Returns the measured velocity of the output shaft; `None` when there is no fresh feedback.
    fn velocity(&self, motor: H) -> Option<AngularVelocity>;

    /// Returns the capabilities of a motor in its configuration; by default velocities.
    fn capabilities(&self, motor: H) -> Capabilities {
        let _ = motor;
        Capabilities::of(&[Capability::Velocity])
    }

    /// Sets the target velocity of the output shaft.
    ///
    /// # Errors
    /// Says why the motor cannot take the target now. The value is then not kept for later.
    fn set_velocity(&mut self, motor: H, target: AngularVelocity) -> Result<(), TargetError>;

    /// Sets the velocities of several motors: of all wheels of a chassis, say.
    ///
    /// # Errors
    /// The first error. The targets of the following motors are set all the same.
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

/// An owner of motors whose output shafts move to an angle, by the shortest way, for example the steering motors of
/// wheels.
///
/// `H` is the owner's handle type. The motors have [`Capability::Angle`]. A tuple or array of such owners is an owner, with the
/// handles of [`VelocityDrive`]; so is `&mut D`.
pub trait AngleDrive<H: Copy> {
    /// Returns the measured angle of the output shaft; `None` without fresh feedback, or before homing.
    fn angle(&self, motor: H) -> Option<Angle>;

    /// Sets the target angle of the output shaft; its number of turns does not matter.
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

/// The handle of a motor in a tuple of two to four owners: the owner, and the handle there. Also the error of one of several parts.
///
/// Tuples and arrays nest, so an owner in the tuple may be a tuple or an array itself.
///
/// # Examples
/// A robot with two DJI motors in front and two motors of its own in the rear:
/// ```
/// use drivetrain::chassis::MecanumWheels;
/// use drivetrain::control::PidConfig;
/// use drivetrain::dji::{AttachError, Bus, Config, Handle, M3508};
/// use drivetrain::motor::OneOf;
///
/// /// The handle of a motor in `(Bus, [Actuator<M>; 2])`.
/// type Wheel = OneOf<Handle<M3508>, (usize, ())>;
///
/// let mut bus = Bus::new();
/// let config = |id| Config::<M3508>::new(id).speed_loop(PidConfig::new(1.9, 2.4, 0.0));
/// let wheels: MecanumWheels<Wheel> = MecanumWheels {
///     front_left: OneOf::First(bus.attach(config(1))?),
///     front_right: OneOf::First(bus.attach(config(2))?),
///     rear_left: OneOf::Second((0, ())),
///     rear_right: OneOf::Second((1, ())),
/// };
/// assert_eq!(wheels.rear_right, OneOf::Second((1, ()))); // the second motor of the array
/// # Ok::<(), AttachError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OneOf<A, B, C = Infallible, D = Infallible> {
    /// A motor of the first owner.
    First(A),
    /// A motor of the second owner.
    Second(B),
    /// A motor of the third owner.
    Third(C),
    /// A motor of the fourth owner.
    Fourth(D),
}

impl<A: Debug, B: Debug, C: Debug, D: Debug> fmt::Display for OneOf<A, B, C, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First(of) => write!(f, "first: {of:?}"),
            Self::Second(of) => write!(f, "second: {of:?}"),
            Self::Third(of) => write!(f, "third: {of:?}"),
            Self::Fourth(of) => write!(f, "fourth: {of:?}"),
        }
    }
}

impl<A: Debug, B: Debug, C: Debug, D: Debug> core::error::Error for OneOf<A, B, C, D> {}

macro_rules! tuple {
    ($handles:ty: $($owner:ident $handle:ident $index:tt $place:ident),+) => {
        impl<$($handle: Copy, $owner: VelocityDrive<$handle>),+> VelocityDrive<$handles>
            for ($($owner,)+)
        {
            fn velocity(&self, motor: $handles) -> Option<AngularVelocity> {
                match motor {
                    $(OneOf::$place(motor) => self.$index.velocity(motor),)+
                }
            }

            fn capabilities(&self, motor: $handles) -> Capabilities {
                match motor {
                    $(OneOf::$place(motor) => self.$index.capabilities(motor),)+
                }
            }

            fn set_velocity(
                &mut self,
                motor: $handles,
                target: AngularVelocity,
            ) -> Result<(), TargetError> {
                match motor {
                    $(OneOf::$place(motor) => self.$index.set_velocity(motor, target),)+
                }
            }
        }

        impl<$($handle: Copy, $owner: AngleDrive<$handle>),+> AngleDrive<$handles>
            for ($($owner,)+)
        {
            fn angle(&self, motor: $handles) -> Option<Angle> {
                match motor {
                    $(OneOf::$place(motor) => self.$index.angle(motor),)+
                }
            }

            fn set_angle(&mut self, motor: $handles, target: Angle) -> Result<(), TargetError> {
                match motor {
                    $(OneOf::$place(motor) => self.$index.set_angle(motor, target),)+
                }
            }
        }
    };
}

tuple!(OneOf<HA, HB>: A HA 0 First, B HB 1 Second);
tuple!(OneOf<HA, HB, HC>: A HA 0 First, B HB 1 Second, C HC 2 Third);
tuple!(OneOf<HA, HB, HC, HD>: A HA 0 First, B HB 1 Second, C HC 2 Third, D HD 3 Fourth);

/// If there is no owner with this index, the motor counts as detached.
impl<H: Copy, D: VelocityDrive<H>, const N: usize> VelocityDrive<(usize, H)> for [D; N] {
    fn velocity(&self, (index, motor): (usize, H)) -> Option<AngularVelocity> {
        self.get(index)?.velocity(motor)
    }

    fn capabilities(&self, (index, motor): (usize, H)) -> Capabilities {
        self.get(index).map_or(Capabilities::NONE, |owner| owner.capabilities(motor))
    }

    fn set_velocity(
        &mut self,
        (index, motor): (usize, H),
        target: AngularVelocity,
    ) -> Result<(), TargetError> {
        self.get_mut(index).ok_or(TargetError::Detached)?.set_velocity(motor, target)
    }
}

/// If there is no owner with this index, the motor counts as detached.
impl<H: Copy, D: AngleDrive<H>, const N: usize> AngleDrive<(usize, H)> for [D; N] {
    fn angle(&self, (index, motor): (usize, H)) -> Option<Angle> {
        self.get(index)?.angle(motor)
    }

    fn set_angle(&mut self, (index, motor): (usize, H), target: Angle) -> Result<(), TargetError> {
        self.get_mut(index).ok_or(TargetError::Detached)?.set_angle(motor, target)
    }
}

/// Why a motor does not take a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TargetError {
    /// The owner has no motor with this handle, for example after a detach.
    Detached,
    /// The target is NaN or infinite, or its stiffness or damping below zero. The motor goes to its safe output in the next update, unless a
    /// good target comes before.
    NotFinite,
    /// The device is not armed.
    Disarmed,
    /// There is no fresh feedback from the motor.
    NoFeedback,
    /// The motor was relaxed by a fault and waits to be armed again.
    Relaxed,
    /// The motor was attached without the control loop for this kind of target.
    NoLoop,
    /// The position of a geared output shaft is relative to power-on until zeroed, or its zero was lost.
    NotHomed,
    /// This motor does not offer this kind of target.
    Unsupported,
    /// The measurement of the target is too old, or lies ahead. The motor moves to its safe output at once.
    StaleMeasurement,
}

impl core::fmt::Display for TargetError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Detached => "the motor was detached",
            Self::NotFinite => "not finite, or a gain below 0",
            Self::Disarmed => "the device is not armed",
            Self::NoFeedback => "no fresh feedback from the motor",
            Self::Relaxed => "the motor was relaxed by a fault: arm it again",
            Self::NoLoop => "the motor was attached without the loop for this target",
            Self::NotHomed => {
                "the output angle is unknown until zeroed, or the present position or angle is set"
            }
            Self::Unsupported => "the motor does not offer this kind of target",
            Self::StaleMeasurement => "the measurement is too old",
        })
    }
}

impl core::error::Error for TargetError {}

/// Angle and velocity of a shaft by another sensor than the motor's own, for example a gimbal's yaw by an IMU.
///
/// `A` is [`Angle`] for a sensor with an angle within a turn, and [`Position`] for a sensor that counts turns. Angle
/// and velocity are those of one axis, in the motor's positive direction: when the motor turns in this direction and
/// its base stands, both grow.
///
/// # Examples
/// ```
/// use drivetrain::motor::Measured;
/// use drivetrain::time::Instant;
/// use drivetrain::units::{Angle, AngularVelocity};
///
/// let yaw = Measured {
///     angle: Angle::from_degrees(350.0),
///     velocity: AngularVelocity::from_degrees_per_s(-12.0),
///     at: Instant::from_micros(1_000),
/// };
/// assert!((yaw.way_to(Angle::from_degrees(10.0)).as_degrees() - 20.0).abs() < 1e-3); // across zero
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Measured<A = Angle> {
    /// The angle or position.
    pub angle: A,
    /// The velocity.
    pub velocity: AngularVelocity,
    /// Time of the measurement; or of its arrival, after a short way.
    pub at: Instant,
}

impl Measured<Angle> {
    /// Returns the shortest way to an angle: within half a turn.
    #[must_use]
    pub fn way_to(&self, target: Angle) -> Angle {
        Angle::from_radians(crate::math::wrap_pi((target - self.angle).as_radians()))
    }
}

impl Measured<Position> {
    /// Returns the way to a position, over many turns.
    #[must_use]
    pub fn way_to(&self, target: Position) -> Angle {
        target - self.angle
    }
}
