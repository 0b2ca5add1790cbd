//! Both motors on pins that only remember, under the same cases.

use super::*;
use crate::control::PidConfig;
use crate::motor::{ArmError, Capability, TargetError, VelocityDrive};
use crate::time::{Duration, Instant, Tick};
use crate::units::AngularVelocity;
use core::cell::{Cell, RefCell};
use embedded_hal::{digital, pwm};
use std::string::ToString;
use std::vec::Vec;

/// What happened on the pins, in order, and the pin that is broken.
#[derive(Default)]
struct Log {
    events: RefCell<Vec<(&'static str, u16)>>,
    broken: Cell<&'static str>,
}

struct Pin<'a> {
    name: &'static str,
    log: &'a Log,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Broken;

impl digital::Error for Broken {
    fn kind(&self) -> digital::ErrorKind {
        digital::ErrorKind::Other
    }
}

impl pwm::Error for Broken {
    fn kind(&self) -> pwm::ErrorKind {
        pwm::ErrorKind::Other
    }
}

impl digital::ErrorType for Pin<'_> {
    type Error = Broken;
}

impl pwm::ErrorType for Pin<'_> {
    type Error = Broken;
}

impl Pin<'_> {
    fn set(&mut self, value: u16) -> Result<(), Broken> {
        if self.log.broken.get() == self.name {
            return Err(Broken);
        }
        self.log.events.borrow_mut().push((self.name, value));
        Ok(())
    }
}

impl digital::OutputPin for Pin<'_> {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.set(0)
    }
    fn set_high(&mut self) -> Result<(), Broken> {
        self.set(1)
    }
}

impl pwm::SetDutyCycle for Pin<'_> {
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Broken> {
        self.set(duty)
    }
}

fn pin<'a>(name: &'static str, log: &'a Log) -> Pin<'a> {
    Pin { name, log }
}

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1_000)
}

fn tick(ms: u64) -> Tick {
    Tick::new(at_ms(ms), 0.001)
}

fn last(log: &Log) -> u16 {
    log.events.borrow().last().map_or(0, |(_, value)| *value)
}

mod rc {
    use super::*;

    fn armed(log: &Log, config: RcConfig) -> RcPwm<Pin<'_>> {
        let config = config.with_arming_time(Duration::from_millis(5));
        let mut esc = RcPwm::new(pin("esc", log), config).unwrap();
        esc.arm(at_ms(0));
        for ms in 0..=5 {
            esc.update(tick(ms)).unwrap();
        }
        assert!(esc.is_armed());
        esc
    }

    #[test]
    fn it_takes_targets_only_after_neutral_for_its_arming_time() {
        let log = Log::default();
        let mut esc = RcPwm::new(pin("esc", &log), RcConfig::new()).unwrap();
        esc.update(tick(0)).unwrap();
        assert_eq!((last(&log), esc.set_throttle(1.0)), (1_500, Err(TargetError::Disarmed)));
        esc.arm(at_ms(1));
        for ms in 1..=2_000 {
            esc.arm(at_ms(ms)); // again and again does not begin anew
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
        let config = RcConfig::new().with_pulses_us(1_100, 1_480, 1_940);
        let mut esc = armed(&log, config);
        for (throttle, pulse) in [
            (0.0, 1_480),
            (1.0, 1_940),
            (-1.0, 1_100),
            (0.5, 1_710),
            (-0.5, 1_290),
            (9.0, 1_940),
            (-9.0, 1_100),
        ] {
            esc.set_throttle(throttle).unwrap();
            esc.update(tick(6)).unwrap();
            assert_eq!(last(&log), pulse, "{throttle}");
        }
        let log = Log::default();
        let mut fan = armed(&log, RcConfig::new().with_pulses_us(1_000, 1_000, 2_000));
        fan.set_throttle(-0.7).unwrap();
        fan.update(tick(6)).unwrap();
        assert_eq!(last(&log), 1_000, "it turns one way");
    }

    #[test]
    fn old_targets_nan_and_stops_give_neutral_and_a_servo_goes_limp() {
        let log = Log::default();
        let mut servo = armed(&log, RcConfig::new().with_idle(Idle::Off));
        servo.set_throttle(0.4).unwrap();
        servo.update(tick(105)).unwrap();
        assert_eq!(last(&log), 1_700);
        servo.update(tick(106)).unwrap();
        assert_eq!((last(&log), servo.guard().forgotten_targets()), (1_500, 1));
        servo.set_throttle(0.4).unwrap();
        assert_eq!(servo.set_throttle(f32::NAN), Err(TargetError::NotFinite));
        servo.update(tick(107)).unwrap();
        assert_eq!(last(&log), 1_500);
        servo.set_throttle(0.4).unwrap();
        servo.emergency_stop();
        servo.arm(at_ms(108));
        servo.update(tick(108)).unwrap();
        assert_eq!((last(&log), servo.is_armed()), (0, false));
    }

    #[test]
    fn velocities_need_a_full_speed_and_are_not_measured() {
        let log = Log::default();
        let mut esc = armed(&log, RcConfig::new());
        let rpm = AngularVelocity::from_rpm;
        assert_eq!(esc.set_velocity((), rpm(10.0)), Err(TargetError::Unsupported));
        assert_eq!(esc.capabilities(()).to_string(), "raw");
        let mut esc = armed(&log, RcConfig::new().with_full_speed(rpm(1_000.0)));
        esc.set_velocity((), rpm(-250.0)).unwrap();
        esc.update(tick(6)).unwrap();
        assert_eq!((last(&log), esc.velocity(())), (1_375, None));
        assert_eq!(esc.capabilities(()).to_string(), "raw, velocity");
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let config = RcConfig::new();
        for (config, name) in [
            (config.with_pulses_us(2_000, 1_500, 1_000), "low pulse"),
            (config.with_pulses_us(1_000, 2_100, 2_000), "neutral pulse"),
            (config.with_period(Duration::from_micros(1_900)), "period"),
            (config.with_full_speed(AngularVelocity::from_rpm(f32::NAN)), "full speed"),
        ] {
            let log = Log::default();
            assert_eq!(RcPwm::new(pin("esc", &log), config).err(), Some(PwmError(name)));
        }
    }
}

