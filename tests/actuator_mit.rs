//! A motor in MIT mode rests by its own frame: each frame after a disarm, an emergency stop, a trip, a lost target, lost feedback,
//! a bad time step or a clock that goes back is read by a decoder of its own, written from the protocol's formulas.

#![cfg(test)]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Capabilities, Claim, Devices, DriveProtocol, Ingest, MotorName, Order,
    TargetError, VelocityDrive, Vitals,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};
use proptest::prelude::*;

#[path = "mit_motor/mod.rs"]
mod mit_motor;
use mit_motor::J4310;

const MASTER_ID: u16 = 0x010;

/// What a Damiao DM-J4310 reads in a frame, by its manual: `x = n * (max - min) / (2^bits - 1) + min`.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Read {
    Enable,
    /// Disables it, or clears its error and leaves it disabled.
    Disable,
    Command {
        position_rad: f64,
        velocity_rad_per_s: f64,
        kp: f64,
        kd: f64,
        torque_nm: f64,
    },
}

const TORQUE_MAX_NM: f64 = 10.0;

fn position_rad(count: u16) -> f64 {
    f64::from(count) * 25.0 / 65_535.0 - 12.5
}

impl Read {
    fn of(frame: &CanFrame) -> Self {
        assert!(frame.is_data_frame() && frame.length() == 8, "{frame:?}");
        let bits = u64::from_be_bytes(*frame.bytes());
        match bits {
            0xFFFF_FFFF_FFFF_FFFC => return Self::Enable,
            0xFFFF_FFFF_FFFF_FFFB | 0xFFFF_FFFF_FFFF_FFFD => return Self::Disable,
            _ => {}
        }
        let field = |lowest: u32, min: f64, max: f64| {
            let count = bits >> lowest & 0xFFF;
            count as f64 * (max - min) / 4_095.0 + min
        };
        Self::Command {
            position_rad: position_rad((bits >> 48) as u16),
            velocity_rad_per_s: field(36, -30.0, 30.0),
            kp: field(24, 0.0, 500.0),
            kd: field(12, 0.0, 5.0),
            torque_nm: field(0, -TORQUE_MAX_NM, TORQUE_MAX_NM),
        }
    }

    /// No stiffness, no damping, and a torque within half a count of zero; or disabled.
    fn is_rest(self) -> bool {
        match self {
            Self::Enable => false,
            Self::Disable => true,
            Self::Command { kp, kd, torque_nm, .. } => {
                let half_a_count_nm = 0.5 * 2.0 * TORQUE_MAX_NM / 4_095.0;
                kp == 0.0 && kd == 0.0 && torque_nm.abs() <= half_a_count_nm + 1e-12
            }
        }
    }

    fn drives(self) -> bool {
        matches!(self, Self::Command { .. }) && !self.is_rest()
    }
}

/// A motor #1 in MIT mode.
trait Mit: DriveProtocol {
    fn make() -> Self;
}

impl Mit for J4310 {
    fn make() -> Self {
        Self::new(1, MASTER_ID).unwrap()
    }
}

/// The same motor with eight zero bytes at rest.
struct EightZeros(J4310);

impl Mit for EightZeros {
    fn make() -> Self {
        Self(J4310::make())
    }
}

impl DriveProtocol for EightZeros {
    fn name(&self) -> MotorName {
        self.0.name()
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        self.0.claims()
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        self.0.decode(frame)
    }
    fn velocity(&self) -> AngularVelocity {
        self.0.velocity()
    }
    fn angle(&self) -> Option<Angle> {
        self.0.angle()
    }
    fn rest(&mut self) -> CanFrame {
        CanFrame::of(id(1), [0; 8])
    }
    fn control(&mut self, order: Order) -> CanFrame {
        self.0.control(order)
    }
    fn reset(&mut self) {
        self.0.reset();
    }
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        self.0.enable(sent)
    }
    fn disable(&mut self) -> Option<CanFrame> {
        self.0.disable()
    }
    fn is_enabled(&self) -> Option<bool> {
        self.0.is_enabled()
    }
    fn capabilities(&self) -> Capabilities {
        self.0.capabilities()
    }
    fn vitals(&self) -> Vitals {
        self.0.vitals()
    }
}

