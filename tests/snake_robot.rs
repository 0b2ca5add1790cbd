//! What the example `snake` shows, as assertions: the whole robot, its faults, its bus, and its two processes.

#![cfg(test)]

#[expect(dead_code, reason = "the example's own report")]
#[path = "../examples/snake/system/mod.rs"]
mod system;

use drivetrain::frame::CanFrame;
use drivetrain::sim::{Sender, Transmission};
use drivetrain::snake::{Command, Register};
use embedded_can::Frame;
use std::net::TcpListener;
use std::time::Duration;
use system::checks::{self, RMS_LIMIT_DEG};
use system::robot::Event;
use system::simulation::{Run, Setup, Trouble};
use system::tcp;

fn setup(seed: u64, trouble: Option<Trouble>) -> Setup {
    Setup { seconds: 10.0, seed, trouble }
}

fn run(seed: u64, trouble: Option<Trouble>) -> Run {
    setup(seed, trouble).run(|_| {}).unwrap()
}

fn assert_all_hold(run: &Run) {
    let name = run.setup.trouble.map_or("no fault", Trouble::name);
    for check in checks::checks(run) {
        assert!(check.holds, "{name}, seed {}: {}", run.setup.seed, check.what);
    }
}

#[test]
fn the_joints_track_the_gait_within_a_degree_over_a_noisy_line() {
    for seed in [1, 2] {
        let run = run(seed, None);
        assert!(run.worst_rms_deg(false) < RMS_LIMIT_DEG, "seed {seed}");
        assert!(run.down.1.checksum_errors > 0, "the noise did something");
        assert_all_hold(&run);
    }
}

#[test]
fn a_host_that_falls_silent_relaxes_the_robot_until_the_operator_says_so() {
    assert_all_hold(&run(1, Some(Trouble::HostLineCut)));
    let storm = run(1, Some(Trouble::CorruptStream));
    assert_all_hold(&storm);
    assert!(storm.down.1.skipped_bytes > 1_000 && storm.host_losses == 1);
}

#[test]
fn a_lost_joint_relaxes_all_and_waits_to_be_armed() {
    assert_all_hold(&run(2, Some(Trouble::SilentJoint)));
    assert_all_hold(&run(2, Some(Trouble::JointPowerLoss)));
}

#[test]
fn a_reset_in_motion_makes_the_present_position_zero_and_jumps_nowhere() {
    assert_all_hold(&run(3, Some(Trouble::ResetInMotion)));
}

#[test]
fn a_controller_that_starts_again_disables_what_still_runs() {
    let run = run(4, Some(Trouble::ControllerReset));
    assert_all_hold(&run);
    let armed = run.events.iter().filter(|(_, event)| *event == Event::Armed).count();
    assert_eq!(armed, 4, "at the start and again by the operator, each time zeroed and enabled");
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let angles = |seed| -> Vec<_> {
        let run = Setup { seconds: 10.0, seed, trouble: None }.run(|_| {}).unwrap();
        run.samples.iter().map(|sample| sample.true_deg).collect()
    };
    assert!(angles(5) == angles(5));
    assert!(angles(5) != angles(6));
}

/// The bits of a standard data frame as they go over the wire, stuff bits, checksum and pause included; written down from
/// the specification (Bosch CAN 2.0 B, chapters 3.1 and 5), and not with the simulator's code.
fn bits_on_the_wire(frame: &CanFrame) -> usize {
    let mut bits = vec![false];
    let mut put = |value: u32, width: u32| {
        bits.extend((0..width).rev().map(|place| value >> place & 1 == 1));
    };
    put(frame.header(), 11);
    put(0, 3);
    put(u32::try_from(frame.data().len()).unwrap(), 4);
    frame.data().iter().for_each(|byte| put(u32::from(*byte), 8));
    let crc = bits.iter().fold(0_u32, |crc, bit| {
        let shifted = crc << 1;
        (if *bit != (crc >> 14 & 1 == 1) { shifted ^ 0x4599 } else { shifted }) & 0x7FFF
    });
    bits.extend((0..15).rev().map(|place| crc >> place & 1 == 1));
    let (mut stuffed, mut equal, mut last) = (0, 0, None);
    for bit in bits.iter().copied() {
        equal = if last == Some(bit) { equal + 1 } else { 1 };
        last = Some(bit);
        if equal == 5 {
            // A bit of the other value, which counts as the first of its kind.
            (stuffed, equal, last) = (stuffed + 1, 1, Some(!bit));
        }
    }
    bits.len() + stuffed + 10 + 3
}

