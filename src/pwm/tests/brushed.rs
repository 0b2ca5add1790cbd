//! The brushed motor.

use super::*;

const SPEED: PidConfig = PidConfig::new(0.02, 0.4, 0.0);
const WHEEL: BrushedConfig =
    BrushedConfig::at_once(3).with_encoder(1_320.0, 16).with_speed_loop(SPEED);

type Motor<'a> = Brushed<Pin<'a>, (Pin<'a>, Pin<'a>)>;

fn motor(log: &Log, config: BrushedConfig) -> Motor<'_> {
    let pins = (pin("in1", log), pin("in2", log));
    Brushed::new(pin("pwm", log), pins, config).unwrap()
}

/// The shaft: 30 rad/s at full duty, with a time constant of 50 ms, and a 16-bit counter that wraps.
struct Shaft {
    rad_per_s: f32,
    counts: f32,
}

impl Shaft {
    fn step(&mut self, share: f32) -> u32 {
        self.rad_per_s += (30.0 * share - self.rad_per_s) * 0.02;
        self.counts += self.rad_per_s * 0.001 * 1_320.0 / core::f32::consts::TAU;
        #[expect(clippy::cast_possible_truncation, reason = "some thousand counts")]
        let counts = self.counts as i32;
        (counts.cast_unsigned().wrapping_add(65_500)) & 0xFFFF
    }
}

#[test]
fn a_velocity_is_followed_in_both_directions_over_the_wrap_of_the_counter() {
    for (goal, reversed) in [(15.0, false), (-15.0, false), (15.0, true), (-15.0, true)] {
        let log = Log::default();
        let mut motor = motor(&log, if reversed { WHEEL.reversed() } else { WHEEL });
        let mut shaft = Shaft { rad_per_s: 0.0, counts: 0.0 };
        for ms in 1..1_500 {
            let duty = if reversed { -motor.duty() } else { motor.duty() };
            motor.ingest_counts(shaft.step(duty), at_ms(ms));
            motor.arm(at_ms(ms)).unwrap();
            motor.set_velocity((), AngularVelocity::from_rad_per_s(goal)).unwrap();
            motor.update(tick(ms)).unwrap();
        }
        let measured = motor.velocity(()).unwrap().as_rad_per_s();
        let truth = if reversed { -shaft.rad_per_s } else { shaft.rad_per_s };
        assert!((truth - goal).abs() < 0.3 && (measured - goal).abs() < 0.6, "{truth}");
        let counts = motor.counts() as f32 * if reversed { -1.0 } else { 1.0 };
        assert!((counts - shaft.counts).abs() < 40.0);
    }
}

#[test]
fn the_pulse_is_off_while_the_direction_changes_and_both_pins_are_never_high() {
    let log = Log::default();
    let mut motor = motor(&log, BrushedConfig::at_once(1));
    motor.arm(at_ms(1)).unwrap();
    for (ms, share) in [(1, 0.5), (2, -0.25), (3, -0.5), (4, 0.0)] {
        motor.set_duty(share).unwrap();
        motor.update(tick(ms)).unwrap();
    }
    assert_eq!(
        *log.events.borrow(),
        [
            ("pwm", 0),
            ("in2", 0),
            ("in1", 1),
            ("pwm", 10_000),
            ("pwm", 0),
            ("in1", 0),
            ("in2", 1),
            ("pwm", 5_000),
            ("pwm", 10_000),
            ("pwm", 0),
            ("in1", 0),
            ("in2", 0),
        ]
    );
}

#[test]
fn a_motor_without_counts_is_not_armed_and_without_new_counts_stops() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL);
    assert_eq!(motor.arm(at_ms(1)).unwrap_err().to_string(), "no feedback from brushed #3");
    motor.update(tick(1)).unwrap();
    assert!(log.events.borrow().iter().all(|(_, value)| *value == 0));
    motor.ingest_counts(0, at_ms(1));
    motor.arm(at_ms(1)).unwrap();
    motor.set_duty(0.5).unwrap();
    motor.update(tick(11)).unwrap();
    assert_eq!(last(&log), 10_000);
    motor.update(tick(12)).unwrap();
    assert_eq!((last(&log), motor.velocity(())), (0, None));
    motor.update(tick(102)).unwrap();
    assert_eq!(motor.set_duty(0.5), Err(TargetError::Relaxed));
}