fn own(number: u8) -> Actuator<J4310> {
    Actuator::new(J4310::new(number, MASTER_ID).unwrap())
}

fn id(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

const DISABLED: u8 = 0;
const ENABLED: u8 = 1;
const OVERLOAD: u8 = 14;

/// An answer of drive #1 in this state, turned by this much: velocity and torque near zero.
fn answer(status: u8, position: u16) -> CanFrame {
    let [a, b] = position.to_be_bytes();
    CanFrame::of(id(MASTER_ID), [status << 4 | 1, a, b, 0x7F, 0xF7, 0xFF, 40, 35])
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Torque,
    Velocity,
    Angle,
}

const KINDS: [Kind; 3] = [Kind::Torque, Kind::Velocity, Kind::Angle];

/// A motor, its drive, and a clock.
struct Bench<M> {
    own: Actuator<M>,
    micros: u64,
    /// What the drive follows.
    is_enabled: bool,
}

impl<M: Mit> Bench<M> {
    fn new() -> Self {
        Self { own: Actuator::new(M::make()), micros: 1_000_000, is_enabled: false }
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.micros)
    }

    fn hear(&mut self, status: u8) -> Ingest {
        let now = self.now();
        self.own.ingest(&answer(status, 0x9000), now)
    }

    fn hear_drive(&mut self) {
        let status = if self.is_enabled { ENABLED } else { DISABLED };
        assert_eq!(self.hear(status), Ingest::Taken);
    }

    fn set(&mut self, kind: Kind, share: f32) -> Result<(), TargetError> {
        match kind {
            Kind::Torque => self.own.set_torque(3.0 * share),
            Kind::Velocity => {
                self.own.set_velocity((), AngularVelocity::from_rad_per_s(6.0 * share))
            }
            Kind::Angle => self.own.set_angle((), Angle::from_turns(0.25 + share / 4.0)),
        }
    }

    fn update(&mut self, dt_s: f32) -> Vec<Read> {
        let tick = Tick::new(self.now(), dt_s);
        self.own.update(tick);
        self.drain()
    }

    fn drain(&mut self) -> Vec<Read> {
        std::iter::from_fn(|| self.take()).collect()
    }

    fn take(&mut self) -> Option<Read> {
        let read = Read::of(&self.own.next_frame(0)?);
        match read {
            Read::Enable => self.is_enabled = true,
            Read::Disable => self.is_enabled = false,
            Read::Command { .. } => {}
        }
        Some(read)
    }

    /// A millisecond with feedback and target.
    fn live(&mut self, kind: Kind) -> Vec<Read> {
        self.micros += 1_000;
        self.hear_drive();
        _ = self.set(kind, 1.0);
        self.update(0.001)
    }

    /// Armed, and driven for a while.
    fn driving(kind: Kind) -> Self {
        let mut bench = Self::new();
        let start = (0..5).flat_map(|_| bench.live(kind)).collect::<Vec<_>>();
        assert!(start[0] == Read::Disable, "{start:?}");
        let now = bench.now();
        bench.own.arm(now).unwrap();
        let sent = (0..250).map(|_| bench.live(kind)).collect::<Vec<_>>();
        let last = sent.last().unwrap();
        assert!(matches!(last[..], [read] if read.drives()), "{kind:?}: {last:?}");
        bench
    }
}

/// What makes the motor rest, and whether it goes on by itself when that is over.
#[derive(Debug, Clone, Copy)]
enum Cause {
    Disarm,
    Trip,
    EmergencyStop,
    NotFinite(f32),
    OldTarget,
    Silence,
    LongSilence,
    OnlyOthersFrames,
    BadStep(f32),
    ClockStands,
    ClockGoesBack(u64),
    ReportsAnError,
    ReportsDisabled,
}

