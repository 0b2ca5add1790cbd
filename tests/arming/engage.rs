//! `engage` alone: it arms a motor that may be driven, and no other, whatever its caller forgot to look at.

use crate::own::{Mine, faulty, healthy, own};
use crate::{PAUSE_MS, at_ms};
use drivetrain::motor::Devices;
use drivetrain::motor::{self, Actuator, Guard, Ingest, TargetError, Timeouts, VelocityDrive};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::AngularVelocity;

/// A motor of one's own that was heard for some time, and the time.
fn heard() -> (Actuator<Mine>, u64) {
    let mut motor = own(1);
    for ms in 1_000..1_000 + PAUSE_MS {
        assert_eq!(motor.ingest(&healthy(1), at_ms(ms)), Ingest::Taken);
        motor.update(Tick::new(at_ms(ms), 0.001));
    }
    (motor, 999 + PAUSE_MS)
}

/// Tells whether it is driven in the next milliseconds.
fn runs(motor: &mut Actuator<Mine>, mut ms: u64) -> bool {
    for _ in 0..5 {
        ms += 1;
        assert_eq!(motor.ingest(&healthy(1), at_ms(ms)), Ingest::Taken);
        _ = motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        motor.update(Tick::new(at_ms(ms), 0.001));
    }
    motor.motor().runs > 0
}

#[test]
fn a_motor_of_ones_own_that_may_be_driven_is_engaged_and_no_other() {
    let (mut motor, ms) = heard();
    motor::CanDevice::engage(&mut motor, at_ms(ms));
    assert!(motor.guard().is_armed() && runs(&mut motor, ms));

    let (mut motor, ms) = heard();
    assert_eq!(motor.ingest(&faulty(1), at_ms(ms + 1)), Ingest::Taken);
    motor.update(Tick::new(at_ms(ms + 1), 0.001));
    motor::CanDevice::engage(&mut motor, at_ms(ms + 1));
    assert!(!motor.guard().is_armed() && !runs(&mut motor, ms + 1), "its ESC reports a fault");

    let (mut motor, ms) = heard();
    motor::CanDevice::engage(&mut motor, at_ms(ms + 11));
    assert!(!motor.guard().is_armed() && !runs(&mut motor, ms + 11), "silent");

    let mut motor = own(1);
    motor::CanDevice::engage(&mut motor, at_ms(1_000));
    assert!(!motor.guard().is_armed() && !runs(&mut motor, 1_000), "never heard");

    let (mut motor, ms) = heard();
    motor.emergency_stop();
    motor::CanDevice::engage(&mut motor, at_ms(ms));
    assert!(!motor.guard().is_armed() && !runs(&mut motor, ms), "stopped");
}

/// The same of the guard, which motors of other kinds have.
#[test]
fn a_guard_engages_with_fresh_feedback_only() {
    let armed = |guard: &mut Guard, ms| {
        guard.engage(at_ms(ms));
        let refused = guard.admit(true) == Err(TargetError::Disarmed);
        assert_eq!(guard.is_armed(), !refused, "{ms}");
        guard.is_armed()
    };
    assert!(!armed(&mut Guard::new(), 1_000), "never heard");
    for (heard_ms, expected) in
        [(1_000, true), (990, true), (989, false), (1_010, true), (1_011, false)]
    {
        let mut guard = Guard::new();
        guard.hear(at_ms(heard_ms));
        assert_eq!(armed(&mut guard, 1_000), expected, "heard at {heard_ms}");
    }
    // Lost, and heard again: not before the tenth frame.
    let mut guard = Guard::new();
    guard.hear(at_ms(1_000));
    _ = guard.drives(at_ms(1_200));
    for ms in 1_201..1_220 {
        guard.hear(at_ms(ms));
        assert_eq!(armed(&mut guard, ms), ms >= 1_210, "{ms}");
    }
    // Its own limit counts, not the usual one.
    let timeouts = Timeouts::new()
        .with_feedback(Duration::from_millis(40), Duration::from_millis(100))
        .unwrap();
    for (ms, expected) in [(1_040, true), (1_041, false)] {
        let mut guard = Guard::new().with_timeouts(timeouts);
        guard.hear(at_ms(1_000));
        assert_eq!(armed(&mut guard, ms), expected, "{ms}");
    }
    // One that cannot be heard is not missing.
    assert!(armed(&mut Guard::without_feedback(), 1_000));
}
