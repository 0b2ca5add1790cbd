//! Drives of every kind as motors of one's own: with and without frames that enable them, with and without a report of it, with
//! several ids, with targets of one kind or all, and with frames of any length.

#![cfg(test)]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, ArmError, Capabilities, Capability, Claim, Condition, DriveProtocol,
    Ingest, MotorName, Order, Target, TargetError, VelocityDrive, WrongSetting,
};
use drivetrain::motor::{Devices, HealthConfig, Vitals};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use std::ops::RangeInclusive;

fn id(raw: u16) -> Id {
    StandardId::new(raw).unwrap().into()
}

/// Commands: a torque on 0x301 with 4 bytes, a velocity on 0x302 with 5, an angle on 0x303 with 8, rest on 0x301 with none.
/// Power on 0x304 with one. Feedback on 0x381 and state on 0x382, each with one byte.
#[derive(Debug, Clone, Copy)]
struct Tool {
    offers: Capabilities,
    /// What the drive is told with one frame each, the last byte of it.
    enables: &'static [u8],
    disables: Option<u8>,
    report: Option<bool>,
    rest: (u16, Option<u8>),
    share: f32,
    temperature_c: i16,
    angle_degrees: u8,
    /// Whether the setting of the drive is known, for a drive with one.
    setting: Option<bool>,
    resets: u32,
}

const ALL: Capabilities =
    Capabilities::of(&[Capability::Torque, Capability::Velocity, Capability::Angle]);

impl Tool {
    /// A drive with frames for its power.
    const POWERED: Self = Self {
        offers: ALL,
        enables: &[1],
        disables: Some(0),
        report: None,
        rest: (0x301, None),
        share: f32::NAN,
        temperature_c: 30,
        angle_degrees: 30,
        setting: None,
        resets: 0,
    };
    /// A drive without them.
    const PLAIN: Self = Self { enables: &[], disables: None, ..Self::POWERED };
    /// A drive that only rests when it is disabled.
    const NO_TORQUE: Self = Self { disables: None, rest: (0x304, Some(0)), ..Self::POWERED };
}

impl DriveProtocol for Tool {
    fn name(&self) -> MotorName {
        MotorName::new("tool", 1)
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let name = self.name();
        let commands = (0x301..=0x304).map(move |raw| Claim::command(id(raw), name));
        commands.chain([0x381, 0x382].map(|raw| Claim::feedback(id(raw), name)))
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        match (frame.id() == id(0x381), frame.data()) {
            (true, [0]) => Ingest::Taken,
            (true, [degrees]) => {
                self.angle_degrees = *degrees;
                Ingest::Taken
            }
            (false, [power @ (0 | 1)]) => {
                self.report = Some(*power == 1);
                Ingest::Taken
            }
            (false, [7]) => Ingest::Unrelated,
            (false, [_]) => Ingest::WrongField,
            _ => Ingest::WrongLength(frame.length()),
        }
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(1.5)
    }
    fn angle(&self) -> Option<Angle> {
        Some(Angle::from_degrees(self.angle_degrees.into()))
    }
    fn rest(&mut self) -> CanFrame {
        match self.rest {
            (raw, Some(byte)) => CanFrame::of(id(raw), [byte]),
            (raw, None) => CanFrame::of(id(raw), []),
        }
    }
    fn control(&mut self, Order { target, share, step }: Order) -> CanFrame {
        assert!(!step.is_hold() && (0.0..=1.0).contains(&share));
        self.share = share;
        match target {
            Target::Torque(nm) => CanFrame::of(id(0x301), nm.to_le_bytes()),
            Target::Velocity(velocity) => {
                let [a, b, c, d] = velocity.as_rad_per_s().to_le_bytes();
                CanFrame::of(id(0x302), [a, b, c, d, 0])
            }
            Target::Angle(angle) => {
                let [a, b, c, d] = angle.as_degrees().to_le_bytes();
                CanFrame::of(id(0x303), [a, b, c, d, 0, 0, 0, 0])
            }
            _ => self.rest(),
        }
    }
    fn reset(&mut self) {
        self.resets += 1;
    }
    fn enable(&mut self, sent: u8) -> Option<CanFrame> {
        let frame = self.enables.get(usize::from(sent) % self.enables.len().max(1));
        frame.map(|byte| CanFrame::of(id(0x304), [*byte]))
    }
    fn disable(&mut self) -> Option<CanFrame> {
        self.disables.map(|byte| CanFrame::of(id(0x304), [byte]))
    }
    fn is_enabled(&self) -> Option<bool> {
        self.report
    }
    fn inquire(&mut self) -> Option<CanFrame> {
        self.setting.map(|_| question())
    }
    fn decode_answer(&mut self, frame: &CanFrame) -> bool {
        let is_answer = self.setting.is_some() && *frame == answer();
        self.setting = self.setting.map(|is_known| is_known || is_answer);
        is_answer
    }
    fn wrong_setting(&self) -> Option<WrongSetting> {
        let motor = self.name();
        let wrong = WrongSetting { motor, setting: "mode", expected: 1.0, found: None };
        self.setting.is_some_and(|is_known| !is_known).then_some(wrong)
    }
    fn forget_settings(&mut self) {
        self.setting = self.setting.map(|_| false);
    }
    fn capabilities(&self) -> Capabilities {
        self.offers
    }
    fn vitals(&self) -> Vitals {
        Vitals { temperature_c: Some(self.temperature_c), ..Vitals::default() }
    }
}

