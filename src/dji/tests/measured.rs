//! Targets by another sensor: both loops on it, its own age, and nothing of the encoder.

use super::*;
use crate::motor::Measured;

const ANGLE: PidConfig = PidConfig::new(10.0, 0.0, 0.0); // rad/s per rad
const RATE: PidConfig = PidConfig::new(2.0, 0.0, 0.0); // V per rad/s
const RAW_PER_V: f32 = 25_000.0 / 24.0;

fn yaw_config() -> Config<Gm6020Voltage> {
    Config::at_once(1).position_loop(ANGLE, RATE)
}

fn radians(radians: f32) -> Angle {
    Angle::from_radians(radians)
}

fn imu(angle: f32, rad_per_s: f32, at: Instant) -> Measured {
    let velocity = AngularVelocity::from_rad_per_s(rad_per_s);
    Measured { angle: radians(angle), velocity, at }
}

/// Hears the encoder at these counts and rpm, and returns the command of an update.
fn run(bus: &mut Bus, ms: u64, counts: u16, rpm: i16) -> i16 {
    assert_eq!(bus.ingest(&feedback(0x205, counts, rpm), at_ms(ms)), Ingest::Taken);
    step(bus, ms);
    sent(bus).last().map_or(0, |frame| frame.1[0])
}

#[test]
fn both_loops_run_on_the_measurement_and_the_encoder_says_nothing() {
    let (mut bus, [yaw]) = armed([yaw_config()]);
    for (ms, counts, rpm) in [(2, 0, 0), (3, 40, 60), (4, 8_000, -100)] {
        let measured = imu(1.0, -0.4, at_ms(ms));
        bus.set_angle_measured(yaw, radians(1.2), measured).unwrap();
        let volts = 2.0 * (10.0 * 0.2 + 0.4);
        let expected = volts * RAW_PER_V;
        let raw = f32::from(run(&mut bus, ms, counts, rpm));
        assert!((raw - expected).abs() <= 1.0, "{raw}, not {expected}");
    }
}

#[test]
fn the_way_is_the_shortest_and_over_many_turns_where_turns_are_measured() {
    let (mut bus, [yaw]) = armed([yaw_config()]);
    let degrees = Angle::from_degrees;
    for (ms, from, to, sign) in [(2, 350.0, 10.0, 1), (3, 10.0, 350.0, -1), (4, 359.0, -350.0, 1)] {
        let measured = Measured { angle: degrees(from), ..imu(0.0, 0.0, at_ms(ms)) };
        bus.set_angle_measured(yaw, degrees(to), measured).unwrap();
        assert_eq!(i32::from(run(&mut bus, ms, 0, 0)).signum(), sign, "{from}° to {to}°");
    }
    let at = at_ms(5);
    let measured =
        Measured { angle: Position::new(7, degrees(10.0)), velocity: AngularVelocity::ZERO, at };
    bus.set_position_measured(yaw, Position::new(6, degrees(300.0)), measured).unwrap();
    let expected = -2.0 * 10.0 * 70.0_f32.to_radians() * RAW_PER_V;
    let raw = f32::from(run(&mut bus, 5, 0, 0));
    assert!((raw - expected.max(-25_000.0)).abs() < 2.0, "{raw}, not {expected}");
}

#[test]
fn a_reversed_motor_turns_its_positive_way() {
    let (mut bus, [yaw]) = armed([yaw_config().reversed()]);
    bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(2))).unwrap();
    assert!(run(&mut bus, 2, 0, 0) < -1_000);
}

#[test]
fn a_measurement_that_is_too_old_is_refused_and_takes_the_target_away() {
    let day = 86_400_000;
    let wrap_ms = (1_u64 << 32) / 1_000; // where a stamp of 32 bits looks fresh again
    for (now, at, taken) in [
        (1_000, 1_000, true),
        (1_000, 980, true),
        (1_000, 979, false),
        (1_000, 1_020, true), // stamped after the last update
        (1_000, 1_022, false),
        (1_000, 1_000 + wrap_ms, false),
        (day, day - wrap_ms - 1, false),
        (day, 0, false),
    ] {
        let (mut bus, [yaw]) = armed([yaw_config()]);
        step(&mut bus, now - 120); // offline by now
        for ms in (0..119).rev() {
            _ = run(&mut bus, now - ms, 0, 0);
        }
        bus.arm(at_ms(now)).unwrap();
        bus.set_raw(yaw, 500).unwrap();
        let outcome = bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(at)));
        assert_eq!(outcome.is_ok(), taken, "now {now}, at {at}: {outcome:?}");
        let raw = run(&mut bus, now + 1, 0, 0);
        if taken {
            assert_eq!(raw > 1_000, now + 1 - at.min(now) <= 20, "now {now}, at {at}: {raw}");
        } else {
            assert_eq!((outcome, raw), (Err(TargetError::StaleMeasurement), 0));
            assert_eq!(bus.state(yaw).unwrap().forgotten_targets, 1);
        }
    }
}