const CAUSES: [Cause; 20] = [
    Cause::Disarm,
    Cause::Trip,
    Cause::EmergencyStop,
    Cause::NotFinite(f32::NAN),
    Cause::NotFinite(f32::INFINITY),
    Cause::NotFinite(f32::NEG_INFINITY),
    Cause::OldTarget,
    Cause::Silence,
    Cause::LongSilence,
    Cause::OnlyOthersFrames,
    Cause::BadStep(0.0),
    Cause::BadStep(-0.001),
    Cause::BadStep(f32::NAN),
    Cause::BadStep(f32::INFINITY),
    Cause::ClockStands,
    Cause::ClockGoesBack(1),
    Cause::ClockGoesBack(900),
    Cause::ClockGoesBack(1_000_000),
    Cause::ReportsAnError,
    Cause::ReportsDisabled,
];

impl Cause {
    /// Lets it happen to a motor that is driven; returns the frames from then on, cycle by cycle.
    fn happen<M: Mit>(self, bench: &mut Bench<M>, kind: Kind) -> Vec<Vec<Read>> {
        match self {
            Self::Disarm | Self::Trip | Self::EmergencyStop => {
                // In the middle of a cycle: a command of it still waits.
                bench.micros += 1_000;
                bench.hear_drive();
                _ = bench.set(kind, 1.0);
                let tick = Tick::new(bench.now(), 0.001);
                bench.own.update(tick);
                match self {
                    Self::Disarm => bench.own.disarm(),
                    Self::Trip => bench.own.trip(),
                    _ => bench.own.emergency_stop(),
                }
                let first = bench.drain();
                std::iter::once(first).chain((0..50).map(|_| bench.live(kind))).collect()
            }
            Self::NotFinite(share) => (0..50)
                .map(|_| {
                    bench.micros += 1_000;
                    bench.hear_drive();
                    assert_eq!(bench.set(kind, share), Err(TargetError::NotFinite));
                    bench.update(0.001)
                })
                .collect(),
            Self::OldTarget => (0..200)
                .filter_map(|ms| {
                    bench.micros += 1_000;
                    bench.hear_drive();
                    let sent = bench.update(0.001);
                    // The target has the time of the update before it.
                    (ms >= 100).then_some(sent)
                })
                .collect(),
            Self::Silence | Self::LongSilence | Self::OnlyOthersFrames => {
                let silent = if matches!(self, Self::Silence) { 30 } else { 300 };
                let mut sent = Vec::new();
                for ms in 1..=silent {
                    bench.micros += 1_000;
                    let now = bench.now();
                    if let Self::OnlyOthersFrames = self {
                        let [_, data @ ..] = *answer(ENABLED, 0x9000).bytes();
                        let [a, b, c, d, e, f, g] = data;
                        let other = CanFrame::of(id(MASTER_ID), [0x12, a, b, c, d, e, f, g]);
                        assert_eq!(bench.own.ingest(&other, now), Ingest::Unrelated);
                        let short = CanFrame::of(id(MASTER_ID), [0x11, a, b, c, d, e, f]);
                        assert!(bench.own.ingest(&short, now).is_malformed());
                        let odd = CanFrame::of(id(MASTER_ID), [0x21, a, b, c, d, e, f, g]);
                        assert!(bench.own.ingest(&odd, now).is_malformed());
                    }
                    _ = bench.set(kind, 1.0);
                    let frames = bench.update(0.001);
                    if ms > 10 {
                        sent.push(frames);
                    }
                }
                sent
            }
            Self::BadStep(dt_s) => (0..20)
                .filter_map(|step| {
                    bench.micros += 1_000;
                    bench.hear_drive();
                    _ = bench.set(kind, 1.0);
                    let sent = bench.update(dt_s);
                    // The last command, once.
                    (step > 0).then_some(sent)
                })
                .collect(),
            Self::ClockStands | Self::ClockGoesBack(_) => {
                bench.hear_drive();
                _ = bench.set(kind, 1.0);
                if let Self::ClockGoesBack(micros) = self {
                    bench.micros -= micros;
                }
                let first = bench.update(0.001);
                std::iter::once(first).chain((0..200).map(|_| bench.live(kind))).collect()
            }
            Self::ReportsAnError => (0..50)
                .map(|_| {
                    bench.micros += 1_000;
                    assert_eq!(bench.hear(OVERLOAD), Ingest::Taken);
                    _ = bench.set(kind, 1.0);
                    bench.update(0.001)
                })
                .collect(),
            Self::ReportsDisabled => {
                bench.is_enabled = false; // it has reset
                (0..200).map(|_| bench.live(kind)).collect()
            }
        }
    }
}