/// The question of a drive with a setting.
fn question() -> CanFrame {
    CanFrame::of(id(0x303), [9])
}

fn answer() -> CanFrame {
    CanFrame::of(id(0x382), [9])
}

/// What the drive reports of its power.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Report {
    /// Nothing.
    None,
    /// What it was told last.
    Follows,
    Always(bool),
}

struct Bench {
    own: Actuator<Tool>,
    ms: u64,
    report: Report,
    told: bool,
}

impl Bench {
    fn new(tool: Tool, report: Report) -> Self {
        Self { own: Actuator::new(tool), ms: 1_000, report, told: false }
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.ms * 1_000)
    }

    fn tick(&self) -> Tick {
        Tick::new(self.now(), 0.001)
    }

    fn hear(&mut self) {
        let now = self.now();
        let status = match self.report {
            Report::None => None,
            Report::Follows => Some(self.told),
            Report::Always(power) => Some(power),
        };
        let frame = match status {
            None => CanFrame::of(id(0x381), [0]),
            Some(power) => CanFrame::of(id(0x382), [u8::from(power)]),
        };
        assert_eq!(self.own.ingest(&frame, now), Ingest::Taken);
    }

    fn drain(&mut self) -> Vec<CanFrame> {
        let frames: Vec<_> = std::iter::from_fn(|| self.own.next_frame(0)).collect();
        for frame in frames.iter().filter(|frame| frame.id() == id(0x304)) {
            self.told = frame.data() != [0];
        }
        frames
    }

    /// A millisecond with feedback, and with a target.
    fn live(&mut self) -> Vec<CanFrame> {
        self.ms += 1;
        self.hear();
        _ = self.own.set_torque(2.0);
        let tick = self.tick();
        self.own.update(tick);
        self.drain()
    }

    /// A millisecond with feedback alone.
    fn idle(&mut self) -> Vec<CanFrame> {
        self.ms += 1;
        self.hear();
        let tick = self.tick();
        self.own.update(tick);
        self.drain()
    }

    fn arm(&mut self) {
        let now = self.now();
        self.own.arm(now).unwrap();
    }

    fn armed(tool: Tool, report: Report) -> Self {
        let mut bench = Self::new(tool, report);
        for _ in 0..5 {
            bench.idle();
        }
        bench.arm();
        bench
    }

    fn driving(tool: Tool, report: Report) -> Self {
        let mut bench = Self::armed(tool, report);
        for _ in 0..300 {
            bench.live();
        }
        assert!(drives(&bench.live()));
        bench
    }
}

fn drives(frames: &[CanFrame]) -> bool {
    frames.iter().any(|frame| frame.id() != id(0x304) && !frame.data().is_empty())
}

/// The frames for the power, each with the millisecond of its cycle.
fn power(cycles: RangeInclusive<u64>, mut cycle: impl FnMut() -> Vec<CanFrame>) -> Vec<(u64, u8)> {
    let frames = cycles.flat_map(|ms| cycle().into_iter().map(move |frame| (ms, frame)));
    let of_power = frames.filter(|(_, frame)| frame.id() == id(0x304));
    of_power.map(|(ms, frame)| (ms, frame.data()[0])).collect()
}

#[test]
fn a_drive_is_disabled_at_the_start_and_reminded_and_told_more_often_while_it_says_enabled() {
    for (report, told) in [
        (Report::None, [1, 101, 201].to_vec()),
        (Report::Always(false), [1, 101, 201].to_vec()),
        (Report::Follows, [1, 101, 201].to_vec()),
        (Report::Always(true), (1..=250).step_by(10).collect()),
    ] {
        let mut bench = Bench::new(Tool::POWERED, report);
        let sent = power(1..=250, || bench.idle());
        assert_eq!(sent, told.iter().map(|ms| (*ms, 0)).collect::<Vec<_>>(), "{report:?}");
    }
    let mut bench = Bench::new(Tool::PLAIN, Report::None);
    assert_eq!(power(1..=250, || bench.idle()), []);
}

#[test]
fn a_drive_is_disabled_at_the_start_also_where_it_is_armed_and_driven_before() {
    let mut bench = Bench::new(Tool::POWERED, Report::Follows);
    bench.told = true;
    bench.hear();
    bench.arm();
    let sent = power(1..=50, || bench.live());
    assert_eq!(sent, [(1, 0), (2, 1)]);
    assert!(drives(&bench.live()));
    // One that needs no frame is driven at once.
    let mut plain = Bench::new(Tool::PLAIN, Report::None);
    plain.hear();
    plain.arm();
    assert!(drives(&plain.live()));
}

