//! The first update without a time step repeats the output of a motor, and the loop then continues from that output.

use super::*;

type Motor<'a> = Brushed<Pin<'a>, (Pin<'a>, Pin<'a>)>;
type Work = fn(&mut Motor<'_>);

/// Armed; its speed loop does nothing but integrate.
fn integrator(log: &Log) -> Motor<'_> {
    let pins = (pin("in1", log), pin("in2", log));
    let integral = PidConfig::new(0.0, 0.001, 0.0);
    let config = BrushedConfig::at_once(1).with_encoder(2_000.0, 16).with_speed_loop(integral);
    let mut motor = Brushed::new(pin("pwm", log), pins, config).unwrap();
    motor.ingest_counts(0, at_ms(0));
    motor.arm(at_ms(0)).unwrap();
    motor
}

/// An update without a step keeps the output of the present target, and no output from before a rest.
#[test]
fn an_update_without_a_step_holds_no_duty_from_before_a_rest() {
    let resting: [Work; 3] = [
        |motor| motor.disarm(),
        |motor| {
            motor.emergency_stop();
            motor.clear_emergency_stop();
        },
        |motor| assert_eq!(motor.set_duty(f32::NAN), Err(TargetError::NotFinite)),
    ];
    for rest in resting {
        let log = Log::default();
        let pins = (pin("in1", &log), pin("in2", &log));
        let mut motor = Brushed::new(pin("pwm", &log), pins, BrushedConfig::at_once(1)).unwrap();
        motor.arm(at_ms(0)).unwrap();
        motor.set_duty(1.0).unwrap();
        motor.update(tick(1)).unwrap();
        assert_eq!(last(&log), 20_000);
        rest(&mut motor);
        for ms in 2..=101 {
            motor.update(tick(ms)).unwrap();
        }
        motor.arm(at_ms(101)).unwrap();
        motor.set_duty(0.1).unwrap();
        motor.update(Tick::new(at_ms(102), 0.0)).unwrap();
        assert_eq!(last(&log), 0);
        motor.update(tick(103)).unwrap();
        assert_eq!(last(&log), 2_000);
        motor.update(Tick::new(at_ms(104), 0.0)).unwrap();
        assert_eq!(last(&log), 2_000, "once");
        motor.update(Tick::new(at_ms(105), 0.0)).unwrap();
        assert_eq!(last(&log), 0);
    }
}

/// The speed loop takes over from a direct duty without a jump; but not from one that was taken away.
#[test]
fn a_speed_loop_does_not_take_over_a_duty_from_before_a_rest() {
    let log = Log::default();
    let mut motor = integrator(&log);
    motor.set_duty(1.0).unwrap();
    motor.update(tick(1)).unwrap();
    assert_eq!(last(&log), 20_000);
    assert_eq!(motor.set_duty(f32::NAN), Err(TargetError::NotFinite));
    motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0)).unwrap();
    motor.update(tick(2)).unwrap();
    assert_eq!(last(&log), 0);
}

/// Nor from one that was never set: armed, a duty, a velocity, and only then an update.
#[test]
fn a_speed_loop_does_not_take_over_a_duty_that_never_was() {
    let log = Log::default();
    let mut motor = integrator(&log);
    motor.set_duty(1.0).unwrap();
    motor.set_velocity((), AngularVelocity::ZERO).unwrap();
    motor.update(tick(1)).unwrap();
    assert_eq!(last(&log), 0);
    // One that was, it does.
    motor.set_duty(0.5).unwrap();
    motor.update(tick(2)).unwrap();
    motor.set_velocity((), AngularVelocity::ZERO).unwrap();
    motor.update(tick(3)).unwrap();
    assert_eq!(last(&log), 10_000);
}