/// Lets everything that makes a motor rest happen to it; returns the first frame that is not rest.
fn check<M: Mit>() -> Result<(), String> {
    for kind in KINDS {
        for cause in CAUSES {
            let mut bench = Bench::<M>::driving(kind);
            for (cycle, sent) in cause.happen(&mut bench, kind).into_iter().enumerate() {
                if sent.is_empty() {
                    return Err(format!("{kind:?}, {cause:?}, cycle {cycle}: nothing"));
                }
                if let Some(read) = sent.iter().find(|read| !read.is_rest()) {
                    return Err(format!("{kind:?}, {cause:?}, cycle {cycle}: {read:?}"));
                }
            }
        }
    }
    Ok(())
}

#[test]
fn every_cause_of_rest_sends_rest_in_the_same_cycle_and_until_it_is_over() {
    assert_eq!(check::<J4310>(), Ok(()));
}

/// The control of the tests of this file.
#[test]
fn eight_zero_bytes_are_a_torque_of_minus_ten_newton_metres() {
    let zeros = CanFrame::of(id(1), [0; 8]);
    let Read::Command { kp, kd, torque_nm, .. } = Read::of(&zeros) else { panic!("a command") };
    assert_eq!((kp, kd, torque_nm), (0.0, 0.0, -10.0));
    let found = check::<EightZeros>().unwrap_err();
    assert!(found.starts_with("Torque, Disarm, cycle 0: "), "{found}");
    assert!(found.ends_with("torque_nm: -10.0 }"), "{found}");
}

#[test]
fn nothing_but_rest_goes_out_before_arming() {
    let mut bench = Bench::<J4310>::new();
    for ms in 0..500 {
        bench.micros += 1_000;
        if ms > 100 {
            assert_eq!(bench.hear(if ms > 300 { ENABLED } else { DISABLED }), Ingest::Taken);
        }
        assert_eq!(bench.set(Kind::Torque, 1.0), Err(TargetError::Disarmed));
        let sent = bench.update(0.001);
        assert!(!sent.is_empty() && sent.into_iter().all(Read::is_rest), "{ms}");
    }
}

#[test]
fn a_late_motor_and_one_with_a_new_target_go_on_by_themselves() {
    for (cause, again) in [
        (Cause::Silence, true),
        (Cause::NotFinite(f32::NAN), true),
        (Cause::OldTarget, true),
        (Cause::BadStep(0.0), true),
        (Cause::Disarm, false),
        (Cause::ClockStands, false),
        (Cause::LongSilence, false),
        (Cause::ReportsAnError, false),
        (Cause::ReportsDisabled, false),
    ] {
        let mut bench = Bench::<J4310>::driving(Kind::Velocity);
        cause.happen(&mut bench, Kind::Velocity);
        let sent = (0..50).flat_map(|_| bench.live(Kind::Velocity)).collect::<Vec<_>>();
        assert_eq!(sent.iter().any(|read| read.drives()), again, "{cause:?}");
    }
}

/// The range opens from zero when the drive was enabled, and an angle starts from where the shaft is.
#[test]
fn the_first_commands_ask_for_little() {
    for kind in KINDS {
        let mut bench = Bench::<J4310>::new();
        bench.hear_drive();
        let now = bench.now();
        bench.own.arm(now).unwrap();
        // The drive takes its time.
        for _ in 0..500 {
            bench.micros += 1_000;
            assert_eq!(bench.hear(DISABLED), Ingest::Taken);
            bench.set(kind, 1.0).unwrap();
            assert!(!bench.update(0.001).into_iter().any(Read::drives));
        }
        bench.is_enabled = true;
        let mut strongest = 0.0_f64;
        for ms in 1..=250 {
            let sent = bench.live(kind);
            let [Read::Command { kp, kd, torque_nm, .. }] = sent[..] else {
                panic!("{ms}: {sent:?}")
            };
            let share = (kp / 20.0).max(kd / 0.6).max(torque_nm / 3.0);
            assert!(share <= f64::from(ms) / 200.0 + 0.01, "{kind:?} {ms}: {sent:?}");
            strongest = strongest.max(share);
        }
        assert!((strongest - 1.0).abs() < 0.01, "{kind:?}: {strongest}");
    }
}

