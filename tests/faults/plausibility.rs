//! F13 to F23: what feedback can mean.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, armed, at_ms, feedback, ticks_since};
use drivetrain::dji::{Bus, Config, ErrorCode, Gm6020Voltage, M2006, M3508};
use drivetrain::encoder::Homing;
use drivetrain::motor::{Ingest, Link};
use drivetrain::sim::{Fault, Line, Simulation};

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f13_the_first_frame_sets_the_angle_without_a_turn,
    f14_a_gap_is_resolved_with_the_speed_or_flagged_but_never_silent,
    f15_a_power_cycle_in_motion_relaxes_and_makes_the_position_uncertain,
    f16_300_000_turns_one_way_lose_no_count,
    f19_error_codes_of_each_esc_are_read_and_unlisted_ones_kept,
    f20_a_c610_has_no_temperature,
];

#[cfg_attr(test, test)]
fn f13_the_first_frame_sets_the_angle_without_a_turn() {
    for angle in [0, 1, 4_097, 5_000, 8_000, 8_191] {
        let mut bus = Bus::new();
        let yaw = bus.attach(Config::<Gm6020Voltage>::new(1)).unwrap();
        assert_eq!(bus.ingest(&feedback(0x205, angle, -60), at_ms(1)), Ingest::Taken);
        let state = bus.state(yaw).unwrap();
        assert_eq!((state.position.turns(), state.rotor_counts), (0, i64::from(angle)));
        let degrees = f32::from(angle) * 360.0 / 8_192.0;
        assert!((state.position.angle().as_degrees() - degrees).abs() < 1e-3);
        assert!((state.velocity.as_rpm() + 60.0).abs() < 1e-3);
        assert_eq!(state.homing, Homing::Absolute);
        if angle == 8_191 {
            saw(format!("{:.2} degrees, 0 turns", state.position.angle().as_degrees()));
        }
    }
}

#[cfg_attr(test, test)]
fn f14_a_gap_is_resolved_with_the_speed_or_flagged_but_never_silent() {
    for seed in 1..=5 {
        let world = Simulation::new(seed);
        let mut rig = Rig::new(&world, Line::Can1, 1);
        let lossy = Fault::LostFrames { line: Line::Can1, id: None, probability: 0.4 };
        world.fault(lossy, at_ms(100)..at_ms(2_900)).unwrap();
        let wheel = rig.wheels[0];
        rig.run(3_000, |bus, ms| {
            let target = if ms / 700 % 2 == 0 { 460.0 } else { -460.0 };
            _ = bus.set_velocity(wheel, crate::rig::rpm(target));
        });
        let state = rig.runner.device().state(wheel).unwrap();
        let truth = world.motor(rig.keys[0]).unwrap().encoder_counts;
        let off = (state.rotor_counts - truth).abs();
        assert!(off < 1_500 || state.ambiguous_gaps > 0, "seed {seed}: {off} counts, no flag");
    }
    // Half a second at full speed is beyond any estimate.
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    bus.zero(wheel).unwrap();
    _ = bus.ingest(&feedback(0x201, 0, 9_000), at_ms(2));
    _ = bus.ingest(&feedback(0x201, 4_000, 9_000), at_ms(90));
    let state = bus.state(wheel).unwrap();
    assert_eq!((state.ambiguous_gaps, state.homing), (1, Homing::Uncertain));
    saw("40 % lost at both full speeds: exact or flagged; 88 ms: flagged");
}

