//! The power limit on a bus: between the update of the loops and the frames, and never upwards.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::PowerModel;
use drivetrain::control::PidConfig;
use drivetrain::dji::{self, Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Ingest;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Line, MotorConfig, Simulation};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{AngularVelocity, Current};
use proptest::prelude::*;

const SPEED: PidConfig = PidConfig::new(2.0, 40.0, 0.0);

/// A motor whose output range opens at once: what is cut is what the loops ask for, from the first update on.
fn at_once<M: dji::Model>(id: u8) -> Config<M> {
    Config::new(id).with_opening(Duration::ZERO)
}

fn feedback(bus: &mut Bus, id: u16, rotor_rpm: i16, now: Instant) {
    let [high, low] = rotor_rpm.to_be_bytes();
    let frame = CanFrame::standard(id, [0, 0, high, low, 0, 0, 30, 0]).unwrap();
    assert_eq!(bus.ingest(&frame, now), Ingest::Taken);
}

fn amperes(bus: &Bus, motor: Handle<M3508>) -> f32 {
    bus.commanded_current(motor).unwrap().as_amperes()
}

/// The words of frame 0x200 as they go out.
fn words(bus: &mut Bus) -> [i16; 4] {
    let frames: Vec<CanFrame> = core::iter::from_fn(|| bus.next_frame()).collect();
    let frame = frames.into_iter().find(|frame| frame.header() == 0x200).unwrap();
    let bytes = frame.bytes();
    [0, 2, 4, 6].map(|at| i16::from_be_bytes([bytes[at], bytes[at + 1]]))
}

proptest! {
    #[test]
    fn no_factor_raises_an_output_defeats_a_limit_or_touches_another_motor(
        targets in proptest::array::uniform4(-60.0_f32..60.0),
        rpm in proptest::array::uniform4(-9_000_i16..9_000),
        limit in 0.5_f32..20.0,
        factor in prop_oneof![Just(f32::NAN), Just(f32::INFINITY), -2.0_f32..3.0],
    ) {
        let mut bus = Bus::new();
        let config = |id| at_once::<M3508>(id)
            .speed_loop(SPEED)
            .with_current_limit(Current::from_amperes(limit));
        let motors = bus.attach_all([1, 2, 3, 4].map(config)).unwrap();
        let now = Instant::from_micros(1_000);
        for (id, rpm) in (0x201..).zip(rpm) {
            feedback(&mut bus, id, rpm, now);
        }
        bus.arm(now).unwrap();
        for (motor, target) in motors.into_iter().zip(targets) {
            bus.set_velocity(motor, AngularVelocity::from_rad_per_s(target)).unwrap();
        }
        bus.update(Tick::new(now, 0.001));
        let before = motors.map(|motor| amperes(&bus, motor));
        bus.scale_outputs(motors.into_iter().take(3), factor);
        let after = motors.map(|motor| amperes(&bus, motor));
        for (before, after) in before.into_iter().zip(after) {
            prop_assert!(after.abs() <= before.abs() && after.abs() <= limit + 1e-3);
            prop_assert!(after * before >= 0.0);
        }
        prop_assert_eq!(before[3].to_bits(), after[3].to_bits());
        for (word, after) in words(&mut bus).into_iter().zip(after) {
            prop_assert!((f32::from(word) * 20.0 / 16_384.0 - after).abs() < 1e-3);
        }
    }

    #[test]
    fn the_modelled_power_on_the_wire_is_within_the_limit_whenever_that_is_possible(
        wanted in proptest::array::uniform4(-20.0_f32..20.0),
        rpm in proptest::array::uniform4(-9_000_i16..9_000),
        limit_w in -50.0_f32..400.0,
    ) {
        let mut bus = Bus::new();
        let motors = bus.attach_all([1, 2, 3, 4].map(at_once::<M3508>)).unwrap();
        let now = Instant::from_micros(1_000);
        for (id, rpm) in (0x201..).zip(rpm) {
            feedback(&mut bus, id, rpm, now);
        }
        bus.arm(now).unwrap();
        for (motor, wanted) in motors.into_iter().zip(wanted) {
            bus.set_current(motor, Current::from_amperes(wanted)).unwrap();
        }
        bus.update(Tick::new(now, 0.001));
        let model = PowerModel::new(1.0, 0.475, 0.065, 0.001).unwrap();
        let loads = |bus: &Bus| motors.map(|motor| (amperes(bus, motor), bus.state(motor).unwrap().velocity));
        let before = loads(&bus);
        let (scale, power_w) = model.cut(before, limit_w);
        bus.scale_outputs(motors, scale);
        let after = loads(&bus);
        let total: f32 = after.into_iter().map(|load| model.power_w(load)).sum();
        // A count of current is 1.2 mA: at most 0.03 W on a wheel that brakes at full speed.
        let bound = power_w.max(limit_w.max(0.0));
        prop_assert!(total <= bound + 0.15, "{total} W, {scale} {power_w}");
    }
}

