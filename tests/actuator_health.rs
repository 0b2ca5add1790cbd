//! A motor of one's own is watched with the same checks as the others, as far as it tells what it knows.

#![cfg(test)]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, ArmError, Claim, Condition, Devices, DriveProtocol, HealthConfig, Ingest, MotorName,
    Order, Reaction, TargetError, VelocityDrive, Vitals,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::{Frame, Id, StandardId};
use proptest::prelude::*;
use std::cell::Cell;
use std::rc::Rc;

/// Reports what the last frame said: temperature, error code, effort and speed in percent. Keeps the share of its last frame.
#[derive(Default)]
struct Talker {
    vitals: Vitals,
    share: f32,
    is_frozen: bool,
    /// Reported instead of what the frame said.
    instead: Rc<Cell<Option<Vitals>>>,
}

fn id(raw: u16) -> Id {
    StandardId::new(raw).unwrap().into()
}

impl DriveProtocol for Talker {
    fn name(&self) -> MotorName {
        MotorName::new("talker", 1)
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        [Claim::command(id(0x123), self.name()), Claim::feedback(id(0x124), self.name())]
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [celsius, code, effort, speed] = *frame.data() else {
            return Ingest::WrongLength(frame.length());
        };
        self.vitals = Vitals {
            temperature_c: Some(celsius.into()),
            has_fault: code >= 10,
            has_warning: (1..10).contains(&code),
            error_code: code,
            effort: f32::from(effort.cast_signed()) / 100.0,
            speed: f32::from(speed.cast_signed()) / 100.0,
            current: 0.0,
        };
        Ingest::Taken
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::ZERO
    }
    fn rest(&mut self) -> CanFrame {
        self.share = 0.0;
        CanFrame::of(id(0x123), [0; 8])
    }
    fn control(&mut self, order: Order) -> CanFrame {
        (self.share, self.is_frozen) = (order.share, order.step.is_frozen());
        CanFrame::of(id(0x123), [100; 8])
    }
    fn reset(&mut self) {}
    fn vitals(&self) -> Vitals {
        self.instead.get().unwrap_or(self.vitals)
    }
}

struct Bench {
    own: Actuator<Talker>,
    ms: u64,
}

impl Bench {
    fn new(config: &'static HealthConfig) -> Self {
        let talker = Talker { share: 1.0, ..Talker::default() };
        let own = Actuator::new(talker).with_health(config).unwrap().with_opening(Duration::ZERO);
        let mut bench = Self { own, ms: 0 };
        bench.step([30, 0, 0, 0]);
        bench.own.arm(bench.now()).unwrap();
        bench
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.ms * 1_000)
    }

    /// A millisecond with this feedback; whether the command that follows drives.
    fn step(&mut self, feedback: [u8; 4]) -> bool {
        self.ms += 1;
        let frame = CanFrame::new(id(0x124), &feedback).unwrap();
        assert_eq!(self.own.ingest(&frame, self.now()), Ingest::Taken);
        _ = self.own.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        self.own.update(Tick::new(self.now(), 0.001));
        self.own.next_frame(0).is_some_and(|frame| *frame.bytes() != [0; 8])
    }

    /// Until a temperature has been looked at.
    fn wait(&mut self, celsius: u8) {
        for _ in 0..8 {
            self.step([celsius, 0, 0, 0]);
        }
    }

    fn edges(&mut self) -> Vec<(Condition, bool)> {
        std::iter::from_fn(|| self.own.next_edge())
            .map(|edge| (edge.condition, edge.began))
            .collect()
    }
}

static USUAL: HealthConfig = HealthConfig::new().with_temperatures(80, 100);

#[test]
fn heat_takes_output_away_and_then_all_of_it() {
    let mut bench = Bench::new(&USUAL);
    for (celsius, drives, share) in [(79, true, 1.0), (90, true, 0.5), (100, false, 0.0)] {
        bench.wait(celsius);
        assert_eq!(bench.step([celsius, 0, 0, 0]), drives, "{celsius}");
        assert!((bench.own.motor().share - share).abs() < 1e-6, "{celsius}");
    }
    bench.wait(95);
    assert!(!bench.step([95, 0, 0, 0]), "hysteresis");
    bench.wait(94);
    assert!(bench.step([94, 0, 0, 0]));
    let edges = bench.edges();
    let expected = [(Condition::Warm, true), (Condition::Hot, true), (Condition::Hot, false)];
    assert_eq!(edges, expected);
}

#[test]
fn heat_is_looked_at_after_the_clock_went_back_too() {
    let mut bench = Bench::new(&USUAL);
    for _ in 0..5_000 {
        assert!(bench.step([30, 0, 0, 0]));
    }
    assert_eq!(bench.own.health().feedback_hz, 1_000);
    bench.ms -= 4_000;
    for _ in 0..1_200 {
        assert!(!bench.step([30, 0, 0, 0]), "tripped");
    }
    assert_eq!(bench.own.health().feedback_hz, 1_000);
    bench.own.arm(bench.now()).unwrap();
    assert!(bench.step([30, 0, 0, 0]));
    bench.wait(100);
    assert!(!bench.step([100, 0, 0, 0]));
}