#[test]
fn the_capabilities_are_the_accepted_targets() {
    let bare = BrushedConfig::at_once(1);
    let heard = bare.with_encoder(1_320.0, 16);
    for (config, text) in [
        (bare, "raw"),
        (heard, "raw, feedback"),
        (heard.with_speed_loop(PidConfig::new(0.02, 0.3, 0.0)), "raw, velocity, feedback"),
    ] {
        let log = Log::default();
        let mut motor = motor(&log, config);
        motor.ingest_counts(0, at_ms(0));
        motor.arm(at_ms(0)).unwrap();
        let offered = motor.capabilities(());
        assert_eq!(offered.to_string(), text);
        let taken = motor.set_velocity((), AngularVelocity::ZERO);
        let expected =
            if offered.has(Capability::Velocity) { Ok(()) } else { Err(TargetError::NoLoop) };
        assert_eq!((taken, motor.set_duty(0.1)), (expected, Ok(())));
    }
}

#[test]
fn old_targets_nan_bad_steps_and_stops_give_zero() {
    let log = Log::default();
    let mut motor = motor(&log, BrushedConfig::at_once(1));
    assert_eq!(motor.set_duty(1.0), Err(TargetError::Disarmed));
    motor.arm(at_ms(0)).unwrap();
    let run = |motor: &mut Motor<'_>, ms, dt_s| {
        motor.update(Tick::new(at_ms(ms), dt_s)).unwrap();
        last(&log)
    };
    motor.set_duty(1.0).unwrap();
    assert_eq!((run(&mut motor, 1, 0.001), run(&mut motor, 101, 0.001)), (20_000, 0));
    let velocity = motor.set_velocity((), AngularVelocity::ZERO);
    assert_eq!((velocity, motor.guard().has_target()), (Err(TargetError::NoLoop), false));
    motor.set_duty(1.0).unwrap();
    assert_eq!(motor.set_duty(f32::INFINITY), Err(TargetError::NotFinite));
    assert_eq!(run(&mut motor, 102, 0.001), 0);
    motor.set_duty(1.0).unwrap();
    assert_eq!((run(&mut motor, 103, 0.001), run(&mut motor, 104, f32::NAN)), (20_000, 20_000));
    assert_eq!(run(&mut motor, 105, f32::NAN), 0);
    motor.set_duty(1.0).unwrap();
    assert_eq!(run(&mut motor, 106, 0.001), 20_000);
    motor.emergency_stop();
    assert_eq!((run(&mut motor, 107, 0.001), motor.arm(at_ms(107))), (0, Err(ArmError::Stopped)));
    motor.clear_emergency_stop();
    assert_eq!(motor.set_duty(1.0), Err(TargetError::Disarmed));
    assert_eq!(motor.arm(at_ms(108)), Err(ArmError::NotReleased));
    for ms in 108..208 {
        assert_eq!(run(&mut motor, ms, 0.001), 0);
    }
    motor.arm(at_ms(208)).unwrap();
    assert_eq!(run(&mut motor, 208, 0.001), 0, "starts from zero");
    motor.set_duty(1.0).unwrap();
    assert_eq!(run(&mut motor, 209, 0.001), 20_000);
    motor.set_duty(1.0).unwrap();
    assert_eq!((run(&mut motor, 209, 0.001), motor.is_armed()), (0, false), "time stands");
}

#[test]
fn a_pin_that_fails_is_named_and_tried_again() {
    let log = Log::default();
    let mut motor = motor(&log, BrushedConfig::at_once(1));
    motor.arm(at_ms(1)).unwrap();
    motor.set_duty(0.5).unwrap();
    log.broken.set("in1");
    assert_eq!(motor.update(tick(1)), Err(OneOf::Second(Broken)));
    assert_eq!(last(&log), 0, "no pulse while the direction is not sure");
    log.broken.set("");
    motor.update(tick(2)).unwrap();
    assert_eq!(last(&log), 10_000);
    log.broken.set("pwm");
    assert_eq!(motor.update(tick(3)), Err(OneOf::First(Broken)));
}

/// The last level of a pin.
fn level(log: &Log, pin: &str) -> u16 {
    log.events.borrow().iter().rev().find(|(name, _)| *name == pin).unwrap().1
}

#[test]
fn a_stop_opens_the_bridge_where_the_pulse_cannot_be_taken_away() {
    let log = Log::default();
    let mut motor = motor(&log, BrushedConfig::at_once(1));
    motor.arm(at_ms(1)).unwrap();
    motor.set_duty(0.5).unwrap();
    motor.update(tick(1)).unwrap();
    assert_eq!((level(&log, "in1"), level(&log, "in2")), (1, 0));
    log.broken.set("pwm");
    motor.disarm();
    assert_eq!(motor.update(tick(2)), Err(OneOf::First(Broken)));
    assert_eq!((level(&log, "in1"), level(&log, "in2")), (0, 0));
}