#[test]
fn without_new_ones_the_output_is_zero_within_a_tick_of_the_limit() {
    for (limit_ms, lead_us) in [(20, 0), (20, 700), (5, 300), (90, 0), (500, 0)] {
        let timeouts = Timeouts::new().with_measured(Duration::from_millis(limit_ms)).unwrap();
        let (bus, [yaw]) = armed([yaw_config()]);
        let mut bus = bus.with_timeouts(timeouts);
        for ms in 2..10 {
            run(&mut bus, ms, 0, 0);
        }
        let at = Instant::from_micros(10_000 - lead_us);
        bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at)).unwrap();
        // The target itself counts for 100 ms, from the update before it.
        let until_us = (at.as_micros() + 1_000 * limit_ms).min(9_000 + 100_000);
        for ms in 10..200 {
            let raw = run(&mut bus, ms, 0, 0);
            assert_eq!(raw != 0, 1_000 * ms <= until_us, "{limit_ms} ms, now {ms}");
        }
        assert_eq!(bus.state(yaw).unwrap().forgotten_targets, 1);
    }
}

#[test]
fn one_that_is_set_again_and_again_does_not_live_longer() {
    let (mut bus, [yaw]) = armed([yaw_config()]);
    run(&mut bus, 2, 0, 0);
    for ms in 3..60 {
        let outcome = bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(3)));
        assert_eq!(outcome.is_ok(), ms - 1 <= 23, "{ms}"); // the update before was at ms - 1
        assert_eq!(run(&mut bus, ms, 0, 0) != 0, ms <= 23, "{ms}");
    }
}

#[test]
fn what_is_not_finite_or_has_no_loop_is_refused() {
    let (mut bus, [yaw]) = armed([yaw_config()]);
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let good = imu(0.0, 0.0, at_ms(2));
        for (target, measured) in [
            (radians(0.1), imu(wrong, 0.0, at_ms(2))),
            (radians(0.1), imu(0.0, wrong, at_ms(2))),
            (radians(wrong), good),
        ] {
            bus.set_angle_measured(yaw, radians(0.1), good).unwrap();
            assert!(run(&mut bus, 2, 0, 0) > 1_000);
            let outcome = bus.set_angle_measured(yaw, target, measured);
            assert_eq!(outcome, Err(TargetError::NotFinite));
            let mut zero = bus;
            assert_eq!(run(&mut zero, 3, 0, 0), 0);
            (bus, _) = armed([yaw_config()]);
        }
    }
    let (mut bus, [bare]) = armed([Config::<Gm6020Voltage>::at_once(1)]);
    let outcome = bus.set_angle_measured(bare, radians(0.1), imu(0.0, 0.0, at_ms(1)));
    assert_eq!(outcome, Err(TargetError::NoLoop));
}

#[test]
fn lost_feedback_of_the_motor_counts_whatever_the_sensor_says() {
    let (mut bus, [yaw]) = armed([yaw_config()]);
    run(&mut bus, 2, 0, 0);
    for ms in 3..40 {
        _ = bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(ms)));
        step(&mut bus, ms);
        let raw = sent(&mut bus).last().map_or(0, |frame| frame.1[0]);
        assert_eq!(raw != 0, ms <= 12, "{ms}");
    }
}

