//! F44 to F50: who is on the bus.

use crate::case::{self, Case, cases, safe_after, saw};
use crate::rig::{SPEED, armed, at_ms, at_once, feedback, rpm, step, words};
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Facts, Gm6020Current, Gm6020Voltage, Handle, M2006, M3508,
    Model,
};
use drivetrain::motor::{ArmError, CanDevice, Claim, Devices, MotorName, TargetError};
use drivetrain::time::Tick;
use embedded_can::StandardId;
use proptest::prelude::*;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f44_an_id_out_of_range_leaves_the_bus_unchanged,
    f45_a_taken_slot_names_both_motors_frame_and_slot,
    f46_every_pair_that_shares_an_id_or_a_slot_is_refused_and_no_other,
    f47_a_handle_of_a_motor_since_detached_finds_nothing,
    f48_detaching_in_operation_sends_one_zero_and_frees_the_slot,
    f49_calls_in_any_order_before_anything_is_heard_give_zeros,
    f50_an_over_subscribed_bus_says_load_ceiling_and_what_to_change,
];

fn attach<M: Model>(bus: &mut Bus, id: u8) -> Result<AnyHandle, AttachError> {
    bus.attach(Config::<M>::new(id)).map(Handle::erase)
}

type Attach = fn(&mut Bus, u8) -> Result<AnyHandle, AttachError>;

const MODELS: [(&Facts, Attach); 4] = [
    (M2006::FACTS, attach::<M2006>),
    (M3508::FACTS, attach::<M3508>),
    (Gm6020Voltage::FACTS, attach::<Gm6020Voltage>),
    (Gm6020Current::FACTS, attach::<Gm6020Current>),
];

#[cfg_attr(test, test)]
fn f44_an_id_out_of_range_leaves_the_bus_unchanged() {
    for (facts, attach) in MODELS {
        let mut bus = Bus::new();
        for id in (0..=255).filter(|id| !(1..=facts.ids).contains(id)) {
            let error = attach(&mut bus, id).unwrap_err();
            assert!(matches!(error, AttachError::Id { highest, .. } if highest == facts.ids));
            assert!(error.to_string().contains(&format!("1..={}", facts.ids)), "{error}");
        }
        saw(attach(&mut bus, 0).unwrap_err());
        assert_eq!((bus.motors().count(), bus.claims().count()), (0, 0));
    }
}

#[cfg_attr(test, test)]
fn f45_a_taken_slot_names_both_motors_frame_and_slot() {
    let mut bus = Bus::new();
    bus.attach(Config::<M3508>::new(6)).unwrap();
    let error = bus.attach(Config::<Gm6020Voltage>::new(2)).unwrap_err().to_string();
    let why = "GM6020 (voltage) #2 collides with M3508 #6 on 0x206 and on slot 1 of 0x1FF";
    assert_eq!(error, why);
    saw(error);
}

/// All pairs of all models and ids, against the rules written down another way.
#[cfg_attr(test, test)]
fn f46_every_pair_that_shares_an_id_or_a_slot_is_refused_and_no_other() {
    let mut refused = 0;
    for (one, attach_one) in MODELS {
        for (other, attach_other) in MODELS {
            for (a, b) in (1..=one.ids).flat_map(|a| (1..=other.ids).map(move |b| (a, b))) {
                let mut bus = Bus::new();
                attach_one(&mut bus, a).unwrap();
                let outcome = attach_other(&mut bus, b);
                let feedback = |facts: &Facts, id: u8| facts.feedback_base + u16::from(id);
                let same_feedback = feedback(one, a) == feedback(other, b);
                let same_slot = one.place(a) == other.place(b);
                assert_eq!(
                    outcome.is_err(),
                    same_feedback || same_slot,
                    "{} {a}, {} {b}",
                    one.name,
                    other.name
                );
                if let Err(error) = outcome {
                    refused += 1;
                    let text = error.to_string();
                    let names = [MotorName::new(one.name, a), MotorName::new(other.name, b)];
                    assert!(names.iter().all(|name| text.contains(&name.to_string())), "{text}");
                    assert_eq!((text.contains("slot"), bus.motors().count()), (same_slot, 1));
                }
            }
        }
    }
    // 4 pairs of C6x0 models with 8 ids, 4 of GM6020 with 7, and 4 ids in common for each of 8 mixed pairs.
    assert_eq!(refused, 4 * 8 + 4 * 7 + 8 * 4);

    // Two families: when arming.
    let mut both = (Bus::new(), Bus::new());
    both.0.attach(Config::<M3508>::new(1)).unwrap();
    both.1.attach(Config::<M2006>::new(1)).unwrap();
    assert!(matches!(both.arm(at_ms(1)), Err(ArmError::Clash(..))));
    let id = StandardId::new(0x201).unwrap();
    let damiao = Claim::command(id, MotorName::new("DM4310 (velocity)", 1));
    assert!(both.0.claims().any(|claim| claim.clashes_with(&damiao)));
    saw(format!(
        "{refused} pairs refused, no other; two families: {}",
        both.arm(at_ms(1)).unwrap_err()
    ));
}