#[test]
fn a_drive_is_disabled_by_a_stop_before_the_first_update() {
    let stops: [fn(&mut Actuator<Tool>); 3] =
        [|own| own.disarm(), |own| own.trip(), |own| own.emergency_stop()];
    for stop in stops {
        let mut bench = Bench::new(Tool::POWERED, Report::None);
        stop(&mut bench.own);
        assert_eq!(bench.drain(), [CanFrame::of(id(0x304), [0]), CanFrame::of(id(0x301), [])]);
    }
}

#[test]
fn a_drive_at_rest_is_reminded_also_where_the_clock_was_set_back() {
    let mut bench = Bench::new(Tool::POWERED, Report::None);
    assert_eq!(power(1..=50, || bench.idle()), [(1, 0)]);
    bench.ms -= 900;
    assert_eq!(power(1..=150, || bench.idle()), [(1, 0), (101, 0)]);
}

#[test]
fn a_drive_is_told_once_at_one_time() {
    for report in [Report::None, Report::Always(true)] {
        let mut bench = Bench::new(Tool::POWERED, report);
        assert_eq!(power(1..=1, || bench.idle()), [(1, 0)]);
        let again = power(2..=5, || {
            let tick = bench.tick();
            bench.own.update(tick);
            bench.drain()
        });
        assert_eq!(again, [], "{report:?}");
    }
}

/// The output opens when the drive is enabled, however long after arming that is.
#[test]
fn a_drive_that_is_enabled_late_opens_from_zero() {
    for report in [Report::None, Report::Follows] {
        let mut bench = Bench::armed(Tool::POWERED, report);
        for _ in 0..500 {
            bench.idle();
        }
        bench.live();
        for ms in 1..=210_u16 {
            assert!(drives(&bench.live()));
            let expected = (f32::from(ms) / 200.0).min(1.0);
            let off = (bench.own.motor().share - expected).abs();
            assert!(off < 0.006, "{report:?} {ms}: {off}");
        }
    }
}

#[test]
fn a_drive_that_does_not_follow_is_told_each_10_ms_and_not_driven_until_it_says_enabled() {
    let mut bench = Bench::armed(Tool::POWERED, Report::Always(false));
    let mut any = false;
    let sent = power(1..=45, || {
        let frames = bench.live();
        any |= drives(&frames);
        frames
    });
    assert_eq!(sent, [(1, 1), (11, 1), (21, 1), (31, 1), (41, 1)]);
    assert!(!any);
    bench.report = Report::Always(true);
    assert!(drives(&bench.live()));
    assert_eq!(power(1..=500, || bench.live()), [], "never repeated");
}

#[test]
fn a_drive_that_says_nothing_is_enabled_once_and_driven_with_it() {
    let mut bench = Bench::armed(Tool::POWERED, Report::None);
    assert_eq!(bench.idle().len(), 1, "no target, no power");
    let first = bench.live();
    assert_eq!(first[0], CanFrame::of(id(0x304), [1]), "before the command");
    assert!(first.len() == 2 && drives(&first));
    assert_eq!(power(1..=500, || bench.live()), []);
}

#[test]
fn a_drive_with_several_frames_gets_one_after_the_other() {
    let tool = Tool { enables: &[5, 6, 1], ..Tool::POWERED };
    let mut bench = Bench::armed(tool, Report::Always(false));
    let sent = power(1..=30, || bench.live());
    assert_eq!(sent, [(1, 5), (11, 6), (21, 1)]);
}

#[test]
fn a_drive_is_disabled_in_the_cycle_in_which_its_motor_rests_for_good() {
    let causes: [fn(&mut Bench); 4] = [
        |bench| bench.own.disarm(),
        |bench| bench.own.trip(),
        |bench| bench.own.emergency_stop(),
        |bench| assert_eq!(bench.own.set_torque(f32::NAN), Err(TargetError::NotFinite)),
    ];
    for (number, cause) in causes.into_iter().enumerate() {
        let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
        let resets = bench.own.motor().resets;
        cause(&mut bench);
        let first = if number < 3 { bench.drain() } else { bench.idle() };
        let expected = [CanFrame::of(id(0x304), [0]), CanFrame::of(id(0x301), [])];
        assert_eq!(first, expected, "{number}");
        assert_eq!(bench.own.motor().resets, resets + 1);
        let told: Vec<_> = power(1..=250, || bench.idle());
        assert!(told.len() == 2 && told.iter().all(|(_, byte)| *byte == 0), "{number}: {told:?}");
    }
    // Without a target, a deadline later.
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    assert_eq!(power(1..=150, || bench.idle()), [(100, 0)]);
    // Late feedback alone does not disable it.
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    let silent = power(1..=50, || {
        bench.ms += 1;
        let tick = bench.tick();
        bench.own.update(tick);
        bench.drain()
    });
    assert_eq!(silent, []);
    assert_eq!(power(1..=50, || bench.live()), []);
    assert!(drives(&bench.live()));
}

#[test]
fn disarming_in_each_tick_disables_no_more_often() {
    for report in [Report::None, Report::Follows] {
        let mut bench = Bench::driving(Tool::POWERED, report);
        let sent = power(1..=205, || {
            bench.own.disarm();
            bench.own.emergency_stop();
            bench.idle()
        });
        let told: Vec<_> = sent.iter().map(|(ms, byte)| (ms / 100, *byte)).collect();
        assert_eq!(told, [(0, 0), (1, 0), (2, 0)], "{report:?}");
    }
}

