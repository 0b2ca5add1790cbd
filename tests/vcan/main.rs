//! A real CAN stack: the bench on a `vcan0` of Linux, a simulated robot on its other side, and candump as the
//! witness of both. [`run`](../run) emulates a PC with a Linux of its own, so that nothing of the host's kernel is needed.
//!
//! The two go in lock-step, a millisecond for each line: so no step depends on the clock. The interface loses and doubles frames,
//! and its queue is full for a while; among the robot's frames are foreign, remote, extended, malformed and error
//! frames. Afterwards every frame has to be accounted for: I6 of `docs/faults.md`, by three counts that are not ours.
//! And a chassis has to move as the bench is asked to.
//!
//! Two CAN controllers with drivers carry the same bench in [`controllers`]. In [`foreign`] a master that others wrote drives simulated
//! drives. In [`window`] tmux types the keys of a session.

#![cfg(test)]
#![cfg(target_os = "linux")]

mod controllers;
mod ends;
mod foreign;
mod judge;
mod window;

use drivetrain::frame::CanFrame;
use drivetrain::geometry::Vec2;
use drivetrain::sim::{ChassisConfig, Line, MotorConfig, Sender, Simulation, Wheel};
use drivetrain::time::Duration;
use judge::{Judge, Phase, Written, end_with_zeros, line_of};
use socketcan::{
    CanErrorFrame, CanFilter, CanSocket, EmbeddedFrame, Frame, Socket, SocketOptions, StandardId,
};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};

const BUS: &str = "vcan0";
/// Between two phases, with nothing in the way of it.
const MARKER: u16 = 0x7F0;
/// After everything else.
const END: u16 = 0x7F1;
const RPM: f32 = 60.0;

/// Name, queueing discipline between the sockets and the bus, milliseconds.
const PHASES: [(&str, &str, u32); 6] = [
    ("clean", "", 1_500),
    ("5 % lost", "netem loss 5%", 4_000),
    ("2 % doubled", "netem duplicate 2%", 2_000),
    ("both", "netem loss 5% duplicate 2%", 3_000),
    // Room for four frames, and none leaves before it is pulled out.
    ("queue full", "plug limit 64", 60),
    ("clean again", "", 1_000),
];

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    for _ in 0..10_000 {
        if done() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("{what}: waited in vain; the bench said: {}", said());
}

fn output(program: &str, arguments: &[&str]) -> String {
    let done = Command::new(program).args(arguments).output().unwrap();
    assert!(done.status.success(), "{program} {arguments:?}: {done:?}");
    String::from_utf8(done.stdout).unwrap()
}

/// Changes what stands between the sockets and the bus.
fn queueing(change: &str, discipline: &str) {
    queueing_on(BUS, change, discipline);
}

fn queueing_on(interface: &str, change: &str, discipline: &str) {
    let words = ["qdisc", change, "dev", interface, "root"].into_iter();
    output("tc", &words.chain(discipline.split_whitespace()).collect::<Vec<_>>());
}

/// Frames that the kernel dropped, and those that still wait.
fn queue(interface: &str) -> (u64, u64) {
    let text = output("tc", &["-s", "qdisc", "show", "dev", interface]);
    let number = |after: &str| {
        let rest = text.split(after).nth(1)?;
        rest.split(|end: char| !end.is_ascii_digit()).next()?.parse().ok()
    };
    let waiting = text.split("backlog ").nth(1).and_then(|bytes| bytes.split_once("b "));
    let waiting = waiting.and_then(|(_, packets)| packets.split_once('p')?.0.parse().ok());
    let counts = number("dropped ").zip(waiting);
    counts.unwrap_or_else(|| panic!("what tc says has another form:\n{text}"))
}

/// A file that the host sees too.
fn result(name: &str) -> String {
    let folder = PathBuf::from(std::env::var("VCAN_RESULTS").unwrap());
    folder.join(name).to_str().unwrap().to_owned()
}

/// Standard error of the last bench.
fn said() -> String {
    fs::read_to_string(result("said")).unwrap()
}

/// The bench, one millisecond after the other.
struct Bench {
    child: Child,
    steps: ChildStdin,
    answers: BufReader<UnixStream>,
}

impl Bench {
    fn start(arguments: &[&str]) -> Self {
        Self::in_real_time(&[&["--lock-step"], arguments].concat())
    }

    fn in_real_time(arguments: &[&str]) -> Self {
        // Full after some hundred lines which nobody reads; a pipe would take 32 000.
        let (answers, stdout) = UnixStream::pair().unwrap();
        let mut child = Command::new(std::env::var("VCAN_BENCH").unwrap())
            .args(["spin", "--interface", BUS, "--arm"])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(OwnedFd::from(stdout))
            .stderr(File::create(result("said")).unwrap())
            .spawn()
            .unwrap();
        let steps = child.stdin.take().unwrap();
        Self { child, steps, answers: BufReader::new(answers) }
    }

