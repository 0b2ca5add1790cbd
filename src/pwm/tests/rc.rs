//! The RC ESC and servo.

use super::*;
use crate::error::ConfigError;

const PERIOD: Duration = Duration::from_millis(20);

fn armed(esc: RcPwm<Pin<'_>>) -> RcPwm<Pin<'_>> {
    let mut esc = esc.with_arming_time(Duration::from_millis(5));
    esc.arm().unwrap();
    for ms in 0..=5 {
        esc.update(tick(ms)).unwrap();
    }
    assert!(esc.is_armed());
    esc
}

#[test]
fn targets_are_taken_only_after_neutral_for_the_arming_time() {
    let log = Log::default();
    let mut esc = at_once(&log);
    esc.update(tick(0)).unwrap();
    assert_eq!((last(&log), esc.set_throttle(1.0)), (1_500, Err(TargetError::Disarmed)));
    esc.arm().unwrap();
    for ms in 1..=2_000 {
        esc.arm().unwrap(); // again and again does not begin anew
        esc.update(tick(ms)).unwrap();
        assert_eq!((last(&log), esc.set_throttle(1.0)), (1_500, Err(TargetError::Disarmed)));
    }
    esc.update(tick(2_001)).unwrap();
    assert_eq!(esc.set_throttle(1.0), Ok(()));
    esc.update(tick(2_002)).unwrap();
    assert_eq!(last(&log), 2_000);
}

#[test]
fn throttle_is_linear_on_both_sides_of_neutral_and_saturates() {
    let log = Log::default();
    let mut esc = armed(at_once(&log).with_pulses_us([1_100, 1_480, 1_940], PERIOD).unwrap());
    for (ms, (throttle, pulse)) in (6..).zip([
        (0.0, 1_480),
        (1.0, 1_940),
        (-1.0, 1_100),
        (0.5, 1_710),
        (-0.5, 1_290),
        (9.0, 1_940),
        (-9.0, 1_100),
    ]) {
        esc.set_throttle(throttle).unwrap();
        esc.update(tick(ms)).unwrap();
        assert_eq!(last(&log), pulse, "{throttle}");
    }
    let log = Log::default();
    let mut fan = armed(at_once(&log).with_pulses_us([1_000, 1_000, 2_000], PERIOD).unwrap());
    fan.set_throttle(-0.7).unwrap();
    fan.update(tick(6)).unwrap();
    assert_eq!(last(&log), 1_000, "it turns one way");
}

#[test]
fn the_arming_time_begins_with_the_first_neutral_pulse_that_the_channel_took() {
    let log = Log::default();
    let mut esc = at_once(&log).with_arming_time(Duration::from_millis(100));
    esc.arm().unwrap();
    log.broken.set("esc");
    for ms in 0..500 {
        assert_eq!(esc.update(tick(ms)), Err(Broken));
    }
    log.broken.set("");
    // The loop stood still for long: the ESC has not seen a pulse yet.
    for ms in 5_000..5_100 {
        esc.update(tick(ms)).unwrap();
        assert_eq!((last(&log), esc.is_armed()), (1_500, false), "{ms}");
    }
    esc.update(tick(5_100)).unwrap();
    assert!(esc.is_armed());
}

#[test]
fn old_targets_nan_and_stops_give_neutral() {
    let log = Log::default();
    let mut esc = armed(at_once(&log));
    esc.set_throttle(0.4).unwrap();
    esc.update(tick(105)).unwrap();
    assert_eq!(last(&log), 1_700);
    esc.update(tick(106)).unwrap();
    assert_eq!((last(&log), esc.guard().forgotten_targets()), (1_500, 1));
    esc.set_throttle(0.4).unwrap();
    assert_eq!(esc.set_throttle(f32::NAN), Err(TargetError::NotFinite));
    esc.update(tick(107)).unwrap();
    assert_eq!((last(&log), esc.is_armed()), (1_500, true));
    esc.set_throttle(0.4).unwrap();
    esc.emergency_stop();
    assert_eq!(esc.arm(), Err(ArmError::Stopped));
    esc.update(tick(108)).unwrap();
    assert_eq!((last(&log), esc.is_armed()), (1_500, false));
}

#[test]
fn a_servo_without_a_pulse_when_idle_goes_limp_and_never_to_its_centre() {
    let log = Log::default();
    let mut servo = armed(at_once(&log).with_off_at_rest());
    servo.set_throttle(0.4).unwrap();
    for (ms, pulse) in [(105, 1_700), (106, 0)] {
        servo.update(tick(ms)).unwrap();
        assert_eq!(last(&log), pulse, "its target is {ms} ms old");
    }
    servo.set_throttle(0.4).unwrap();
    assert_eq!(servo.set_throttle(f32::NAN), Err(TargetError::NotFinite));
    servo.update(tick(107)).unwrap();
    assert_eq!(last(&log), 0);
    servo.set_throttle(0.4).unwrap();
    servo.emergency_stop();
    servo.update(tick(108)).unwrap();
    assert_eq!(last(&log), 0);
}

#[test]
fn a_clock_that_stands_or_goes_back_gives_neutral() {
    for next_ms in [50, 49, 6] {
        let log = Log::default();
        let mut esc = armed(at_once(&log));
        esc.set_throttle(1.0).unwrap();
        esc.update(tick(50)).unwrap();
        assert_eq!(last(&log), 2_000);
        for ms in next_ms..100 {
            esc.update(tick(ms)).unwrap();
            assert_eq!((last(&log), esc.is_armed()), (1_500, false), "{ms}");
            assert_eq!(esc.set_throttle(1.0), Err(TargetError::Relaxed));
        }
        assert_eq!(esc.arm(), Err(ArmError::NotReleased), "94 ms, or less, after the trip");
        for ms in 100..200 {
            esc.update(tick(ms)).unwrap();
        }
        assert_eq!(esc.arm(), Ok(()));
    }
}

/// As for every motor: one update, and no second one.
#[test]
fn an_update_without_a_step_gives_a_pulse_once() {
    let log = Log::default();
    let mut esc = armed(at_once(&log));
    let mut pulse = |ms: u64, dt_s: f32| {
        esc.set_throttle(1.0).unwrap();
        esc.update(Tick::new(at_ms(ms), dt_s)).unwrap();
        last(&log)
    };
    assert_eq!([pulse(6, 0.001), pulse(7, 0.0)], [2_000, 2_000]);
    assert_eq!([pulse(8, f32::NAN), pulse(9, 0.0)], [1_500, 1_500]);
    assert_eq!(pulse(10, 0.001), 2_000);
}

#[test]
fn the_throttle_opens_after_arming() {
    let log = Log::default();
    let mut esc = armed(RcPwm::new(pin("esc", &log)));
    for (ms, pulse) in [(6, 1_503), (55, 1_625), (105, 1_750), (204, 1_998), (205, 2_000)] {
        esc.set_throttle(1.0).unwrap();
        esc.update(tick(ms)).unwrap();
        assert_eq!(last(&log), pulse, "{ms} ms");
    }
}

#[test]
fn a_lost_command_is_one_edge_with_its_time_however_often_it_happens() {
    let log = Log::default();
    let mut esc = armed(at_once(&log).with_id(7));
    for round in 0..1_000 {
        esc.set_throttle(0.1).unwrap();
        for ms in [6, 60, 120] {
            esc.update(tick(round * 200 + ms)).unwrap();
        }
    }
    let edge = esc.next_edge().unwrap();
    assert_eq!(edge.source.to_string(), "RC PWM #7");
    assert_eq!((edge.condition, edge.began), (Condition::CommandLost, true));
    assert!((118_976..=120_000).contains(&edge.at.as_micros()), "{edge}");
    assert!(esc.next_edge().is_some_and(|edge| !edge.began) && esc.next_edge().is_none());
    assert_eq!(esc.health().forgotten_targets, 1_000);
    assert_eq!(esc.conditions().to_string(), "command lost");
    assert!(esc.health().to_string().starts_with("RC PWM #7: online, armed, command lost; "));
}

#[test]
fn velocities_need_a_full_speed_and_are_not_measured() {
    let log = Log::default();
    let mut esc = armed(at_once(&log));
    let rpm = AngularVelocity::from_rpm;
    assert_eq!(esc.set_velocity((), rpm(10.0)), Err(TargetError::Unsupported));
    assert_eq!(esc.capabilities(()).to_string(), "raw");
    let mut esc = armed(at_once(&log).with_full_speed(rpm(1_000.0)).unwrap());
    esc.set_velocity((), rpm(-250.0)).unwrap();
    esc.update(tick(6)).unwrap();
    assert_eq!((last(&log), esc.velocity(())), (1_375, None));
    assert_eq!(esc.capabilities(()).to_string(), "raw, velocity");
}

#[test]
fn invalid_parameters_are_named() {
    let log = Log::default();
    let pulses =
        |pulses, period_us| at_once(&log).with_pulses_us(pulses, Duration::from_micros(period_us));
    for (esc, name) in [
        (pulses([2_000, 1_500, 1_000], 20_000), "low pulse"),
        (pulses([1_000, 2_100, 2_000], 20_000), "neutral pulse"),
        (pulses([1_000, 1_500, 2_000], 1_900), "period"),
        (at_once(&log).with_full_speed(AngularVelocity::from_rpm(f32::NAN)), "full speed"),
    ] {
        assert_eq!(esc.err(), Some(ConfigError::Unusable(name)));
    }
}
