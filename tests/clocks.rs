//! No sequence of clock values drives a motor longer than its command deadline.
//!
//! Every device runs under random clocks that wrap early, swing, jump and stand, with an application that may stop at any
//! moment. The reference is written down here, in 64-bit times: see [`Reference`].

#![cfg(test)]

use drivetrain::control::TimeStep;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, Devices, Own, TargetError, VelocityDrive};
use drivetrain::snake::{self, Command, Joint, Joints, Register, Reply};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};
use embedded_can::Frame;

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../examples/custom_motor.rs"]
mod custom_motor;
use custom_motor::MyMotor;

const DEADLINE_US: u64 = 100_000;
const PAUSE_US: u64 = 100_000;
/// A program that stalls did not release its switch.
const LONGEST_STEP_US: u64 = 20_000;

/// A device with one motor, or several that do the same.
trait Subject {
    fn hear(&mut self, now: Instant);
    fn arm(&mut self, now: Instant) -> Result<(), ArmError>;
    fn is_armed(&mut self) -> bool;
    fn set(&mut self) -> Result<(), TargetError>;
    /// Runs an update and takes every frame; tells whether one of them, or an output, asks for something.
    fn drives(&mut self, tick: Tick) -> bool;
}

struct Wheel(Bus, Handle<M3508>);

impl Wheel {
    fn new(id: u8) -> Self {
        let mut bus = Bus::new();
        let wheel = bus.attach(Config::<M3508>::new(id)).unwrap();
        Self(bus, wheel)
    }
}

fn is_driving(frame: &CanFrame) -> bool {
    *frame.bytes() != [0; 8]
}

impl Subject for Wheel {
    fn hear(&mut self, now: Instant) {
        _ = self.0.ingest(&CanFrame::standard(0x201, [0; 8]).unwrap(), now);
    }
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        self.0.arm(now)
    }
    fn is_armed(&mut self) -> bool {
        self.0.is_armed()
    }
    fn set(&mut self) -> Result<(), TargetError> {
        self.0.set_current(self.1, Current::from_amperes(5.0))
    }
    fn drives(&mut self, tick: Tick) -> bool {
        self.0.update(tick);
        core::iter::from_fn(|| self.0.next_frame()).filter(is_driving).count() > 0
    }
}

/// A bus and a motor of one's own, as one device.
struct Both(Bus, Handle<M3508>, Own<MyMotor>);

impl Both {
    fn new() -> Self {
        let Wheel(bus, wheel) = Wheel::new(1);
        Self(bus, wheel, Own::new(MyMotor::new(3).unwrap()))
    }
}

impl Subject for Both {
    fn hear(&mut self, now: Instant) {
        let own = embedded_can::StandardId::new(0x143).unwrap();
        for frame in
            [CanFrame::standard(0x201, [0; 8]).unwrap(), CanFrame::new(own, &[0, 0, 30]).unwrap()]
        {
            _ = (&mut self.0, &mut self.2).ingest(&frame, now);
        }
    }
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        (&mut self.0, &mut self.2).arm(now)
    }
    fn is_armed(&mut self) -> bool {
        // Either part, as with targets.
        self.0.is_armed() || Devices::is_armed(&mut self.2)
    }
    fn set(&mut self) -> Result<(), TargetError> {
        let own = self.2.set_velocity((), AngularVelocity::from_rpm(100.0));
        let dji = self.0.set_current(self.1, Current::from_amperes(5.0));
        // A target that either takes is one.
        own.or(dji)
    }
    fn drives(&mut self, tick: Tick) -> bool {
        let mut both = (&mut self.0, &mut self.2);
        both.update(tick);
        core::iter::from_fn(|| both.next_frame(0)).filter(is_driving).count() > 0
    }
}

struct Snake(Joints, Joint);

impl Snake {
    fn new() -> Self {
        let mut joints = Joints::new();
        let joint = joints.attach(snake::Config::new(5)).unwrap();
        Self(joints, joint)
    }
}

impl Subject for Snake {
    fn hear(&mut self, now: Instant) {
        let id = embedded_can::StandardId::new(5).unwrap();
        let reply = Reply::new(Register::ActualPosition, 0).encode();
        _ = self.0.ingest(&CanFrame::new(id, &reply).unwrap(), now);
    }
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        self.0.arm(now)
    }
    fn is_armed(&mut self) -> bool {
        Devices::is_armed(&mut self.0)
    }
    fn set(&mut self) -> Result<(), TargetError> {
        self.0.set_position(self.1, Position::from_angle(Angle::from_degrees(5.0)))
    }
    fn drives(&mut self, tick: Tick) -> bool {
        self.0.update(tick);
        let is_safe =
            |frame: &CanFrame| Command::decode(frame.data()).is_some_and(Command::is_safe);
        let unsafe_frames =
            core::iter::from_fn(|| self.0.next_frame()).filter(|frame| !is_safe(frame));
        unsafe_frames.count() > 0 || self.0.state(self.1).is_some_and(|state| state.is_driven)
    }
}

