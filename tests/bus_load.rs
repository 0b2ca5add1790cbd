//! The load that is reckoned against the load that the simulated bus carries.

#![cfg(test)]

use drivetrain::dji::{AttachError, Bus, Config, Gm6020Current, Gm6020Voltage, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, BusLoad, Devices};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    Line, MotorConfig, Sender, Simulation, frame_bits, nominal_bits, worst_case_bits,
};
use drivetrain::time::Duration;
use proptest::prelude::*;

proptest! {
    /// Law: whatever the content, a frame is as long as the nominal one at least and the worst case at most.
    #[test]
    fn every_frame_lies_between_nominal_and_worst_case(id in 0_u16..0x800, data: [u8; 8]) {
        let exact = frame_bits(&CanFrame::standard(id, data).unwrap());
        prop_assert!((BusLoad::NOMINAL_BITS..=BusLoad::WORST_CASE_BITS).contains(&exact));
    }
}

#[test]
fn the_bounds_are_those_of_the_simulator() {
    assert_eq!(BusLoad::NOMINAL_BITS, nominal_bits(false, 8));
    assert_eq!(BusLoad::WORST_CASE_BITS, worst_case_bits(false, 8));
    for length in 0..=9 {
        let load = BusLoad::new(1_000_000).with_frames_of(length, 1, 1_000_000);
        let bits = [nominal_bits(false, length), worst_case_bits(false, length)];
        assert_eq!(load.to_string(), format!("{} % to {} %", bits[0] * 100, bits[1] * 100));
    }
}

/// Runs motors with raw commands for a second; returns the reckoned and the measured load.
fn measured(ids: impl Iterator<Item = u8>, raw: i16) -> (BusLoad, f32) {
    let world = Simulation::new(5);
    let mut bus = Bus::new();
    let wheels: Vec<_> = ids
        .map(|id| {
            world.attach(MotorConfig::m3508(id)).unwrap();
            bus.attach(Config::<M3508>::new(id)).unwrap()
        })
        .collect();
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut before = world.traffic(Line::Can1);
    for step in 0..10_500 {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        if step == 500 {
            before = world.traffic(Line::Can1);
        }
        if let Some(tick) = runner.due() {
            _ = runner.is_armed() || runner.arm(tick).is_ok();
            for wheel in &wheels {
                _ = runner.device_mut().set_raw(*wheel, raw);
            }
            runner.tick(tick);
        }
    }
    (runner.device().load(), world.traffic(Line::Can1).since(&before).load())
}

#[test]
fn the_measured_load_lies_between_nominal_and_worst_case() {
    for motors in 1..=5 {
        for raw in [1, -1, 500] {
            let (load, measured) = measured(1..=motors, raw);
            // The clocks of the ESCs are up to 100 ppm off.
            let (low, high) = (load.nominal() * 0.9995, load.worst_case() * 1.0005);
            assert!((low..=high).contains(&measured), "{motors} motors: {measured} not in {load}");
        }
    }
}

/// Law: the bounds that the runner counts by are those of the simulator, for any frame.
#[test]
fn frames_of_every_kind_are_counted_by_their_length() {
    use embedded_can::{ExtendedId, Frame, Id, StandardId};
    let (short, long) = (StandardId::new(0x7A).unwrap(), ExtendedId::new(0x1ABC_DEF0).unwrap());
    for (id, is_long) in [(Id::from(short), false), (Id::from(long), true)] {
        for length in 0..=8 {
            let frame = CanFrame::new(id, &[0; 8][..usize::from(length)]).unwrap();
            let bounds = (nominal_bits(is_long, length), worst_case_bits(is_long, length));
            assert_eq!(BusLoad::frame_bits(&frame), bounds);
        }
        let remote = CanFrame::new_remote(id, 8).unwrap();
        let bounds = (nominal_bits(is_long, 0), worst_case_bits(is_long, 0));
        assert_eq!(BusLoad::frame_bits(&remote), bounds);
    }
}

/// The runner's load beside what the simulated bus carried, from 2 s to 5 s; and the frames a second.
fn runner_and_truth(world: &Simulation, motors: u8) -> (BusLoad, f32, f32) {
    use embedded_can::{ExtendedId, Frame};
    let mut bus = Bus::new();
    for id in 1..=motors {
        world.attach(MotorConfig::m3508(id)).unwrap();
        bus.attach(Config::<M3508>::new(id)).unwrap();
    }
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let other = CanFrame::new(ExtendedId::new(0x1234_5678).unwrap(), &[1, 2, 3]).unwrap();
    let mut before = world.traffic(Line::Can1);
    for step in 0..50_500 {
        world.advance(Duration::from_micros(100));
        if step % 50 == 0 {
            world.inject(Line::Can1, other).unwrap();
        }
        if step == 20_000 {
            before = world.traffic(Line::Can1);
        }
        runner.poll(16);
        if let Some(tick) = runner.due() {
            runner.tick(tick);
        }
        assert!(runner.measured_load().is_none() || step >= 9_999, "not before a second is over");
    }
    let truth = world.traffic(Line::Can1).since(&before);
    (runner.measured_load().unwrap(), truth.load(), truth.frames as f32 / 3.05)
}