#[test]
fn a_fault_relaxes_until_it_is_gone_and_armed_and_a_warning_does_not() {
    let mut bench = Bench::new(&USUAL);
    assert!(bench.step([30, 3, 0, 0]) && bench.step([30, 0, 0, 0]));
    assert_eq!(bench.edges(), [(Condition::Warning, true), (Condition::Warning, false)]);
    assert!(!bench.step([30, 10, 0, 0]) && !bench.step([30, 11, 0, 0]));
    assert!(matches!(bench.own.arm(bench.now()), Err(ArmError::Faulty(_))));
    assert!(!bench.step([30, 0, 0, 0]), "latched");
    assert_eq!(bench.own.set_velocity((), AngularVelocity::ZERO), Err(TargetError::Relaxed));
    assert_eq!(bench.own.arm(bench.now()), Err(ArmError::NotReleased));
    for _ in 0..100 {
        assert!(!bench.step([30, 0, 0, 0]));
    }
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
    assert!(bench.step([30, 0, 0, 0]));
    let edges = bench.edges();
    assert_eq!(edges, [(Condition::Fault, true), (Condition::Fault, false)]);
}

/// In the update that sees the code, and once for each code of a severity.
#[test]
fn an_error_is_an_edge_as_its_code_changes_and_one_without_a_code_counts_too() {
    use Condition::{Fault, Warning};
    let mut bench = Bench::new(&USUAL);
    for _ in 0..20 {
        bench.step([30, 0, 0, 0]);
    }
    for (number, (code, drives, expected)) in [
        (3, true, &[(Warning, true)][..]),
        (3, true, &[]),
        (4, true, &[(Warning, true)]),
        (4, true, &[]),
        (10, false, &[(Warning, false), (Fault, true)]),
        (10, false, &[]),
        (11, false, &[(Fault, true)]),
        (11, false, &[]),
        (0, false, &[(Fault, false)]),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!(bench.step([30, code, 0, 0]), drives, "{number}");
        let edges = bench.edges();
        assert_eq!(edges.len(), expected.len(), "{number}: {edges:?}");
        assert!(expected.iter().all(|edge| edges.contains(edge)), "{number}: {edges:?}");
    }
    let error_code = 5;
    for (vitals, drives, expected) in [
        (Vitals { error_code, ..Vitals::default() }, true, &[][..]),
        (Vitals { has_warning: true, ..Vitals::default() }, true, &[(Warning, true)]),
        (Vitals { has_fault: true, ..Vitals::default() }, false, &[(Fault, true)]),
    ] {
        let mut bench = Bench::new(&USUAL);
        for _ in 0..20 {
            assert!(bench.step([30, 0, 0, 0]));
        }
        bench.own.motor().instead.set(Some(vitals));
        assert_eq!(bench.step([30, 0, 0, 0]), drives, "{vitals:?}");
        assert_eq!(bench.edges(), expected, "{vitals:?}");
        assert_eq!(bench.own.health().error_code, vitals.error_code);
    }
}

/// 80 ms have ten checks, one each 8 ms. A motor at half of its speed does not stall.
#[test]
fn a_check_that_finds_an_armed_motor_at_its_limit_is_counted() {
    let mut bench = Bench::new(&USUAL);
    let mut counted = |code, effort: i8, speed: i8, disarms: bool| {
        if disarms {
            bench.own.disarm();
        }
        for _ in 0..80 {
            bench.step([30, code, effort.cast_unsigned(), speed.cast_unsigned()]);
        }
        bench.own.health().saturated
    };
    assert_eq!(counted(0, 99, 50, false), 0);
    assert_eq!(counted(0, 100, 50, false), 10);
    assert_eq!(counted(0, -120, -50, false), 20);
    assert_eq!(counted(3, 100, 50, false), 30, "also while a condition holds");
    assert_eq!(counted(0, 100, 50, true), 30);
}

#[test]
fn a_stall_is_reported_or_relaxes() {
    static RELAX: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Stalled, Reaction::Relax);
    for (config, relaxes) in [(&USUAL, false), (&RELAX, true)] {
        let mut bench = Bench::new(config);
        let driven = (0..600).filter(|_| bench.step([30, 0, 90, 1])).count();
        assert_eq!(driven < 600, relaxes, "{driven}");
        assert_eq!(bench.edges(), [(Condition::Stalled, true)]);
    }
}

