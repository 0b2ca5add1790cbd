//! From one way of driving a motor to another: no jump of the output where a loop has an integral to carry it.

use super::watching::{Bench, CALM, Told};
use super::*;
use crate::motor::{Condition, Measured};

const STILL: Told = Told { rpm: 0, counts_per_ms: 0, ..CALM };
/// 60 rpm: 2 pi rad/s, and 8.192 counts a millisecond.
const TURNING: Told = Told { rpm: 60, counts_per_ms: 8, ..CALM };
const RATE: f32 = core::f32::consts::TAU;
const PI: PidConfig = PidConfig::new(2.0, 5.0, 0.0);

fn yaw() -> Bench<Gm6020Voltage> {
    Bench::new(Config::at_once(1).position_loop(PidConfig::new(10.0, 5.0, 0.0), PI))
}

fn volts(
    bench: &mut Bench<Gm6020Voltage>,
    told: Told,
    ask: impl FnOnce(&mut Bus, Handle<Gm6020Voltage>),
) -> f32 {
    bench.ms += 1;
    bench.hear(told);
    ask(&mut bench.bus, bench.motor);
    step(&mut bench.bus, bench.ms);
    f32::from(sent(&mut bench.bus).last().map_or(0, |(_, words)| words[0])) * 24.0 / 25_000.0
}

/// What another sensor says: here, and as fast as the encoder.
fn measured(bench: &Bench<Gm6020Voltage>) -> Measured {
    let velocity = AngularVelocity::from_rad_per_s(RATE);
    Measured { angle: Angle::ZERO, velocity, at: at_ms(bench.ms) }
}

#[test]
fn a_speed_loop_goes_on_from_a_direct_command() {
    for raw in [5_000, -7_000] {
        let mut bench = yaw();
        bench.run(20, TURNING, raw);
        let first = volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
        assert!((first - f32::from(raw) * 24.0 / 25_000.0).abs() < 0.01, "{first} V after {raw}");
    }
}

#[test]
fn a_position_loop_goes_on_from_the_velocity_and_starts_from_rest_without_one() {
    let here = |bus: &mut Bus, yaw| {
        let here = bus.state(yaw).unwrap().position;
        bus.set_position(yaw, here).unwrap();
    };
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let first = volts(&mut bench, TURNING, here);
    assert!(first.abs() < 0.05, "{first} V: it goes on at its velocity");
    let mut bench = yaw();
    bench.run(20, TURNING, 0);
    bench.bus.relax(bench.motor);
    let first = volts(&mut bench, TURNING, here);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: it is to stop");
}

#[test]
fn an_angle_by_another_sensor_goes_on_from_a_velocity_and_starts_from_rest_without_one() {
    let hold = |bench: &mut Bench<Gm6020Voltage>| {
        let measured = Measured { at: at_ms(bench.ms + 1), ..measured(bench) };
        volts(bench, TURNING, |bus, yaw| {
            bus.set_angle_measured(yaw, Angle::ZERO, measured).unwrap();
        })
    };
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let first = hold(&mut bench);
    assert!(first.abs() < 0.05, "{first} V: it goes on at its velocity");
    let mut bench = yaw();
    bench.run(20, TURNING, 0);
    bench.bus.relax(bench.motor);
    let first = hold(&mut bench);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: it is to stop");
    // From an angle by the encoder: the position loop has what it needs, and keeps it.
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, STILL, |bus, yaw| bus.set_angle(yaw, Angle::ZERO).unwrap());
    }
    let first = hold(&mut bench);
    assert!((first + 2.0 * RATE).abs() < 0.05, "{first} V: no integral was made up");
}

/// A second against an obstacle, then the other way: an integral beyond the limit would take as long to come back.
#[test]
fn a_speed_loop_that_is_changed_is_limited_as_the_one_it_was_attached_with() {
    let loops = PidConfig::new(0.0, 100.0, 0.0);
    let limited = |bench: &mut Bench<Gm6020Voltage>, rad_per_s: f32| {
        volts(bench, STILL, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(rad_per_s)).unwrap();
        })
    };
    for change in [false, true] {
        let mut bench = Bench::new(Config::at_once(1).speed_loop(loops));
        if change {
            bench.bus.set_speed_loop(bench.motor, loops).unwrap();
        }
        for _ in 0..1_000 {
            limited(&mut bench, 10.0);
        }
        let highest = limited(&mut bench, 10.0);
        assert!((highest - 24.0).abs() < 1e-3, "{highest} V");
        for _ in 0..12 {
            limited(&mut bench, -10.0);
        }
        let after = limited(&mut bench, -10.0);
        assert!(
            (after - 12.0).abs() < 0.01,
            "1 V a tick, and the first one is the turn: {after} V"
        );
    }
}