#[test]
fn an_angle_starts_from_where_the_shaft_is() {
    let mut bench = Bench::<J4310>::new();
    bench.is_enabled = true;
    let start_rad = position_rad(0x9000);
    let target_rad = start_rad - 1.5;
    // 0x9000 of 0xFFFF in ±12.5 rad, and three turns.
    let turned_rad = f32::from(0x9000_u16) * 25.0 / 65_535.0 - 14.0;
    let target = Angle::from_radians(turned_rad + 3.0 * std::f32::consts::TAU);
    let (mut shaft, mut positions) = (0x9000, Vec::new());
    for ms in 0..260 {
        bench.micros += 1_000;
        let now = bench.now();
        assert_eq!(bench.own.ingest(&answer(ENABLED, shaft), now), Ingest::Taken);
        if ms == 5 {
            bench.own.arm(now).unwrap();
        }
        _ = bench.own.set_angle((), target);
        bench.own.update(Tick::new(now, 0.001));
        while let Some(frame) = bench.own.next_frame(0) {
            if Read::of(&frame).drives() {
                let [a, b, ..] = *frame.bytes();
                shaft = u16::from_be_bytes([a, b]); // follows at once
                positions.push(position_rad(shaft));
            }
        }
    }
    let steps = positions.windows(2).map(|pair| pair[0] - pair[1]);
    assert!(start_rad - positions[0] < 0.03, "{}", positions[0]);
    assert!(steps.into_iter().all(|step| (-0.001..0.01).contains(&step)), "{positions:?}");
    assert!((positions.last().unwrap() - target_rad).abs() < 0.001, "{positions:?}");
}

/// The torque that the drive applies where it answers with these counts of position and velocity.
fn asked_nm(read: Read, position: u16, velocity: u16) -> f64 {
    let (wanted_rad, velocity_rad_per_s, kp, kd, torque_nm) = match read {
        Read::Enable | Read::Disable => return 0.0, // it follows rest
        Read::Command { position_rad, velocity_rad_per_s, kp, kd, torque_nm } => {
            (position_rad, velocity_rad_per_s, kp, kd, torque_nm)
        }
    };
    let measured = f64::from(velocity) * 60.0 / 4_095.0 - 30.0;
    kp * (wanted_rad - position_rad(position)) + kd * (velocity_rad_per_s - measured) + torque_nm
}

/// The torque for this target, where the range opens for so long: it takes 200 ms.
fn asked_of(kind: Kind, target: f32, opened_ms: u32, position: u16, velocity: u16) -> f64 {
    let mut bench = Bench::<J4310>::new();
    bench.is_enabled = true;
    let mut read = None;
    for ms in 0..=opened_ms {
        bench.micros += 1_000;
        let now = bench.now();
        let [a, b] = position.to_be_bytes();
        let [c, d] = (velocity << 4 | 0x7).to_be_bytes();
        let frame = CanFrame::of(id(MASTER_ID), [0x11, a, b, c, d, 0xFF, 40, 35]);
        assert_eq!(bench.own.ingest(&frame, now), Ingest::Taken);
        if ms == 0 {
            bench.own.arm(now).unwrap();
        }
        _ = match kind {
            Kind::Torque => bench.own.set_torque(target),
            Kind::Velocity => bench.own.set_velocity((), AngularVelocity::from_rad_per_s(target)),
            Kind::Angle => bench.own.set_angle((), Angle::from_radians(target)),
        };
        read = bench.update(0.001).pop();
    }
    asked_nm(read.unwrap(), position, velocity)
}

const LIMIT_NM: f64 = 3.0;
/// Each field is truncated to a count.
const COUNTS_NM: f64 = 0.05;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]
    /// Law: no target of any kind asks for more than the share of the limit, wherever the shaft is and however fast it turns.
    #[test]
    fn no_target_asks_for_more_than_the_share_of_the_limit(
        kind in prop::sample::select(&KINDS[..]),
        target in -60.0_f32..60.0,
        opened_ms in 1_u32..240,
        position: u16,
        velocity in 0_u16..4_096,
    ) {
        let asked = asked_of(kind, target, opened_ms, position, velocity);
        let limit = LIMIT_NM * (f64::from(opened_ms) / 200.0).min(1.0) + COUNTS_NM;
        prop_assert!(asked.abs() <= limit, "{asked} Nm of {limit}");
    }
}