#[test]
fn from_one_sensor_to_the_other_there_is_no_kick() {
    let rate = PidConfig::new(2.0, 0.0, 0.01);
    let config = || Config::<Gm6020Voltage>::at_once(1).position_loop(ANGLE, rate);
    let (mut bus, [yaw]) = armed([config()]);
    let encoder = |bus: &mut Bus, ms| {
        bus.set_angle(yaw, radians(0.0)).unwrap();
        run(bus, ms, 0, 0)
    };
    let other = |bus: &mut Bus, ms| {
        // The base turns at 5 rad/s: so does the gimbal, in the world.
        bus.set_angle_measured(yaw, radians(1.5), imu(1.0, 5.0, at_ms(ms))).unwrap();
        run(bus, ms, 0, 0)
    };
    for ms in 2..6 {
        assert_eq!(encoder(&mut bus, ms), 0);
    }
    for ms in 6..10 {
        assert_eq!(other(&mut bus, ms), 0, "10 * 0.5 - 5, and no derivative of the step");
    }
    for ms in 10..14 {
        assert_eq!(encoder(&mut bus, ms), 0);
    }
}

#[test]
fn what_is_offered_is_what_is_taken() {
    use crate::motor::Capability;
    let cases = |bus: &mut Bus, motor: AnyHandle| {
        let offered = bus.capabilities(motor);
        for (capability, outcome) in [
            (Capability::Raw, bus.set_raw(motor, 1)),
            (Capability::Velocity, bus.set_velocity(motor, AngularVelocity::ZERO)),
            (Capability::Position, bus.set_position(motor, Position::ZERO)),
        ] {
            let refused = if offered.has(capability) { Ok(()) } else { Err(TargetError::NoLoop) };
            assert_eq!(outcome, refused, "{capability} of {offered}");
        }
        let angle = bus.set_angle(motor, Angle::ZERO);
        let known = offered.has(Capability::AbsoluteAngle);
        match (offered.has(Capability::Angle), known) {
            (false, _) => assert_eq!(angle, Err(TargetError::NoLoop)),
            (true, false) => assert_eq!(angle, Err(TargetError::NotHomed)),
            (true, true) => assert_eq!(angle, Ok(())),
        }
        offered.to_string()
    };
    fn each<M: Model>(
        cases: impl Fn(&mut Bus, AnyHandle) -> std::string::String,
    ) -> Vec<std::string::String> {
        let bare = Config::<M>::at_once(1);
        [bare, bare.speed_loop(RATE), bare.position_loop(ANGLE, RATE)]
            .map(|config| {
                let (mut bus, [motor]) = armed([config]);
                let text = cases(&mut bus, motor.erase());
                bus.detach(motor);
                assert_eq!(bus.capabilities(motor).to_string(), "nothing");
                text
            })
            .into()
    }
    assert_eq!(
        each::<M3508>(cases),
        [
            "raw, current, feedback, temperature, error codes",
            "raw, current, velocity, feedback, temperature, error codes",
            "raw, current, velocity, angle, position, feedback, temperature, error codes",
        ]
    );
    assert_eq!(each::<M2006>(cases)[0], "raw, current, feedback, error codes");
    assert_eq!(
        each::<Gm6020Current>(cases)[0],
        "raw, current, feedback, temperature, absolute angle"
    );
    assert_eq!(
        each::<Gm6020Voltage>(cases)[2],
        "raw, voltage, velocity, angle, position, feedback, temperature, absolute angle"
    );
}

#[test]
fn a_sensor_that_dies_or_tells_old_news_is_an_edge_with_its_time() {
    let lost = |bus: &mut Bus, from, until| {
        let edge = bus.next_edge().unwrap();
        assert_eq!((edge.condition, edge.began), (crate::motor::Condition::CommandLost, true));
        assert!((from..=until).contains(&edge.at.as_micros()), "{edge}");
        assert_eq!(bus.next_edge(), None);
    };
    let (mut bus, [yaw]) = armed([yaw_config()]);
    for ms in 2..1_100 {
        // 20 ms old is too old: found by an update.
        let at = at_ms(ms.min(1_000));
        let _stale = bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at));
        run(&mut bus, ms, 0, 0);
    }
    lost(&mut bus, 1_019_000, 1_022_000);
    for ms in 1_100..1_140 {
        bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(ms))).unwrap();
        run(&mut bus, ms, 0, 0);
    }
    assert!(bus.next_edge().is_some_and(|edge| !edge.began), "it has a target again");
    // Found when it is set.
    let old = bus.set_angle_measured(yaw, radians(0.1), imu(0.0, 0.0, at_ms(1_100)));
    assert_eq!(old, Err(TargetError::StaleMeasurement));
    lost(&mut bus, 1_137_000, 1_140_000);
}
