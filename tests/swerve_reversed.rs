//! A swerve module whose drive runs backward: each function that steers, drives or measures it.

#![cfg(test)]

use drivetrain::chassis::{
    Chassis, ChassisLimits, Kinematics, ModuleMotors, ModuleState, Swerve, WheelSpeed,
};
use drivetrain::geometry::{Twist, Vec2};
use drivetrain::motor::{AngleDrive, TargetError, VelocityDrive};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use proptest::prelude::*;

const RADIUS_M: f32 = 0.05;
const CORNERS: [Vec2; 4] =
    [Vec2::new(0.3, 0.3), Vec2::new(0.3, -0.3), Vec2::new(-0.3, 0.3), Vec2::new(-0.3, -0.3)];
const TICK: Tick = Tick::new(Instant::START, 0.001);
/// The speed of a wheel in rad/s at which the modules are told to drive.
const SPEED: f32 = 10.0;

fn degrees(degrees: f32) -> Angle {
    Angle::from_degrees(degrees)
}

fn module(rad_per_s: f32, angle: f32) -> ModuleState {
    ModuleState::new(AngularVelocity::from_rad_per_s(rad_per_s), degrees(angle))
}

fn swerve() -> Swerve<4> {
    Swerve::new(RADIUS_M, CORNERS).unwrap()
}

/// Four modules that are told the same, and what is remembered of them.
struct Modules {
    swerve: Swerve<4>,
    steering: [Option<(Angle, bool)>; 4],
}

impl Modules {
    /// With a hysteresis of 5 degrees, without cosine compensation, nothing remembered.
    fn new() -> Self {
        Self { swerve: swerve().without_cosine_compensation(), steering: [None; 4] }
    }

    /// Reversed, pointing at `here`: told to drive straight back.
    fn reversed(here: f32) -> Self {
        let mut modules = Self::new();
        let (angle, speed) = modules.steer(here + 180.0, here);
        assert!(near(angle, here) && near(speed, -SPEED), "{angle} {speed}");
        modules
    }

    /// The angle in degrees and the speed in rad/s that a module is given which is told to drive into a direction.
    fn steer(&mut self, direction: f32, here: f32) -> (f32, f32) {
        self.steer_as(module(SPEED, direction), Some(here))
    }

    fn steer_as(&mut self, wanted: ModuleState, here: Option<f32>) -> (f32, f32) {
        let measured = [here.map(degrees); 4];
        let told = self.swerve.steer(&mut self.steering, [wanted; 4], measured);
        same(told)
    }

    fn stand(&mut self, here: Option<f32>) -> (f32, f32) {
        self.steer_as(ModuleState::default(), here)
    }
}

fn same(told: [ModuleState; 4]) -> (f32, f32) {
    assert!(told.iter().all(|module| *module == told[0]), "{told:?}");
    (told[0].angle.as_degrees(), told[0].velocity.as_rad_per_s())
}

fn near(is: f32, should: f32) -> bool {
    (is - should).abs() < 1e-2
}

// With the sign of the hysteresis turned round for a reversed drive, every other test passed.
#[test]
fn a_reversed_drive_stays_reversed_until_it_is_off_by_ninety_degrees_and_the_hysteresis() {
    for side in [1.0, -1.0] {
        for here in [0.0, -170.0, 3_600.0] {
            for off in [60.0, 86.0, 89.0, 91.0, 94.0] {
                let off = side * off;
                let (angle, speed) = Modules::reversed(here).steer(here + 180.0 + off, here);
                assert!(near(angle, here + off) && near(speed, -SPEED), "{off}: {angle} {speed}");
            }
            for off in [96.0, 120.0, 179.0] {
                let off = side * off;
                let (angle, speed) = Modules::reversed(here).steer(here + 180.0 + off, here);
                let ahead = here + off - side * 180.0;
                assert!(near(angle, ahead) && near(speed, SPEED), "{off}: {angle} {speed}");
            }
        }
    }
}

#[test]
fn a_command_that_dithers_about_ninety_degrees_does_not_flip_a_reversed_drive() {
    for side in [1.0, -1.0] {
        let mut modules = Modules::reversed(0.0);
        for step in 0..100 {
            let off = side * if step % 2 == 0 { 94.0 } else { 86.0 };
            let (angle, speed) = modules.steer(180.0 + off, 0.0);
            assert!(near(angle, off) && speed < 0.0, "{step}: {angle} {speed}");
        }
    }
}