#[test]
fn a_step_of_each_kind_asks_for_the_whole_limit_and_none_for_nothing() {
    let (middle, stands) = (0x8000, 2_047);
    for (kind, target) in [(Kind::Torque, 9.0), (Kind::Velocity, 20.0), (Kind::Angle, 3.0)] {
        for sign in [-1.0_f32, 1.0] {
            let asked = asked_of(kind, sign * target, 220, middle, stands);
            let wanted = f64::from(sign) * LIMIT_NM;
            assert!((asked - wanted).abs() < COUNTS_NM, "{kind:?}: {asked} for {wanted}");
        }
        assert!(asked_of(kind, 0.0, 220, middle, stands).abs() < COUNTS_NM, "{kind:?}");
    }
    // The speed has a limit too: this count is 12.5 rad/s.
    let asked = asked_of(Kind::Velocity, 20.0, 220, middle, 2_900);
    assert!(asked.abs() < COUNTS_NM, "{asked}");
}

/// A position at an end of its range is that one or any beyond.
#[test]
fn at_an_end_of_the_range_there_is_no_angle_and_an_angle_target_rests() {
    for end in [0, u16::MAX] {
        let mut bench = Bench::<J4310>::driving(Kind::Angle);
        bench.micros += 1_000;
        let now = bench.now();
        assert!(bench.own.angle(()).is_some());
        assert_eq!(bench.own.ingest(&answer(ENABLED, end), now), Ingest::Taken);
        assert_eq!(bench.own.angle(()), None);
        bench.set(Kind::Angle, 1.0).unwrap();
        assert!(bench.update(0.001).into_iter().all(Read::is_rest));
        assert!(bench.live(Kind::Angle).into_iter().any(Read::drives), "back within it");
    }
}

#[test]
fn an_id_that_an_answer_has_no_room_for_is_refused_and_so_is_one_id_for_command_and_answers() {
    for number in [0, 16, 0x15, 255] {
        assert!(J4310::new(number, MASTER_ID).is_none(), "{number}");
    }
    let refused = Actuator::new(J4310::new(5, 5).unwrap()).arm(Instant::START).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "command of DM-J4310 #5 on 0x5 clashes with feedback of DM-J4310 #5 on 0x5"
    );
}

#[test]
fn two_motors_share_the_id_of_their_answers() {
    let mut pair = (own(1), own(2));
    let now = Instant::from_micros(1_000);
    let of = |drive: u8, position: u8| {
        CanFrame::of(id(MASTER_ID), [drive, position, 0, 0x7F, 0xF7, 0xFF, 40, 35])
    };
    assert_eq!(pair.ingest(&of(2, 0xFF), now), Ingest::Taken);
    assert_eq!(pair.ingest(&of(3, 0xFF), now), Ingest::Unrelated);
    let missing = pair.arm(now).unwrap_err().to_string();
    assert_eq!(missing, "no feedback from DM-J4310 #1");
    assert_eq!(pair.ingest(&of(1, 0x01), now), Ingest::Taken);
    assert_eq!(pair.arm(now), Ok(()));
    assert!(pair.0.angle(()).unwrap() < pair.1.angle(()).unwrap());
    let mut twins = (own(1), own(1));
    assert!(twins.clash().is_some(), "the commands are not shared");
}

/// Something that happens to a motor.
#[derive(Debug, Clone)]
enum Event {
    /// So many milliseconds with everything as it should be.
    Live(u8, usize),
    /// A pause in which nobody asks, with feedback, and then a request to arm.
    AskAfterAPause,
    Ask,
    Disarm,
    Trip,
    Stop,
    Clear,
    Target(usize, f32),
    Hear(u8, u16),
    HearOther,
    /// Time moves by so many microseconds, either way.
    Wait(i64),
    Update(f32),
    /// Some frames are taken.
    Take(u8),
    /// A frame that was taken once is given back.
    Return(usize),
}

