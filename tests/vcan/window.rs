//! The window of the bench on a real CAN stack: tmux types the keys of a session and reads the screens.

use super::{BUS, Robot, output, result};
use crate::judge::end_with_zeros;
use drivetrain::sim::{MotorConfig, Simulation};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const COMMANDS: &str = "200#";
const ZEROS: &str = "200#0000000000000000";

/// An M3508 on the bus, by the clock.
struct Motor {
    is_silent: Arc<AtomicBool>,
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<Vec<String>>,
}

impl Motor {
    fn start() -> Self {
        let (is_silent, is_over) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let (silent, over) = (is_silent.clone(), is_over.clone());
        let thread = std::thread::spawn(move || {
            let world = Simulation::new(3);
            world.attach(MotorConfig::m3508(1)).unwrap();
            let mut robot = Robot::new(world);
            while !over.load(Ordering::Relaxed) {
                if silent.load(Ordering::Relaxed) {
                    robot.receive();
                } else {
                    robot.feed_back();
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            robot.receive();
            robot.received
        });
        Self { is_silent, is_over, thread }
    }

    /// The frames that it received.
    fn end(self) -> Vec<String> {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

fn tmux(arguments: &[&str]) -> String {
    // Its socket, and its log on a failure.
    let socket = result("tmux");
    output("tmux", &[&["-u", "-f", "/dev/null", "-S", &socket], arguments].concat())
}

fn keys(keys: &[&str]) {
    tmux(&[&["send-keys", "-t", "bench"], keys].concat());
}

fn screen() -> String {
    tmux(&["capture-pane", "-p", "-t", "bench"])
}

/// Waits until a line of the screen has all these words.
fn sees(words: &[&str]) {
    for _ in 0..200 {
        let screen = screen();
        if screen.lines().any(|line| words.iter().all(|word| line.contains(word))) {
            return;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("{words:?} is not on the screen:\n{}", screen());
}

/// A screen without what the clock of the PC decides: a number is N, the strip chart is its frame, and the log is
/// its order to cut the battery. A late frame may make a position uncertain.
fn masked(screen: &str) -> String {
    let (mut lines, mut is_log): (Vec<String>, bool) = (Vec::new(), false);
    for line in screen.lines() {
        is_log = (is_log || line.starts_with("┌log")) && !line.starts_with('└');
        let is_edge = line.starts_with('│') && !line.contains(": cut the battery");
        if is_log && is_edge {
            continue;
        }
        let (mut masked, mut before) = (String::new(), ' ');
        for sign in
            line.replace(", position uncertain", "").replace("position uncertain", "").chars()
        {
            let is_name = before.is_alphanumeric() && !masked.ends_with('N') || before == '#';
            before = sign;
            let sign = match sign {
                '\u{2800}'..='\u{28FF}' => ' ',
                '0'..='9' | '.' if !is_name => 'N',
                _ => sign,
            };
            // Of a number, a gap or a border, one sign.
            if !(matches!(sign, ' ' | '─' | 'N') && masked.ends_with(sign)) {
                masked.push(sign);
            }
        }
        let line = masked.replace("-N", "N").trim_end().to_owned();
        if !line.chars().all(|sign| matches!(sign, '│' | ' ')) {
            lines.push(line);
        }
    }
    lines.join("\n") + "\n"
}

/// Waits until the screen, masked, is the expected one.
fn shows(name: &str, expected: &str) {
    for _ in 0..100 {
        if masked(&screen()) == expected {
            return;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("the screen is not that of {name}:\n{}\nbut:\n{}", expected, masked(&screen()));
}

#[test]
#[ignore = "needs vcan0 and tmux: tests/vcan/run starts a Linux that has them"]
fn a_session_in_the_window_goes_from_the_start_to_a_stop() {
    let motor = Motor::start();
    let bench = std::env::var("VCAN_BENCH").unwrap();
    let command =
        format!("{bench} --interface {BUS} --motors m3508:1; echo exit code $?; busybox sleep 600");
    tmux(&["new-session", "-d", "-s", "bench", "-x", "140", "-y", "40", &command]);
    sees(&["drivetrain bench  vcan0  listening, nothing is sent"]);
    sees(&["M3508 #1", "Online", "relaxed"]);
    shows("start", include_str!("screens/start.txt"));
    std::thread::sleep(Duration::from_millis(300));
    keys(&["A"]);
    std::thread::sleep(Duration::from_millis(300));
    sees(&["drivetrain bench  vcan0  ARMED"]);
    sees(&["M3508 #1", "Online", " still "]);
    shows("armed", include_str!("screens/armed.txt"));
    // All three presses count, whatever picture stands between them.
    keys(&["S-Right", "Right", "Right"]);
    sees(&["M3508 #1", " 120.0 ", " speed "]);
    shows("jog", include_str!("screens/jog.txt"));
    keys(&["t"]);
    sees(&["PidConfig::new(", ").with_output_limit(6.0)"]);
    keys(&["S-Right"]);
    sees(&["M3508 #1", " 100.0 ", " speed "]);
    motor.is_silent.store(true, Ordering::Relaxed);
    sees(&["all stop: M3508 #1"]);
    sees(&["M3508 #1 is not heard: cut the battery"]);
    shows("fault", include_str!("screens/fault.txt"));
    motor.is_silent.store(false, Ordering::Relaxed);
    sees(&["drivetrain bench  vcan0  listening, nothing is sent"]);
    std::thread::sleep(Duration::from_millis(300));
    keys(&["A"]);
    std::thread::sleep(Duration::from_millis(300));
    sees(&["drivetrain bench  vcan0  ARMED"]);
    keys(&["S-Right"]);
    sees(&["M3508 #1", " 100.0 ", " speed "]);
    keys(&["?", "Escape"]);
    sees(&["drivetrain bench  vcan0  listening, nothing is sent"]);
    keys(&["q"]);
    sees(&["exit code 0"]);
    tmux(&["kill-server"]);
    let received = motor.end();
    let drives = |frame: &&String| frame.starts_with(COMMANDS) && *frame != ZEROS;
    assert!(received.iter().filter(drives).count() > 1_000, "{} frames", received.len());
    end_with_zeros(&received, &["200"]);
}