#[cfg(feature = "hal")]
mod pins {
    use super::*;
    use drivetrain::pwm::{Brushed, BrushedConfig, OnePin, RcConfig, RcPwm};
    use drivetrain::time::Duration;
    use embedded_hal::{digital, pwm};
    use std::convert::Infallible;

    pub(super) struct Pin(u16);

    impl digital::ErrorType for Pin {
        type Error = Infallible;
    }
    impl digital::OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
        fn set_high(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }
    impl pwm::ErrorType for Pin {
        type Error = Infallible;
    }
    impl pwm::SetDutyCycle for Pin {
        fn max_duty_cycle(&self) -> u16 {
            20_000
        }
        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
            self.0 = duty;
            Ok(())
        }
    }

    /// The ESC takes no time to arm.
    pub(super) fn esc() -> RcPwm<Pin> {
        RcPwm::new(Pin(0), RcConfig::new().with_arming_time(Duration::ZERO)).unwrap()
    }

    impl Subject for RcPwm<Pin> {
        fn hear(&mut self, _now: Instant) {}
        fn arm(&mut self, _now: Instant) -> Result<(), ArmError> {
            Self::arm(self)
        }
        fn is_armed(&mut self) -> bool {
            Self::is_armed(self)
        }
        fn set(&mut self) -> Result<(), TargetError> {
            self.set_throttle(1.0)
        }
        fn drives(&mut self, tick: Tick) -> bool {
            self.update(tick).unwrap();
            self.channel().0 != 1_500
        }
    }

    pub(super) fn brushed() -> Brushed<Pin, OnePin<Pin>> {
        let config = BrushedConfig::new(1).with_encoder(2_000.0, 16);
        Brushed::new(Pin(0), OnePin(Pin(0)), config).unwrap()
    }

    impl Subject for Brushed<Pin, OnePin<Pin>> {
        fn hear(&mut self, now: Instant) {
            self.ingest_counts(0, now);
        }
        fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
            Self::arm(self, now)
        }
        fn is_armed(&mut self) -> bool {
            Self::is_armed(self)
        }
        fn set(&mut self) -> Result<(), TargetError> {
            self.set_duty(1.0)
        }
        fn drives(&mut self, tick: Tick) -> bool {
            self.update(tick).unwrap();
            self.channel().0 != 0
        }
    }
}

/// The least that every device must keep, in full times.
#[derive(Debug, Default)]
struct Reference {
    /// The time of the last update.
    updated: Option<u64>,
    armed_at: u64,
    is_armed: bool,
    /// The sum of the forward steps since the target was set last; `None` without a target.
    driven_us: Option<u64>,
    /// No update since the target was set: the clock of the next one was read before that.
    is_new: bool,
    /// A trip that no arming has taken back.
    tripped: bool,
    /// The updates since the last request to arm, the last trip and the last update without time.
    quiet_us: u64,
}

impl Reference {
    fn arm(&mut self, now: u64, outcome: Result<(), ArmError>, is_armed: bool) {
        let paused = self.quiet_us >= PAUSE_US;
        assert!(outcome.is_err() || paused || !self.tripped, "armed at {now}: {self:?}");
        self.quiet_us = 0;
        if outcome.is_ok() {
            (self.tripped, self.is_armed, self.armed_at) = (false, is_armed, now);
        }
    }

    fn set(&mut self, outcome: Result<(), TargetError>) {
        assert!(outcome.is_err() || !self.tripped, "a target is taken: {self:?}");
        if outcome.is_ok() {
            (self.driven_us, self.is_new) = (Some(0), true);
        }
    }

    fn update(&mut self, now: u64, drives: bool, is_armed: bool) {
        let step = self.updated.map_or(Some(0), |updated| now.checked_sub(updated));
        let moved_on = now >= self.armed_at && (self.updated.is_none() || step > Some(0));
        self.updated = Some(now);
        self.quiet_us += step.unwrap_or(0).min(LONGEST_STEP_US);
        if !moved_on {
            (self.driven_us, self.quiet_us) = (None, 0);
            self.armed_at = self.armed_at.min(now);
            assert!(!is_armed, "armed without time at {now}: {self:?}");
        }
        // The application never disarms.
        if core::mem::replace(&mut self.is_armed, is_armed) && !is_armed {
            (self.tripped, self.quiet_us) = (true, 0);
        }
        let Some(driven_us) = &mut self.driven_us else {
            assert!(!drives, "driven without a target at {now}: {self:?}");
            return;
        };
        if !core::mem::take(&mut self.is_new) {
            *driven_us += step.unwrap_or(0);
        }
        let is_young = *driven_us <= DEADLINE_US;
        assert!(!drives || is_young, "driven for too long at {now}: {self:?}");
    }
}