    fn step(&mut self) {
        writeln!(self.steps).unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        assert_eq!(answer, ".\n");
    }

    /// Ends it, and returns what it reports.
    fn end(mut self) -> Vec<String> {
        drop(self.steps);
        let report = self.answers.lines().map(Result::unwrap).collect();
        assert!(self.child.wait().unwrap().success(), "{}", said());
        report
    }
}

/// A socket that gets the test's own frames only. The kernel gives a frame to all sockets at once and keeps the order: when
/// this one has a frame, everybody has everything that went before it. Without it a busy machine may be late with the last
/// frames, and the bench would end before them.
struct Witness(CanSocket);

impl Witness {
    fn new() -> Self {
        Self::on(BUS)
    }

    fn on(interface: &str) -> Self {
        let socket = CanSocket::open(interface).unwrap();
        socket.set_nonblocking(true).unwrap();
        let filters = [MARKER, END].map(|id| CanFilter::new(id.into(), 0x7FF));
        socket.set_filters(&filters).unwrap();
        Self(socket)
    }

    fn has_seen(&self, id: u16, data: u8) {
        wait_until("a marker on the bus", || {
            let Ok(frame) = self.0.read_frame() else { return false };
            frame.raw_id() == u32::from(id) && frame.data()[0] == data
        });
    }
}

struct Robot {
    world: Simulation,
    socket: CanSocket,
    written: Written,
    /// The received frames, as candump would write them.
    received: Vec<String>,
    ms: u32,
}

impl Robot {
    fn new(world: Simulation) -> Self {
        Self::on(BUS, world)
    }

    fn on(interface: &str, world: Simulation) -> Self {
        let socket = CanSocket::open(interface).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self { world, socket, written: Written::default(), received: Vec::new(), ms: 0 }
    }

    fn write(&mut self, frame: &socketcan::CanFrame) {
        match self.socket.write_frame(frame) {
            Ok(()) => self.written.accepted += 1,
            // No buffer space: the queue is full.
            Err(error) => {
                assert_eq!(error.raw_os_error(), Some(105), "{error}");
                self.written.refused += 1;
            }
        }
    }

    fn mark(&mut self, witness: &Witness, id: u16, count: u8) {
        self.data(StandardId::new(id).unwrap(), &[count]);
        witness.has_seen(id, count);
    }

    fn data(&mut self, id: impl Into<embedded_can::Id>, data: &[u8]) {
        self.write(&socketcan::CanFrame::new(id, data).unwrap());
    }

    fn error(&mut self, class: u32, data: &[u8]) {
        self.write(&CanErrorFrame::new_error(class, data).unwrap().into());
    }

    /// A millisecond: takes the commands that have come, and sends feedback and much else.
    fn step(&mut self) {
        self.feed_back();
        self.noise();
        self.ms += 1;
    }

    /// The motors alone.
    fn feed_back(&mut self) {
        self.receive();
        let mut feedback: Vec<CanFrame> = Vec::new();
        self.world.advance_with(Duration::from_millis(1), |record| {
            if record.sender != Sender::Controller {
                feedback.push(record.frame);
            }
        });
        for frame in feedback {
            self.write(&frame.convert::<socketcan::CanFrame>().unwrap());
        }
    }

    fn receive(&mut self) {
        while let Ok(frame) = self.socket.read_frame() {
            self.received.push(line_of(&frame));
            let frame = CanFrame::copy_of(&frame).unwrap();
            _ = embedded_can::nb::Can::transmit(&mut self.world.controller_on(Line::Can1), &frame);
        }
    }

    /// Frames that are no feedback of these motors, or look like it.
    fn noise(&mut self) {
        let standard = |id| StandardId::new(id).unwrap();
        let count = self.ms.to_be_bytes();
        let ids = [standard(0x201), standard(0x203), standard(0x209)];
        let id = ids[self.ms as usize % 3];
        self.data(standard(0x300 + (self.ms % 64) as u16), &count);
        match self.ms % 8 {
            0 => self.write(&socketcan::CanFrame::new_remote(id, 8).unwrap()),
            1 | 5 => {
                let extended = socketcan::ExtendedId::new(u32::from(id.as_raw())).unwrap();
                self.data(extended, &[0; 8]);
            }
            2 => self.data(id, &count),
            3 => self.data(id, &[0x20, 0, 0, 0, 0, 0, 0, 0]),
            // Another motor of the family, which is not attached.
            4 => self.data(standard(0x208), &[0; 8]),
            // The number of an error frame is its class: this one would be a motor's id.
            6 => self.error(0x201, &[0; 8]),
            _ => self.error(0x004, &[0, 1, 0, 0, 0, 0, 0, 0]),
        }
    }
}