#[test]
fn an_enable_never_goes_out_after_a_disable() {
    let enable = CanFrame::of(id(0x304), [1]);
    // It waits while the motor is disarmed.
    let mut bench = Bench::armed(Tool::POWERED, Report::None);
    bench.ms += 1;
    bench.hear();
    bench.own.set_torque(2.0).unwrap();
    let tick = bench.tick();
    bench.own.update(tick);
    bench.own.disarm();
    assert_eq!(power(1..=250, || bench.idle()).iter().filter(|(_, byte)| *byte == 1).count(), 0);
    // The driver gives it back after that.
    let mut bench = Bench::armed(Tool::POWERED, Report::None);
    assert_eq!(bench.live()[0], enable);
    bench.own.disarm();
    assert!(bench.own.requeue(&enable));
    assert_eq!(power(1..=250, || bench.idle()).iter().filter(|(_, byte)| *byte == 1).count(), 0);
}

#[test]
fn a_frame_that_is_given_back_comes_again_with_the_next_update() {
    let (enable, disable) = (CanFrame::of(id(0x304), [1]), CanFrame::of(id(0x304), [0]));
    let mut bench = Bench::armed(Tool::POWERED, Report::None);
    for _ in 0..3 {
        assert_eq!(bench.live()[0], enable);
        assert!(bench.own.requeue(&enable));
        assert_eq!(bench.drain(), [], "not before");
    }
    assert_eq!(bench.live()[0], enable);
    assert_eq!(power(1..=50, || bench.live()), []);
    bench.own.disarm();
    for _ in 0..3 {
        assert_eq!(bench.drain()[0], disable);
        assert!(bench.own.requeue(&disable));
        bench.ms += 1;
        bench.hear();
        let tick = bench.tick();
        bench.own.update(tick);
    }
    // A command waits for the next update anyway, and leaves the power alone.
    for _ in 0..20 {
        let command = *bench.idle().last().unwrap();
        assert!(bench.own.requeue(&command));
    }
    assert_eq!(power(1..=50, || bench.idle()), []);
    let strangers = [CanFrame::of(id(0x300), [1]), CanFrame::of(id(0x381), [1])];
    assert!(strangers.iter().all(|frame| !bench.own.requeue(frame)));
    let remote = CanFrame::new_remote(id(0x304), 1).unwrap();
    assert!(!bench.own.requeue(&remote));
}

#[test]
fn a_frame_that_is_given_back_after_the_drive_followed_does_not_come_again() {
    let enable = CanFrame::of(id(0x304), [1]);
    let mut bench = Bench::armed(Tool::POWERED, Report::Follows);
    assert_eq!(bench.live()[0], enable);
    assert!(drives(&bench.live()), "the drive said enabled");
    _ = bench.own.requeue(&enable);
    assert_eq!(power(1..=50, || bench.live()), []);
}

#[test]
fn a_frame_that_waits_to_enable_a_drive_is_not_sent_while_its_motor_is_late() {
    let mut bench = Bench::armed(Tool::POWERED, Report::Follows);
    bench.own.set_torque(2.0).unwrap();
    for gap_ms in [1, 20] {
        bench.ms += gap_ms;
        let tick = bench.tick();
        bench.own.update(tick);
    }
    assert!(bench.drain().iter().all(|frame| frame.id() != id(0x304)));
    assert_eq!(bench.live()[0], CanFrame::of(id(0x304), [1]), "heard again");
}

#[test]
fn a_drive_that_was_late_tells_its_setting_again_before_it_is_armed() {
    let tool = Tool { setting: Some(false), ..Tool::POWERED };
    let mut bench = Bench::new(tool, Report::Follows);
    bench.idle();
    assert_eq!(bench.own.ingest(&answer(), bench.now()), Ingest::Taken);
    bench.idle();
    assert_eq!(bench.own.motor().wrong_setting(), None);
    bench.ms += 20;
    let tick = bench.tick();
    bench.own.update(tick);
    bench.hear();
    assert!(bench.own.motor().wrong_setting().is_some());
    assert!(bench.own.arm(bench.now()).is_err());
    bench.idle();
    assert_eq!(bench.own.ingest(&answer(), bench.now()), Ingest::Taken);
    bench.arm();
    // The program stood still, so no update found the drive late: only after 100 ms without feedback it may be another one.
    for (gap_ms, is_known) in [(100, true), (101, false)] {
        bench.ms += gap_ms;
        bench.hear();
        assert_eq!(bench.own.motor().wrong_setting().is_none(), is_known, "{gap_ms} ms");
        assert_eq!(bench.own.ingest(&answer(), bench.now()), Ingest::Taken);
        bench.idle();
    }
}