mod brushed {
    use super::*;

    const SPEED: PidConfig = PidConfig::new(0.02, 0.4, 0.0);
    const WHEEL: BrushedConfig =
        BrushedConfig::new(3).with_encoder(1_320.0, 16).with_speed_loop(SPEED);

    type Motor<'a> = Brushed<Pin<'a>, TwoPins<Pin<'a>, Pin<'a>>>;

    fn motor(log: &Log, config: BrushedConfig) -> Motor<'_> {
        let pins = TwoPins(pin("in1", log), pin("in2", log));
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
        let mut motor = motor(&log, BrushedConfig::new(1));
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
    fn without_counts_it_is_not_armed_and_without_new_ones_it_stops() {
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
    fn what_it_offers_is_what_it_takes() {
        let bare = BrushedConfig::new(1);
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
        let mut motor = motor(&log, BrushedConfig::new(1));
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
        assert_eq!((run(&mut motor, 103, 0.001), run(&mut motor, 103, f32::NAN)), (20_000, 20_000));
        assert_eq!(run(&mut motor, 103, f32::NAN), 0);
        motor.set_duty(1.0).unwrap();
        assert_eq!(run(&mut motor, 104, 0.001), 20_000);
        motor.emergency_stop();
        assert_eq!(
            (run(&mut motor, 105, 0.001), motor.arm(at_ms(105))),
            (0, Err(ArmError::Stopped))
        );
        motor.clear_emergency_stop();
        assert_eq!(motor.set_duty(1.0), Err(TargetError::Disarmed));
        motor.arm(at_ms(106)).unwrap();
        assert_eq!(run(&mut motor, 106, 0.001), 0, "starts from zero");
    }

    #[test]
    fn a_pin_that_fails_is_named_and_tried_again() {
        let log = Log::default();
        let mut motor = motor(&log, BrushedConfig::new(1));
        motor.arm(at_ms(1)).unwrap();
        motor.set_duty(0.5).unwrap();
        log.broken.set("in1");
        assert_eq!(motor.update(tick(1)), Err(BrushedError::Direction(Broken)));
        assert_eq!(last(&log), 0, "no pulse while the direction is not sure");
        log.broken.set("");
        motor.update(tick(2)).unwrap();
        assert_eq!(last(&log), 10_000);
        log.broken.set("pwm");
        assert_eq!(motor.update(tick(3)), Err(BrushedError::Pwm(Broken)));
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let config = BrushedConfig::new(1);
        let bad_gain = PidConfig::new(f32::NAN, 0.0, 0.0);
        for (config, name) in [
            (config.with_encoder(0.0, 16), "counts per turn"),
            (config.with_encoder(f32::NAN, 16), "counts per turn"),
            (config.with_encoder(100.0, 33), "counter width"),
            (config.with_velocity_filter(-1.0), "velocity filter"),
            (config.with_limit(1.01), "limit"),
            (config.with_limit(f32::NAN), "limit"),
            (config.with_speed_loop(SPEED), "speed loop without an encoder"),
            (WHEEL.with_speed_loop(bad_gain), "kp"),
        ] {
            assert_eq!(config.validate(), Err(PwmError(name)));
        }
    }
}