/// A speed loop starts afresh if a direct duty replaced the loop meanwhile, or if a rest came before the loop took over.
#[test]
fn a_speed_loop_does_not_go_on_from_before_a_duty_or_a_rest() {
    let velocity: Work = |motor| motor.set_velocity((), AngularVelocity::ZERO).unwrap();
    let nowhere: Work = |motor| {
        let nowhere = AngularVelocity::from_rad_per_s(f32::NAN);
        assert_eq!(motor.set_velocity((), nowhere), Err(TargetError::NotFinite));
    };
    let full: Work = |motor| motor.set_duty(1.0).unwrap();
    let none: Work = |motor| motor.set_duty(0.0).unwrap();
    // Each with a millisecond after it, but for those that are followed at once.
    let replaced: &[&[Work]] = &[&[full], &[velocity], &[none], &[nowhere, velocity]];
    let interrupted: &[&[Work]] = &[&[full], &[velocity, nowhere], &[velocity]];
    let at_once: &[&[Work]] = &[&[full], &[velocity, nowhere, velocity]];
    for steps in [replaced, interrupted, at_once] {
        let log = Log::default();
        let mut motor = integrator(&log);
        for (ms, works) in (1..).zip(steps) {
            works.iter().for_each(|work| work(&mut motor));
            motor.update(tick(ms)).unwrap();
        }
        assert_eq!(last(&log), 0);
    }
    // Zeros for want of a step before the loop took over.
    let log = Log::default();
    let mut motor = integrator(&log);
    full(&mut motor);
    motor.update(tick(1)).unwrap();
    velocity(&mut motor);
    for (ms, dt_s, duty) in [(2, f32::NAN, 20_000), (3, f32::NAN, 0), (4, 0.001, 0)] {
        motor.update(Tick::new(at_ms(ms), dt_s)).unwrap();
        assert_eq!(last(&log), duty);
    }
    // Late before the loop took over: the encoder is heard again at 30 ms.
    let log = Log::default();
    let mut motor = integrator(&log);
    full(&mut motor);
    motor.update(tick(1)).unwrap();
    velocity(&mut motor);
    motor.update(tick(20)).unwrap();
    assert_eq!(last(&log), 0);
    motor.ingest_counts(0, at_ms(30));
    motor.update(tick(30)).unwrap();
    assert_eq!(last(&log), 0);
}

/// A program that arms in each tick drives a blocked motor once.
#[test]
fn a_blocked_motor_stays_relaxed_however_often_it_is_armed() {
    let log = Log::default();
    let pins = (pin("in1", &log), pin("in2", &log));
    let speed = PidConfig::new(0.02, 0.4, 0.0);
    let wheel = BrushedConfig::at_once(3).with_encoder(1_320.0, 16).with_speed_loop(speed);
    let mut motor = Brushed::new(pin("pwm", &log), pins, wheel).unwrap();
    let mut stalls = 0;
    for ms in 1..4_000 {
        motor.ingest_counts(0, at_ms(ms));
        assert_eq!(motor.arm(at_ms(ms)).is_ok(), stalls == 0, "{ms}");
        _ = motor.set_velocity((), AngularVelocity::from_rad_per_s(15.0));
        motor.update(tick(ms)).unwrap();
        while let Some(edge) = motor.next_edge() {
            stalls += u32::from(edge.condition == Condition::Stalled && edge.began);
        }
    }
    assert_eq!(stalls, 1);
}

/// A refused target takes the one before away, also where a good one comes in the same cycle.
#[test]
fn a_good_velocity_behind_a_refused_one_starts_the_loop_afresh() {
    let log = Log::default();
    let mut motor = integrator(&log);
    let mut step = |ms: u64, refused: Option<f32>| {
        motor.ingest_counts(0, at_ms(ms));
        if let Some(rad_per_s) = refused {
            motor.set_velocity((), AngularVelocity::from_rad_per_s(rad_per_s)).unwrap_err();
        }
        motor.set_velocity((), AngularVelocity::from_rad_per_s(10.0)).unwrap();
        motor.update(tick(ms)).unwrap();
        motor.duty()
    };
    let (first, last) = (step(1, None), (2..=200).map(|ms| step(ms, None)).last().unwrap());
    let afresh = step(201, Some(f32::NAN));
    assert!(last > 1.2 * first && (afresh - first).abs() < 1e-6, "{first}, {last}, {afresh}");
}

/// The shaft is held, and its counts are late: the loop keeps its integral, whether or not the program sets its target meanwhile, as a motor of `dji`.
#[test]
fn a_target_refused_while_counts_are_late_leaves_the_integral() {
    let log = Log::default();
    let mut motor = integrator(&log);
    let rad_per_s = AngularVelocity::from_rad_per_s;
    for ms in 1..=300 {
        motor.ingest_counts(0, at_ms(ms));
        motor.set_velocity((), rad_per_s(100.0)).unwrap();
        motor.update(tick(ms)).unwrap();
    }
    let before = motor.duty();
    assert!(before > 0.02, "{before}");
    for ms in 301..=350 {
        _ = motor.set_velocity((), rad_per_s(100.0));
        motor.update(tick(ms)).unwrap();
        assert_eq!(motor.duty() == 0.0, ms > 310, "{ms}");
    }
    motor.ingest_counts(0, at_ms(351));
    motor.set_velocity((), rad_per_s(100.0)).unwrap();
    motor.update(tick(351)).unwrap();
    let step = motor.duty() - before;
    assert!((0.0..0.01).contains(&step), "{before}, {step}");
}