/// In each of the two directions: it may have been remembered in one of them only.
#[test]
fn the_width_of_the_hysteresis_is_the_same_in_both_directions() {
    for width in [0.0_f32, 1.0, 5.0, 30.0, 80.0] {
        let swerve = swerve().with_hysteresis(degrees(width)).without_cosine_compensation();
        for reversed in [false, true] {
            for side in [1.0, -1.0] {
                let flips_at = (0..1_800_u16).map(|step| f32::from(step) * 0.1).find(|off| {
                    let mut steering = [None; 4];
                    let mut steer = |direction| {
                        let wanted = [module(SPEED, direction); 4];
                        let told = swerve.steer(&mut steering, wanted, [Some(Angle::ZERO); 4]);
                        same(told).1 < 0.0
                    };
                    let straight = if reversed { 180.0 } else { 0.0 };
                    assert_eq!(steer(straight), reversed);
                    steer(straight + side * off) != reversed
                });
                let flips_at = flips_at.unwrap();
                assert!((flips_at - 90.0 - width).abs() < 0.25, "{width} {reversed}: {flips_at}");
            }
        }
    }
}

#[test]
fn standing_and_a_lost_angle_do_not_forget_that_the_drive_is_reversed() {
    let pauses: [fn(&mut Modules); 3] = [
        |modules| assert!(near(modules.stand(Some(0.0)).1, 0.0)),
        |modules| assert!(near(modules.stand(None).1, 0.0)),
        |modules| assert!(near(modules.steer_as(module(SPEED, 180.0), None).1, 0.0)),
    ];
    for pause in pauses {
        let mut modules = Modules::reversed(0.0);
        for _ in 0..3 {
            pause(&mut modules);
        }
        let (angle, speed) = modules.steer(180.0 + 93.0, 0.0);
        assert!(near(angle, 93.0) && near(speed, -SPEED), "{angle} {speed}");
    }
}

#[test]
fn what_is_remembered_anew_is_not_reversed() {
    let mut modules = Modules::reversed(0.0);
    modules.steering = [None; 4];
    let (angle, speed) = modules.steer(93.0, 0.0);
    assert!(near(angle, 93.0) && near(speed, SPEED), "{angle} {speed}");
}

/// The first module stands at 45 degrees, so its lock is there or at 225.
#[test]
fn the_lock_takes_the_direction_that_it_took_before() {
    let locked = |modules: &mut Modules, here: f32| {
        let told = modules.swerve.lock(&mut modules.steering, [Some(degrees(here)); 4]);
        told[0].angle.as_degrees()
    };
    let close = |is: f32, should: f32| (is - should).abs() < 0.3;
    // 94 degrees off, it goes to the nearer end only if it was there before.
    let mut fresh = Modules::new();
    assert!(close(locked(&mut fresh, 45.0 + 94.0), 45.0));
    let mut modules = Modules::new();
    assert!(close(locked(&mut modules, 45.0 + 100.0), 225.0));
    assert!(close(locked(&mut modules, 225.0), 225.0));
    assert!(close(locked(&mut modules, 225.0 - 94.0), 225.0), "pushed by hand");
    assert!(close(locked(&mut modules, 225.0 - 96.0), 45.0));
    assert!(close(locked(&mut modules, 225.0 - 86.0), 45.0), "and now this one");
    // The drive goes on in the direction of the lock, and the lock in that of the drive.
    let mut modules = Modules::new();
    assert!(close(locked(&mut modules, 45.0 + 100.0), 225.0));
    let wanted = [module(SPEED, 180.0 + 93.0); 4];
    let told = modules.swerve.steer(&mut modules.steering, wanted, [Some(Angle::ZERO); 4]);
    assert!(near(told[0].velocity.as_rad_per_s(), -SPEED), "{told:?}");
    let mut modules = Modules::reversed(45.0);
    assert!(close(locked(&mut modules, 45.0 + 86.0), 225.0));
}

#[test]
fn a_reversed_drive_is_compensated_with_the_cosine_of_its_own_error() {
    let swerve = swerve();
    for (direction, here, angle) in [(170.0, 30.0, -10.0), (-170.0, -30.0, 10.0)] {
        let mut steering = [None; 4];
        let told =
            swerve.steer(&mut steering, [module(SPEED, direction); 4], [Some(degrees(here)); 4]);
        let (told, speed) = same(told);
        let expected = -SPEED * 40.0_f32.to_radians().cos();
        assert!(near(told, angle) && near(speed, expected), "{told} {speed}");
        // Across its way it does not push, and beyond it neither: not backward, which is forward here.
        for off in [90.0, 94.0] {
            let wanted = [module(SPEED, here + 180.0 + off); 4];
            let told = swerve.steer(&mut steering, wanted, [Some(degrees(here)); 4]);
            assert!(same(told).1.abs() < 1e-2, "{told:?}");
        }
    }
}

