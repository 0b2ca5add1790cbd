//! Any layout, any wheels, any commands, any steps: what the wheels are told is finite, within their limit, and nothing when
//! the command is old or no number.
#![no_main]

use drivetrain::chassis::{
    Chassis, ChassisLimits, ChassisMode, Differential, Kinematics, Mecanum, ModeConfig, Modes,
    ModuleState, Omni, Swerve, WheelSpeed,
};
use drivetrain::control::PidConfig;
use drivetrain::geometry::{Heading, Pose2, Twist, Vec2};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain_fuzz::{Clock, Input};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let radius = input.positive();
    let vec2 = |input: &mut Input| Vec2::new(input.float(), input.float());
    let speed = |input: &mut Input| AngularVelocity::from_rad_per_s(input.float());
    match input.byte() % 6 {
        0 | 1 => {
            let front_left = Vec2::new(input.positive(), input.positive());
            let Ok(layout) = Mecanum::new(radius, front_left) else { return };
            drive(layout, input, speed);
        }
        2 => {
            let Ok(layout) = Differential::new(radius, input.positive()) else { return };
            drive(layout, input, speed);
        }
        3 => {
            let wheel = |input: &mut Input| {
                Pose2::tangential(Angle::from_radians(input.float()), input.positive())
            };
            let wheels = [wheel(&mut input), wheel(&mut input), wheel(&mut input)];
            let Ok(layout) = Omni::<3>::new(radius, wheels) else { return };
            drive(layout, input, speed);
        }
        4 => {
            let places = [vec2(&mut input), vec2(&mut input), vec2(&mut input), vec2(&mut input)];
            let Ok(layout) = Swerve::<4>::new(radius, places) else { return };
            let layout = layout.with_hysteresis(Angle::from_radians(input.float()));
            let mut steering = [None; 4];
            drive(layout, input, |input| {
                let wanted = core::array::from_fn(|_| {
                    ModuleState::new(speed(input), Angle::from_radians(input.float()))
                });
                let measured = core::array::from_fn(|_| {
                    (input.byte() % 4 != 0).then(|| Angle::from_radians(input.float()))
                });
                let [module, ..] = layout.steer(&mut steering, wanted, measured);
                module
            });
        }
        _ => modes(input),
    }
});

fn drive<K: Kinematics>(
    layout: K,
    mut input: Input,
    mut measured: impl FnMut(&mut Input) -> K::Speed,
) where
    Chassis<K>: Copy,
{
    let mut chassis = Chassis::new(layout);
    let mut clock = Clock::new(1_000);
    let mut limit = f32::MAX;
    // Seconds since the command was renewed.
    let mut age_s = f64::MAX;
    let mut renewed = false;
    let mut ramps = false;
    while !input.is_empty() {
        match input.byte() {
            0..=31 => {
                let twist = Twist::new(input.float(), input.float(), input.float());
                if !twist.is_finite() {
                    check_refusal(chassis, twist);
                }
                chassis.set_body(twist);
                renewed = true;
            }
            32..=63 => {
                let twist = Twist::new(input.float(), input.float(), input.float());
                chassis.set_world(twist, Heading::new(Angle::from_radians(input.float())));
                renewed = true;
            }
            64..=71 => chassis.set_heading(Heading::new(Angle::from_radians(input.float()))),
            72..=79 => {
                chassis.stop();
                renewed = true;
            }
            80..=87 => chassis.restart(),
            88..=91 => chassis.set_pose(Pose2::ORIGIN),
            92..=111 => {
                let (linear, angular, wheel) = (input.positive(), input.positive(), input.float());
                let limits = ChassisLimits::new()
                    .with_acceleration(linear, angular)
                    .with_wheel_speed(AngularVelocity::from_rad_per_s(wheel));
                if chassis.set_limits(limits).is_ok() {
                    limit = wheel;
                    ramps = true;
                }
            }
            lost => {
                let now = clock.pass(&mut input);
                let wheels = K::map(layout_wheels(&chassis), |_: K::Speed| {
                    (lost < 240 || input.coin()).then(|| measured(&mut input))
                });
                let dt_s = input.step_s();
                let tick = Tick::new(Instant::from_micros(now), dt_s);
                if renewed {
                    age_s = 0.0;
                } else if dt_s.is_finite() && dt_s > 0.0 {
                    age_s += f64::from(dt_s);
                }
                renewed = false;
                let old = age_s > 0.101;
                let (mut same, mut stopped) = (chassis, chassis);
                stopped.stop();
                let targets = chassis.update(wheels, tick);
                let again = same.update(wheels, tick);
                let _: K::Wheels<()> = K::map(K::zip(targets, again), |(target, again)| {
                    let speed = target.velocity().as_rad_per_s();
                    assert!(speed.is_finite(), "{speed}: {:?}", chassis.status());
                    // Where wheels would turn at 1e38 rad/s the factor has few digits.
                    let slack = if limit >= 1.0 { 1e-5 } else { 1e-2 };
                    assert!(speed.abs() <= limit + limit * slack + 1e-6, "I2: {speed} of {limit}");
                    assert_eq!(speed.to_bits(), again.velocity().as_rad_per_s().to_bits(), "I10");
                    let rests = !old || dt_s <= 0.0 || !dt_s.is_finite() || ramps || speed == 0.0;
                    assert!(rests, "I4: {speed} after {age_s} s");
                });
                if old {
                    // With limits of acceleration it is on its way to rest, at the rate of a stop.
                    let stopped = stopped.update(wheels, tick);
                    let _: K::Wheels<()> = K::map(K::zip(targets, stopped), |(target, stopped)| {
                        let [target, stopped] =
                            [target, stopped].map(|speed| speed.velocity().as_rad_per_s());
                        assert_eq!(target.to_bits(), stopped.to_bits(), "I4: not as a stop");
                    });
                }
                assert!(!old || chassis.status().command_stale, "I4: {age_s} s");
                let (pose, moves) = (chassis.pose(), chassis.measured());
                assert!(moves.is_finite(), "{moves:?}");
                assert!(pose.angle.is_finite(), "{pose:?}");
                assert!(!pose.x_m.is_nan() && !pose.y_m.is_nan(), "{pose:?}");
            }
        }
    }
}