#[test]
fn after_a_failed_pin_both_pins_are_set_again() {
    for next in [0.5, -0.5] {
        let log = Log::default();
        let mut motor = motor(&log, BrushedConfig::at_once(1));
        motor.arm(at_ms(1)).unwrap();
        motor.set_duty(0.5).unwrap();
        motor.update(tick(1)).unwrap();
        log.broken.set("in2");
        motor.set_duty(-0.5).unwrap();
        assert_eq!(motor.update(tick(2)), Err(OneOf::Second(Broken)));
        assert_eq!(level(&log, "pwm"), 0);
        log.broken.set("");
        motor.set_duty(next).unwrap();
        motor.update(tick(3)).unwrap();
        let pins = if next > 0.0 { (1, 0) } else { (0, 1) };
        assert_eq!(
            (level(&log, "in1"), level(&log, "in2"), level(&log, "pwm")),
            (pins.0, pins.1, 10_000)
        );
    }
}

#[test]
fn invalid_parameters_are_named() {
    let config = BrushedConfig::at_once(1);
    let bad_gain = PidConfig::new(f32::NAN, 0.0, 0.0);
    for (config, name) in [
        (config.with_encoder(0.0, 16), "counts per turn"),
        (config.with_encoder(f32::NAN, 16), "counts per turn"),
        (config.with_encoder(100.0, 33), "counter width"),
        (config.with_velocity_filter(-1.0), "velocity filter"),
        (config.with_limit(1.01), "limit"),
        (config.with_limit(f32::NAN), "limit"),
        (config.with_no_load_speed(AngularVelocity::ZERO), "no-load speed"),
        (config.with_health(&SENSELESS), "stall hold"),
        (config.with_speed_loop(SPEED), "speed loop without an encoder"),
        (WHEEL.with_speed_loop(bad_gain), "kp"),
    ] {
        assert_eq!(config.validate().map_err(|error| error.parameter()), Err(name));
    }
}

static SENSELESS: HealthConfig = HealthConfig::new().with_stall_hold(2.0);
static HOLDS: HealthConfig = HealthConfig::new().with_stall_hold(0.25);

/// Runs a speed loop for some milliseconds on what `counts` makes of the duty; returns the edges and when they were seen.
fn run(
    motor: &mut Motor<'_>,
    ms: core::ops::Range<u64>,
    goal: f32,
    mut counts: impl FnMut(f32) -> Option<u32>,
) -> Vec<(Condition, bool, u64)> {
    let mut seen = Vec::new();
    for ms in ms {
        if let Some(counts) = counts(motor.duty()) {
            motor.ingest_counts(counts, at_ms(ms));
        }
        _ = motor.set_velocity((), AngularVelocity::from_rad_per_s(goal));
        motor.update(tick(ms)).unwrap();
        while let Some(edge) = motor.next_edge() {
            assert_eq!(edge.source.to_string(), "brushed #3");
            assert!(at_ms(ms).since(edge.at).as_micros() < 1_024, "{edge} seen after {ms} ms");
            seen.push((edge.condition, edge.began, ms));
        }
    }
    seen
}

#[test]
fn an_encoder_that_is_cut_off_does_not_leave_the_motor_at_full_duty_in_either_direction() {
    for goal in [15.0, -15.0] {
        let log = Log::default();
        let mut motor = motor(&log, WHEEL);
        let mut shaft = Shaft { rad_per_s: 0.0, counts: 0.0 };
        motor.ingest_counts(0, at_ms(0));
        motor.arm(at_ms(0)).unwrap();
        assert_eq!(run(&mut motor, 1..1_000, goal, |duty| Some(shaft.step(duty))), []);
        // From now on it counts nothing, and says so.
        let dead = shaft.step(motor.duty());
        let seen = run(&mut motor, 1_000..2_500, goal, |_| Some(dead));
        let [(Condition::Stalled, true, began), (Condition::Stalled, false, _)] = seen[..] else {
            panic!("{seen:?}");
        };
        assert!((1_500..1_800).contains(&began), "half a second at half duty: {began}");
        assert_eq!((last(&log), motor.is_armed(), motor.duty()), (0, false, 0.0));
        motor.arm(at_ms(2_500)).unwrap();
    }
}

#[test]
fn a_stall_is_reported_or_limited_as_configured() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL.with_health(&HOLDS));
    motor.ingest_counts(0, at_ms(0));
    motor.arm(at_ms(0)).unwrap();
    let seen = run(&mut motor, 1..3_000, 30.0, |_| Some(0));
    assert!(matches!(seen[..], [(Condition::Stalled, true, _)]), "{seen:?}");
    assert!(motor.is_armed() && (motor.duty() - 0.25).abs() < 1e-6, "{}", motor.duty());
    // It comes free: it turns, and has all of its output again, without a jump.
    let mut shaft = Shaft { rad_per_s: 0.0, counts: 36.0 };
    let seen = run(&mut motor, 3_000..4_500, 15.0, |duty| Some(shaft.step(duty)));
    assert!(matches!(seen[..], [(Condition::Stalled, false, _)]), "{seen:?}");
    assert!((shaft.rad_per_s - 15.0).abs() < 0.5, "{}", shaft.rad_per_s);
}