/// At half of the way from the warning to the limit, half of the output is left for each kind of target.
#[test]
fn a_motor_that_is_warm_keeps_to_its_share_in_a_position_loop_too() {
    let strong = PidConfig::new(1_000.0, 0.0, 0.0);
    for position in [strong, PidConfig::new(1_000.0, 0.0, 0.0).with_integral_limit(1.0)] {
        let mut bench = Bench::new(Config::<M3508>::at_once(1).position_loop(position, strong));
        let warm = Told { celsius: 154, ..CALM };
        let mut word = 0;
        for ms in 0..40 {
            bench.ms += 1;
            bench.hear(warm);
            let far = Position::from_turns(if ms < 20 { 100 } else { -100 });
            bench.bus.set_position(bench.motor, far).unwrap();
            step(&mut bench.bus, bench.ms);
            word = sent(&mut bench.bus)[0].1[0];
            if ms == 19 {
                assert_eq!(word, 7_745, "26 K of 55 are left");
            }
        }
        assert_eq!(word, -7_745);
        assert!(bench.bus.conditions(bench.motor).contains(Condition::Warm));
    }
}

/// 1 rad to go, at 1 rad/s a radian and 1 A per rad/s: far below the open share of the output.
#[test]
fn a_position_loop_goes_at_the_open_share_of_its_velocity() {
    let gain = PidConfig::new(1.0, 0.0, 0.0);
    let opening = Duration::from_millis(1_000);
    let mut bench =
        Bench::new(Config::<M3508>::new(1).with_opening(opening).position_loop(gain, gain));
    for ms in 2..1_100_u16 {
        bench.ms += 1;
        bench.hear(STILL);
        let ahead = Position::from_angle(Angle::from_radians(1.0));
        bench.bus.set_position(bench.motor, ahead).unwrap();
        step(&mut bench.bus, bench.ms);
        let word = sent(&mut bench.bus).last().map_or(0, |(_, words)| words[0]);
        // The range opens further at each look.
        let share = |ms: u16| (f32::from(ms) / 1_000.0).min(1.0) * 16_384.0 / 20.0;
        let expected = share(ms.saturating_sub(15)) - 1.0..=share(ms + 1) + 1.0;
        assert!(expected.contains(&f32::from(word)), "{ms} ms: {word} of {expected:?}");
    }
}

#[test]
fn a_position_loop_does_not_go_on_from_a_velocity_before_a_rest() {
    let mut bench = yaw();
    for _ in 0..20 {
        volts(&mut bench, TURNING, |bus, yaw| {
            bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap();
        });
    }
    let here = |bus: &mut Bus, yaw| {
        let here = bus.state(yaw).unwrap().position;
        bus.set_position(yaw, here).unwrap();
    };
    volts(&mut bench, TURNING, |bus, yaw| {
        here(bus, yaw);
        let nowhere = AngularVelocity::from_rpm(f32::NAN);
        assert_eq!(bus.set_velocity(yaw, nowhere), Err(TargetError::NotFinite));
    });
    let integral =
        bench.bus.motors.get_mut(bench.motor.erase().key()).unwrap().speed_loop_mut().terms().i;
    let first = volts(&mut bench, STILL, here);
    assert!((first - integral).abs() < 0.05, "{first} V: it is where it is to be");
}

/// In each tick a program sets one target, and then the wanted target in its place. A loop once kept its first output for ever then.
#[test]
fn what_is_replaced_before_it_is_done_leaves_the_loops_as_they_are() {
    type Ask = fn(&mut Bus, Handle<Gm6020Voltage>);
    let asks: [Ask; 3] = [
        |bus, yaw| bus.set_raw(yaw, 0).unwrap(),
        |bus, yaw| bus.set_velocity(yaw, AngularVelocity::ZERO).unwrap(),
        |bus, yaw| bus.set_angle(yaw, Angle::from_degrees(90.0)).unwrap(),
    ];
    let wanted: [Ask; 3] = [
        |bus, yaw| bus.set_velocity(yaw, AngularVelocity::from_rad_per_s(RATE)).unwrap(),
        |bus, yaw| bus.set_position(yaw, Position::from_turns(3)).unwrap(),
        |bus, yaw| bus.set_raw(yaw, 1_000).unwrap(),
    ];
    for want in wanted {
        for first in asks {
            let (mut plain, mut twice) = (yaw(), yaw());
            for tick in 0..50_i16 {
                let told = Told { rpm: 2 * tick, counts_per_ms: tick.unsigned_abs() / 4, ..CALM };
                let expected = volts(&mut plain, told, want);
                let got = volts(&mut twice, told, |bus, yaw| {
                    first(bus, yaw);
                    want(bus, yaw);
                });
                assert_eq!(got.to_bits(), expected.to_bits(), "tick {tick}");
            }
        }
    }
}

/// A change of gains ends no rest: a command that was discarded is no start for a loop.
#[test]
fn gains_set_between_a_refused_target_and_a_good_one_start_from_zero() {
    for dt_s in [0.001, 0.0] {
        let mut bench = yaw();
        bench.run(20, STILL, 5_000);
        let yaw = bench.motor;
        bench.ms += 1;
        bench.hear(STILL);
        bench.bus.relax(yaw);
        bench.bus.set_speed_loop(yaw, PI).unwrap();
        bench.bus.set_velocity(yaw, AngularVelocity::ZERO).unwrap();
        bench.bus.update(Tick::new(at_ms(bench.ms), dt_s));
        assert!(sent(&mut bench.bus).iter().all(|(_, words)| *words == [0; 4]), "{dt_s}");
    }
}