/// I5: a command that is no number stops the chassis as `stop` does, and is counted.
fn check_refusal<K: Kinematics>(mut chassis: Chassis<K>, twist: Twist<drivetrain::geometry::Body>)
where
    Chassis<K>: Copy,
{
    let (mut stopped, before) = (chassis, chassis.status().rejected);
    chassis.set_body(twist);
    stopped.stop();
    assert_eq!(chassis.status().rejected, before.saturating_add(1), "I6");
    let wheels = K::map(layout_wheels(&chassis), |_: K::Speed| None);
    let tick = Tick::new(Instant::from_micros(1), 0.001);
    let both = K::zip(chassis.update(wheels, tick), stopped.update(wheels, tick));
    let _: K::Wheels<()> = K::map(both, |(one, other)| {
        let [one, other] = [one, other].map(|speed| speed.velocity().as_rad_per_s());
        assert_eq!(one.to_bits(), other.to_bits(), "I5");
    });
}

fn layout_wheels<K: Kinematics>(chassis: &Chassis<K>) -> K::Wheels<K::Speed> {
    chassis.kinematics().inverse(Twist::ZERO)
}

fn modes(mut input: Input) {
    let mut config = ModeConfig::new(PidConfig::new(input.positive(), input.positive(), 0.0));
    if input.coin() {
        config = config.with_rotor(input.positive(), input.positive(), input.positive());
        config = config.with_transition(input.positive());
    }
    let timeout_s = input.positive();
    let instead = if input.coin() { ChassisMode::Relax } else { ChassisMode::Independent };
    config = config.with_alternating_rotor().with_gimbal_timeout(timeout_s);
    if instead == ChassisMode::Relax {
        config = config.with_relax_without_gimbal();
    }
    let Ok(mut modes) = Modes::new(config) else { return };
    // Seconds since the gimbal told its yaw.
    let mut age_s = f64::MAX;
    while !input.is_empty() {
        let kind = input.byte();
        let mode = match kind % 4 {
            0 => ChassisMode::Relax,
            1 => ChassisMode::FollowGimbal,
            2 => ChassisMode::Rotor,
            _ => ChassisMode::Independent,
        };
        modes.set_mode(mode);
        let command = Twist::new(input.float(), input.float(), input.float());
        let yaw = (kind < 192).then(|| Angle::from_radians(input.float()));
        let dt_s = input.step_s();
        let known = yaw.filter(|yaw| yaw.is_finite());
        match known {
            Some(_) => age_s = 0.0,
            None if dt_s.is_finite() && dt_s > 0.0 => age_s += f64::from(dt_s),
            None => {}
        }
        // I5 and I10: what is no number counts as nothing, and otherwise the same gives the same.
        let mut same = modes;
        let twist = modes.update(command, yaw, dt_s);
        let clean = if command.is_finite() { command } else { Twist::ZERO };
        let again = same.update(clean, known, dt_s);
        assert_eq!(format!("{twist:?}"), format!("{again:?}"), "I5 or I10");
        if let Some(twist) = twist {
            assert!(twist.is_finite(), "{twist:?} of {command:?}");
        }
        assert_eq!(twist.is_none(), modes.acting() == ChassisMode::Relax);
        // Sums of f32 and of f64 may differ by a step or so.
        let lost = age_s > f64::from(timeout_s) * 1.01 + 0.001;
        if lost && matches!(mode, ChassisMode::FollowGimbal | ChassisMode::Rotor) {
            assert_eq!(modes.acting(), instead, "I4: no yaw for {age_s} s");
        }
        for edges in 0.. {
            if modes.take_edge().is_none() {
                break;
            }
            assert!(edges < 2);
        }
    }
}