#[test]
fn a_question_is_asked_each_10_ms_also_where_the_clock_was_set_back() {
    let tool = Tool { setting: Some(false), ..Tool::POWERED };
    let mut bench = Bench::new(tool, Report::Follows);
    let asked = |bench: &mut Bench| -> Vec<u64> {
        (1..=50).filter(|_| bench.idle().contains(&question())).collect()
    };
    let rhythm = |asked: &[u64]| asked.windows(2).all(|pair| pair[1] - pair[0] == 10);
    let before = asked(&mut bench);
    assert!(before.len() == 5 && rhythm(&before), "{before:?}");
    bench.ms -= 900;
    let after = asked(&mut bench);
    assert!(after.len() == 5 && rhythm(&after), "{after:?}");
    while !bench.idle().contains(&question()) {}
    for _ in 0..5 {
        let tick = bench.tick();
        bench.own.update(tick);
        assert!(!bench.drain().contains(&question()), "asked at this time already");
    }
}

#[test]
fn a_drive_that_resets_trips_and_is_not_enabled_again() {
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    assert_eq!(bench.own.next_edge(), None);
    bench.told = false; // it lost its supply
    let first = bench.live();
    assert_eq!(first[0], CanFrame::of(id(0x304), [0]));
    assert!(!drives(&first) && !bench.own.is_armed());
    assert_eq!(bench.own.set_torque(2.0), Err(TargetError::Relaxed));
    let edges: Vec<_> = std::iter::from_fn(|| bench.own.next_edge()).collect();
    let told: Vec<_> = edges.iter().map(|edge| (edge.condition, edge.began)).collect();
    assert_eq!(told, [(Condition::Fault, true), (Condition::Fault, false)]);
    // A program that asks in each tick does not arm it.
    for _ in 0..300 {
        let now = bench.now();
        assert_eq!(bench.own.arm(now), Err(ArmError::NotReleased));
        let frames = bench.live();
        assert!(frames.iter().all(|frame| *frame != CanFrame::of(id(0x304), [1])));
    }
    for _ in 0..100 {
        bench.idle();
    }
    bench.arm();
    assert_eq!(power(1..=50, || bench.live()), [(1, 1)]);
    assert!(drives(&bench.live()));
}

/// Also where the reaction to faults is to report them only.
#[test]
fn a_drive_that_resets_trips_whatever_a_fault_leads_to() {
    use drivetrain::motor::Reaction;
    static REPORT: HealthConfig =
        HealthConfig::new().with_reaction(Condition::Fault, Reaction::Report);
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    bench.own = bench.own.with_health(&REPORT).unwrap();
    bench.told = false;
    assert!(!drives(&bench.live()) && !bench.own.is_armed());
}

#[test]
fn a_drive_that_resets_as_soon_as_it_is_enabled_is_not_enabled_again() {
    let mut bench = Bench::armed(Tool::POWERED, Report::Always(false));
    assert_eq!(power(1..=1, || bench.live()), [(1, 1)]);
    bench.report = Report::Always(true);
    assert!(drives(&bench.live()));
    bench.report = Report::Always(false);
    let sent = power(3..=150, || bench.live());
    assert_eq!(sent[0], (22, 0), "a report from before may come for 20 ms");
    assert!(sent.iter().all(|(_, byte)| *byte == 0) && !bench.own.is_armed());
}

#[test]
fn a_drive_that_is_disarmed_and_armed_at_once_has_not_reset() {
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    bench.own.disarm();
    bench.arm();
    bench.own.set_torque(2.0).unwrap();
    // The answer to the disable comes after the enable was sent, one from before that before it.
    for (status, driven) in [(true, false), (true, true), (false, false), (true, true)] {
        bench.report = Report::Always(status);
        assert_eq!(drives(&bench.live()), driven, "{status}");
    }
    bench.report = Report::Follows;
    for _ in 0..100 {
        bench.live();
    }
    assert!(bench.own.is_armed() && drives(&bench.live()));
}

#[test]
fn a_drive_that_rests_by_being_disabled_is_enabled_each_time() {
    let mut bench = Bench::driving(Tool::NO_TORQUE, Report::Follows);
    assert_eq!(power(1..=50, || bench.live()), []);
    // Late feedback: rest is the frame that disables it.
    let silent = power(1..=30, || {
        bench.ms += 1;
        let tick = bench.tick();
        bench.own.update(tick);
        bench.drain()
    });
    assert_eq!(silent.len(), 20, "each update from the 11th on");
    assert!(silent.iter().all(|(_, byte)| *byte == 0));
    let again = power(1..=50, || bench.live());
    assert_eq!(again, [(1, 1)], "nothing disables it while it is enabled");
    assert!(bench.own.is_armed() && drives(&bench.live()));
    let tick = Tick::new(bench.now() + Duration::from_millis(1), 0.0);
    bench.own.update(tick);
    assert!(drives(&bench.drain()), "once");
    let tick = Tick::new(bench.now() + Duration::from_millis(2), 0.0);
    bench.own.update(tick);
    assert_eq!(bench.drain(), [CanFrame::of(id(0x304), [0])]);
    bench.ms += 2;
    for _ in 0..100 {
        bench.live();
    }
    assert!(bench.own.is_armed() && drives(&bench.live()), "it has not reset");
}