#[test]
fn the_load_is_that_of_the_bits_and_between_nominal_and_worst_case() {
    let setup = setup(1, None);
    let (from_s, until_s) = setup.steady();
    let mut bits = 0;
    let run = setup
        .run(|record| {
            if (from_s..until_s).contains(&system::seconds(record.at)) {
                bits += bits_on_the_wire(&record.frame);
            }
        })
        .unwrap();
    let counted = bits as f64 / (f64::from(until_s - from_s) * 1e6);
    let printed = f64::from(run.traffic.load());
    assert!((printed / counted - 1.0).abs() < 0.001, "{printed} is not {counted}");
    let (nominal, worst) = (f64::from(run.budget.nominal()), f64::from(run.budget.worst_case()));
    assert!(nominal < counted && counted < worst && worst < 0.9, "{nominal} {counted} {worst}");
}

#[test]
fn nothing_is_sent_to_a_joint_that_owes_an_answer() {
    let mut owes = [None::<Register>; 13];
    let (mut asked, mut answered) = (0, 0);
    let mut watch = |record: &Transmission| {
        let Some(owed) = owes.get_mut(usize::try_from(record.frame.header()).unwrap()) else {
            return;
        };
        if record.sender == Sender::Controller {
            assert_eq!(*owed, None, "{record} while an answer is due");
            if let Some(Command::Read(register)) = Command::decode(record.frame.data()) {
                *owed = Some(register);
                asked += 1;
            }
        } else {
            let (register, _) = Register::from_reply(record.frame.data()).unwrap();
            assert_eq!(owed.take(), Some(register));
            answered += 1;
        }
    };
    // The predecessor's question may be open when a controller starts, so not that one.
    setup(1, Some(Trouble::ResetInMotion)).run(&mut watch).unwrap();
    assert!(asked > 9_000 && asked - answered <= 1, "{asked} {answered}");
}

/// Runs host and robot in threads, in processes in CI; real bytes over TCP in both. Each side is held up by its hitch.
fn talk(robot_hitch: impl FnMut() + Send + 'static, host_hitch: impl FnMut()) {
    const SECONDS: f32 = 4.0;
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let robot = std::thread::spawn(move || {
        tcp::robot(&listener, SECONDS, 1, robot_hitch).map_err(|error| error.to_string())
    });
    let host = tcp::host(port, SECONDS, host_hitch).unwrap();
    let robot = robot.join().unwrap().unwrap();
    assert_eq!((host.verdict(0.05), robot.verdict(0.05)), (Ok(()), Ok(())));
    let (down, up) = ((robot.counts.frames, host.sent), (host.counts.frames, robot.sent));
    assert!(down.0 <= down.1 && up.0 <= up.1, "came and sent: {down:?} {up:?}");
}

/// Sleeps for so many ms in each turn of that number.
fn every(turns: u32, ms: u64) -> impl FnMut() + Send {
    let mut turn = 0;
    move || {
        turn += 1;
        if turn % turns == 0 {
            std::thread::sleep(Duration::from_millis(ms));
        }
    }
}

#[test]
fn host_and_robot_talk_over_tcp() {
    talk(|| {}, || {});
}

/// Turns that a busy machine stretches: at d71443a a robot that simulates slower than real time never read again.
#[test]
fn a_robot_that_is_slower_than_real_time_and_its_host_talk_over_tcp() {
    talk(every(600, 100), || {});
}

/// At d71443a the robot made up for the delay in one go, without reading, and counted several frames in one write as one that was
/// sent.
#[test]
fn a_robot_that_is_held_up_and_its_host_talk_over_tcp() {
    talk(every(5_000, 300), || {});
}

/// At d71443a the robot stopped whenever it did not hear the host for 160 ms.
#[test]
fn a_robot_and_its_host_that_is_held_up_talk_over_tcp() {
    talk(every(4_000, 200), every(100, 200));
}
