//! What an update without a time step holds.

use super::*;

/// What is held for an update without a step is the output of the target in force, not one from before a rest.
#[test]
fn an_update_without_a_step_holds_no_duty_from_before_a_rest() {
    let log = Log::default();
    let pins = TwoPins(pin("in1", &log), pin("in2", &log));
    let mut motor = Brushed::new(pin("pwm", &log), pins, BrushedConfig::new(1)).unwrap();
    motor.arm(at_ms(0)).unwrap();
    motor.set_duty(1.0).unwrap();
    motor.update(tick(1)).unwrap();
    assert_eq!(last(&log), 20_000);
    motor.disarm();
    motor.arm(at_ms(1)).unwrap();
    motor.set_duty(0.1).unwrap();
    motor.update(Tick::new(at_ms(2), 0.0)).unwrap();
    assert_eq!(last(&log), 0);
    motor.update(tick(3)).unwrap();
    assert_eq!(last(&log), 2_000);
    motor.update(Tick::new(at_ms(4), 0.0)).unwrap();
    assert_eq!(last(&log), 2_000);
}