#[test]
fn an_encoder_that_counts_the_wrong_way_is_a_runaway_until_it_is_armed() {
    for goal in [10.0, -10.0] {
        let log = Log::default();
        let no_load = AngularVelocity::from_rad_per_s(30.0);
        let mut motor = motor(&log, WHEEL.with_no_load_speed(no_load));
        let mut shaft = Shaft { rad_per_s: 0.0, counts: 0.0 };
        motor.ingest_counts(0, at_ms(0));
        motor.arm(at_ms(0)).unwrap();
        let seen = run(&mut motor, 1..1_500, goal, |duty| Some(shaft.step(-duty)));
        assert!(matches!(seen[..], [(Condition::Runaway, true, 1..700)]), "{seen:?}");
        assert_eq!((last(&log), motor.is_armed()), (0, false));
        motor.arm(at_ms(1_500)).unwrap();
        assert!(motor.next_edge().is_some_and(|edge| !edge.began));
    }
}

#[test]
fn lost_counts_are_late_and_then_offline_each_once_with_its_time() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL);
    motor.ingest_counts(0, at_ms(0));
    motor.arm(at_ms(0)).unwrap();
    let seen = run(&mut motor, 1..300, 1.0, |_| None);
    assert_eq!(seen, [(Condition::Late, true, 11), (Condition::Offline, true, 101)]);
    let seen = run(&mut motor, 300..330, 1.0, |_| Some(0));
    assert_eq!(seen, [(Condition::Late, false, 309), (Condition::Offline, false, 309)]);
    // A thousand unread gaps are one.
    for gap in 0..1_000 {
        motor.ingest_counts(0, at_ms(400 + gap * 20));
        motor.update(tick(400 + gap * 20)).unwrap();
        motor.update(tick(415 + gap * 20)).unwrap();
    }
    let all: Vec<_> = core::iter::from_fn(|| motor.next_edge()).map(|edge| edge.began).collect();
    assert_eq!(all, [true, false]);
}

#[test]
fn health_is_a_line_with_rate_and_gap() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL.reversed());
    _ = run(&mut motor, 1..2_100, 0.0, |_| Some(0));
    let health = motor.health();
    assert!((998..=1_001).contains(&health.feedback_hz), "{health}");
    assert_eq!((health.link, health.longest_gap.as_micros()), (Link::Online, 992));
    assert!(health.to_string().starts_with("brushed #3: online, disarmed, healthy; "));
    let log = Log::default();
    let bare = self::motor(&log, BrushedConfig::at_once(3));
    assert_eq!((bare.health().feedback_hz, bare.conditions().is_empty()), (0, true));
}

#[test]
fn without_an_encoder_a_stall_is_not_known() {
    let log = Log::default();
    let mut motor = motor(&log, BrushedConfig::at_once(3));
    motor.arm(at_ms(0)).unwrap();
    for ms in 1..2_000 {
        motor.set_duty(1.0).unwrap();
        motor.update(tick(ms)).unwrap();
    }
    assert_eq!((last(&log), motor.next_edge()), (20_000, None));
}

static CARELESS: HealthConfig =
    HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Ignore);

#[test]
fn an_ignored_stall_is_not_reported() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL.with_health(&CARELESS));
    motor.ingest_counts(0, at_ms(0));
    motor.arm(at_ms(0)).unwrap();
    assert_eq!(run(&mut motor, 1..2_000, 30.0, |_| Some(0)), []);
    assert!(motor.is_armed());
}

#[test]
fn from_rest_the_proportional_part_acts_at_once_and_from_a_duty_nothing_jumps() {
    let log = Log::default();
    let mut motor = motor(&log, WHEEL);
    motor.ingest_counts(0, at_ms(0));
    motor.arm(at_ms(0)).unwrap();
    let goal = AngularVelocity::from_rad_per_s(10.0);
    motor.set_velocity((), goal).unwrap();
    motor.update(tick(1)).unwrap();
    assert!((motor.duty() - 0.2).abs() < 1e-6, "kp of 0.02: {}", motor.duty());
    motor.set_duty(0.5).unwrap();
    motor.update(tick(2)).unwrap();
    motor.set_velocity((), goal).unwrap();
    motor.update(tick(3)).unwrap();
    assert!((motor.duty() - 0.5).abs() < 1e-6, "{}", motor.duty());
}