#[cfg_attr(test, test)]
fn f15_a_power_cycle_in_motion_relaxes_and_makes_the_position_uncertain() {
    for forgets_angle in [false, true] {
        let world = Simulation::new(3);
        let mut rig = Rig::new(&world, Line::Can1, 2);
        rig.drive(100);
        let wheel = rig.wheels[0];
        rig.runner.device_mut().zero(wheel).unwrap();
        let loss = Fault::PowerLoss { motor: rig.keys[0], forgets_angle };
        world.fault(loss, at_ms(500)..at_ms(900)).unwrap();
        rig.drive(450);
        let before = rig.runner.device().state(wheel).unwrap();
        rig.drive(300);
        assert_eq!(rig.link(0), Link::Offline);
        rig.drive(53);
        assert_eq!(rig.link(0), Link::Recovering);
        let back = rig.runner.device().state(wheel).unwrap();
        // Half a rotor turn for the phase, and three frames of up to 525 counts.
        let made_up = (back.rotor_counts - before.rotor_counts).abs();
        assert!(made_up < 4_096 + 3 * 525, "{made_up} counts of turns that nobody saw");
        rig.drive(297);
        let after = rig.runner.device().state(wheel).unwrap();
        assert_eq!((after.link, after.homing), (Link::Online, Homing::Uncertain));
        assert!(!rig.runner.device().is_motor_armed(wheel));
        assert!(rig.words(0, 520, 1_200).iter().all(|word| *word == 0), "relaxed until re-armed");
        let truth = world.motor(rig.keys[0]).unwrap().velocity;
        assert!((after.velocity - truth).as_rpm().abs() < 2.0, "no jump in velocity");
        assert!(rig.words(1, 520, 1_200).iter().all(|word| *word > 0), "the other goes on");
        safe_after(ticks_since(500, rig.first_zero(0, 500)));
        saw(format!("{made_up} counts made up, {:?}, relaxed", after.homing));
    }
}

#[cfg_attr(test, test)]
fn f16_300_000_turns_one_way_lose_no_count() {
    for direction in [1_i64, -1] {
        let (mut bus, [wheel]) = armed([Config::new(1)]);
        let step = direction * 4_000; // 29 300 rpm, more than any rotor
        let mut counts = 0_i64;
        for sample in 1..=614_400_u64 {
            counts += step;
            let angle = u16::try_from(counts.rem_euclid(8_192)).unwrap();
            _ = bus.ingest(&feedback(0x201, angle, 0), at_ms(1 + sample));
        }
        let state = bus.state(wheel).unwrap();
        assert_eq!((state.rotor_counts, counts / 8_192), (counts, direction * 300_000));
        assert!(counts.abs() > i64::from(i32::MAX));
        let turns = counts * 187 / 3_591 / 8_192;
        assert!((state.position.turns() - turns).abs() <= 1);
        saw(format!("{} counts, exact", state.rotor_counts));
    }
}

#[cfg_attr(test, test)]
fn f19_error_codes_of_each_esc_are_read_and_unlisted_ones_kept() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    let feeder = bus.attach(Config::<M2006>::new(2)).unwrap();
    let mut read = |id: u16, code: u8| {
        let mut data = *feedback(id, 0, 0).bytes();
        data[7] = code;
        let frame = drivetrain::frame::CanFrame::standard(id, data).unwrap();
        assert_eq!(bus.ingest(&frame, at_ms(1)), Ingest::Taken);
        if id == 0x201 { bus.state(wheel).unwrap().error } else { bus.state(feeder).unwrap().error }
    };
    for id in [0x201, 0x202] {
        assert_eq!(read(id, 0), None);
        assert_eq!(read(id, 3), Some(ErrorCode::PhaseLoss));
        assert_eq!(read(id, 200), Some(ErrorCode::Unlisted(200)));
        assert_eq!(read(id, 0), None, "clears with the condition");
    }
    assert_eq!(read(0x201, 6), Some(ErrorCode::Unlisted(6)), "not assigned on C620");
    assert_ne!(read(0x202, 6), Some(ErrorCode::Unlisted(6)), "a stall on C610");
    saw(format!("6 is {:?} on a C610, unlisted on a C620", read(0x202, 6)));
}

#[cfg_attr(test, test)]
fn f20_a_c610_has_no_temperature() {
    let mut bus = Bus::new();
    let feeder = bus.attach(Config::<M2006>::new(1)).unwrap();
    let wheel = bus.attach(Config::<M3508>::new(2)).unwrap();
    for id in [0x201, 0x202] {
        _ = bus.ingest(&feedback(id, 0, 0), at_ms(1));
    }
    assert_eq!(bus.state(feeder).unwrap().temperature_c, None);
    assert_eq!(bus.state(wheel).unwrap().temperature_c, Some(25));
    saw("None beside Some(25)");
}