#[test]
fn a_stop_stays_a_stop_whatever_the_factor() {
    let mut bus = Bus::new();
    let motor = bus.attach(at_once::<M3508>(1)).unwrap();
    let now = Instant::from_micros(1_000);
    feedback(&mut bus, 0x201, 100, now);
    bus.arm(now).unwrap();
    bus.set_current(motor, Current::from_amperes(5.0)).unwrap();
    bus.emergency_stop();
    bus.update(Tick::new(now, 0.001));
    for factor in [0.5, 1.0, f32::INFINITY] {
        bus.scale_outputs([motor], factor);
    }
    assert_eq!(words(&mut bus), [0; 4]);
    bus.detach(motor);
    bus.scale_outputs([motor], 0.5); // of a motor that is gone: nothing
    assert_eq!(bus.commanded_current(motor), None);
}

#[test]
fn a_speed_loop_that_is_cut_does_not_wind_up() {
    // A shaft that cannot turn, a second long, with a tenth of the output let through; then the target is zero.
    let released = |factor: f32| {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M3508>(1).speed_loop(SPEED)).unwrap();
        for ms in 1..=1_001 {
            let now = Instant::from_micros(1_000 * ms);
            feedback(&mut bus, 0x201, 0, now);
            if ms == 1 {
                bus.arm(now).unwrap();
            }
            let target = if ms <= 1_000 { 2.0 } else { 0.0 };
            bus.set_velocity(motor, AngularVelocity::from_rad_per_s(target)).unwrap();
            bus.update(Tick::new(now, 0.001));
            bus.scale_outputs([motor], factor);
        }
        amperes(&bus, motor)
    };
    assert!((released(1.0) - 20.0).abs() < 4.1, "{}", released(1.0)); // wound up to the motor's limit
    assert!(released(0.1) < 0.1, "{}", released(0.1));
}

#[test]
fn the_runner_shows_what_the_loops_ask_for_before_it_sends() {
    let world = Simulation::new(1);
    world.attach(MotorConfig::m3508(1)).unwrap();
    let steering = world.attach(MotorConfig::gm6020_voltage(1).with_line(Line::Can2)).unwrap();
    let (mut one, mut other) = (Bus::new(), Bus::new());
    let wheel = one.attach(at_once::<M3508>(1)).unwrap();
    let module = other.attach(at_once::<Gm6020Voltage>(1)).unwrap();
    let mut one = Runner::new(Nb(world.controller()), world.clock(), one);
    let mut other = Runner::new(Nb(world.controller_on(Line::Can2)), world.clock(), other);
    let mut seen = 0;
    for _ in 0..100 {
        world.advance(Duration::from_millis(1));
        one.poll(16);
        other.poll(16);
        let (Some(tick), Some(other_tick)) = (one.due(), other.due()) else { continue };
        let _missing = one.is_armed() || one.arm(tick).is_ok();
        let _missing = other.is_armed() || other.arm(other_tick).is_ok();
        let _disarmed = one.device_mut().set_current(wheel, Current::from_amperes(4.0));
        let _disarmed = other.device_mut().set_raw(module, 1_000);
        // One limit over two buses: both have updated, neither has sent.
        one.tick_limited(tick, |bus| {
            seen += u32::from((amperes(bus, wheel) - 4.0).abs() < 1e-2);
            other.tick_limited(other_tick, |other| {
                bus.scale_outputs([wheel], 0.5);
                other.scale_outputs([module], 0.25);
            });
        });
    }
    world.advance(Duration::from_millis(1));
    assert!(seen > 90);
    assert_eq!(world.motor(steering).unwrap().command, 250);
    let wheel = world.traffic(Line::Can1);
    assert!(wheel.sent > 90, "{wheel:?}");
}
