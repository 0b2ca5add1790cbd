//! Joints and their drives on a simulated bus, through the runner.

#![cfg(test)]

use drivetrain::encoder::{Homing, Position};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, Condition, Devices, Link, TargetError};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Controller, Fault, Line, MotorKey, Sender, Simulation};
use drivetrain::snake::{Command, Config, Joint, Joints, Register};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::Frame;

type Shell<'w> = Runner<Nb<Controller<'w>>, &'w Simulation, Joints>;

struct Robot<'w> {
    world: &'w Simulation,
    runner: Shell<'w>,
    joints: Vec<Joint>,
    keys: Vec<MotorKey>,
    /// Where they are told to be, in degrees.
    wanted: Option<f32>,
    /// The application arms as soon as it sees itself disarmed and, where it is told to release its request, 100 ms later.
    is_eager: bool,
    /// When it asks next, and how often it was told so.
    asks_at: Instant,
    released: u32,
    /// What was written to the joint with the id 1.
    writes: Vec<Command>,
}

impl<'w> Robot<'w> {
    fn new(world: &'w Simulation, count: u8, joints: Joints) -> Self {
        Self::of(world, (1..=count).map(|id| (id, None)), joints)
    }

    fn of(
        world: &'w Simulation,
        places: impl Iterator<Item = (u8, Option<i32>)>,
        mut joints: Joints,
    ) -> Self {
        let attached = |(id, pulses)| world.attach_joint(Line::Can1, id, pulses).unwrap();
        let keys: Vec<_> = places.map(attached).collect();
        let fast = |id| Config::new(id).with_speed(AngularVelocity::from_rpm(30.0));
        let handles = (1..).take(keys.len()).map(|id| joints.attach(fast(id)).unwrap()).collect();
        let runner = Runner::new(Nb(world.controller()), world.clock(), joints);
        let (wanted, writes) = (None, Vec::new());
        let (is_eager, asks_at, released) = (false, Instant::START, 0);
        Self { world, runner, joints: handles, keys, wanted, is_eager, asks_at, released, writes }
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..10 * ms {
            self.world.advance_with(Duration::from_micros(100), |record| {
                let ours = record.sender == Sender::Controller && record.frame.header() == 1;
                let command = Command::decode(record.frame.data()).filter(|_| ours);
                self.writes.extend(command.filter(|sent| matches!(sent, Command::Write(..))));
            });
            self.runner.poll(16);
            let Some(tick) = self.runner.due() else { continue };
            let asks = self.is_eager && !self.runner.is_armed() && tick.now() >= self.asks_at;
            if asks {
                self.set_lost_zeros();
            }
            if asks && self.runner.arm(tick) == Err(ArmError::NotReleased) {
                self.released += 1;
                self.asks_at = tick.now() + Duration::from_millis(100);
            }
            if let Some(degrees) = self.wanted {
                let position = Position::from_angle(Angle::from_degrees(degrees));
                for joint in &self.joints {
                    _ = self.runner.device_mut().set_position(*joint, position);
                }
            }
            self.runner.tick(tick);
        }
    }

    fn arm(&mut self) {
        let now = self.world.now();
        for joint in self.joints.clone() {
            self.runner.device_mut().zero(joint).unwrap();
        }
        self.runner.device_mut().arm(now).unwrap();
    }

    /// Makes the present positions zero where the zero was lost.
    fn set_lost_zeros(&mut self) {
        for joint in &self.joints {
            let joints = self.runner.device_mut();
            if joints.state(*joint).is_some_and(|state| state.homing == Homing::Uncertain) {
                joints.zero(*joint).unwrap();
            }
        }
    }

    fn degrees(&self, joint: usize) -> f32 {
        let state = self.runner.device().state(self.joints[joint]).unwrap();
        state.position.as_angle().as_degrees()
    }

    fn is_enabled(&self, joint: usize) -> bool {
        self.world.motor(self.keys[joint]).unwrap().is_enabled
    }
}

