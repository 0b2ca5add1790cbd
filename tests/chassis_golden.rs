//! Every layout against `data/chassis/golden.txt`, which `generate.py` beside it computes without the crate's formulas.

#![cfg(test)]

use drivetrain::chassis::{Differential, Mecanum, MecanumWheels, ModuleState, Omni, Swerve};
use drivetrain::geometry::{Body, Pose2, Twist, Vec2};
use drivetrain::units::{Angle, AngularVelocity};

const GOLDEN: &str = include_str!("data/chassis/golden.txt");
const CORNERS: [Vec2; 4] =
    [Vec2::new(0.2, 0.18), Vec2::new(0.2, -0.18), Vec2::new(-0.2, 0.18), Vec2::new(-0.2, -0.18)];

fn numbers(text: &str) -> Vec<f32> {
    text.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

/// The motions of a layout with the values of its wheels.
fn cases(layout: &str) -> Vec<(Twist<Body>, Vec<f32>)> {
    let cases: Vec<_> = GOLDEN
        .lines()
        .map(|line| line.split('|').map(str::trim).collect::<Vec<_>>())
        .filter(|fields| fields[0] == layout)
        .map(|fields| {
            let motion = match fields[1].strip_prefix("about ").map(numbers) {
                Some(turn) => Twist::new(0.0, 0.0, turn[2]).about(Vec2::new(turn[0], turn[1])),
                None => {
                    let motion = numbers(fields[1]);
                    Twist::new(motion[0], motion[1], motion[2])
                }
            };
            (motion, numbers(fields[2]))
        })
        .collect();
    assert_eq!(cases.len(), 12, "{layout}"); // nine motions, three turns about a point of the body
    cases
}

fn compare<const N: usize>(
    layout: &str,
    inverse: impl Fn(Twist<Body>) -> [AngularVelocity; N],
    forward: impl Fn([AngularVelocity; N]) -> Twist<Body>,
) {
    for (motion, expected) in cases(layout) {
        let wheels: [f32; N] = expected.try_into().unwrap();
        for (is, should) in inverse(motion).iter().zip(wheels) {
            let error = (is.as_rad_per_s() - should).abs();
            assert!(
                error < 2e-5 * (1.0 + should.abs()),
                "{layout} {motion:?}: {is:?}, not {should}"
            );
        }
        let back = forward(wheels.map(AngularVelocity::from_rad_per_s));
        // The differential drive cannot move sideways.
        let sideways = if N == 2 { motion.vy_m_s } else { 0.0 };
        let error = back + Twist::new(0.0, sideways, 0.0) - motion;
        assert!(
            error.linear().norm() < 1e-5 && error.wz_rad_s.abs() < 3e-5,
            "{layout} {motion:?}: {error:?}"
        );
    }
}

#[test]
fn mecanum_with_both_roller_mountings() {
    let usual = Mecanum::new(0.076, Vec2::new(0.20, 0.18)).unwrap();
    compare(
        "mecanum_o",
        |twist| usual.inverse(twist).into_array(),
        |wheels| usual.forward(MecanumWheels::from_array(wheels)),
    );
    let other = Mecanum::<'X'>::with_rollers(0.076, Vec2::new(0.1, 0.3)).unwrap();
    compare(
        "mecanum_x",
        |twist| other.inverse(twist).into_array(),
        |wheels| other.forward(MecanumWheels::from_array(wheels)),
    );
}

#[test]
fn omni_with_three_four_and_scattered_wheels() {
    let three = Omni::three(0.05, 0.2).unwrap();
    compare("omni_three", |twist| three.inverse(twist), |wheels| three.forward(wheels));
    let four = Omni::four(0.05, 0.25).unwrap();
    compare("omni_four", |twist| four.inverse(twist), |wheels| four.forward(wheels));
    let wheel = |x, y, degrees| Pose2::new(x, y, Angle::from_degrees(degrees));
    let scattered = [
        wheel(0.3, 0.1, 100.0),
        wheel(0.0, -0.2, 10.0),
        wheel(-0.1, 0.3, 170.0),
        wheel(-0.3, -0.2, -60.0),
    ];
    let scattered = Omni::new(0.06, scattered).unwrap();
    compare(
        "omni_off_centre",
        |twist| scattered.inverse(twist),
        |wheels| scattered.forward(wheels),
    );
}

#[test]
fn differential() {
    let chassis = Differential::new(0.076, 0.18).unwrap();
    compare("differential", |twist| chassis.inverse(twist), |wheels| chassis.forward(wheels));
}

#[test]
fn swerve_speeds_and_angles() {
    compare_modules("swerve", CORNERS);
    let off_centre = [Vec2::new(0.3, 0.1), Vec2::new(0.0, -0.2), Vec2::new(-0.1, 0.3)];
    compare_modules("swerve_off_centre", off_centre);
}

fn compare_modules<const N: usize>(layout: &str, places: [Vec2; N]) {
    let swerve = Swerve::new(0.076, places).unwrap();
    let (coarse, relative) = if cfg!(feature = "micromath") { (0.3, 6e-3) } else { (1e-3, 1e-5) };
    for (motion, expected) in cases(layout) {
        let mut given = expected.chunks(2);
        let modules = places.map(|_| {
            let module = given.next().unwrap();
            let velocity = AngularVelocity::from_rad_per_s(module[0]);
            ModuleState::new(velocity, Angle::from_degrees(module[1]))
        });
        let error = swerve.forward(modules) - motion;
        let bound = relative * (1.0 + motion.linear().norm() + motion.wz_rad_s.abs());
        assert!(
            error.linear().norm() + error.wz_rad_s.abs() < 3.0 * bound,
            "{layout} {motion:?}: {error:?}"
        );
        for (module, should) in swerve.inverse(motion).iter().zip(expected.chunks(2)) {
            assert!((module.velocity.as_rad_per_s() - should[0]).abs() < 2e-5 * (1.0 + should[0]));
            if should[0] < 1e-4 {
                continue; // the body turns about this module, which has no direction then
            }
            let turn = (module.angle.as_degrees() - should[1]).abs();
            assert!(
                turn.min((turn - 360.0).abs()) < coarse,
                "{motion:?}: {module:?}, not {should:?}"
            );
        }
    }
}