#[test]
fn a_second_master_refuses_arming_names_the_frame_and_is_forgotten() {
    let mut bench = Bench::new(&USUAL);
    let rival = CanFrame::new(id(0x123), &[7; 8]).unwrap();
    assert_eq!(bench.own.ingest(&rival, bench.now()), Ingest::Unrelated);
    assert!(bench.step([30, 0, 0, 0]), "reported only");
    assert_eq!(bench.edges(), [(Condition::SecondMaster, true)]);
    bench.own.disarm();
    let refused = bench.own.arm(bench.now()).map_err(|error| error.to_string());
    assert_eq!(refused, Err("another node sends the command of talker #1 on 0x123".into()));
    for _ in 0..1_001 {
        bench.step([30, 0, 0, 0]);
    }
    assert_eq!(bench.edges(), [(Condition::SecondMaster, false)]);
    assert_eq!(bench.own.arm(bench.now()), Ok(()));
}

#[test]
fn silence_is_an_edge_and_health_fits_a_line() {
    let mut bench = Bench::new(&USUAL);
    for _ in 0..2_500 {
        bench.step([30, 0, 0, 0]);
    }
    assert_eq!(bench.edges(), []);
    for _ in 0..110 {
        bench.ms += 1;
        bench.own.update(Tick::new(bench.now(), 0.001));
    }
    let edges: Vec<_> = std::iter::from_fn(|| bench.own.next_edge())
        .map(|edge| (edge.condition, edge.at))
        .collect();
    let [(Condition::Late, late), (Condition::CommandLost, _), (Condition::Offline, offline)] =
        edges[..]
    else {
        panic!("{edges:?}")
    };
    assert_eq!(late.as_micros() / 1_024, 2_512_000 / 1_024);
    assert_eq!(offline.as_micros() / 1_024, 2_602_000 / 1_024);
    let line = bench.own.health().to_string();
    let start = "talker #1: offline, disarmed, late, offline, command lost; 1000 Hz, gap 992 us, 30 C, error 0;";
    assert!(line.starts_with(start), "{line}");
}

/// A hundredth and anything that `f32` can hold.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-300..300_i16).prop_map(|percent| f32::from(percent) / 100.0),
        any::<u32>().prop_map(f32::from_bits),
    ]
}

proptest! {
    /// Law: the share of an order is 0 to 1, and a number, whatever the motor tells, however its health is configured, however it
    /// opens, and whatever its clock shows.
    #[test]
    fn the_share_of_an_order_is_a_number_from_0_to_1(
        hold in number(),
        temperatures in prop_oneof![(0..120_i16, 0..120_i16), any::<(i16, i16)>()],
        opening_us in prop_oneof![0..400_000_u64, any::<u64>()],
        steps in prop::collection::vec(
            (prop::option::of(any::<i16>()), -20..130_i16, number(), number(), 0..30_000_u64),
            1..60,
        ),
    ) {
        let config = HealthConfig::new()
            .with_temperatures(temperatures.0, temperatures.1)
            .with_stall(0.1, 0.5, Duration::from_millis(5))
            .with_stall_hold(hold);
        let talker = Talker::default();
        let told = Rc::clone(&talker.instead);
        let own = Actuator::new(talker).with_opening(Duration::from_micros(opening_us));
        // One that makes no sense is refused, and that of the start is left.
        let mut own = match own.with_health(Box::leak(Box::new(config))) {
            Ok(own) => own,
            Err(parameter) => {
                let broken = !(0.0..=1.0).contains(&hold) || temperatures.0 >= temperatures.1;
                prop_assert!(broken, "{}", parameter);
                return Ok(());
            }
        };
        prop_assert!((0.0..=1.0).contains(&hold));
        let mut us = 1_000;
        for (any_celsius, celsius, effort, speed, gap_us) in steps {
            us += gap_us;
            let now = Instant::from_micros(us);
            let frame = CanFrame::new(id(0x124), &[0; 4]).unwrap();
            _ = own.ingest(&frame, now);
            let temperature_c = any_celsius.or(Some(celsius));
            let vitals = Vitals { temperature_c, effort, speed, ..Vitals::default() };
            told.set(Some(vitals));
            _ = own.arm(now);
            _ = own.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
            own.update(Tick::new(now, 0.001));
            while own.next_frame(0).is_some() {}
            let share = own.motor().share;
            prop_assert!((0.0..=1.0).contains(&share), "{} of {:?}", share, vitals);
        }
    }
}

/// A loop that takes the rate of a measurement from before late feedback would kick.
#[test]
fn the_first_step_after_late_feedback_is_frozen() {
    let mut bench = Bench::new(&USUAL);
    let is_frozen = |bench: &Bench| bench.own.motor().is_frozen;
    assert!((0..20).all(|_| bench.step([30, 0, 0, 0]) && !is_frozen(&bench)));
    bench.ms += 14;
    bench.own.update(Tick::new(bench.now(), 0.014));
    assert!(bench.step([30, 0, 0, 0]) && is_frozen(&bench));
    assert!(bench.step([30, 0, 0, 0]) && !is_frozen(&bench));
}