#[test]
fn the_load_that_the_runner_counts_is_that_of_the_bus() {
    for motors in [1, 3, 5] {
        let (load, truth, frames) = runner_and_truth(&Simulation::new(9), motors);
        let (low, high) = (load.nominal() * 0.995, load.worst_case() * 1.005);
        assert!((low..=high).contains(&truth), "{motors} motors: {truth} not in {load}");
        assert!((load.frames_per_s() as f32 / frames - 1.0).abs() < 0.005, "{load:?}, {frames}");
        assert!(load.worst_case() - load.nominal() < 0.16, "the bounds say something");
    }
    // What the filter drops is not seen: the foreign frames, 200 a second of 91 bits.
    let (all, ..) = runner_and_truth(&Simulation::new(9), 2);
    let (seen, truth, _) =
        runner_and_truth(&Simulation::new(9).with_filter(Line::Can1, 0x200, 0x7F0), 2);
    assert!((all.nominal() - seen.nominal() - 200.0 * 91e-6).abs() < 1e-3, "{all:?} {seen:?}");
    assert!(truth > seen.nominal());
}

#[test]
fn more_than_the_bus_carries_fills_it() {
    let (load, measured) = measured(1..=8, 500);
    assert!(load.nominal() > 1.0 && measured > 0.99, "{load}: {measured}");
}

#[test]
fn commands_0x2ff_and_0x2fe_starve_on_a_full_bus_and_0x200_does_not() {
    let world = Simulation::new(5);
    let mut bus = Bus::new();
    for id in 1..=8 {
        world.attach(MotorConfig::m3508(id)).unwrap();
        bus.attach(Config::<M3508>::new(id)).unwrap();
    }
    world.attach(MotorConfig::gm6020_voltage(5)).unwrap();
    world.attach(MotorConfig::gm6020_current(6)).unwrap();
    bus.attach(Config::<Gm6020Voltage>::new(5)).unwrap();
    bus.attach(Config::<Gm6020Current>::new(6)).unwrap();
    let bus = bus.with_keep_alive(Duration::from_millis(1)); // as if all moved
    assert_eq!(bus.load().to_string(), "156 % to 189 %");
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut sent = [0_u32; 0x800];
    for _ in 0..10_000 {
        world.advance_with(Duration::from_micros(100), |record| {
            if record.sender == Sender::Controller {
                sent[usize::try_from(record.frame.header()).unwrap()] += 1;
            }
        });
        runner.poll(16);
        if let Some(tick) = runner.due() {
            runner.tick(tick);
        }
    }
    assert!(sent[0x200] > 900 && sent[0x1FF] > 900, "{} {}", sent[0x200], sent[0x1FF]);
    assert!(sent[0x2FF] < 100 && sent[0x2FE] < 100, "{} {}", sent[0x2FF], sent[0x2FE]);
}

/// Arms motors after 2.2 s, `absent` of which are not on the bus; returns the refusal.
fn refusal(motors: u8, absent: u8) -> ArmError {
    let world = Simulation::new(5);
    let mut bus = Bus::new();
    for id in 1..=motors {
        bus.attach(Config::<M3508>::new(id)).unwrap();
        if id + absent <= motors {
            world.attach(MotorConfig::m3508(id)).unwrap();
        }
    }
    // As if all moved.
    let bus = bus.with_keep_alive(Duration::from_millis(1));
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut last = None;
    for _ in 0..22_000 {
        world.advance(Duration::from_micros(100));
        runner.poll(16);
        if let Some(tick) = runner.due() {
            last = Some(tick);
            runner.tick(tick);
        }
    }
    runner.arm(last.unwrap()).unwrap_err()
}

#[test]
fn a_motor_that_a_full_bus_starves_is_missing_with_the_load_of_the_bus() {
    let starved = refusal(8, 0);
    let ArmError::Missing(missing) = starved else { panic!("{starved}") };
    let load = missing.full_bus().unwrap();
    assert!((100..130).contains(&load), "{load} %");
    let text = starved.to_string();
    let remedy = format!(
        "#8; the bus may be full (load up to {load} %): lower the feedback rate or use a second bus"
    );
    assert!(text.starts_with("no feedback from M3508 #") && text.ends_with(&remedy), "{text}");
    // Unplugged from a bus with room.
    assert_eq!(refusal(5, 1).to_string(), "no feedback from M3508 #5");
}

#[test]
fn a_refused_motor_leaves_the_bus_as_it_was_and_fits_at_a_lower_rate() {
    let mut bus = Bus::new().with_load_ceiling(0.9);
    bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new)).unwrap();
    let before = bus.load();
    let Err(AttachError::Load { load, feedback_hz, .. }) = bus.attach(Config::<M3508>::new(5))
    else {
        panic!("not refused");
    };
    assert_eq!((bus.load(), bus.motors().count(), bus.claims().count()), (before, 4, 5));
    assert_eq!(load.frames_per_s(), 7_000);
    let mut bus = bus.with_feedback_rate(feedback_hz);
    bus.attach(Config::<M3508>::new(5)).unwrap();
    assert!(bus.load().worst_case() <= 0.9);
    // A ceiling is kept when a motor leaves and another one comes.
    let first = bus.motors().next().unwrap().0;
    bus.detach(first);
    bus.attach(Config::<M3508>::new(1)).unwrap();
    assert!(bus.attach(Config::<M3508>::new(6)).is_err());
}

#[test]
fn a_ceiling_holds_at_compile_time_too() {
    const REFUSED: bool = {
        let mut bus = Bus::new().with_load_ceiling(0.2);
        bus.attach(Config::<M3508>::new(1)).is_err()
    };
    const { assert!(REFUSED) };
}
