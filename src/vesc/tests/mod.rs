//! The count of turns, ids and lengths.

use super::*;
use crate::encoder::GearRatio;
use crate::error::ConfigError;
use crate::frame::CanFrame;
use crate::motor::{DriveProtocol, Ingest};
use crate::units::AngularVelocity;
use embedded_can::{ExtendedId, Frame, Id, StandardId};

const MODEL: Model = Model {
    name: "test",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.05,
    current_limit_a: 40.0,
    max_velocity: AngularVelocity::from_rad_per_s(600.0),
};

fn m3508() -> Model {
    Model { gear: GearRatio::new(3_591, 187).unwrap(), ..MODEL }
}

#[test]
fn the_tachometer_wraps_and_no_count_is_lost() {
    let mut shaft = MODEL.tachometer();
    shaft.take(i32::MAX);
    let before = shaft.position();
    shaft.take(i32::MIN + 41); // 42 counts on: one turn
    let after = shaft.position();
    assert_eq!(after.turns() - before.turns(), 1);
    assert_eq!(before.angle(), after.angle());
    shaft.take(i32::MAX); // and back
    assert_eq!(shaft.position(), before);
}

#[test]
fn turns_through_a_gear_are_exact_after_a_million_of_them() {
    let model = m3508();
    let mut shaft = model.tachometer();
    // 3591 turns of the rotor are 187 of the output shaft.
    let mut count = 0_i32;
    for _ in 0..14_000 {
        count += 42 * 3_591;
        shaft.take(count);
        assert_eq!(shaft.position().angle().as_radians().to_bits(), 0);
    }
    assert_eq!(shaft.position().turns(), 187 * 14_000);
    // The same in steps that end within turns.
    let mut small = model.tachometer();
    let mut at = 0;
    while at < count / 1_000 {
        at = (at + 997).min(count / 1_000);
        small.take(at);
    }
    let turns = f64::from(at) / 42.0 * 187.0 / 3_591.0;
    let found = small.position().turns() as f64 + f64::from(small.position().angle().as_turns());
    assert!((found - turns).abs() < 1e-5, "{found} {turns}");
}

#[test]
fn the_longest_products_of_the_tachometer_stay_within_32_bits() {
    let gear = GearRatio::new(4_096, 1).unwrap();
    let max_velocity = AngularVelocity::from_rad_per_s(1.0);
    let model = Model { pole_pairs: 255, gear, max_velocity, ..MODEL };
    let long = Model { gear: GearRatio::new(4_095, 4_094).unwrap(), ..model };
    assert_eq!(Motor::new(model, 1, Mode::position()).err(), None);
    assert!(
        matches!(Motor::new(long, 1, Mode::position()), Err(ConfigError::Limit { parameter, .. }) if parameter.contains("gear"))
    );
    let mut shaft = model.tachometer();
    for count in [i32::MAX, i32::MIN, 0, i32::MIN, -1, 1, i32::MAX] {
        shaft.take(count);
        let phase = shaft.position().angle().as_turns();
        assert!((0.0..1.0).contains(&phase), "{count} {phase}");
    }
}

#[test]
fn each_status_has_one_length_and_others_change_nothing() {
    for packet in 0..=255_u8 {
        for length in 0..=8_usize {
            let mut feedback = Feedback::default();
            let is_status = matches!(packet, 9 | 14 | 15 | 16 | 27 | 58);
            let is_right = is_status && length == 8 || packet == 27 && length == 6;
            assert_eq!(feedback.take(packet, &[1; 8][..length]), is_right, "{packet} {length}");
            assert_eq!(feedback != Feedback::default(), is_right);
        }
    }
}

#[test]
fn frames_of_other_drives_and_with_other_ids_are_not_its_own() {
    let mut motor = Motor::new(MODEL, 23, Mode::current()).unwrap();
    let extended = |raw| Id::Extended(ExtendedId::new(raw).unwrap());
    let claimed = |motor: &Motor, id: Id| motor.claims().into_iter().any(|claim| claim.covers(id));
    for packet in 0..=255_u32 {
        let is_own = matches!(packet, 0..=4 | 8 | 9..=13 | 14..=16 | 27 | 58);
        assert_eq!(claimed(&motor, extended(packet << 8 | 23)), is_own, "{packet}");
        assert!(!claimed(&motor, extended(packet << 8 | 24)));
        assert!(!claimed(&motor, extended(1 << 16 | packet << 8 | 23)));
    }
    assert!(!claimed(&motor, Id::Standard(StandardId::new(0x117).unwrap())));
    let other = CanFrame::new(extended(0x918), &[1; 8]).unwrap();
    assert_eq!(motor.decode(&other), Ingest::Unrelated);
    let standard = CanFrame::new(StandardId::new(0x117).unwrap(), &[1; 8]).unwrap();
    assert_eq!(motor.decode(&standard), Ingest::Unrelated);
    assert_eq!(motor.feedback(), &Feedback::default());
}

#[test]
fn only_the_answer_to_our_own_question_has_a_fault_code() {
    let answer = [23, 1, 50, 0, 0, 0x80, 0, 4];
    assert_eq!(codec::fault(&answer, 23), Some(4));
    for place in 0..7 {
        let mut other = answer;
        other[place] ^= 1;
        assert_eq!(codec::fault(&other, 23), None, "{other:?}");
    }
    for length in 0..8 {
        assert_eq!(codec::fault(&answer[..length], 23), None);
    }
}
