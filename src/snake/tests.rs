//! Rules of the joints, driven through their public face.

use super::*;
use crate::encoder::{Homing, Position};
use crate::frame::CanFrame;
use crate::motor::{ArmError, CanDevice, Ingest, Link, Malformed, TargetError};
use crate::time::{Duration, Instant, Tick};
use crate::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};
use std::string::ToString;
use std::vec::Vec;

fn at_ms(ms: u64) -> Instant {
    Instant::START + Duration::from_millis(ms)
}

fn frame(id: u8, data: &[u8]) -> CanFrame {
    CanFrame::new(StandardId::new(u16::from(id)).unwrap(), data).unwrap()
}

fn reply(id: u8, register: Register, value: i32) -> CanFrame {
    frame(id, &Reply::new(register, value).encode())
}

/// Joints that answer at once, with drives that stand where they are told to stand.
struct Bench {
    joints: Joints,
    handles: Vec<Joint>,
    /// By the index of the id.
    raw: [i32; 12],
    enabled: [i32; 12],
    silent: Vec<u8>,
    ms: u64,
}

impl Bench {
    fn new(ids: &[u8]) -> Self {
        let mut joints = Joints::new();
        let handles = ids.iter().map(|id| joints.attach(Config::new(*id)).unwrap()).collect();
        Self { joints, handles, raw: [0; 12], enabled: [0; 12], silent: Vec::new(), ms: 0 }
    }

    /// Some milliseconds; returns all that was sent.
    fn run(&mut self, ms: u64) -> Vec<(u8, Command)> {
        let mut sent = Vec::new();
        for _ in 0..ms {
            self.ms += 1;
            self.joints.update(Tick::new(at_ms(self.ms), 0.001));
            while let Some(frame) = self.joints.next_frame() {
                let id = u8::try_from(frame.header()).unwrap();
                let command = Command::decode(frame.data()).unwrap();
                sent.push((id, command));
                self.answer(id, command);
            }
        }
        sent
    }

    fn answer(&mut self, id: u8, command: Command) {
        let index = usize::from(id - 1);
        match command {
            Command::Write(Register::Enable, value) => self.enabled[index] = value,
            Command::Write(..) => {}
            Command::Read(_) if self.silent.contains(&id) => {}
            Command::Read(register) => {
                let value = match register {
                    Register::ActualPosition => self.raw[index],
                    Register::ActualSpeed => 65_536,
                    Register::Enable => self.enabled[index],
                    _ => 77,
                };
                let outcome = self.joints.ingest(&reply(id, register, value), at_ms(self.ms));
                assert_eq!(outcome, Ingest::Taken);
            }
        }
    }

    /// The same with targets in each millisecond.
    fn drive(&mut self, ms: u64) -> Vec<(u8, Command)> {
        let mut sent = Vec::new();
        for _ in 0..ms {
            for joint in self.handles.clone() {
                _ = self.joints.set_pulses(joint, 1_000);
            }
            sent.extend(self.run(1));
        }
        sent
    }

    fn armed(ids: &[u8]) -> Self {
        let mut bench = Self::new(ids);
        bench.run(30);
        bench.joints.arm(at_ms(bench.ms)).unwrap();
        bench
    }

    fn state(&self, joint: usize) -> State {
        self.joints.state(self.handles[joint]).unwrap()
    }
}

const ALL: [u8; 12] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12];

fn writes(sent: &[(u8, Command)]) -> Vec<Command> {
    sent.iter().map(|(_, command)| *command).filter(|c| matches!(c, Command::Write(..))).collect()
}

#[test]
fn a_controller_that_starts_disables_every_joint_first() {
    let mut bench = Bench::new(&ALL);
    let sent = bench.run(1);
    assert_eq!(sent[..12], ALL.map(|id| (id, Command::DISABLE)));
    assert!(sent[12..].iter().all(|(_, command)| matches!(command, Command::Read(_))));
}