/// That a handle of another brand does not compile is shown by the `compile_fail` example of `Bus::branded`.
#[cfg_attr(test, test)]
fn f47_a_handle_of_a_motor_since_detached_finds_nothing() {
    let (mut bus, [old, other]) = armed([1, 2].map(|id| Config::new(id).speed_loop(SPEED)));
    bus.detach(old);
    let new = bus.attach(at_once::<M2006>(1)).unwrap();
    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(2));
    bus.arm(at_ms(2)).unwrap();
    assert_eq!(bus.set_raw(old, 900), Err(TargetError::Detached));
    assert_eq!(bus.set_velocity(old, rpm(9.0)), Err(TargetError::Detached));
    bus.relax(old);
    bus.detach(old);
    assert_eq!((bus.state(old), bus.link(old), bus.is_motor_armed(old)), (None, None, false));
    bus.set_raw(new, 5).unwrap();
    bus.set_raw(other, 6).unwrap();
    assert_eq!(step(&mut bus, 3), Some([5, 6, 0, 0]), "never another motor's command");
    saw("Detached, None; the new motor untouched");
}

#[cfg_attr(test, test)]
fn f48_detaching_in_operation_sends_one_zero_and_frees_the_slot() {
    let (mut bus, [first, second]) = armed([1, 2].map(Config::<M3508>::new));
    bus.set_raw(first, 100).unwrap();
    bus.set_raw(second, 200).unwrap();
    assert_eq!(step(&mut bus, 2), Some([100, 200, 0, 0]));
    bus.detach(first);
    assert_eq!(step(&mut bus, 3), Some([0, 200, 0, 0]));
    bus.detach(second);
    assert_eq!(bus.next_frame().map(|frame| words(&frame)), Some([0; 4]));
    assert!((4..40).all(|ms| step(&mut bus, ms).is_none()));
    assert!(bus.attach(Config::<M2006>::new(1)).is_ok());
    safe_after(1);
    saw("one frame of zeros, then silence");
}

/// One call of the bus, by number.
fn call(bus: &mut Bus, number: u8, id: u8, ms: u64) {
    let wheel = bus.motors().map(|(motor, _)| motor).nth(usize::from(id) % 3);
    match (number, wheel) {
        (0, _) => _ = bus.attach(at_once::<M3508>(id).speed_loop(SPEED)),
        (1, _) => _ = bus.attach(at_once::<Gm6020Voltage>(id)),
        (2, Some(wheel)) => bus.detach(wheel),
        (3, Some(wheel)) => _ = bus.set_raw(wheel, i16::from(id) * 100),
        (4, Some(wheel)) => _ = bus.set_velocity(wheel, rpm(f32::from(id))),
        (5, Some(wheel)) => bus.relax(wheel),
        (6, Some(wheel)) => _ = bus.zero(wheel),
        (7, _) => bus.update(Tick::new(at_ms(ms), 0.001)),
        (8, _) => bus.disarm(),
        (9, _) => bus.emergency_stop(),
        (10, _) => bus.clear_emergency_stop(),
        (11, _) => _ = bus.arm(at_ms(ms)),
        (12, _) => _ = bus.requeue(&feedback(0x200, 0, 0)),
        _ => CanDevice::engage(bus, at_ms(ms)),
    }
}

proptest! {
    #[cfg_attr(test, test)]
    fn f49_calls_in_any_order_before_anything_is_heard_give_zeros(
        calls in prop::collection::vec((0_u8..14, 0_u8..9), 0..200),
    ) {
        _ = case::take_seen();
        saw("up to 200 calls of 14 kinds in random order: zeros only");
        let mut bus = Bus::new();
        for (ms, (number, id)) in (1..).zip(calls) {
            call(&mut bus, number, id, ms);
            prop_assert!(!bus.is_armed());
            while let Some(frame) = bus.next_frame() {
                prop_assert_eq!(words(&frame), [0; 4]);
            }
        }
    }
}

#[cfg_attr(test, test)]
fn f50_an_over_subscribed_bus_says_load_ceiling_and_what_to_change() {
    let mut bus = Bus::new().with_load_ceiling(0.8);
    bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new)).unwrap();
    assert_eq!(bus.load().to_string(), "56 % to 68 %");
    let error = bus.attach(Config::<M3508>::new(5)).unwrap_err();
    let why = "M3508 #5: the bus load of up to 95 % is above its ceiling of 80 %; \
               feedback at 785 Hz fits, or a second bus";
    assert_eq!(error.to_string(), why);
    let mut slower = bus.with_feedback_rate(785);
    slower.attach(Config::<M3508>::new(5)).unwrap();
    assert!(slower.load().worst_case() <= 0.8);
    saw(error);
}