/// A chassis with motors that do at once what they are told.
struct Bench {
    speeds: [AngularVelocity; 4],
    angles: [Angle; 4],
}

impl VelocityDrive<usize> for Bench {
    fn velocity(&self, motor: usize) -> Option<AngularVelocity> {
        self.speeds.get(motor).copied()
    }
    fn set_velocity(&mut self, motor: usize, target: AngularVelocity) -> Result<(), TargetError> {
        self.speeds[motor] = target;
        Ok(())
    }
}

impl AngleDrive<usize> for Bench {
    fn angle(&self, motor: usize) -> Option<Angle> {
        self.angles.get(motor).copied()
    }
    fn set_angle(&mut self, motor: usize, target: Angle) -> Result<(), TargetError> {
        self.angles[motor] = target;
        Ok(())
    }
}

/// What the encoders show when the modules point forward.
const ZERO: Angle = Angle::from_degrees(200.0);

impl Bench {
    fn new(angles: [f32; 4]) -> Self {
        let angles = angles.map(|angle| degrees(angle) + ZERO);
        Self { speeds: [AngularVelocity::ZERO; 4], angles }
    }

    fn drive(&mut self, chassis: &mut Chassis<Swerve<4>>) {
        let modules = [0, 1, 2, 3].map(|motor| ModuleMotors::new(motor, motor, ZERO));
        chassis.drive(self, modules, TICK);
    }

    fn reversed(&self) -> [bool; 4] {
        self.speeds.map(|speed| speed < AngularVelocity::ZERO)
    }
}

#[test]
fn a_chassis_that_drives_back_turns_its_wheels_backward_and_its_pose_goes_back() {
    let mut chassis = Chassis::new(swerve());
    let mut bench = Bench::new([0.0; 4]);
    for _ in 0..1_001 {
        chassis.set_body(Twist::new(-0.5, 0.0, 0.0));
        bench.drive(&mut chassis);
    }
    assert_eq!(bench.reversed(), [true; 4]);
    for (speed, angle) in bench.speeds.into_iter().zip(bench.angles) {
        assert!(near(speed.as_rad_per_s(), -SPEED), "{speed:?}");
        assert!((angle - ZERO).as_degrees().abs() < 0.3, "{angle:?}");
    }
    assert!((chassis.pose().x_m + 0.5).abs() < 1e-3, "{:?}", chassis.pose());
    assert!(chassis.measured().vx_m_s < -0.49);
    assert!(chassis.status().slip_m_s.is_some_and(|slip| slip < 1e-3), "{:?}", chassis.status());
}

/// The chassis remembers for each module on its own, and over standing still and the lock.
#[test]
fn a_chassis_keeps_the_modules_reversed_that_are() {
    let mut chassis = Chassis::new(swerve());
    // Forward is 10 degrees off for two of them, and nearly behind the two others.
    let mut bench = Bench::new([10.0, -10.0, 170.0, -170.0]);
    let mut go = |bench: &mut Bench, direction: f32, speed: f32| {
        let (sin, cos) = direction.to_radians().sin_cos();
        chassis.set_body(Twist::new(speed * cos, speed * sin, 0.0));
        bench.drive(&mut chassis);
    };
    go(&mut bench, 0.0, 0.5);
    let some = [false, false, true, true];
    assert_eq!(bench.reversed(), some);
    go(&mut bench, 0.0, 0.0);
    // The modules were told to come to 0 and 180 degrees: 93 degrees off all of them.
    go(&mut bench, 93.0, 0.5);
    go(&mut bench, 93.0, 0.5);
    assert_eq!(bench.reversed(), some);
    go(&mut bench, 93.0 + 96.0, 0.5);
    go(&mut bench, 93.0 + 96.0, 0.5);
    assert_eq!(bench.reversed(), some.map(|reversed| !reversed));
    chassis.restart();
    bench.angles = [ZERO; 4];
    chassis.set_body(Twist::new(0.0, 0.5, 0.0));
    for _ in 0..2 {
        chassis.set_body(Twist::new(-0.02, 0.5, 0.0));
        bench.drive(&mut chassis);
    }
    assert_eq!(bench.reversed(), [false; 4], "after a restart all begin anew");
}

