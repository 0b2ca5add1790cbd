//! What errors and handles say: each text names what is wrong, for the person at the serial console.

#![cfg(test)]

use drivetrain::chassis::{ChassisLimits, Mecanum, ModeConfig, Modes, PowerBuffer, PowerModel};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, M3508};
use drivetrain::error::ConfigError;
use drivetrain::geometry::Vec2;
use drivetrain::motor::{Claim, MotorName, Role};
use drivetrain::runner::FrameQueue;
use drivetrain::time::ExtendedCounter;
use embedded_can::StandardId;

fn says(text: &impl std::fmt::Display, words: &[&str]) {
    let text = text.to_string();
    for word in words {
        assert!(text.contains(word), "\"{text}\" does not say {word}");
    }
}

#[test]
fn chassis_errors_name_the_value() {
    says(&Mecanum::new(0.0, Vec2::new(0.2, 0.2)).unwrap_err(), &["wheel_radius_m"]);
    says(&drivetrain::chassis::Differential::new(f32::NAN, 0.2).unwrap_err(), &["wheel_radius_m"]);
    says(&PowerModel::new(1.0, 1.0, -1.0, 0.0).unwrap_err(), &["k2", "zero or more"]);
    let limits = ChassisLimits::new().with_command_timeout(0.0);
    says(&limits.validate().unwrap_err(), &["command timeout", "more than zero"]);
    let limits = ChassisLimits::new().with_command_timeout(f32::INFINITY);
    says(&limits.validate().unwrap_err(), &["command timeout in s", "at most 1 is"]);
    let swing = ModeConfig::new(PidConfig::new(1.0, 0.0, 0.0)).with_rotor(1.0, 2.0, 1.0);
    says(&Modes::new(swing).unwrap_err(), &["swing", "base"]);
    let spoilt = ModeConfig::new(PidConfig::new(f32::NAN, 0.0, 0.0));
    says(&Modes::new(spoilt).unwrap_err(), &["follow loop", "kp"]);
}

#[test]
fn the_power_buffer_names_its_loop_or_its_value() {
    let pid = PidConfig::new(2.0, 0.0, 0.0);
    says(&PowerBuffer::new(-1.0, pid).unwrap_err(), &["reserve_j"]);
    let buffer = PowerBuffer::new(20.0, pid).unwrap();
    let error = buffer.with_blind_share(f32::NAN).unwrap_err();
    assert!(matches!(error, ConfigError::Negative(_)));
    says(&error, &["blind_share"]);
    let spoilt = PowerBuffer::new(20.0, PidConfig::new(-1.0, 0.0, 0.0)).unwrap_err();
    says(&spoilt, &["buffer's loop", "kp"]);
    let mut half = buffer.with_blind_share(0.5).unwrap();
    assert!((half.allowance_w(80.0, None, 0.001) - 40.0).abs() < 1e-4);
}

#[test]
fn loop_errors_say_what_is_missing() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let pid = PidConfig::new(1.0, 0.0, 0.0);
    let error = bus.set_speed_loop(wheel, pid).unwrap_err();
    says(&error, &["without this loop"]);
    says(&ConfigError::Unusable("kp"), &["kp is not usable"]);
    bus.detach(wheel);
    says(&bus.set_position_loop(wheel, pid).unwrap_err(), &["detached"]);
}

#[test]
fn handles_show_model_and_slot_and_are_equal_to_themselves() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let yaw = bus.attach(Config::<Gm6020Current>::new(3)).unwrap();
    assert_eq!(format!("{wheel:?}"), "Handle(M3508 in slot 0)");
    assert_eq!(format!("{:?}", yaw.erase()), "AnyHandle(slot 6)"); // 0x207 is the seventh from 0x201
    assert_eq!(wheel.erase(), wheel.into());
    assert_ne!(wheel.erase(), yaw.erase());
}

#[test]
fn claims_and_counters_say_who_and_what() {
    let id = StandardId::new(0x123).unwrap();
    let claim = Claim::new(id, Role::Command, MotorName::new("pump", 4));
    assert_eq!((claim.role(), claim.motor().id()), (Role::Command, 4));
    says(&claim, &["pump", "4", "123"]);
    says(&ExtendedCounter::new_16_bit(999_983).unwrap_err(), &["999983 Hz", "rounder frequency"]);
}

#[test]
fn both_ends_of_a_queue_say_how_many_frames_wait() {
    let mut queue = FrameQueue::<8>::default();
    let (mut sender, receiver) = queue.split();
    let frame = drivetrain::frame::CanFrame::standard(0x201, [0; 8]).unwrap();
    assert!(sender.push(&frame, drivetrain::time::Instant::START));
    assert_eq!(format!("{sender:?}"), "FrameSender(1 waiting)");
    assert_eq!(format!("{receiver:?}"), "FrameReceiver(1 waiting)");
}
