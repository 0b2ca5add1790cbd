//! Whatever ends the bench or holds up what it says, the motors are left at zero. What a drive does with its last current
//! when nobody sends it another is not known.

use super::{Bench, END, Robot, Witness, output, queueing, result, said, wait_until};
use crate::judge::end_with_zeros;
use drivetrain::sim::{MotorConfig, Simulation};
use std::fs::File;
use std::io::{BufRead, Write};
use std::net::Shutdown;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitStatus};

const ZEROS: &str = "200#0000000000000000";

const ASKED: [&str; 4] = ["--motors", "m3508:1", "--rpm", "60"];

fn robot() -> Robot {
    let world = Simulation::new(3);
    world.attach(MotorConfig::m3508(1)).unwrap();
    Robot::new(world)
}

/// Half a second later the motor turns.
fn driven(more: &[&str]) -> (Robot, Bench) {
    let mut robot = robot();
    let mut bench = Bench::start(&[&ASKED, more].concat());
    for _ in 0..500 {
        bench.step();
        robot.step();
    }
    assert_ne!(robot.received.last().unwrap(), ZEROS);
    (robot, bench)
}

pub(crate) fn signal(name: &str, bench: &Bench) {
    output("busybox", &["kill", name, &bench.child.id().to_string()]);
}

/// What comes before the marker is all that it sent.
fn is_left_at_zero(robot: &mut Robot, witness: &Witness) {
    robot.mark(witness, END, 0);
    robot.receive();
    end_with_zeros(&robot.received, &["200"]);
}

pub(crate) fn ends(bench: &mut Bench) -> ExitStatus {
    wait_until("the end of the bench", || bench.child.try_wait().unwrap().is_some());
    bench.child.wait().unwrap()
}

/// As people use it, by the clock; the others here go step by step.
struct ByTheClock {
    robot: Robot,
    bench: Bench,
}

impl ByTheClock {
    /// Driven, for a second and more.
    fn start(seconds: &str) -> Self {
        let (robot, arguments) = (robot(), [&ASKED[..], &["--seconds", seconds]].concat());
        let mut running = Self { robot, bench: Bench::in_real_time(&arguments) };
        wait_until("a motor that is driven", || {
            running.millisecond();
            running.robot.received.iter().any(|frame| frame != ZEROS)
        });
        (0..1_000).for_each(|_| running.millisecond());
        running
    }

    fn millisecond(&mut self) {
        self.robot.step();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }

