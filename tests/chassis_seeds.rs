//! Formulas of the documents this crate started from, in their corrected form, each with what was wrong; the others stand
//! beside the code that they are about.

#![cfg(test)]

use core::f32::consts::FRAC_1_SQRT_2;
use drivetrain::chassis::{Mecanum, MecanumWheels, Omni, PowerModel};
use drivetrain::geometry::{Heading, Twist, Vec2, World};
use drivetrain::math::{wrap, wrap_positive};
use drivetrain::units::{Angle, AngularVelocity};

/// Wheel radius, wheelbase and track of the first seed's call.
const CALL: (f32, f32, f32) = (0.076, 0.2, 0.25);

fn mecanum() -> Mecanum {
    let (wheel_radius_m, wheelbase_m, track_m) = CALL;
    Mecanum::new(wheel_radius_m, Vec2::new(0.5 * wheelbase_m, 0.5 * track_m)).unwrap()
}

// The first seed declares half spacings and is called with full ones: its robot turned twice as fast as told.
#[test]
fn the_lengths_are_half_the_wheelbase_and_half_the_track() {
    let wheels = mecanum().inverse(Twist::new(0.0, 0.0, 1.0)).map(AngularVelocity::as_rad_per_s);
    let surface_m_s = wheels.front_right * CALL.0;
    assert!((surface_m_s - (0.1 + 0.125)).abs() < 1e-6, "{surface_m_s} m/s");
}

// The first seed wants angles in [0, 360], where 0 and 360 are one direction with two names.
#[test]
fn a_whole_turn_is_zero_and_never_360_degrees() {
    for whole in [360.0, -360.0, 720.0, 0.0, -0.0] {
        assert!(wrap_positive(whole, 360.0).abs() < f32::MIN_POSITIVE);
    }
    let below = wrap_positive(-1e-6, 360.0);
    assert!((0.0..360.0).contains(&below), "{below}");
}

// The first seed's cyclic mode makes -340 of 10 - 350 degrees: the long way round.
#[test]
fn from_350_to_10_degrees_is_20_and_back_is_minus_20() {
    assert!((wrap(10.0 - 350.0, 360.0) - 20.0).abs() < 1e-6);
    assert!((wrap(350.0 - 10.0, 360.0) + 20.0).abs() < 1e-6);
}

// "Angles are degrees, never radians", says the first seed, and gives yaw rates and its transforms radians.
#[test]
fn degrees_and_radians_are_one_angle() {
    let (degrees, radians) = (Angle::from_degrees(90.0), Angle::from_radians(1.570_796_4));
    let body = |angle| Twist::<World>::new(1.0, 0.0, 0.0).to_body(Heading::new(angle));
    let error = body(degrees) - body(radians);
    assert!(error.linear().norm() < 1e-6, "{error:?}");
}

// The third seed with a heading: v_y is not put in, and -(a - b) becomes -a - b in rows 3 and 4. Its axes are x right,
// y forward; its wheels 1 to 4 stand rear right, rear left, front left, front right.
#[test]
fn the_third_seeds_rows_with_a_heading_turn_the_whole_command() {
    let layout = Omni::four(0.05, 0.2).unwrap();
    for degrees in [0.0_f32, 30.0, 90.0, 135.0, -160.0] {
        let (x, y, w) = (0.3, 0.8, 1.5);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        // World to body is R(-theta).
        let (across, ahead) = (x * cosine + y * sine, y * cosine - x * sine);
        let row =
            |sign_x: f32, sign_y: f32| FRAC_1_SQRT_2 * (sign_x * across + sign_y * ahead) + 0.2 * w;
        let heading = Heading::new(Angle::from_degrees(degrees));
        let [front_left, front_right, rear_left, rear_right] =
            layout.inverse(Twist::<World>::new(y, -x, w).to_body(heading));
        let pairs = [
            (rear_right, row(1.0, 1.0)),
            (rear_left, row(1.0, -1.0)),
            (front_left, row(-1.0, -1.0)),
            (front_right, row(-1.0, 1.0)),
        ];
        for (is, should) in pairs {
            let is = is.as_rad_per_s() * 0.05;
            assert!((is - should).abs() < 1e-5, "{degrees}: {is} and not {should}");
        }
    }
}

// The fifth seed adds three sticks of full size without any limit: a wheel is asked for three times its speed.
#[test]
fn three_full_sticks_are_slowed_to_the_limit_and_keep_their_direction() {
    let (radius, _, _) = CALL;
    let fastest = AngularVelocity::from_rad_per_s(20.0);
    let full = 20.0 * radius; // m/s
    let sticks = Twist::new(full, full, full / 0.225);
    let asked = mecanum().inverse(sticks);
    assert!((asked.front_right.as_rad_per_s() - 60.0).abs() < 1e-3, "{asked:?}");
    let (limited, factor) = asked.desaturate(fastest);
    assert!((factor - 1.0 / 3.0).abs() < 1e-6, "{factor}");
    let slowed = mecanum().forward(limited) - sticks * (1.0 / 3.0);
    assert!(slowed.linear().norm() < 1e-5 && slowed.wz_rad_s.abs() < 1e-4, "{slowed:?}");
}

// XRobot gives each wheel its own root of the power equation: equal wheels come out unequal, and the robot turns.
#[test]
fn equal_wheels_stay_equal_through_the_power_limit_whatever_the_others_do() {
    let model = PowerModel::new(1.0, 1.0, 2.0, 0.001).unwrap();
    let load = |torque, speed_rad_s| (torque, AngularVelocity::from_rad_per_s(speed_rad_s));
    let wheels = MecanumWheels {
        front_left: load(3.0, 40.0),
        front_right: load(3.0, 40.0),
        rear_left: load(-1.0, 40.0),
        rear_right: load(0.5, -20.0),
    };
    for limit_w in [0.0, 30.0, 80.0, 150.0] {
        let (scale, _) = model.cut(wheels, limit_w);
        let torques = wheels.map(|(torque, _)| torque * scale);
        assert_eq!(torques.front_left.to_bits(), torques.front_right.to_bits());
        // And the torques keep their proportions, so the pull keeps its direction.
        assert!((torques.rear_left * 3.0 + torques.front_left).abs() < 1e-5, "{torques:?}");
    }
}