/// Its shaft was free meanwhile.
#[test]
fn an_angle_starts_again_from_where_the_shaft_is() {
    let go = |bench: &mut Bench| {
        bench.ms += 1;
        bench.hear();
        _ = bench.own.set_angle((), Angle::from_degrees(90.0));
        let tick = bench.tick();
        bench.own.update(tick);
        let frames = bench.drain();
        let angle = frames.into_iter().find(|frame| frame.id() == id(0x303))?;
        let [a, b, c, d, ..] = *angle.bytes();
        Some(f32::from_le_bytes([a, b, c, d]))
    };
    fn late(bench: &mut Bench) {
        for _ in 0..20 {
            bench.ms += 1;
            let tick = bench.tick();
            bench.own.update(tick);
            bench.drain();
        }
    }
    fn disarmed(bench: &mut Bench) {
        bench.own.disarm();
        bench.idle();
        bench.arm();
    }
    for (tool, report, pause) in [
        (Tool::NO_TORQUE, Report::Follows, late as fn(&mut Bench)),
        (Tool::NO_TORQUE, Report::Follows, disarmed),
        (Tool::POWERED, Report::Follows, disarmed),
        (Tool::PLAIN, Report::None, disarmed),
    ] {
        let mut bench = Bench::armed(tool, report);
        let first: Vec<f32> = (0..300).filter_map(|_| go(&mut bench)).collect();
        assert!((first[0] - 30.0).abs() < 0.5, "{}", first[0]);
        assert!((first.last().unwrap() - 90.0).abs() < 1e-3);
        pause(&mut bench);
        let now = bench.now();
        assert_eq!(bench.own.ingest(&CanFrame::of(id(0x381), [200]), now), Ingest::Taken);
        let second: Vec<f32> = (0..300).filter_map(|_| go(&mut bench)).collect();
        assert!((second[0] - 200.0).abs() < 1.0, "{}", second[0]);
        assert!((second.last().unwrap() - 90.0).abs() < 1e-3);
    }
}

#[test]
fn a_target_that_the_motor_does_not_offer_changes_nothing() {
    let kinds = [Capability::Torque, Capability::Velocity, Capability::Angle];
    for offered in kinds {
        let tool = Tool { offers: Capabilities::of(&[offered]), ..Tool::PLAIN };
        let mut bench = Bench::armed(tool, Report::None);
        let set = |own: &mut Actuator<Tool>, kind, value: f32| match kind {
            Capability::Torque => own.set_torque(value),
            Capability::Velocity => own.set_velocity((), AngularVelocity::from_rad_per_s(value)),
            _ => own.set_angle((), Angle::from_degrees(value)),
        };
        for ms in 0..300_u16 {
            bench.ms += 1;
            bench.hear();
            set(&mut bench.own, offered, 30.0).unwrap();
            for other in kinds.into_iter().filter(|kind| *kind != offered) {
                let value = if ms % 2 == 0 { 7.0 } else { f32::NAN };
                assert_eq!(set(&mut bench.own, other, value), Err(TargetError::Unsupported));
            }
            let tick = bench.tick();
            bench.own.update(tick);
            let frames = bench.drain();
            let (raw, length, [a, b, c, d]) = match offered {
                Capability::Torque => (0x301, 4, 30.0_f32.to_le_bytes()),
                Capability::Velocity => (0x302, 5, 30.0_f32.to_le_bytes()),
                _ => (0x303, 8, Angle::from_degrees(30.0).as_degrees().to_le_bytes()),
            };
            assert_eq!(frames.len(), 1);
            assert_eq!((frames[0].id(), frames[0].length()), (id(raw), length));
            // A velocity opens from the measured one.
            if offered != Capability::Velocity || ms >= 200 {
                assert_eq!(frames[0].data()[..4], [a, b, c, d], "{offered:?} {ms}");
            }
        }
    }
    let mut bench = Bench::armed(Tool::PLAIN, Report::None);
    assert_eq!(VelocityDrive::capabilities(&bench.own, ()), ALL);
    assert_eq!(bench.own.velocity(()), Some(AngularVelocity::from_rad_per_s(1.5)));
    assert_eq!(bench.own.angle(()), Some(Angle::from_degrees(30.0)));
    for _ in 0..20 {
        bench.ms += 1;
        let tick = bench.tick();
        bench.own.update(tick);
    }
    assert_eq!((bench.own.velocity(()), bench.own.angle(())), (None, None), "late");
}

/// The motor once took torques without end where its drive had left the mode for torques.
#[test]
fn a_motor_that_takes_the_kind_of_its_target_no_longer_rests_and_refuses_the_next() {
    let mut bench = Bench::armed(Tool::PLAIN, Report::None);
    for ms in 0..300 {
        bench.ms += 1;
        bench.hear();
        if ms == 250 {
            bench.own.motor_mut().offers = Capabilities::of(&[Capability::Velocity]);
        }
        let set = bench.own.set_torque(1.0);
        assert_eq!(set, if ms > 250 { Err(TargetError::Unsupported) } else { Ok(()) }, "{ms}");
        let tick = bench.tick();
        bench.own.update(tick);
        let torque = 1.0_f32.to_le_bytes();
        let is_driven = bench.drain().iter().any(|frame| frame.bytes()[..4] == torque);
        assert_eq!(is_driven, ms < 250, "{ms}");
    }
}

