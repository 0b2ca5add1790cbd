//! Two CAN controllers on one bus, the bench on `can0` and the robot on `can1`. Unlike `vcan0` these have drivers: a frame
//! leaves by a transmit queue and comes by an interrupt, and an interface that is taken down drops what waits in its queue.

use super::{
    Bench, END, MARKER, RPM, Robot, Witness, output, queue, queueing_on, said, wait_until,
};
use crate::ends::{ends, is_there, signal};
use crate::judge::end_with_zeros;
use drivetrain::damiao::Model;
use drivetrain::sim::{DamiaoDrive, Drive, MotorConfig, MotorKey, Simulation};
use drivetrain::units::AngularVelocity;
use socketcan::{CanFilter, CanFrame, CanSocket, EmbeddedFrame, Socket, SocketOptions, StandardId};
use std::fs;
use std::io::{BufRead, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The interface of the bench.
const NEAR: &str = "can0";
/// The interface of the robot.
const FAR: &str = "can1";
const COMMANDS: [&str; 2] = ["200", "2FF"];

struct Bus {
    robot: Robot,
    motors: Vec<MotorKey>,
    /// Writes markers behind the frames of the bench.
    near: CanSocket,
    seen_near: Witness,
    seen_far: Witness,
    steps: u64,
}

/// Half a second later the motors turn.
fn driven() -> (Bus, Bench) {
    let world = Simulation::new(4);
    let mut configs: Vec<_> = (1..=4).map(MotorConfig::m3508).collect();
    configs.push(MotorConfig::gm6020_voltage(5));
    let motors = configs.into_iter().map(|config| world.attach(config).unwrap()).collect();
    let mut bus = Bus {
        robot: Robot::on(FAR, world),
        motors,
        near: CanSocket::open(NEAR).unwrap(),
        seen_near: Witness::on(NEAR),
        seen_far: Witness::on(FAR),
        steps: 0,
    };
    let rpm = RPM.to_string();
    let mut bench =
        Bench::start(&["--interface", NEAR, "--motors", "m3508:1-4,gm6020:5", "--rpm", &rpm]);
    // It listens when it has answered.
    bench.step();
    bus.drive(&mut bench, 500);
    assert!(!bus.is_left_at_zero());
    (bus, bench)
}

impl Bus {
    fn drive(&mut self, bench: &mut Bench, ms: u32) {
        for _ in 0..ms {
            self.feed_back();
            bench.step();
            self.deliver();
        }
    }

    /// The number in the markers of this step.
    fn step(&self) -> u8 {
        self.steps.to_le_bytes()[0]
    }

    /// A millisecond of the robot. Returns when the bench's interface has its frames.
    fn feed_back(&mut self) {
        self.steps += 1;
        self.robot.feed_back();
        self.robot.mark(&self.seen_near, MARKER, self.step());
    }

    /// Returns when the robot has every frame that the bench's interface took.
    fn deliver(&mut self) {
        let marker = CanFrame::new(StandardId::new(END).unwrap(), &[self.step()]).unwrap();
        self.near.write_frame(&marker).unwrap();
        self.seen_far.has_seen(END, self.step());
        self.robot.receive();
    }

    /// A bus on which frames that go first leave 16 ms to each command. Returns when the queue is full of commands.
    fn congest(&mut self, bench: &mut Bench) {
        queueing_on(NEAR, "add", "netem rate 8kbit limit 5");
        for _ in 0..20 {
            self.feed_back();
            bench.step();
        }
        assert!(queue(NEAR).1 > 2, "nothing waits");
        self.robot.receive();
        assert!(!self.is_left_at_zero());
    }

    fn commands<'a>(&'a self, id: &'a str) -> impl DoubleEndedIterator<Item = &'a String> {
        self.robot.received.iter().filter(move |frame| frame.split('#').next() == Some(id))
    }

    /// By the last command of each id.
    fn is_left_at_zero(&self) -> bool {
        COMMANDS.iter().all(|id| {
            let last = self.commands(id).next_back();
            last.is_some_and(|frame| frame.ends_with("#0000000000000000"))
        })
    }

    fn received_commands(&self) -> u64 {
        COMMANDS.iter().map(|id| self.commands(id).count() as u64).sum()
    }
}

/// A counter of the driver of an interface.
fn counted(interface: &str, counter: &str) -> u64 {
    let file = format!("/sys/class/net/{interface}/statistics/{counter}");
    fs::read_to_string(file).unwrap().trim().parse().unwrap()
}

/// A counter of the bench.
fn reported(report: &[String], name: &str) -> u64 {
    let count = report.iter().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    count.unwrap_or_else(|| panic!("no {name} in {report:?}")).parse().unwrap()
}

#[test]
#[ignore = "needs can0 and can1 on one bus: tests/vcan/run starts a Linux that has them"]
fn two_controllers_drive_motors_and_their_drivers_count_the_same_frames() {
    const COUNTERS: [(&str, &str); 8] = [
        (NEAR, "tx_packets"),
        (FAR, "rx_packets"),
        (FAR, "tx_packets"),
        (NEAR, "rx_packets"),
        (NEAR, "tx_dropped"),
        (FAR, "tx_dropped"),
        (NEAR, "rx_over_errors"),
        (FAR, "rx_over_errors"),
    ];
    let count = || COUNTERS.map(|(interface, counter)| counted(interface, counter));
    let before = count();
    let (mut bus, mut bench) = driven();
    bus.drive(&mut bench, 1_000);
    let speeds = |motor| bus.robot.world.motor(motor).unwrap().velocity.as_rpm();
    let reached: Vec<f32> = bus.motors.iter().copied().map(speeds).collect();
    let report = bench.end();
    bus.steps += 1;
    bus.deliver();
    end_with_zeros(&bus.robot.received, &COMMANDS);

    let counts = std::array::from_fn(|index| count()[index] - before[index]);
    let (sent, fed_back) = (reported(&report, "sent"), bus.robot.written.accepted);
    assert_eq!(sent, bus.received_commands());
    let (commanded, markers) = (sent + bus.steps, bus.steps - 1 + bus.steps - 1);
    assert_eq!(counts, [commanded, commanded, fed_back, fed_back, 0, 0, 0, 0], "{COUNTERS:?}");
    assert_eq!(reported(&report, "taken"), fed_back - (bus.steps - 1));
    assert_eq!(reported(&report, "unrelated"), markers);
    assert_eq!((reported(&report, "refused"), reported(&report, "send_errors")), (0, 0));
    assert!(reached.iter().all(|rpm| (rpm - RPM).abs() < 3.0), "{reached:?} rpm, not {RPM}");
    println!("{commanded} frames from can0 to can1, {fed_back} back, none lost");
}

#[test]
#[ignore = "needs can0 and can1 on one bus: tests/vcan/run starts a Linux that has them"]
fn a_congested_bus_refuses_commands_loses_none_and_ends_with_zeros() {
    let (mut bus, mut bench) = driven();
    bus.congest(&mut bench);
    signal("-TERM", &bench);
    writeln!(bench.steps).unwrap();
    assert!(ends(&mut bench).success(), "{}", said());
    wait_until("an empty queue", || queue(NEAR).1 == 0);
    let dropped = queue(NEAR).0;
    queueing_on(NEAR, "del", "");
    bus.deliver();
    assert!(bus.is_left_at_zero());
    let report: Vec<String> = bench.answers.lines().map(Result::unwrap).collect();
    let refused = reported(&report, "refused");
    assert_eq!(reported(&report, "sent"), bus.received_commands());
    assert_eq!((refused, 0), (dropped, reported(&report, "send_errors")));
    assert!(refused > 10, "{refused} refused: the queue was hardly full");
    println!("{refused} refused by the queue, {} arrived", bus.received_commands());
}

/// The queue is full of commands that are not zero. Whether the interface comes back or not, they must not arrive.
#[test]
#[ignore = "needs can0 and can1 on one bus: tests/vcan/run starts a Linux that has them"]
fn an_interface_that_goes_down_stops_all_and_no_stale_command_follows() {
    for comes_back in [true, false] {
        let (mut bus, mut bench) = driven();
        bus.congest(&mut bench);
        output("ip", &["link", "set", NEAR, "down"]);
        bus.robot.receive();
        bus.robot.received.clear();
        wait_until("a word of it", || {
            bus.robot.feed_back();
            _ = writeln!(bench.steps);
            said().contains("bench: can0 takes no zeros: cut the battery\n")
        });
        assert!(said().starts_with("bench: all stop: "), "{}", said());
        assert!(is_there(&mut bench), "it left the motors as they were");
        if comes_back {
            output("ip", &["link", "set", NEAR, "up"]);
        }
        assert_eq!(ends(&mut bench).code(), Some(1));
        if !comes_back {
            let end = "bench: can0 takes no zeros, and the last command may stand. Cut the battery";
            assert!(said().contains(end), "{}", said());
            output("ip", &["link", "set", NEAR, "up"]);
        }
        wait_until("an empty queue", || queue(NEAR).1 == 0);
        queueing_on(NEAR, "del", "");
        // The other one still has the error of the interface.
        bus.near = CanSocket::open(NEAR).unwrap();
        bus.deliver();
        let zeros = bus.robot.received.iter().filter(|frame| frame.ends_with("#0000000000000000"));
        assert_eq!(zeros.count() as u64, bus.received_commands(), "a stale command arrived");
        assert_eq!(bus.is_left_at_zero(), comes_back);
        print!("{}", said());
    }
}

/// As a person starts it, by the clock.
#[test]
#[ignore = "needs can0 and can1 on one bus: tests/vcan/run starts a Linux that has them"]
fn the_example_socketcan_turns_a_motor_and_leaves_it_at_zero() {
    let world = Simulation::new(6);
    let motor = world.attach(MotorConfig::m3508(1)).unwrap();
    let mut robot = Robot::on(FAR, world);
    let mut example =
        Command::new(std::env::var("VCAN_EXAMPLE").unwrap()).arg(NEAR).spawn().unwrap();
    let mut millisecond = || {
        robot.feed_back();
        std::thread::sleep(Duration::from_millis(1));
        robot.world.motor(motor).unwrap().velocity.as_rpm()
    };
    wait_until("a motor that turns", || millisecond() > 27.0);
    output("busybox", &["kill", "-TERM", &example.id().to_string()]);
    wait_until("the end of the example", || {
        millisecond();
        example.try_wait().unwrap().is_some()
    });
    assert!(example.wait().unwrap().success());
    robot.mark(&Witness::on(NEAR), END, 0);
    robot.receive();
    end_with_zeros(&robot.received, &["200"]);
}

/// To its own end after 5 s, with a drive that only answers on a socket of its own.
#[test]
#[ignore = "needs can0 and can1 on one bus: tests/vcan/run starts a Linux that has them"]
fn the_example_socketcan_turns_a_damiao_beside_an_m3508() {
    let world = Simulation::new(7);
    world.attach(MotorConfig::m3508(1)).unwrap();
    let mut robot = Robot::on(FAR, world);
    // The three mailboxes of the simulated controller are for commands to the M3508.
    robot.socket.set_filters(&[CanFilter::new(0x200, 0x7FF)]).unwrap();
    let socket = CanSocket::open(FAR).unwrap();
    socket.set_nonblocking(true).unwrap();
    let mut drive = DamiaoDrive::of(Model::J4310, 1);
    let (mut fastest, mut before) = (0.0_f32, Instant::now());
    let mut example = Command::new(std::env::var("VCAN_EXAMPLE").unwrap())
        .args([NEAR, "--motors", "m3508:1,damiao4310:1"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until("the end of the example", || {
        robot.feed_back();
        while let Ok(frame) = socket.read_frame() {
            let frame = drivetrain::frame::CanFrame::copy_of(&frame).unwrap();
            if let Some(answer) = drive.hear(&frame) {
                socket.write_frame(&answer.convert::<CanFrame>().unwrap()).unwrap();
            }
        }
        let now = Instant::now();
        drive.step(now.duration_since(before).as_secs_f32());
        before = now;
        fastest = fastest.max(drive.shaft().velocity_rad_per_s());
        std::thread::sleep(Duration::from_millis(1));
        example.try_wait().unwrap().is_some()
    });
    let output = example.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{said}");
    for name in ["M3508 #1: ", "DM-J4310 #1: "] {
        let rpm = said.lines().find_map(|line| line.strip_prefix(name)?.strip_suffix(" rpm"));
        let rpm: f32 = rpm.unwrap_or_else(|| panic!("no {name} in {said}")).parse().unwrap();
        assert!((rpm - 30.0).abs() < 3.0, "{said}");
    }
    let fastest = AngularVelocity::from_rad_per_s(fastest).as_rpm();
    assert!((27.0..45.0).contains(&fastest), "{fastest} rpm");
    assert!(!drive.is_enabled() && drive.shaft().torque_nm() == 0.0);
    robot.mark(&Witness::on(NEAR), END, 0);
    robot.receive();
    end_with_zeros(&robot.received, &["200"]);
    print!("{said}");
}
