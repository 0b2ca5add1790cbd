//! Wheel layouts, their kinematics and their wheels.

use crate::opaque::Function;
use drivetrain::chassis::*;
use drivetrain::units::AngularVelocity;

pub fn call_all() {
    Differential::new.call();
    Differential::inverse.call();
    Differential::forward.call();
    Mecanum::new.call();
    Mecanum::with_rollers.call();
    Mecanum::inverse.call();
    Mecanum::forward.call();
    OmniWheel::tangential.call();
    Omni::<4>::new.call();
    Omni::<4>::inverse.call();
    Omni::<4>::forward.call();
    OmniThree::new.call();
    OmniThree::inverse.call();
    OmniThree::forward.call();
    OmniFour::new.call();
    OmniFour::inverse.call();
    OmniFour::forward.call();
    SteeringConfig::new.call();
    SteeringConfig::with_hysteresis.call();
    SteeringConfig::with_hold_below.call();
    SteeringConfig::without_cosine_compensation.call();
    SwerveSteering::<4>::new.call();
    SwerveSteering::<4>::steer.call();
    SwerveSteering::<4>::lock.call();
    ModuleState::new.call();
    Swerve::<4>::new.call();
    Swerve::<4>::positions_m.call();
    Swerve::<4>::inverse.call();
    Swerve::<4>::forward.call();
    wheels!(DifferentialWheels MecanumWheels OmniThreeWheels OmniFourWheels);
}

/// What a macro gives to every set of wheels, which it calls `name`.
macro_rules! wheels {
    ($($name:ident)*) => {
        $(
            (|wheels: $name<f32>| $name::map(wheels, |speed| speed > 0.0)).call();
            (|wheels: $name<f32>| $name::try_map(wheels, |speed| (speed > 0.0).then_some(speed).ok_or(1_u8))).call();
            $name::<f32>::zip::<u8>.call();
            (|wheels: &$name<f32>| *$name::as_ref(wheels).into_array()[0]).call();
            (|wheels: &mut $name<f32>| *$name::as_mut(wheels).into_array()[0] = 1.0).call();
            $name::<f32>::into_array.call();
            $name::<f32>::from_array.call();
            $name::<f32>::splat.call();
            $name::<Option<f32>>::all.call();
            $name::<AngularVelocity>::desaturate.call();
        )*
    };
}
use wheels;