/// The share opens after arming and falls with heat; the smaller one counts.
#[test]
fn the_share_is_that_of_the_opening_or_that_of_the_heat() {
    static HEAT: HealthConfig = HealthConfig::new().with_temperatures(80, 100);
    let tool = Tool { temperature_c: 90, ..Tool::PLAIN };
    let mut bench = Bench::new(tool, Report::None);
    bench.own = Actuator::new(tool).with_health(&HEAT).unwrap();
    for _ in 0..20 {
        bench.idle();
    }
    bench.arm();
    for ms in 1..300_u16 {
        assert!(drives(&bench.live()));
        let expected = (f32::from(ms) / 200.0).min(0.5);
        assert!((bench.own.motor().share - expected).abs() < 0.006, "{ms}");
    }
    let mut at_once = Bench::new(Tool::PLAIN, Report::None);
    at_once.own = Actuator::new(Tool::PLAIN).with_opening(Duration::ZERO);
    at_once.hear();
    at_once.arm();
    at_once.live();
    assert!((at_once.own.motor().share - 1.0).abs() < 1e-6);
}

#[test]
fn frames_of_several_ids_are_taken_handed_on_or_refused() {
    let mut bench = Bench::new(Tool::PLAIN, Report::None);
    let now = bench.now();
    let mut ingest =
        |raw, data: &[u8]| bench.own.ingest(&CanFrame::new(id(raw), data).unwrap(), now);
    assert_eq!(ingest(0x381, &[0]), Ingest::Taken);
    assert_eq!(ingest(0x382, &[1]), Ingest::Taken);
    assert_eq!(ingest(0x382, &[7]), Ingest::Unrelated);
    assert_eq!(ingest(0x382, &[9]), Ingest::WrongField);
    assert_eq!(ingest(0x381, &[]), Ingest::WrongLength(0));
    assert_eq!(ingest(0x383, &[0]), Ingest::Unrelated);
    let remote = CanFrame::new_remote(id(0x381), 1).unwrap();
    assert_eq!(bench.own.ingest(&remote, now), Ingest::Unrelated);
    let extended = CanFrame::of(ExtendedId::new(0x381).unwrap(), [0]);
    assert_eq!(bench.own.ingest(&extended, now), Ingest::Unrelated);
    assert_eq!(bench.own.clash(), None);
}

#[test]
fn a_second_master_is_named_by_the_command_that_it_sent() {
    for raw in 0x301..=0x304 {
        let mut bench = Bench::new(Tool::PLAIN, Report::None);
        bench.idle();
        let now = bench.now();
        let rival = CanFrame::of(id(raw), [1]);
        assert_eq!(bench.own.ingest(&rival, now), Ingest::Unrelated);
        let Err(ArmError::SecondMaster(claim)) = bench.own.arm(now) else { panic!("{raw:X}") };
        assert_eq!((claim.id(), claim.is_feedback()), (id(raw), false));
    }
}

/// A motor that answers with its state within the id, and takes commands with a number within it, as a CyberGear does.
struct WideId;

impl DriveProtocol for WideId {
    fn name(&self) -> MotorName {
        MotorName::new("wide", 1)
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let id = |raw| ExtendedId::new(raw).unwrap();
        [
            Claim::command(id(0x0100_0001), self.name()).with_mask(0x1F00_00FF),
            Claim::feedback(id(0x0200_01FD), self.name()).with_mask(0x1F00_FFFF),
        ]
    }
    fn decode(&mut self, _: &CanFrame) -> Ingest {
        Ingest::Taken
    }
    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::ZERO
    }
    fn rest(&mut self) -> CanFrame {
        CanFrame::of(ExtendedId::new(0x017F_FF01).unwrap(), [])
    }
    fn control(&mut self, _: Order) -> CanFrame {
        CanFrame::of(ExtendedId::new(0x0112_3401).unwrap(), [])
    }
    fn reset(&mut self) {}
}

#[test]
fn an_id_may_carry_more_than_an_address() {
    let mut own = Actuator::new(WideId);
    let now = Instant::from_micros(1_000);
    let frame = |raw| CanFrame::of(ExtendedId::new(raw).unwrap(), []);
    assert_eq!(own.ingest(&frame(0x0280_02FD), now), Ingest::Unrelated);
    assert_eq!(own.ingest(&frame(0x02BF_01FD), now), Ingest::Taken);
    own.arm(now).unwrap();
    own.set_velocity((), AngularVelocity::ZERO).unwrap();
    own.update(Tick::new(now, 0.001));
    let command = own.next_frame(0).unwrap();
    assert_eq!(command, frame(0x0112_3401));
    assert!(own.requeue(&command) && !own.requeue(&frame(0x0112_3402)));
    assert_eq!(own.ingest(&frame(0x0155_5501), now), Ingest::Unrelated);
    assert!(matches!(own.arm(now), Err(ArmError::SecondMaster(_))));
}