#[test]
#[ignore = "needs vcan0, candump and tc: tests/vcan/run starts a Linux that has them"]
fn every_frame_on_a_real_can_stack_is_accounted_for() {
    let witness = Witness::new();
    let world = Simulation::new(1);
    let mut configs: Vec<_> = (1..=4).map(MotorConfig::m3508).collect();
    configs.push(MotorConfig::gm6020_voltage(5));
    let keys: Vec<_> = configs.into_iter().map(|config| world.attach(config).unwrap()).collect();
    let mut robot = Robot::new(world);
    let (motors, rpm, log) = ("m3508:1-4,gm6020:5", RPM.to_string(), result("ours.log"));
    let mut bench = Bench::start(&["--motors", motors, "--rpm", &rpm, "--log", &log]);
    let mut candump = Command::new("candump")
        .args(["-L", "-r", "16777216", &format!("{BUS},0:0,#FFFFFFFF")])
        .stdout(File::create(result("candump.log")).unwrap())
        .spawn()
        .unwrap();
    wait_until("three sockets on the bus", || {
        let listeners = |file: &str| fs::read_to_string(file).unwrap().matches(" raw").count();
        listeners("/proc/net/can/rcvlist_all") >= 3 && listeners("/proc/net/can/rcvlist_err") >= 2
    });

    let mut phases = Vec::new();
    for (index, (name, discipline, ms)) in PHASES.into_iter().enumerate() {
        if !discipline.is_empty() {
            queueing("add", discipline);
        }
        robot.written = Written::default();
        for _ in 0..ms {
            robot.step();
            bench.step();
        }
        if discipline.starts_with("plug") {
            queueing("change", "plug release_indefinite");
        }
        wait_until("an empty queue", || queue(BUS).1 == 0);
        let dropped = if discipline.is_empty() { 0 } else { queue(BUS).0 };
        if !discipline.is_empty() {
            queueing("del", "");
        }
        // What still came, then the marker. With frames of the robot before the commands: where one of the last two was lost,
        // the other would be followed by its like.
        robot.step();
        bench.step();
        let written = robot.written;
        robot.receive();
        robot.mark(&witness, MARKER, u8::try_from(index).unwrap());
        bench.step();
        phases.push(Phase { name, written, dropped });
    }
    for _ in 0..200 {
        robot.step();
        bench.step();
    }
    robot.mark(&witness, MARKER, u8::try_from(PHASES.len()).unwrap());
    bench.step();
    let reached: Vec<f32> =
        keys.iter().map(|key| robot.world.motor(*key).unwrap().velocity.as_rpm()).collect();
    let report = bench.end();
    robot.mark(&witness, END, 0);
    robot.receive();
    // candump is slower than the others, and writes in blocks: it has caught up when what comes last is in its file.
    for _ in 0..1_000 {
        robot.data(StandardId::new(END).unwrap(), &[0; 8]);
    }
    wait_until("the end of what candump writes", || {
        fs::read_to_string(result("candump.log")).unwrap().contains(" 7F1#")
    });
    output("busybox", &["kill", "-TERM", &candump.id().to_string()]);
    candump.wait().unwrap();

    let judge =
        Judge::new(&result("candump.log"), &result("ours.log"), &report, robot.received, phases);
    judge.bytes_are_equal();
    judge.all_motors_are_left_at_zero();
    judge.print_table();
    judge.frames_add_up();
    assert!(reached.iter().all(|rpm| (rpm - RPM).abs() < 3.0), "{reached:?} rpm, not {RPM}");
    println!("motors at the end: {reached:.1?} rpm, {RPM} asked for");
}

/// The body is the simulator's and knows nothing of the kinematics. Ids 1 to 4 stand as the bench's help says: front right,
/// front left, rear left, rear right.
#[test]
#[ignore = "needs vcan0: tests/vcan/run starts a Linux that has it"]
fn a_mecanum_chassis_moves_as_it_is_asked_and_is_left_at_zero() {
    let (ahead, left, turn) = (0.6, -0.3, 0.8);
    let world = Simulation::new(2);
    let places = [(0.20, -0.18), (0.20, 0.18), (-0.20, 0.18), (-0.20, -0.18)];
    let wheels: Vec<_> = (1..)
        .zip(places)
        .map(|(id, (x, y))| {
            let motor = world.attach(MotorConfig::m3508(id)).unwrap();
            let wheel = Wheel::mecanum(motor, 0.076, Vec2::new(x, y));
            if y < 0.0 { wheel.reversed() } else { wheel }
        })
        .collect();
    world.attach_chassis(ChassisConfig::new(&wheels)).unwrap();
    let mut robot = Robot::new(world);
    let mut bench = Bench::start(&["--mecanum", &format!("{ahead},{left},{turn}")]);
    for _ in 0..2_000 {
        bench.step();
        robot.step();
    }
    let moved = robot.world.chassis().unwrap().1;
    bench.end();
    robot.mark(&Witness::new(), END, 0);
    robot.receive();
    end_with_zeros(&robot.received, &["200"]);
    let off = [moved.vx_m_s - ahead, moved.vy_m_s - left, moved.wz_rad_s - turn];
    assert!(off.iter().all(|off| off.abs() < 0.02), "{moved:?}");
    println!("chassis: {moved:.3?}");
}