/// xorshift64.
struct Random(u64);

impl Random {
    /// Below 2^`lowest` to 2^(`lowest` + `spread` - 1), each of these as often.
    fn of_any_size(&mut self, lowest: u64, spread: u64) -> u64 {
        let bits = lowest + self.below(spread);
        self.below(1 << bits)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

/// One clock, as it is wrong in some way.
enum Clock {
    Wraps(u64),
    Swings(u64),
    Jumps,
    Stands,
    Right,
}

impl Clock {
    fn draw(random: &mut Random) -> Self {
        match random.below(5) {
            0 => Self::Wraps(1 << (8 + random.below(25))),
            1 => Self::Swings(1 + random.of_any_size(0, 20)),
            2 => Self::Jumps,
            3 => Self::Stands,
            _ => Self::Right,
        }
    }

    fn read(&self, real: u64, before: u64, random: &mut Random) -> u64 {
        match self {
            Self::Wraps(period) => real % period,
            Self::Swings(by) => 1_000_000 + real % 2 * by,
            Self::Jumps if random.below(64) == 0 => u64::MAX - random.below(2),
            Self::Jumps if random.below(8) == 0 => random.of_any_size(4, 36),
            Self::Jumps => before.saturating_add(random.below(30_000)),
            Self::Stands if random.below(4) == 0 => before,
            Self::Stands => before + random.below(20_000),
            Self::Right => real,
        }
    }
}

/// Runs clocks of 40 updates each, every one on a device of its own.
fn run<S: Subject>(clocks: u64, make: impl Fn() -> S) -> [u64; 2] {
    let (mut driven, mut tripped) = (0, 0);
    for seed in 1..=clocks {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let clock = Clock::draw(&mut random);
        // The application stops at some time: it sets no target and does not ask.
        let ends = random.below(40);
        let asks_always = random.below(2) == 0;
        let (mut subject, mut reference) = (make(), Reference::default());
        let (mut real, mut now) = (random.below(1 << 33), 0);
        for update in 0..40 {
            real += 1 + random.of_any_size(4, 13);
            now = clock.read(real, now, &mut random);
            let at = Instant::from_micros(now);
            subject.hear(at);
            if update < ends {
                if asks_always || random.below(8) == 0 {
                    let outcome = subject.arm(at);
                    reference.arm(now, outcome, subject.is_armed());
                }
                if random.below(3) != 0 {
                    reference.set(subject.set());
                }
            }
            let drives = subject.drives(Tick::new(at, 0.001));
            reference.update(now, drives, subject.is_armed());
            driven += u64::from(drives);
        }
        tripped += u64::from(reference.tripped);
    }
    [driven, tripped]
}

fn every_device(clocks: u64) {
    let show = |name: &str, [driven, tripped]: [u64; 2]| {
        println!("{name}: {clocks} clocks, {driven} updates driven, {tripped} tripped at the end");
        assert!(driven > clocks / 10 && tripped > clocks / 10, "{name} was not tried");
    };
    show("dji", run(clocks, || Wheel::new(1)));
    show("dji and own", run(clocks, Both::new));
    show("snake", run(clocks, Snake::new));
    #[cfg(feature = "hal")]
    {
        show("RC ESC", run(clocks, pins::esc));
        show("brushed", run(clocks, pins::brushed));
    }
}

#[test]
fn no_clock_drives_a_motor_longer_than_its_deadline() {
    every_device(4_000);
}

#[test]
#[ignore = "10^6 clocks: by .ci/run"]
fn a_million_clocks_drive_no_motor_longer_than_its_deadline() {
    every_device(200_000);
}

/// The reference finds what it is for.
#[test]
#[should_panic(expected = "driven for too long")]
fn a_target_that_outlives_its_deadline_is_found() {
    struct Immortal(bool);
    impl Subject for Immortal {
        fn hear(&mut self, _now: Instant) {}
        fn arm(&mut self, _now: Instant) -> Result<(), ArmError> {
            Ok(())
        }
        fn is_armed(&mut self) -> bool {
            true
        }
        fn set(&mut self) -> Result<(), TargetError> {
            self.0 = true;
            Ok(())
        }
        fn drives(&mut self, tick: Tick) -> bool {
            self.0 && !TimeStep::new(tick.dt_s(), 0.02).is_hold()
        }
    }
    let mut reference = Reference::default();
    let mut subject = Immortal(false);
    reference.set(subject.set());
    for ms in 0..200 {
        let drives = subject.drives(Tick::new(Instant::from_micros(1_000 * ms), 0.001));
        reference.update(1_000 * ms, drives, subject.is_armed());
    }
}