#[test]
fn each_joint_of_twelve_is_asked_each_12_ms_for_two_positions_and_a_speed() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let sent = bench.drive(12 * 24);
    let asked = |id, wanted| {
        let asks = |(to, command): &&(u8, Command)| *to == id && *command == Command::Read(wanted);
        sent.iter().filter(asks).count()
    };
    for id in ALL {
        let counts = [Register::ActualPosition, Register::ActualSpeed, Register::Enable];
        assert_eq!(counts.map(|register| asked(id, register)), [16, 7, 1], "{id}");
    }
    // One question and one write in each millisecond, no more and no less: what `load` reckons.
    assert_eq!(sent.len(), 2 * 12 * 24);
    assert_eq!(bench.joints.load().frames_per_s(), 3_000);
    assert!((bench.joints.load().worst_case() - 0.305).abs() < 1e-6);
}

#[test]
fn a_joint_is_brought_up_in_order_with_its_enable_last() {
    let mut bench = Bench::armed(&[4]);
    let sent = bench.drive(9);
    use Register::{Acceleration, Current, Deceleration, Enable, Mode, Speed};
    let expected = [
        (Mode, 1),
        (Current, 2_000),
        (Acceleration, 0x0010_AAAA),
        (Deceleration, 0x0010_AAAA),
        (Speed, 10_923),
        (Register::Position, 1_000),
        (Enable, 1),
        (Register::Position, 1_000),
        (Register::Position, 1_000),
    ];
    assert_eq!(writes(&sent), expected.map(|(register, value)| Command::Write(register, value)));
}

#[test]
fn news_go_before_repetitions_and_only_what_changed_is_written() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let (first, last) = (bench.handles[0], bench.handles[11]);
    bench.joints.set_speed(last, AngularVelocity::from_rpm(-20.0)).unwrap();
    bench.joints.set_pulses(first, -5).unwrap();
    let sent = bench.run(3);
    let mut news = sent.iter().filter(|(_, command)| matches!(command, Command::Write(..)));
    let two = [*news.next().unwrap(), *news.next().unwrap()];
    assert!(two.contains(&(12, Command::Write(Register::Speed, 21_845))));
    assert!(two.contains(&(1, Command::Write(Register::Position, -5))));
    assert!(matches!(news.next(), Some((_, Command::Write(Register::Position, 1_000)))));
}

#[test]
fn zeroing_makes_the_present_position_zero_and_relaxes() {
    let mut bench = Bench::new(&[2, 3]);
    bench.raw = [70_000; 12];
    bench.run(30);
    assert_eq!(bench.state(0).homing, Homing::Relative);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(20);
    assert!(bench.state(0).is_driven);
    bench.joints.zero(bench.handles[0]).unwrap();
    let sent = bench.run(1);
    assert_eq!(sent[0], (2, Command::DISABLE));
    let state = bench.state(0);
    assert_eq!((state.pulses, state.raw_pulses, state.homing), (0, 70_000, Homing::Homed));
    assert_eq!(bench.joints.offset(bench.handles[0]).map(|offset| offset.target(0)), Some(70_000));
    bench.joints.set_pulses(bench.handles[0], -1_000).unwrap();
    let sent = bench.run(20);
    assert!(sent.contains(&(2, Command::Write(Register::Position, 69_000))));
}

#[test]
fn a_joint_that_gets_a_new_target_at_once_is_disabled_before_it_is_brought_up() {
    let mut bench = Bench::armed(&[2]);
    bench.drive(20);
    bench.joints.relax(bench.handles[0]);
    bench.joints.set_pulses(bench.handles[0], 5).unwrap();
    let sent = writes(&bench.run(9));
    assert_eq!(sent[..2], [Command::DISABLE, Command::Write(Register::Mode, 1)]);
    assert_eq!(sent[7], Command::Write(Register::Enable, 1));
    // The same when the driver gives the disable back.
    bench.joints.relax(bench.handles[0]);
    bench.joints.set_pulses(bench.handles[0], 6).unwrap();
    let refused = bench.joints.next_frame().unwrap();
    assert!(bench.joints.requeue(&refused));
    let sent = writes(&bench.run(9));
    assert_eq!(sent[..2], [Command::DISABLE, Command::Write(Register::Mode, 1)]);
}

