//! Values of geometry and chassis through a file and back, and files that somebody spoiled.

#![cfg(test)]
#![cfg(feature = "serde")]

use core::fmt::Debug;
use drivetrain::chassis::{
    ChassisLimits, ChassisMode, MecanumWheels, ModeConfig, Modes, ModuleState, PowerModel,
};
use drivetrain::control::PidConfig;
use drivetrain::geometry::{
    Body, Heading, Point2, Point3, Pose2, Rotation2, Rotation3, Transform2, Transform3, Twist,
    Vec2, Vec3, World,
};
use drivetrain::units::{Angle, AngularVelocity};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

fn read<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

fn round<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: T) {
    let text = serde_json::to_string(&value).unwrap();
    assert_eq!(read::<T>(&text).as_ref(), Ok(&value), "{text}");
}

fn turned(roll: f32, pitch: f32, yaw: f32) -> Rotation3 {
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_radians);
    Rotation3::from_roll_pitch_yaw(roll, pitch, yaw)
}

proptest! {
    #[test]
    fn geometry_survives_a_file_bit_by_bit(
        x in -1e3_f32..1e3, y in -1e3_f32..1e3, a in -10.0_f32..10.0, b in -10.0_f32..10.0, c in -10.0_f32..10.0
    ) {
        let angle = Angle::from_radians(a);
        let (rotation2, rotation3) = (Rotation2::new(angle), turned(a, b, c));
        round(Vec2::new(x, y));
        round(Vec3::new(x, y, a));
        round(Point2::<Body>::new(x, y));
        round(Point3::<World>::new(x, y, c));
        round(Twist::<Body>::new(x, y, a));
        round(rotation2);
        round(Heading::new(angle));
        round(rotation3);
        round(rotation3.roll_pitch_yaw());
        round(Pose2::<World>::new(x, y, angle));
        round(Transform2::<Body, World>::new(rotation2, Vec2::new(x, y)));
        round(Transform3::<Body, World>::new(rotation3, Vec3::new(x, y, b)));
    }

    #[test]
    fn whatever_is_read_as_a_rotation_has_length_one(
        w in -1e3_f32..1e3, x in -1e3_f32..1e3, y in -1e3_f32..1e3, z in -1e3_f32..1e3
    ) {
        if let Ok(turn) = read::<Rotation2>(&format!("{{\"cos\":{w},\"sin\":{x}}}")) {
            let length = turn.cos().hypot(turn.sin());
            prop_assert!((length - 1.0).abs() < 1e-6, "{turn:?}");
            prop_assert!((turn.sin() * w - turn.cos() * x).abs() < 1e-3, "{turn:?}");
        }
        let text = format!("{{\"w\":{w},\"vector\":{{\"x\":{x},\"y\":{y},\"z\":{z}}}}}");
        if let Ok(turn) = read::<Rotation3>(&text) {
            let square: f32 = turn.to_quaternion().iter().map(|part| part * part).sum();
            prop_assert!((square - 1.0).abs() < 2e-6, "{turn:?}");
        }
    }
}

#[test]
fn values_of_the_chassis_survive_a_file() {
    let speed = AngularVelocity::from_rad_per_s(-3.5);
    round(Pose2::<Body>::tangential(Angle::from_degrees(60.0), 0.2));
    round(MecanumWheels { front_left: 1_u8, front_right: 2, rear_left: 3, rear_right: 4 });
    round(MecanumWheels::splat(speed));
    round(ModuleState::new(speed, Angle::from_degrees(700.0)));
    round(PowerModel::new(1.0, 0.475, 0.065, 0.001).unwrap());
    round(ChassisLimits::new().with_acceleration(3.0, 20.0).with_wheel_speed(speed.abs()));
    let modes = ModeConfig::new(PidConfig::new(6.0, 0.0, 0.1).with_output_limit(8.0));
    round(modes.with_rotor(6.0, 2.0, 3.0).with_alternating_rotor());
    round(modes.with_gimbal_timeout(0.05).with_relax_without_gimbal().with_transition(0.1));
    for mode in [
        ChassisMode::Relax,
        ChassisMode::FollowGimbal,
        ChassisMode::Rotor,
        ChassisMode::Independent,
    ] {
        round(mode);
    }
}

/// The text of a value with one part of it replaced.
fn spoiled<T: Serialize>(value: T, part: &str, by: &str) -> String {
    let text = serde_json::to_string(&value).unwrap();
    let spoiled = text.replacen(part, by, 1);
    assert_ne!(text, spoiled, "{part} is not in it");
    spoiled
}

#[test]
fn a_rotation_without_a_length_and_a_transform_that_shears_are_refused() {
    let reason = "is not usable";
    let refused = |error: Option<String>| {
        assert!(error.as_ref().is_some_and(|text| text.contains(reason)), "{error:?}")
    };
    refused(read::<Rotation2>("{\"cos\":0.0,\"sin\":0.0}").err());
    let zero = spoiled(Rotation3::IDENTITY, "1.0", "0.0");
    refused(read::<Rotation3>(&zero).err());
    refused(read::<[Rotation3; 1]>(&format!("[{zero}]")).err()); // inside of another value too
    let transform = Transform3::<Body, World>::IDENTITY;
    refused(read::<Transform3<Body, World>>(&spoiled(transform, "1.0", "1.5")).err()); // longer
    refused(read::<Transform3<Body, World>>(&spoiled(transform, "1.0", "-1.0")).err()); // mirrored
    refused(read::<Transform3<Body, World>>(&spoiled(transform, "0.0", "0.3")).err()); // sheared
    let plane = Transform2::<Body, World>::IDENTITY;
    refused(read::<Transform2<Body, World>>(&spoiled(plane, "1.0", "0.0")).err());
    let infinite = read::<Rotation3>(&spoiled(Rotation3::IDENTITY, "1.0", "1e39")).err();
    assert!(infinite.is_some()); // by the format or by the rotation
}

#[test]
fn a_heading_in_a_file_cannot_contradict_itself() {
    let heading = Heading::new(Angle::from_degrees(90.0));
    let text = serde_json::to_string(&heading).unwrap();
    assert_eq!(text, serde_json::to_string(&heading.angle()).unwrap());
    assert_eq!(read::<Heading>(&text), Ok(heading));
}

#[test]
fn a_power_model_with_a_negative_loss_is_refused() {
    let model = PowerModel::new(1.0, 0.5, 0.25, 0.0).unwrap();
    let error = read::<PowerModel>(&spoiled(model, "\"k2\":0.25", "\"k2\":-0.25")).unwrap_err();
    assert!(error.starts_with("k2: must be zero or more, and finite"), "{error}");
}

#[test]
fn configurations_that_are_checked_where_they_are_used_are_still_checked() {
    let limits = ChassisLimits::new().with_acceleration(3.0, 20.0);
    let limits: ChassisLimits = read(&spoiled(limits, "3.0", "-3.0")).unwrap();
    assert!(limits.validate().is_err());
    let modes = ModeConfig::new(PidConfig::new(6.0, 0.0, 0.0)).with_transition(0.125);
    let modes: ModeConfig = read(&spoiled(modes, "0.125", "-0.125")).unwrap();
    assert!(Modes::new(modes).is_err());
}