#[test]
fn joints_go_where_they_are_told_from_wherever_they_were_zeroed() {
    let world = Simulation::new(3);
    let mut robot = Robot::new(&world, 12, Joints::new());
    robot.run(50);
    let start: Vec<_> =
        robot.keys.iter().map(|key| world.motor(*key).unwrap().encoder_counts).collect();
    robot.arm();
    robot.wanted = Some(45.0);
    robot.run(600);
    for (index, start) in start.iter().enumerate() {
        let way = world.motor(robot.keys[index]).unwrap().encoder_counts - start;
        assert_eq!(way, 8_192, "an eighth of a turn, whatever the counter was");
        assert!((robot.degrees(index) - 45.0).abs() < 0.01);
    }
    robot.wanted = Some(-45.0);
    robot.run(800);
    assert!((0..12).all(|joint| (robot.degrees(joint) + 45.0).abs() < 0.01));
}

#[test]
fn an_application_that_stops_setting_targets_has_its_joints_disabled() {
    let world = Simulation::new(3);
    let mut robot = Robot::new(&world, 12, Joints::new());
    robot.run(50);
    robot.arm();
    robot.wanted = Some(60.0);
    robot.run(150);
    assert!((0..12).all(|joint| robot.is_enabled(joint)));
    robot.wanted = None;
    robot.run(110);
    assert!((0..12).all(|joint| !robot.is_enabled(joint)));
    assert!(robot.runner.is_armed(), "relaxed, and not disarmed");
}

#[test]
fn an_emergency_stop_disables_twelve_joints_within_five_milliseconds_over_three_mailboxes() {
    let world = Simulation::new(3);
    let mut robot = Robot::new(&world, 12, Joints::new());
    robot.run(50);
    robot.arm();
    robot.wanted = Some(60.0);
    robot.run(150);
    robot.runner.device_mut().emergency_stop();
    robot.run(5);
    assert!((0..12).all(|joint| !robot.is_enabled(joint)));
    let now = world.now();
    assert_eq!(robot.runner.device_mut().arm(now), Err(ArmError::Stopped));
}

#[test]
fn the_load_of_every_budget_is_measured_between_its_bounds() {
    // Four frames a tick would need a queue before the three mailboxes.
    for (reads, writes) in [(1, 1), (2, 1), (1, 2)] {
        let world = Simulation::new(9);
        let joints = Joints::new().with_frames_per_update(reads, writes);
        let mut robot = Robot::new(&world, 12, joints);
        robot.run(50);
        robot.arm();
        robot.wanted = Some(60.0);
        robot.run(200);
        let before = world.traffic(Line::Can1);
        robot.run(1_000);
        let measured = world.traffic(Line::Can1).since(&before).load();
        let load = robot.runner.device().load();
        // What the runner has sent, and what is answered, shift by a frame at the ends.
        let (low, high) = (load.nominal() * 0.998, load.worst_case() * 1.002);
        assert!((low..=high).contains(&measured), "{reads} {writes}: {measured} not in {load}");
        let collisions = robot.keys.iter().map(|key| world.motor(*key).unwrap().collisions);
        assert_eq!(collisions.sum::<u32>(), 0);
    }
}

#[test]
fn a_joint_that_is_unplugged_is_named_and_comes_back() {
    let world = Simulation::new(4);
    let mut robot = Robot::new(&world, 4, Joints::new());
    let at = |ms| Instant::START + Duration::from_millis(ms);
    world.fault(Fault::Silent(robot.keys[2]), at(300)..at(700)).unwrap();
    robot.run(50);
    robot.arm();
    robot.wanted = Some(30.0);
    robot.run(450);
    let joint = robot.joints[2];
    assert_eq!(robot.runner.device().link(joint), Some(Link::Offline));
    assert_eq!(robot.runner.device_mut().set_pulses(joint, 0), Err(TargetError::Relaxed));
    let now = world.now();
    let refused = robot.runner.device_mut().arm(now).map_err(|error| error.to_string());
    assert_eq!(refused, Err("no feedback from snake joint #3".to_owned()));
    assert!(!robot.is_enabled(2) && robot.is_enabled(1));
    robot.run(400);
    assert_eq!(robot.runner.device().link(joint), Some(Link::Online));
    let now = world.now();
    robot.runner.device_mut().arm(now).unwrap();
    robot.run(100);
    assert!(!robot.is_enabled(2) && robot.is_enabled(1));
    assert_eq!(robot.runner.device_mut().set_pulses(joint, 0), Err(TargetError::NotHomed));
    robot.set_lost_zeros();
    robot.run(100);
    assert!(robot.is_enabled(2));
}