#[test]
fn a_reversed_joint_turns_position_speed_and_target_around() {
    let mut bench = Bench::new(&[]);
    bench.handles.push(bench.joints.attach(Config::new(6).reversed()).unwrap());
    bench.raw = [16_384; 12];
    bench.run(10);
    let state = bench.state(0);
    assert_eq!((state.pulses, state.position.as_turns()), (-16_384, -0.25));
    assert!((state.velocity.as_rpm() + 60.0).abs() < 1e-3);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    let quarter = Position::from_angle(Angle::from_degrees(90.0));
    bench.joints.set_position(bench.handles[0], quarter).unwrap();
    assert!(writes(&bench.run(8)).contains(&Command::Write(Register::Position, -16_384)));
}

#[test]
fn positions_saturate_and_refused_ones_relax() {
    let mut bench = Bench::armed(&[1]);
    let joint = bench.handles[0];
    for (turns, pulses) in [(i64::MAX, 0x7FFF_0000), (i64::MIN, i32::MIN), (-2, -131_072)] {
        bench.joints.set_position(joint, Position::from_turns(turns)).unwrap();
        let sent = writes(&bench.run(8));
        assert!(sent.contains(&Command::Write(Register::Position, pulses)), "{turns}");
    }
    let nan = Position::from_angle(Angle::from_radians(f32::NAN));
    assert_eq!(bench.joints.set_position(joint, nan), Err(TargetError::NotFinite));
    assert_eq!(bench.run(1)[0], (1, Command::DISABLE));
    assert_eq!(bench.state(0).refused_targets, 1);
    let rate = AngularVelocity::from_rpm(f32::INFINITY);
    assert_eq!(bench.joints.set_speed(joint, rate), Err(TargetError::NotFinite));
    bench.joints.set_speed(joint, AngularVelocity::from_rpm(9_999.0)).unwrap();
    bench.drive(8);
    assert!(
        !writes(&bench.drive(8))
            .iter()
            .any(|c| matches!(c, Command::Write(Register::Speed, v) if *v > 278_528))
    );
}

#[test]
fn while_an_answer_is_due_nothing_is_sent_to_that_joint_a_stop_neither() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(100);
    bench.silent = ALL.to_vec();
    let sent = bench.drive(1);
    let asked = sent.iter().find(|(_, command)| matches!(command, Command::Read(_))).unwrap().0;
    assert_eq!(
        bench.joints.awaited(bench.handles[usize::from(asked - 1)]),
        Some(Register::ActualPosition)
    );
    bench.joints.emergency_stop();
    let sent = bench.run(1);
    assert!(sent.iter().filter(|(_, command)| *command == Command::DISABLE).count() == 11);
    assert!(sent.iter().all(|(id, _)| *id != asked));
    // After 2 ms it gets its stop in any case.
    assert!(bench.run(2).contains(&(asked, Command::DISABLE)));
    assert!(bench.joints.counters().unanswered >= 1);
}

#[test]
fn a_silent_joint_is_late_after_40_ms_and_offline_after_100_and_the_others_go_on() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.joints.zero(bench.handles[4]).unwrap();
    bench.drive(20);
    bench.silent = std::vec![5];
    let heard = bench.ms;
    let mut late = None;
    for _ in 0..140 {
        let sent = bench.drive(1);
        if sent.contains(&(5, Command::DISABLE)) {
            late.get_or_insert(bench.ms - heard);
        }
        assert!(writes(&sent).iter().any(|command| !command.is_safe()), "the others go on");
    }
    assert!(late.unwrap() <= 43, "{late:?}");
    let state = bench.state(4);
    assert_eq!((state.link, state.homing), (Link::Offline, Homing::Uncertain));
    assert!(state.unanswered > 5 && !bench.joints.is_armed());
    assert!(bench.joints.is_joint_armed(bench.handles[3]));
    let missing = bench.joints.arm(at_ms(bench.ms)).unwrap_err();
    assert_eq!(missing.to_string(), "no feedback from snake joint #5");
    // Ten positions in a row bring it back, but it moves only when it is armed again.
    bench.silent.clear();
    let sent = bench.drive(250);
    assert!(!sent.iter().any(|(id, command)| *id == 5 && !command.is_safe()));
    assert_eq!(bench.state(4).link, Link::Online);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    assert!(bench.drive(100).iter().any(|(id, command)| *id == 5 && !command.is_safe()));
}

