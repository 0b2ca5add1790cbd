//! Armed again: nothing that was seen before counts after it.

use crate::at_ms;
use crate::own::{feedback, own};
use drivetrain::dji::{AnyHandle, Bus, Config, Gm6020Voltage, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{Condition, HealthConfig, Ingest, TargetError, VelocityDrive};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};

/// A current without a command while the speed rises by 0.3 of that without load within 0.5 s, for 0.1 s: a runaway.
/// Each spell is shorter, and rises by less.
const SPELL_MS: u64 = 80;

/// The speed in percent of that without load, `ms` after the beginning: 60 % in 160 ms.
fn rising(ms: u64) -> u64 {
    ms * 60 / (2 * SPELL_MS)
}

/// A DJI motor that is asked for nothing and turns faster and faster by a current of its own.
struct Dji {
    bus: Bus,
    motor: AnyHandle,
    ms: u64,
    angle: u16,
}

impl Dji {
    fn new() -> Self {
        Self::with(Config::new(1))
    }

    fn with(config: Config<M3508>) -> Self {
        let mut bus = Bus::new();
        let motor = bus.attach(config).unwrap().erase();
        let mut dji = Self { bus, motor, ms: 1_000, angle: 0 };
        // Slow, until the bus has looked at it.
        (0..50).for_each(|_| _ = dji.step(0, 0));
        dji
    }

    /// A millisecond; returns the word that was sent, if one was.
    fn step(&mut self, percent: u64, current: i16) -> Option<i16> {
        self.ms += 1;
        // 9000 rpm of the rotor is about its speed without load.
        let rpm = i16::try_from(percent * 90).unwrap();
        self.angle = (self.angle + 1) % 8_192;
        let ([a, b], [c, d], [e, f]) =
            (self.angle.to_be_bytes(), rpm.to_be_bytes(), current.to_be_bytes());
        let frame = CanFrame::standard(0x201, [a, b, c, d, e, f, 30, 0]).unwrap();
        assert_eq!(self.bus.ingest(&frame, at_ms(self.ms)), Ingest::Taken);
        self.bus.update(Tick::new(at_ms(self.ms), 0.001));
        let frame = self.bus.next_frame()?;
        Some(i16::from_be_bytes([frame.bytes()[0], frame.bytes()[1]]))
    }

    fn spell(&mut self, from_ms: u64) {
        for ms in from_ms..from_ms + SPELL_MS {
            self.step(rising(ms), 8_000);
        }
    }

    fn ran_away(&self) -> bool {
        self.bus.conditions(self.motor).contains(Condition::Runaway)
    }
}

// The timers of the checks were kept over an arming: a motor that had been at the limit for nearly long enough before was
// relaxed at once after it, and no test noticed.
#[test]
fn a_runaway_that_was_nearly_noticed_before_arming_begins_anew() {
    // Both spells in one: it is noticed, or what follows would show nothing.
    let mut dji = Dji::new();
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    dji.spell(0);
    assert!(!dji.ran_away(), "too short");
    dji.spell(SPELL_MS);
    assert!(dji.ran_away() && !dji.bus.is_armed());
    // Armed again between them, in each of the ways there are.
    let ways: [fn(&mut Dji); 2] = [
        |dji| dji.bus.arm(at_ms(dji.ms)).unwrap(),
        |dji| dji.bus.arm_only(&[dji.motor], at_ms(dji.ms)).unwrap(),
    ];
    for arm in ways {
        let mut dji = Dji::new();
        arm(&mut dji);
        dji.spell(0);
        dji.bus.disarm();
        arm(&mut dji);
        dji.spell(SPELL_MS);
        assert!(!dji.ran_away() && dji.bus.is_armed());
    }
}

/// What happens between the two spells.
#[derive(Clone, Copy, PartialEq)]
enum Between {
    Nothing,
    Arming,
    Silence,
}

#[test]
fn so_it_does_for_a_motor_of_ones_own() {
    let runs_away = |between: Between| {
        let mut motor = own(1);
        let mut now = 1_000;
        for ms in 0..50 + 2 * SPELL_MS {
            if ms == 50 + SPELL_MS {
                match between {
                    Between::Nothing => {}
                    Between::Arming => {
                        motor.disarm();
                        motor.arm(at_ms(now)).unwrap();
                    }
                    // Late, not lost: it stays armed.
                    Between::Silence => (0..40).for_each(|_| {
                        now += 1;
                        motor.update(Tick::new(at_ms(now), 0.001));
                    }),
                }
            }
            now += 1;
            let (current, speed) = if ms < 50 { (0, 0) } else { (50, rising(ms - 50)) };
            let frame = feedback(1, 0, current, i8::try_from(speed).unwrap());
            assert_eq!(motor.ingest(&frame, at_ms(now)), Ingest::Taken);
            if ms == 20 {
                motor.arm(at_ms(now)).unwrap();
            }
            motor.update(Tick::new(at_ms(now), 0.001));
            _ = motor.next_frame(0);
        }
        let ran_away = motor.guard().conditions().contains(Condition::Runaway);
        assert_eq!(motor.guard().is_armed(), !ran_away);
        ran_away
    };
    assert!(runs_away(Between::Nothing));
    assert!(!runs_away(Between::Arming));
    assert!(!runs_away(Between::Silence));
}