fn event() -> impl Strategy<Value = Event> {
    let share = prop_oneof![
        8 => -2.0_f32..2.0,
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(f32::MAX),
    ];
    let wait = prop_oneof![
        6 => 500_i64..2_000,
        2 => 8_000_i64..12_000,
        2 => 95_000_i64..105_000,
        1 => Just(0),
        1 => -2_000_i64..0,
        1 => -10_000_000_i64..10_000_000,
    ];
    let step = prop_oneof![
        6 => Just(0.001_f32),
        1 => Just(0.0),
        1 => Just(-0.001),
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(10.0),
    ];
    prop_oneof![
        4 => (1_u8..60, 0_usize..3).prop_map(|(ms, kind)| Event::Live(ms, kind)),
        3 => Just(Event::AskAfterAPause),
        1 => Just(Event::Ask),
        1 => Just(Event::Disarm),
        1 => Just(Event::Trip),
        1 => Just(Event::Stop),
        2 => Just(Event::Clear),
        4 => (0_usize..3, share).prop_map(|(kind, share)| Event::Target(kind, share)),
        4 => (0_u8..16, any::<u16>()).prop_map(|(status, turn)| Event::Hear(status, turn)),
        4 => any::<u16>().prop_map(|turn| Event::Hear(ENABLED, turn)),
        1 => Just(Event::HearOther),
        4 => wait.prop_map(Event::Wait),
        8 => step.prop_map(Event::Update),
        4 => (1_u8..4).prop_map(Event::Take),
        2 => any::<usize>().prop_map(Event::Return),
    ]
}

/// The bench, and what the rules allow: written from their text, with none of the guard's code.
struct Judged {
    bench: Bench<J4310>,
    taken: Vec<CanFrame>,
    is_armed: bool,
    is_stopped: bool,
    /// When the target counts from.
    target: Option<u64>,
    heard: Option<u64>,
    /// The status of the last answer, and whether it was "enabled" at the last update.
    status: Option<u8>,
    is_enabled: bool,
    /// The time of the last update, or of arming.
    now: u64,
    updated: Option<u64>,
    /// The last update had no step.
    held: bool,
    /// The frames that wait have to be rest.
    must_rest: bool,
    drove: u32,
}

impl Judged {
    fn new() -> Self {
        Self {
            bench: Bench::new(),
            taken: Vec::new(),
            is_armed: false,
            is_stopped: false,
            target: None,
            heard: None,
            status: None,
            is_enabled: false,
            now: 0,
            updated: None,
            held: true,
            must_rest: true,
            drove: 0,
        }
    }

    fn ask(&mut self) {
        let now = self.bench.now();
        let was_armed = self.bench.own.is_armed();
        if self.bench.own.arm(now).is_ok() {
            assert!(!self.is_stopped && self.heard.is_some());
            self.now = self.now.max(self.bench.micros);
            if !was_armed {
                self.target = None;
            }
            self.is_armed = true;
        }
    }

    fn rest(&mut self) {
        (self.is_armed, self.target, self.must_rest) = (false, None, true);
    }

    fn target(&mut self, kind: Kind, share: f32) {
        match self.bench.set(kind, share) {
            Ok(()) => self.target = Some(self.now),
            Err(TargetError::NotFinite | TargetError::NoFeedback) => self.target = None,
            Err(_) => {}
        }
    }

    fn hear(&mut self, status: u8, turn: u16) {
        let now = self.bench.now();
        if self.bench.own.ingest(&answer(status, turn), now) == Ingest::Taken {
            assert!(matches!(status, 0 | 1 | 8..=14));
            self.heard = self.heard.max(Some(self.bench.micros));
            self.status = Some(status);
        }
    }

    fn update(&mut self, dt_s: f32) {
        let now = self.bench.micros;
        let is_bad = !(dt_s > 0.0 && dt_s.is_finite());
        if self.updated.is_some_and(|before| now <= before) || now < self.now {
            self.is_armed = false; // the clock does not go on
        }
        if self.status.is_some_and(|status| status >= 8) {
            self.is_armed = false;
        }
        let is_old =
            |since: Option<u64>, limit| since.is_none_or(|since| now.saturating_sub(since) > limit);
        if is_old(self.target, 100_000) || !self.is_armed {
            self.target = None;
        }
        let is_late = is_old(self.heard, 10_000);
        self.must_rest = self.target.is_none() || is_late || (is_bad && self.held);
        self.held = is_bad || self.must_rest;
        self.is_enabled = self.status == Some(ENABLED);
        (self.now, self.updated) = (now, Some(now));
        self.bench.own.update(Tick::new(self.bench.now(), dt_s));
    }