#[test]
fn a_relaxed_joint_is_told_again_each_100_ms() {
    let mut bench = Bench::new(&[7]);
    bench.run(1);
    let sent = bench.run(1_000);
    assert_eq!(writes(&sent), [Command::DISABLE; 10]);
}

#[test]
fn a_drive_that_lost_its_enable_is_noticed_and_waits_to_be_armed() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.enabled[8] = 0; // its supply was away for a moment
    bench.drive(300);
    let state = bench.state(8);
    assert_eq!((state.resets, state.is_driven, bench.enabled[8]), (1, false, 0));
    assert!(!bench.joints.is_armed() && bench.state(7).is_driven);
    bench.joints.arm(at_ms(bench.ms)).unwrap();
    bench.drive(100);
    assert_eq!(bench.enabled, [1; 12]);
}

#[test]
fn a_position_further_off_than_a_joint_can_go_disarms_it() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(100);
    bench.raw[2] = 5_000; // 28 degrees
    bench.drive(30);
    assert_eq!(bench.state(2).position_jumps, 0);
    bench.raw[2] = -60_000;
    bench.drive(30);
    let state = bench.state(2);
    assert_eq!((state.position_jumps, state.is_driven, state.pulses), (1, false, -60_000));
    assert_eq!(bench.joints.set_pulses(bench.handles[2], 0), Err(TargetError::Disarmed));
    bench.joints.arm(at_ms(bench.ms)).unwrap();
}

#[test]
fn replies_are_sorted_by_their_register() {
    let mut bench = Bench::new(&[3]);
    bench.raw = [-7; 12];
    bench.run(10);
    let (pulses, rpm) = (bench.state(0).pulses, bench.state(0).velocity.as_rpm());
    assert!(pulses == -7 && (rpm - 60.0).abs() < 1e-3);
    bench.joints.read(bench.handles[0], Register::Deceleration).unwrap();
    assert_eq!(bench.joints.answer(bench.handles[0]), None);
    bench.run(4);
    let answer = bench.joints.answer(bench.handles[0]);
    assert_eq!(answer, Some(Reply::new(Register::Deceleration, 77)));
    assert_eq!((bench.state(0).pulses, bench.joints.answer(bench.handles[0])), (-7, None));
}