#[test]
fn a_brown_out_shorter_than_any_time_limit_does_not_set_a_joint_going_again() {
    let world = Simulation::new(4);
    let mut robot = Robot::new(&world, 12, Joints::new());
    let at = |ms| Instant::START + Duration::from_millis(ms);
    world
        .fault(Fault::PowerLoss { motor: robot.keys[6], forgets_angle: true }, at(400)..at(405))
        .unwrap();
    robot.run(50);
    robot.arm();
    robot.wanted = Some(5.0);
    robot.run(354);
    assert!(!robot.is_enabled(6), "it forgot that it was enabled");
    robot.run(400);
    let state = robot.runner.device().state(robot.joints[6]).unwrap();
    assert!(state.resets + state.position_jumps >= 1, "{state:?}");
    assert!(!robot.is_enabled(6) && !state.is_driven && !robot.runner.is_armed());
}

/// Takes the supply of a joint that stands so many degrees from where its drive began to count. Returns whether the zero counts as lost, and
/// how far in rad the joint goes on when it is told the same again.
fn lose_supply(degrees: f32, loss_ms: u64, is_driven: bool) -> (bool, f32) {
    let world = Simulation::new(4);
    let mut robot = Robot::of(&world, [(1, Some(0))].into_iter(), Joints::new());
    robot.run(50);
    robot.arm();
    robot.wanted = Some(degrees);
    robot.run(2_000);
    let key = robot.keys[0];
    let shaft = || world.motor(key).unwrap().position.as_turns();
    let before = shaft();
    assert!((before * 360.0 - degrees).abs() < 1.0, "{before}");
    if !is_driven {
        robot.wanted = None;
        robot.runner.device_mut().disarm();
        robot.run(500);
    }
    let window = world.now()..world.now() + Duration::from_millis(loss_ms);
    let fault = Fault::PowerLoss { motor: key, forgets_angle: true };
    world.fault(fault, window).unwrap();
    robot.run(500);
    let edges = std::iter::from_fn(|| Devices::next_edge(robot.runner.device_mut()));
    let is_told = edges.into_iter().any(|edge| edge.condition == Condition::PositionUncertain);
    robot.run(2_000);
    (is_told, (shaft() - before).abs() * std::f32::consts::TAU)
}

/// The zero is lost where the drive counts from another angle: a joint at rest cannot have turned by so much. What is within 0.4 rad, and
/// 8 rad/s times the time without a position, is not told from a joint that was turned.
#[test]
fn a_joint_whose_drive_counts_anew_after_a_short_loss_of_supply_is_not_driven_away() {
    for degrees in [6.0_f32, 17.0, 60.0, 172.0] {
        for loss_ms in [5, 20, 35, 50, 90, 150] {
            let most = 0.4 + 8.0e-3 * (loss_ms as f32 + 15.0);
            let (is_told, way) = lose_supply(degrees, loss_ms, true);
            assert!(way < if is_told { 0.1 } else { most }, "{degrees}, {loss_ms}: {way} rad");
            let (is_told, way) = lose_supply(degrees, loss_ms, false);
            assert!(is_told || degrees.to_radians() < most, "{degrees}, {loss_ms}");
            assert!(way < 0.1, "disarmed");
        }
    }
}