    fn take(&mut self) -> Result<bool, TestCaseError> {
        let Some(frame) = self.bench.own.next_frame(0) else { return Ok(false) };
        let read = Read::of(&frame);
        prop_assert!(read.is_rest() || !self.must_rest, "{read:?}");
        prop_assert!(!read.drives() || self.is_enabled, "{read:?}");
        self.drove += u32::from(read.drives());
        self.taken.push(frame);
        Ok(true)
    }

    fn happen(&mut self, event: &Event) -> Result<(), TestCaseError> {
        match *event {
            Event::Live(ms, kind) => {
                for _ in 0..ms {
                    self.bench.micros += 1_000;
                    // A drive that is told to is enabled.
                    let told = self.taken.iter().rev().map(Read::of);
                    let mut power =
                        told.filter(|read| matches!(read, Read::Enable | Read::Disable));
                    let status = u8::from(power.next() == Some(Read::Enable));
                    self.hear(status, 0x9000);
                    self.target(KINDS[kind], 1.0);
                    self.update(0.001);
                    while self.take()? {}
                }
            }
            Event::AskAfterAPause => {
                for _ in 0..111 {
                    self.bench.micros += 1_000;
                    self.hear(DISABLED, 0x9000);
                    self.update(0.001);
                    while self.take()? {}
                }
                self.ask();
            }
            Event::Ask => self.ask(),
            Event::Disarm => {
                self.bench.own.disarm();
                self.rest();
            }
            Event::Trip => {
                self.bench.own.trip();
                self.rest();
            }
            Event::Stop => {
                self.bench.own.emergency_stop();
                self.rest();
                self.is_stopped = true;
            }
            Event::Clear => {
                self.bench.own.clear_emergency_stop();
                self.is_stopped = false;
            }
            Event::Target(kind, share) => self.target(KINDS[kind], share),
            Event::Hear(status, turn) => self.hear(status, turn),
            Event::HearOther => {
                let now = self.bench.now();
                let other = CanFrame::of(id(MASTER_ID), [0x12, 0, 0, 0, 0, 0, 40, 35]);
                prop_assert_eq!(self.bench.own.ingest(&other, now), Ingest::Unrelated);
            }
            Event::Wait(micros) => {
                self.bench.micros = self.bench.micros.saturating_add_signed(micros).max(1);
            }
            Event::Update(dt_s) => self.update(dt_s),
            Event::Take(frames) => {
                for _ in 0..frames {
                    self.take()?;
                }
            }
            Event::Return(number) => {
                if let Some(frame) = self.taken.get(number % self.taken.len().max(1)) {
                    prop_assert!(self.bench.own.requeue(frame));
                }
            }
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]
    /// Law: whatever happens, in whatever order, no frame drives where the rules ask for rest.
    #[test]
    fn no_frame_drives_where_the_rules_ask_for_rest(
        events in proptest::collection::vec(event(), 1..120),
    ) {
        let mut judged = Judged::new();
        for event in &events {
            judged.happen(event)?;
        }
        while judged.take()? {}
    }
}

/// What the law allows happens.
#[test]
fn the_motor_drives_where_the_rules_allow_it() {
    for kind in 0..3 {
        let mut judged = Judged::new();
        for event in [Event::AskAfterAPause, Event::Live(60, kind), Event::Live(60, kind)] {
            judged.happen(&event).unwrap();
        }
        assert!(judged.drove > 100 && !judged.must_rest, "{kind}: {}", judged.drove);
    }
}

#[test]
fn timeouts_are_those_that_the_rules_of_this_file_take() {
    let timeouts = drivetrain::motor::Timeouts::new();
    assert_eq!(timeouts.late(), Duration::from_millis(10));
    assert_eq!(timeouts.command(), Duration::from_millis(100));
}