#[test]
fn what_is_no_reply_is_refused_counted_and_keeps_nothing_fresh() {
    let mut bench = Bench::armed(&[3]);
    let now = at_ms(bench.ms);
    let mut ingest = |id, data: &[u8]| bench.joints.ingest(&frame(id, data), now);
    assert_eq!(ingest(3, &[4, 7, 0, 0, 0]), Ingest::Malformed(Malformed::Length(5)));
    assert_eq!(ingest(3, &[4, 0x0D, 0, 0, 0, 0]), Ingest::Malformed(Malformed::Field));
    assert_eq!(ingest(3, &[9, 7, 0, 0, 0, 0]), Ingest::Malformed(Malformed::Field));
    assert_eq!(ingest(3, &[1, 0x10, 0, 0, 0, 1]), Ingest::Malformed(Malformed::Field));
    assert_eq!(ingest(3, &[3, 7]), Ingest::Malformed(Malformed::Length(2)));
    assert_eq!(ingest(4, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    assert_eq!(ingest(13, &[4, 7, 0, 0, 0, 0]), Ingest::Unrelated);
    let counters = bench.joints.counters();
    assert_eq!((counters.bad_length, counters.bad_field), (1, 2));
    assert_eq!((counters.foreign_commands, counters.unattached), (2, 1));
    assert_eq!(bench.state(0).bad_replies, 5);
}

#[test]
fn ids_and_parameters_that_make_no_sense_are_named() {
    let mut joints = Joints::new();
    let mut refused = |config| joints.attach(config).unwrap_err().to_string();
    assert_eq!(refused(Config::new(0)), "snake joint #0: the id is not within 1..=12");
    assert_eq!(refused(Config::new(13)), "snake joint #13: the id is not within 1..=12");
    for rpm in [-1.0, 256.0, f32::NAN] {
        let speed = AngularVelocity::from_rpm(rpm);
        assert_eq!(
            refused(Config::new(1).with_speed(speed)),
            "snake joint #1: speed is not usable"
        );
    }
    let settings = Settings::new().with_current(0);
    assert_eq!(
        refused(Config::new(1).with_settings(settings)),
        "snake joint #1: current is not usable"
    );
    joints.attach(Config::new(1)).unwrap();
    assert_eq!(joints.attach(Config::new(1)), Err(AttachError::Taken(slot::name(1))));
    assert_eq!(joints.joints().count(), 1);
}

#[test]
fn a_detached_joint_is_disabled_once_and_its_handle_finds_nothing() {
    let mut bench = Bench::armed(&[1, 2]);
    bench.drive(50);
    let gone = bench.handles[0];
    bench.joints.detach(gone);
    let sent = bench.run(50);
    assert_eq!(sent[0], (1, Command::DISABLE));
    assert!(sent[1..].iter().all(|(id, _)| *id == 2));
    let again = bench.joints.attach(Config::new(1)).unwrap();
    assert_eq!(bench.joints.set_pulses(gone, 0), Err(TargetError::Detached));
    assert_eq!((bench.joints.state(gone), bench.joints.link(again)), (None, Some(Link::Unheard)));
    for _ in 0..14 {
        let last = bench.joints.joints().next().unwrap().0;
        bench.joints.detach(last);
        bench.joints.attach(Config::new(1)).unwrap();
    }
    let last = bench.joints.joints().next().unwrap().0;
    bench.joints.detach(last);
    assert_eq!(bench.joints.attach(Config::new(1)), Err(AttachError::WornOut(slot::name(1))));
}

#[test]
fn a_driver_that_takes_one_frame_a_tick_starves_no_joint() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    let mut asked = [0; 12];
    let mut written = [0; 12];
    for _ in 0..2_400 {
        bench.ms += 1;
        for joint in bench.handles.clone() {
            _ = bench.joints.set_pulses(joint, 1_000);
        }
        bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
        let sent = bench.joints.next_frame().unwrap();
        if let Some(refused) = bench.joints.next_frame() {
            assert!(bench.joints.requeue(&refused));
        }
        let id = u8::try_from(sent.header()).unwrap();
        let command = Command::decode(sent.data()).unwrap();
        let counts = if command.is_safe() { &mut asked } else { &mut written };
        counts[usize::from(id - 1)] += 1;
        bench.answer(id, command);
    }
    assert!(written.iter().all(|count| *count > 20), "{written:?}");
    assert!(asked.iter().all(|count| *count > 20), "{asked:?}");
}

#[test]
fn an_emergency_stop_in_the_middle_of_a_tick_disables_all_with_the_next_frames() {
    let mut bench = Bench::armed(&ALL);
    bench.drive(200);
    bench.ms += 1;
    bench.joints.update(Tick::new(at_ms(bench.ms), 0.001));
    bench.joints.emergency_stop();
    let sent: Vec<_> = core::iter::from_fn(|| bench.joints.next_frame()).collect();
    let stops = sent.iter().filter(|frame| Command::decode(frame.data()) == Some(Command::DISABLE));
    assert_eq!((stops.count(), sent.len()), (12, 13)); // and one question
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Err(ArmError::Stopped));
}