    /// Goes on with `meanwhile` until it ends.
    fn end(mut self, meanwhile: fn(&mut Self)) -> ExitStatus {
        wait_until("the end of the bench", || {
            meanwhile(&mut self);
            !is_there(&mut self.bench)
        });
        is_left_at_zero(&mut self.robot, &Witness::new());
        assert!(self.bench.answers.lines().any(|line| line.unwrap().starts_with("packed ")));
        self.bench.child.wait().unwrap()
    }
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn the_motors_are_left_at_zero_when_the_time_is_over_or_somebody_ends_it() {
    assert!(ByTheClock::start("3").end(ByTheClock::millisecond).success(), "{}", said());
    let running = ByTheClock::start("100");
    signal("-INT", &running.bench);
    assert!(running.end(ByTheClock::millisecond).success(), "{}", said());
}

/// The zeros are on the bus, but nobody knows whether it has them.
#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_motor_that_falls_silent_at_the_end_is_named() {
    let running = ByTheClock::start("100");
    signal("-INT", &running.bench);
    assert_eq!(running.end(|silent| silent.robot.receive()).code(), Some(1));
    let end = "M3508 #1 is not heard, and the last command may stand";
    assert!(said().contains(end), "{}", said());
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_motor_that_falls_silent_stops_all_and_is_named() {
    let (mut robot, mut bench) = driven(&[]);
    wait_until("the end of the bench", || {
        _ = writeln!(bench.steps);
        !is_there(&mut bench)
    });
    assert_eq!(ends(&mut bench).code(), Some(1));
    is_left_at_zero(&mut robot, &Witness::new());
    assert!(said().starts_with("bench: all stop: M3508 #1: "), "{}", said());
}

/// Room for four frames, and none leaves: the last command stands, and so do those in the queue.
#[test]
#[ignore = "needs vcan0 and tc: tests/vcan/run starts a Linux that has them"]
fn zeros_that_the_interface_does_not_take_are_waited_for_and_said() {
    for code in [0, 1] {
        let (mut robot, mut bench) = driven(&[]);
        queueing("add", "plug limit 64");
        for _ in 0..5 {
            bench.step();
            robot.step();
        }
        assert_ne!(robot.received.last().unwrap(), ZEROS);
        signal("-TERM", &bench);
        writeln!(bench.steps).unwrap();
        wait_until("a word of it", || said() == "bench: vcan0 takes no zeros: cut the battery\n");
        assert!(is_there(&mut bench), "it left the motor as it was");
        if code == 0 {
            queueing("change", "plug release_indefinite");
        }
        assert_eq!(ends(&mut bench).code(), Some(code));
        queueing("del", "");
        if code == 0 {
            is_left_at_zero(&mut robot, &Witness::new());
        }
    }
}

/// A closed terminal, and Ctrl-Z.
#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn the_motors_are_left_at_zero_when_a_terminal_is_closed_or_would_halt_it() {
    let witness = Witness::new();
    for name in ["-HUP", "-TSTP"] {
        let (mut robot, mut bench) = driven(&[]);
        signal(name, &bench);
        writeln!(bench.steps).unwrap();
        assert!(ends(&mut bench).success(), "{name}");
        is_left_at_zero(&mut robot, &witness);
    }
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn the_motors_are_left_at_zero_when_nobody_can_read_what_it_says() {
    let witness = Witness::new();
    let (mut robot, mut bench) = driven(&[]);
    bench.answers.get_ref().shutdown(Shutdown::Both).unwrap();
    wait_until("the end of the bench", || {
        robot.step();
        _ = writeln!(bench.steps);
        bench.child.try_wait().unwrap().is_some()
    });
    assert!(!ends(&mut bench).success());
    assert!(said().starts_with("bench: standard output: "), "{}", said());
    is_left_at_zero(&mut robot, &witness);
}

/// A thousand answers that nobody reads, as with a full pipe or Ctrl-S: the motor is driven on, and a signal ends that at once.
/// Then only what is to be read waits.
fn unread() -> (Robot, Bench) {
    let (mut robot, mut bench) = driven(&[]);
    for _ in 0..1_000 {
        let seen = robot.received.len();
        writeln!(bench.steps).unwrap();
        wait_until("a command", || {
            robot.receive();
            robot.received.len() > seen
        });
        robot.step();
    }
    end_held_up(&mut robot, &mut bench);
    (robot, bench)
}

/// The motors are safe at once, whatever is still to be written.
fn end_held_up(robot: &mut Robot, bench: &mut Bench) {
    assert_ne!(robot.received.last().unwrap(), ZEROS);
    signal("-TERM", bench);
    writeln!(bench.steps).unwrap();
    wait_until("zeros", || {
        robot.receive();
        robot.received.iter().rev().take_while(|frame| *frame == ZEROS).count() >= 2
    });
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert!(is_there(bench), "nobody held it up");
}

pub(crate) fn is_there(bench: &mut Bench) -> bool {
    bench.child.try_wait().unwrap().is_none()
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_reader_who_does_not_read_holds_up_no_motor() {
    let (mut robot, mut bench) = unread();
    let said: Vec<String> = (&mut bench.answers).lines().map(Result::unwrap).collect();
    assert!(ends(&mut bench).success());
    is_left_at_zero(&mut robot, &Witness::new());
    let answered = said.iter().take_while(|line| *line == ".").count();
    let unread = said.iter().find_map(|line| line.strip_prefix("unread ")).unwrap();
    let unread: usize = unread.parse().unwrap();
    assert_eq!(answered + unread, 1_000);
    assert!(unread > 0);
    println!("of 1000 answers that nobody read for a while {unread} were lost, and no command");
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_second_signal_ends_it_for_a_reader_who_does_not_read() {
    let (mut robot, mut bench) = unread();
    let waits = "bench: nothing more is sent; waits for standard output, and a signal ends that\n";
    wait_until("a word of it", || said() == waits);
    wait_until("its end by a signal", || {
        // It may be about to reckon with one.
        _ = Command::new("busybox").args(["kill", &bench.child.id().to_string()]).output();
        !is_there(&mut bench)
    });
    assert_eq!(ends(&mut bench).signal(), Some(15));
    is_left_at_zero(&mut robot, &Witness::new());
}

/// A pipe that nobody empties: full after half a second.
#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_log_that_takes_nothing_holds_up_no_motor() {
    let pipe = &result("pipe");
    output("busybox", &["mkfifo", pipe]);
    // To open it waits for the other side.
    let reader = std::thread::spawn({
        let pipe = pipe.to_owned();
        move || File::open(pipe).unwrap()
    });
    let (mut robot, mut bench) = driven(&["--log", pipe]);
    for _ in 0..1_000 {
        bench.step();
        robot.step();
    }
    end_held_up(&mut robot, &mut bench);
    let log = std::io::read_to_string(reader.join().unwrap()).unwrap();
    assert!(ends(&mut bench).success());
    is_left_at_zero(&mut robot, &Witness::new());
    let commands = |frames: &mut dyn Iterator<Item = &str>| -> Vec<String> {
        frames.filter(|frame| frame.starts_with("200#")).map(str::to_owned).collect()
    };
    let logged = commands(&mut log.lines().filter_map(|line| line.split(' ').nth(2)));
    assert_eq!(logged, commands(&mut robot.received.iter().map(String::as_str)));
}

#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_log_on_a_full_disk_holds_up_no_motor_and_is_an_error_at_the_end() {
    let (mut robot, mut bench) = driven(&["--log", "/dev/full"]);
    for _ in 0..100 {
        bench.step();
        robot.step();
    }
    assert_ne!(robot.received.last().unwrap(), ZEROS);
    signal("-TERM", &bench);
    writeln!(bench.steps).unwrap();
    assert_eq!(ends(&mut bench).code(), Some(1));
    is_left_at_zero(&mut robot, &Witness::new());
    assert!(said().starts_with("bench: --log /dev/full: "), "{}", said());
    assert!(bench.answers.lines().any(|line| line.unwrap().starts_with("packed ")));
}
