//! Wheel layouts, their kinematics and their wheels.

use crate::opaque::Function;
use drivetrain::chassis::*;
use drivetrain::dji::{AnyHandle, Bus};
use drivetrain::motor::OneOf;
use drivetrain::time::Tick;
use drivetrain::units::AngularVelocity;

pub fn call_all() {
    Differential::new.call();
    Differential::inverse.call();
    Differential::forward.call();
    Mecanum::<'O'>::new.call();
    Mecanum::<'O'>::with_rollers.call();
    Mecanum::<'O'>::inverse.call();
    Mecanum::<'X'>::forward.call();
    Omni::<4>::new.call();
    Omni::<4>::inverse.call();
    Omni::<4>::forward.call();
    Omni::three.call();
    Omni::four.call();
    Swerve::<4>::with_hysteresis.call();
    Swerve::<4>::with_hold_below.call();
    Swerve::<4>::without_cosine_compensation.call();
    ModuleState::new.call();
    <AngularVelocity as WheelSpeed>::is_finite.call();
    <ModuleState as WheelSpeed>::is_finite.call();
    Swerve::<4>::new.call();
    Swerve::<4>::steer.call();
    Swerve::<4>::lock.call();
    Swerve::<4>::positions_m.call();
    Swerve::<4>::inverse.call();
    Swerve::<4>::forward.call();
    FiveBar::new.call();
    FiveBar::state.call();
    FiveBar::angles.call();
    LegState::torques.call();
    BalanceModel::plant.call();
    Balancer::new.call();
    Balancer::start.call();
    Balancer::stop.call();
    Balancer::set_motion.call();
    Balancer::set_length.call();
    Balancer::phase.call();
    Balancer::is_slipping.call();
    Balancer::update.call();
    Chassis::<Mecanum>::new.call();
    Chassis::<Mecanum>::set_limits.call();
    Chassis::<Mecanum>::set_body.call();
    Chassis::<Mecanum>::set_world.call();
    Chassis::<Mecanum>::set_heading.call();
    Chassis::<Mecanum>::set_gyro_offset.call();
    Chassis::<Mecanum>::stop.call();
    Chassis::<Mecanum>::lock.call();
    Chassis::<Mecanum>::restart.call();
    Chassis::<Mecanum>::update.call();
    Chassis::<Mecanum>::measured.call();
    Chassis::<Mecanum>::reference.call();
    Chassis::<Mecanum>::pose.call();
    Chassis::<Mecanum>::set_pose.call();
    Chassis::<Mecanum>::status.call();
    Chassis::<Mecanum>::kinematics.call();
    (|chassis: &mut Chassis<Mecanum>,
      bus: &mut Bus,
      wheels: MecanumWheels<AnyHandle>,
      tick: Tick| Chassis::<Mecanum>::drive(chassis, bus, wheels, tick))
    .call();
    (|chassis: &mut Chassis<Swerve<4>>,
      bus: &mut Bus,
      modules: [ModuleMotors<AnyHandle, AnyHandle>; 4],
      tick: Tick| Chassis::<Swerve<4>>::drive(chassis, bus, modules, tick))
    .call();
    (|chassis: &mut Chassis<Swerve<2>>,
      drives: &mut Bus,
      steerings: &mut Bus,
      modules: [ModuleMotors<OneOf<AnyHandle, AnyHandle>>; 2],
      tick: Tick| {
        Chassis::<Swerve<2>>::drive(chassis, &mut (drives, steerings), modules, tick)
    })
    .call();
    (|chassis: &mut Chassis<Mecanum>,
      front: &mut Bus,
      rear: &mut Bus,
      wheels: MecanumWheels<(usize, AnyHandle)>,
      tick: Tick| Chassis::<Mecanum>::drive(chassis, &mut [front, rear], wheels, tick))
    .call();
    ModuleMotors::<AnyHandle, AnyHandle>::new.call();
    ChassisLimits::new.call();
    ChassisLimits::with_acceleration.call();
    ChassisLimits::with_wheel_speed.call();
    ChassisLimits::with_command_timeout.call();
    ChassisLimits::validate.call();
    ModeConfig::new.call();
    ModeConfig::with_rotor.call();
    ModeConfig::with_clockwise_rotor.call();
    ModeConfig::with_alternating_rotor.call();
    ModeConfig::with_gimbal_timeout.call();
    ModeConfig::with_relax_without_gimbal.call();
    ModeConfig::with_transition.call();
    Modes::new.call();
    Modes::set_mode.call();
    Modes::mode.call();
    Modes::acting.call();
    Modes::take_edge.call();
    Modes::update.call();
    Odometry::new.call();
    Odometry::advance.call();
    Odometry::pose.call();
    Odometry::heading.call();
    Odometry::set_position_m.call();
    Odometry::set_gyro_offset.call();
    PowerModel::new.call();
    PowerModel::power_w.call();
    (|model: &PowerModel, wheels: [(f32, AngularVelocity); 4], limit_w: f32| {
        PowerModel::cut(model, wheels, limit_w)
    })
    .call();
    PowerBuffer::new.call();
    PowerBuffer::with_blind_share.call();
    PowerBuffer::allowance_w.call();
    CapacitorPlan::new.call();
    CapacitorPlan::with_most_w.call();
    CapacitorPlan::allowance_w.call();
    PowerFit::new.call();
    PowerFit::model.call();
    PowerFit::rejected.call();
    (|fit: &mut PowerFit, wheels: [(f32, AngularVelocity); 4], watts: f32| {
        PowerFit::learn(fit, wheels, watts)
    })
    .call();
    wheels!(MecanumWheels);
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