/// Each offered frame is taken, replaced by a newer one, or waits.
#[test]
fn frames_add_up() {
    let mut bench = Bench::armed(Tool::POWERED, Report::None);
    let before = bench.own.superseded();
    let mut taken = 0_u32;
    let mut offered = 0_u32;
    for ms in 0..1_000_u32 {
        bench.ms += 1;
        bench.hear();
        let (was_on, wants) = (ms > 0 && (ms - 1) / 50 % 2 == 0, ms / 50 % 2 == 0);
        if wants {
            _ = bench.own.set_torque(1.0);
        } else {
            _ = bench.own.set_torque(f32::NAN);
        }
        let tick = bench.tick();
        bench.own.update(tick);
        offered += 1 + u32::from(was_on != wants);
        for _ in 0..ms % 3 {
            taken += u32::from(bench.own.next_frame(0).is_some());
        }
    }
    let waiting = u32::try_from(bench.drain().len()).unwrap();
    let superseded = bench.own.superseded() - before;
    assert_eq!(offered, taken + superseded + waiting);
}

/// What is held for an update without a step is the command of the target in force, not one from before a rest.
#[test]
fn an_update_without_a_step_holds_no_command_from_before_a_rest() {
    let resting: [fn(&mut Bench); 3] = [
        |bench| bench.own.disarm(),
        |bench| assert_eq!(bench.own.set_torque(f32::NAN), Err(TargetError::NotFinite)),
        |bench| {
            for _ in 0..15 {
                bench.ms += 1;
                let tick = bench.tick();
                bench.own.update(tick);
            }
            bench.hear(); // it was late
        },
    ];
    for rest in resting {
        let mut bench = Bench::driving(Tool::PLAIN, Report::None);
        rest(&mut bench);
        let now = bench.now();
        drivetrain::motor::CanDevice::engage(&mut bench.own, now);
        bench.own.set_torque(1.0).unwrap();
        bench.drain();
        let driven = CanFrame::of(id(0x301), 1.0_f32.to_le_bytes());
        let none = CanFrame::of(id(0x301), []);
        let mut sent = |dt_s| {
            bench.ms += 1;
            let tick = Tick::new(bench.now(), dt_s);
            bench.own.update(tick);
            bench.drain()
        };
        assert_eq!([0.0, 0.0].map(&mut sent), [[none], [none]]);
        assert_eq!(sent(0.001), [driven]);
        assert_eq!([0.0, 0.0].map(&mut sent), [[driven], [none]], "once");
    }
}

/// A frame is due in the 11th update, which has no step.
#[test]
fn an_update_without_a_step_enables_no_drive() {
    let mut bench = Bench::armed(Tool::POWERED, Report::Always(false));
    let mut cycle = 0;
    let sent = power(1..=25, || {
        cycle += 1;
        bench.ms += 1;
        bench.hear();
        bench.own.set_torque(2.0).unwrap();
        let tick = Tick::new(bench.now(), if cycle == 11 { 0.0 } else { 0.001 });
        bench.own.update(tick);
        bench.drain()
    });
    assert_eq!(sent, [(1, 1), (12, 1), (22, 1)]);
}

#[test]
fn of_several_frames_that_enable_a_drive_the_one_given_back_comes_again() {
    let tool = Tool { enables: &[7, 1], ..Tool::POWERED };
    let mut bench = Bench::armed(tool, Report::Always(false));
    for _ in 0..3 {
        assert_eq!(bench.live()[0], CanFrame::of(id(0x304), [7]));
        assert!(bench.own.requeue(&CanFrame::of(id(0x304), [7])));
    }
    let told: Vec<u8> = power(1..=35, || bench.live()).into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(told, [7, 1, 7, 1]);
}

/// A frame without a place is offered again as it was taken last, once, and no other frame is.
#[test]
fn what_is_put_back_is_the_frame_that_was_taken_last() {
    fn update(bench: &mut Bench) {
        bench.ms += 1;
        bench.hear();
        bench.own.set_torque(2.0).unwrap();
        let tick = bench.tick();
        bench.own.update(tick);
    }
    fn again(bench: &mut Bench) -> CanFrame {
        let frame = bench.own.next_frame(0).unwrap();
        let mut data = frame.data().to_vec();
        data.push(9);
        let other = <CanFrame as Frame>::new(frame.id(), &data).unwrap();
        assert!(!bench.own.put_back(&other), "never offered");
        assert!(bench.own.put_back(&frame));
        assert!(!bench.own.put_back(&frame), "waits already");
        assert_eq!(bench.own.next_frame(0), Some(frame));
        frame
    }
    let mut bench = Bench::armed(Tool::POWERED, Report::Always(false));
    update(&mut bench);
    let enable = again(&mut bench);
    assert_eq!(enable, CanFrame::of(id(0x304), [1]));
    bench.drain();
    update(&mut bench);
    assert!(!bench.own.put_back(&enable), "of the update before");
    let mut bench = Bench::driving(Tool::POWERED, Report::Follows);
    update(&mut bench);
    let command = again(&mut bench);
    assert_eq!(command.id(), id(0x301));
    assert_eq!(bench.own.next_frame(0), None);
}