/// What disarms joint 1, how it is counted (resets and jumps), and how often the request to arm has to be released.
type Event = (&'static str, fn(&mut Robot), (u16, u16), u32);

fn brown_out(robot: &mut Robot) {
    let now = robot.world.now();
    let window = now..now + Duration::from_millis(5);
    robot
        .world
        .fault(Fault::PowerLoss { motor: robot.keys[0], forgets_angle: true }, window)
        .unwrap();
}

fn register(command: &Command) -> u8 {
    let (Command::Write(register, _) | Command::Read(register)) = *command;
    register.as_raw()
}

fn stop_and_clear(robot: &mut Robot) {
    robot.runner.device_mut().emergency_stop();
    robot.runner.device_mut().clear_emergency_stop();
}

/// It once went on as if nothing had been where it was armed before the next update: not disabled, nor enabled again.
#[test]
fn a_joint_that_is_armed_again_at_once_is_disabled_and_brought_up_anew_whatever_disarmed_it() {
    let events: [(i32, Event); 4] = [
        (0, ("found disabled", brown_out, (1, 0), 1)),
        (25_000, ("further off than it can go", brown_out, (0, 1), 1)),
        (0, ("disarmed", |robot| robot.runner.device_mut().disarm(), (0, 0), 0)),
        (0, ("stopped and cleared", stop_and_clear, (0, 0), 1)),
    ];
    for (position, (what, event, counts, releases)) in events {
        let world = Simulation::new(4);
        let mut robot = Robot::of(&world, [(1, Some(position))].into_iter(), Joints::new());
        robot.run(50);
        robot.arm();
        (robot.wanted, robot.is_eager) = (Some(5.0), true);
        robot.run(250);
        robot.writes.clear();
        event(&mut robot);
        robot.run(400);
        let state = robot.runner.device().state(robot.joints[0]).unwrap();
        assert_eq!((state.resets, state.position_jumps), counts, "{what}");
        assert!(state.is_driven && robot.is_enabled(0), "{what}: {state:?}");
        assert_eq!(robot.released, releases, "{what}");
        // A joint that waits to be armed is told again each 100 ms; the last time is the first step of bringing it up.
        let is_disable = |sent: &Command| *sent == Command::DISABLE;
        let told = robot.writes.iter().filter(|sent| is_disable(sent)).count();
        assert!((1..=1 + 2 * usize::try_from(releases).unwrap()).contains(&told), "{what}: {told}");
        let last = robot.writes.iter().rposition(is_disable).unwrap();
        let mut since = robot.writes.iter().skip(last);
        let registers: Vec<_> = since.by_ref().take(8).map(register).collect();
        assert_eq!(registers, [0x10, 0x0F, 0x08, 0x0B, 0x0C, 0x09, 0x0A, 0x10], "{what}");
        assert!(since.all(|sent| register(sent) == 0x0A), "{what}: brought up once");
    }
}

#[test]
fn a_second_controller_shows_in_the_counters() {
    let world = Simulation::new(4);
    let mut robot = Robot::new(&world, 2, Joints::new());
    robot.run(20);
    let foreign: CanFrame = Command::Write(Register::Enable, 1).frame(1).unwrap();
    world.inject(Line::Can1, foreign).unwrap();
    robot.run(5);
    assert_eq!(robot.runner.device().counters().foreign_commands, 1);
}

/// The negative control of every `collisions == 0` here and in `snake_robot`.
#[test]
fn a_controller_that_does_not_wait_for_the_answer_collides_with_it() {
    use embedded_can::nb::Can;
    let world = Simulation::new(6);
    let key = world.attach_joint(Line::Can1, 3, None).unwrap();
    let mut can = world.controller();
    let read = Command::Read(Register::ActualPosition).frame(3).unwrap();
    let write = Command::Write(Register::Position, 5).frame(3).unwrap();
    let urgent = CanFrame::standard(0, [0; 8]).unwrap();
    for _ in 0..50 {
        can.transmit(&read).unwrap();
        world.advance(Duration::from_micros(130));
        // The bus is busy until after the answer is due, and this waits as well.
        for _ in 0..2 {
            world.inject(Line::Can1, urgent).unwrap();
        }
        world.advance(Duration::from_micros(10));
        can.transmit(&write).unwrap();
        world.advance(Duration::from_millis(2));
    }
    let state = world.motor(key).unwrap();
    assert!(state.replies == 50 && state.collisions > 25, "{state:?}");
}

#[test]
fn one_bus_carries_dji_motors_and_joints_and_finds_no_clash() {
    use drivetrain::dji::{Bus, Config as Dji, Gm6020Voltage, M2006};
    let mut bus = Bus::new();
    bus.attach(Dji::<Gm6020Voltage>::new(1)).unwrap();
    bus.attach(Dji::<M2006>::new(1)).unwrap();
    let mut joints = Joints::new();
    for id in 1..=12 {
        joints.attach(Config::new(id)).unwrap();
    }
    assert_eq!(joints.load().and(&bus.load()).to_string(), "70 % to 85 %");
    let mut both = (joints, bus);
    assert_eq!(both.clash(), None);
    let mut twice = [Joints::new(), Joints::new()];
    for joints in &mut twice {
        joints.attach(Config::new(5)).unwrap();
    }
    assert!(matches!(twice.arm(Instant::from_micros(1)), Err(ArmError::Clash(..))));
}