/// What a motor ran away with before is over when it is armed: it is looked for anew.
#[test]
fn a_runaway_is_over_when_the_motor_is_armed_again() {
    let mut dji = Dji::new();
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    dji.spell(0);
    dji.spell(SPELL_MS);
    assert!(dji.ran_away());
    (0..200).for_each(|_| _ = dji.step(60, 0));
    assert!(dji.ran_away() && !dji.bus.is_armed(), "it waits to be armed");
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    assert!(!dji.ran_away() && dji.bus.is_armed());
    (0..50).for_each(|_| _ = dji.step(60, 0));
    assert!(!dji.ran_away() && dji.bus.is_armed());
}

#[test]
fn a_silence_lets_a_runaway_begin_anew_too() {
    let mut dji = Dji::new();
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    dji.spell(0);
    // Late, not lost: it stays armed.
    for _ in 0..40 {
        dji.ms += 1;
        dji.bus.update(Tick::new(at_ms(dji.ms), 0.001));
    }
    dji.spell(SPELL_MS);
    assert!(!dji.ran_away() && dji.bus.is_armed());
}

/// Heard for the first time outside of its soft limits, armed at once and driven outward: not even in the first update.
#[test]
fn a_motor_that_is_armed_outside_of_its_soft_limits_is_driven_inward_only() {
    static LIMITS: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_degrees(60.0), Angle::from_degrees(300.0));
    for (angle, outward) in [(683_u16, -1_i16), (7_509, 1)] {
        for sign in [1, -1] {
            let mut bus = Bus::new();
            let yaw = bus.attach(Config::<Gm6020Voltage>::new(1).with_health(&LIMITS)).unwrap();
            let [a, b] = angle.to_be_bytes();
            let frame = CanFrame::standard(0x205, [a, b, 0, 0, 0, 0, 30, 0]).unwrap();
            let mut words = Vec::new();
            for ms in 1_000..1_300 {
                assert_eq!(bus.ingest(&frame, at_ms(ms)), Ingest::Taken);
                if ms == 1_000 {
                    bus.arm(at_ms(ms)).unwrap();
                }
                bus.set_raw(yaw, sign * 10_000).unwrap();
                bus.update(Tick::new(at_ms(ms), 0.001));
                let sent = std::iter::from_fn(|| bus.next_frame());
                words.extend(sent.map(|frame| {
                    let [a, b, ..] = *frame.bytes();
                    i16::from_be_bytes([a, b]).signum()
                }));
            }
            let inward = sign != outward;
            assert!(words.iter().all(|word| *word == 0 || (inward && *word == sign)), "{words:?}");
            assert_eq!(words.contains(&sign), inward, "{angle} {sign}");
        }
    }
}

#[test]
fn no_target_from_before_acts_after_arming_again() {
    let mut dji = Dji::new();
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    dji.bus.set_raw(dji.motor, 5_000).unwrap();
    dji.step(0, 0);
    dji.bus.disarm();
    assert_eq!(dji.bus.set_raw(dji.motor, 5_000), Err(TargetError::Disarmed));
    dji.bus.arm(at_ms(dji.ms)).unwrap();
    let mut motor = own(1);
    assert_eq!(motor.ingest(&feedback(1, 0, 0, 0), at_ms(1)), Ingest::Taken);
    motor.arm(at_ms(1)).unwrap();
    motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0)).unwrap();
    motor.update(Tick::new(at_ms(2), 0.001));
    let (runs, resets) = (motor.motor().runs, motor.motor().resets);
    assert!(runs > 0);
    motor.disarm();
    motor.arm(at_ms(2)).unwrap();
    assert!(motor.motor().resets > resets, "the loop starts from rest");
    for ms in 3..300 {
        assert_eq!(motor.ingest(&feedback(1, 0, 0, 0), at_ms(ms)), Ingest::Taken);
        motor.update(Tick::new(at_ms(ms), 0.001));
        dji.step(0, 0);
        dji.bus.update(Tick::new(at_ms(dji.ms) + Duration::from_micros(500), 0.001));
        while let Some(frame) = dji.bus.next_frame() {
            assert_eq!(*frame.bytes(), [0; 8]);
        }
    }
    assert_eq!(motor.motor().runs, runs);
}