#[test]
fn the_wheel_limit_slows_a_chassis_that_drives_back_as_one_that_drives_forward() {
    let limit = AngularVelocity::from_rad_per_s(4.0);
    let mut chassis = Chassis::new(swerve());
    chassis.set_limits(ChassisLimits::new().with_wheel_speed(limit)).unwrap();
    let mut bench = Bench::new([0.0; 4]);
    for _ in 0..3 {
        chassis.set_body(Twist::new(-0.5, 0.0, 0.0));
        bench.drive(&mut chassis);
    }
    assert!(
        bench.speeds.iter().all(|speed| near(speed.as_rad_per_s(), -4.0)),
        "{:?}",
        bench.speeds
    );
    // So does the layout's own function, for modules that are reversed already.
    let swerve = swerve();
    let (told, factor) =
        swerve.desaturate([-8.0, 2.0, -4.0, 1.0].map(|speed| module(speed, 30.0)), limit);
    assert!(near(factor, 0.5), "{factor}");
    for (told, speed) in told.into_iter().zip([-4.0, 1.0, -2.0, 0.5]) {
        assert!(near(told.velocity.as_rad_per_s(), speed), "{told:?}");
        assert!(near(told.angle.as_degrees(), 30.0), "{told:?}");
    }
}

proptest! {
    /// Law: a wheel that rolls backward at an angle is one that rolls forward at the angle and half a turn.
    #[test]
    fn a_reversed_wheel_is_measured_as_what_it_does(
        speeds in proptest::array::uniform4(-20.0_f32..20.0),
        angles in proptest::array::uniform4(-400.0_f32..400.0),
        turned in proptest::array::uniform4(any::<bool>()),
        lost in proptest::array::uniform4(any::<bool>()),
    ) {
        let swerve = swerve();
        let mut index = 0..4;
        let one = speeds.map(|speed| module(speed, angles[index.next().unwrap()]));
        let mut index = 0..4;
        let other = one.map(|module| match turned[index.next().unwrap()] {
            true => ModuleState::new(module.velocity * -1.0, module.angle + degrees(180.0)),
            false => module,
        });
        let difference = swerve.forward(one) - swerve.forward(other);
        prop_assert!(difference.linear().norm() < 1e-3 && difference.wz_rad_s.abs() < 1e-2, "{difference:?}");
        prop_assert!((swerve.slip_m_s(one) - swerve.slip_m_s(other)).abs() < 1e-3);
        for (one, other) in one.into_iter().zip(other) {
            let (near, far) = (one.distance(other), one.distance(other.scaled(-1.0)));
            let speed = one.velocity.as_rad_per_s().abs();
            prop_assert!(near < 1e-3 && (far - 2.0 * speed).abs() < 1e-3, "{near} {far}");
        }
        let known = |modules: [ModuleState; 4]| {
            let mut index = 0..4;
            modules.map(|module| (!lost[index.next().unwrap()]).then_some(module))
        };
        match (swerve.forward_partial(known(one)), swerve.forward_partial(known(other))) {
            (Some(one), Some(other)) => {
                let difference = one - other;
                prop_assert!(difference.linear().norm() < 1e-2 && difference.wz_rad_s.abs() < 3e-2, "{difference:?}");
            }
            (one, other) => prop_assert!(one.is_none() && other.is_none()),
        }
    }

    /// Law: what a module is told leads where it was wanted, whichever way the drive runs; a wanted speed below zero
    /// is one against the angle.
    #[test]
    fn a_wanted_velocity_below_zero_leads_against_its_angle(
        speed in 1.0_f32..20.0, direction in -400.0_f32..400.0, here in -400.0_f32..400.0, before in -400.0_f32..400.0,
    ) {
        let mut modules = Modules::new();
        modules.steer(before, here);
        let mut other = Modules { swerve: modules.swerve, steering: modules.steering };
        let (angle, velocity) = modules.steer_as(module(-speed, direction), Some(here));
        let (sin, cos) = angle.to_radians().sin_cos();
        let (wanted_sin, wanted_cos) = direction.to_radians().sin_cos();
        prop_assert!((velocity * cos + speed * wanted_cos).abs() < 2e-2, "{angle} {velocity}");
        prop_assert!((velocity * sin + speed * wanted_sin).abs() < 2e-2, "{angle} {velocity}");
        prop_assert!((angle - here).abs() <= 95.1);
        let (angle, velocity) = other.steer_as(module(speed, direction + 180.0), Some(here));
        let (sin, cos) = angle.to_radians().sin_cos();
        prop_assert!((velocity * cos + speed * wanted_cos).abs() < 2e-2, "{angle} {velocity}");
        prop_assert!((velocity * sin + speed * wanted_sin).abs() < 2e-2, "{angle} {velocity}");
    }
}
