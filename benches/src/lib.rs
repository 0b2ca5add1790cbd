//! The robot that the benches run: eight M3508, alone on a bus or under a runner, whose feedback is always there; and simulated motors.

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::{Clock, Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{ErrorKind, nb::Can};
use std::hint::black_box;

/// What the motors are asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Targets {
    Speed,
    Position,
    /// Nothing: the motors are not armed.
    Disarmed,
}

/// Eight motors on a bus.
#[derive(Debug)]
pub struct Eight {
    pub bus: Bus,
    pub motors: [Handle<M3508>; 8],
    pub now: Instant,
    angle: u16,
    targets: Targets,
}

/// A rotor that turns at 191 rpm moves by 26 counts a ms; the output shaft then turns at 1.04 rad/s.
const COUNTS: u16 = 26;

/// Returns the feedback of a motor whose rotor is at `angle`.
///
/// # Panics
/// If 0x200 and the id together are no id of 11 bits.
#[must_use]
pub fn feedback(id: u16, angle: u16) -> CanFrame {
    let [high, low] = angle.to_be_bytes();
    CanFrame::standard(0x200 + id, [high, low, 0, 191, 0, 40, 30, 0]).expect("an id of 11 bits")
}

impl Eight {
    /// Armed unless that is what is asked for, after ten ticks: from then on a tick is like another.
    ///
    /// # Panics
    /// When the bus refuses the motors, which it does not.
    #[must_use]
    pub fn new(targets: Targets) -> Self {
        let speed = PidConfig::new(0.5, 4.0, 0.0).with_integral_limit(5.0);
        let position = PidConfig::new(10.0, 0.0, 0.0);
        let mut bus = Bus::new();
        // Open at once, as in all ticks but the first 200 after arming.
        let config =
            |id| Config::new(id).position_loop(position, speed).with_opening(Duration::ZERO);
        let motors = bus.attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(config)).expect("eight free ids");
        let now = Instant::from_micros(1_000_000);
        let mut eight = Self { bus, motors, now, angle: 0, targets };
        eight.tick();
        if targets != Targets::Disarmed {
            eight.bus.arm(eight.now).expect("all were heard");
        }
        (0..10).for_each(|_| eight.tick());
        while eight.bus.next_edge().is_some() {}
        eight
    }

    fn target(bus: &mut Bus, motors: [Handle<M3508>; 8], targets: Targets) {
        for motor in motors {
            _ = match targets {
                Targets::Speed => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(1.0)),
                Targets::Position => {
                    let here = bus.state(motor).map_or(Position::ZERO, |state| state.position);
                    bus.set_position(motor, here + Angle::from_degrees(1.0))
                }
                Targets::Disarmed => Ok(()),
            };
        }
    }

    /// Hears a frame of each motor.
    pub fn hear(&mut self) {
        self.angle = (self.angle + COUNTS) % 8_192;
        for id in 1..=8 {
            _ = self.bus.ingest(black_box(&feedback(id, self.angle)), self.now);
        }
    }

    /// Sets the targets, hears eight frames, updates, takes the commands: 1 ms later.
    pub fn tick(&mut self) {
        Self::target(&mut self.bus, self.motors, self.targets);
        self.now = self.now + Duration::from_millis(1);
        self.hear();
        self.bus.update(Tick::new(self.now, 0.001));
        while let Some(frame) = self.bus.next_frame() {
            black_box(frame);
        }
    }
}

/// A driver that has a frame of each motor in each cycle, and takes every command.
#[derive(Debug)]
pub struct Stub {
    /// Less than the ids of the frames by 1 to 8.
    base: u16,
    next: u16,
    angle: u16,
}

impl Can for Stub {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        black_box(frame);
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        if self.next == 8 {
            return Err(nb::Error::WouldBlock);
        }
        self.next += 1;
        Ok(black_box(feedback(self.base + self.next, self.angle)))
    }
}

/// A clock that goes on by hand.
#[derive(Debug)]
pub struct Hand(Instant);

impl Clock for Hand {
    fn now(&mut self) -> Instant {
        self.0 = self.0 + Duration::from_micros(500); // read twice in a cycle
        self.0
    }
}

/// A program: eight motors under a runner.
#[derive(Debug)]
pub struct Robot {
    pub runner: Runner<Nb<Stub>, Hand, Bus>,
    motors: [Handle<M3508>; 8],
    targets: Targets,
}

impl Robot {
    /// As [`Eight::new`], under a runner.
    #[must_use]
    pub fn new(targets: Targets) -> Self {
        let Eight { bus, motors, now, angle, .. } = Eight::new(targets);
        let runner = Runner::new(Nb(Stub { base: 0, next: 0, angle }), Hand(now), bus);
        let mut robot = Self { runner, motors, targets };
        (0..10).for_each(|_| robot.cycle());
        robot
    }

    /// Poll 8 frames, `due`, targets, tick.
    pub fn cycle(&mut self) {
        self.poll();
        if let Some(tick) = self.runner.due() {
            Eight::target(self.runner.device_mut(), self.motors, self.targets);
            self.runner.tick(tick);
        }
    }

    /// Poll 8 frames.
    pub fn poll(&mut self) {
        let driver = &mut self.runner.port_mut().0;
        (driver.next, driver.angle) = (0, (driver.angle + COUNTS) % 8_192);
        self.runner.poll(16);
    }

    /// Changes the frames that the driver has into those of another device.
    #[must_use]
    pub fn of_others(mut self) -> Self {
        self.runner.port_mut().0.base = 0x100;
        self
    }

    /// A cycle in which the velocity of each motor is read, and edges are asked for.
    pub fn program(&mut self) -> f32 {
        let bus = self.runner.device();
        let speeds = self
            .motors
            .map(|motor| bus.state(motor).map_or(0.0, |state| state.velocity.as_rad_per_s()));
        while let Some(edge) = self.runner.device_mut().next_edge() {
            black_box(&edge);
        }
        self.cycle();
        speeds.iter().sum()
    }
}

/// Simulates so many M3508 on one bus.
///
/// # Panics
/// With more motors than the bus has ids.
#[must_use]
pub fn simulated(motors: u8) -> Box<Simulation> {
    let world = Box::new(Simulation::new(7));
    for id in 1..=motors {
        world.attach(MotorConfig::m3508(id)).expect("a free id");
    }
    world
}

/// Lets a second pass at 1 kHz: two command frames out, all feedback in.
///
/// # Panics
/// If an id of a command is none of 11 bits, which it is.
pub fn run_second(world: &Simulation) {
    let mut can = world.controller();
    let words = [0x04, 0x00, 0x04, 0x00, 0x04, 0x00, 0x04, 0x00];
    let commands =
        [0x200, 0x1FF].map(|id| CanFrame::standard(id, words).expect("an id of 11 bits"));
    for _ in 0..1_000 {
        for command in &commands {
            _ = black_box(can.transmit(command));
        }
        world.advance(Duration::from_millis(1));
        while let Ok(frame) = can.receive() {
            black_box(frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_robot_runs_as_it_says() {
        for targets in [Targets::Speed, Targets::Position] {
            let mut robot = Robot::new(targets);
            let before = robot.runner.statistics();
            (0..100).for_each(|_| robot.cycle());
            let after = robot.runner.statistics();
            assert!(robot.runner.is_armed(), "{targets:?}");
            assert_eq!((after.overruns, after.refused), (0, 0), "{targets:?}");
            assert_eq!(after.taken - before.taken, 800, "{targets:?}");
            assert_eq!(after.sent - before.sent, 200, "{targets:?}");
        }
        let mut robot = Robot::new(Targets::Disarmed);
        assert!(!robot.runner.is_armed());
        let unrelated = robot.runner.statistics().unrelated;
        robot = robot.of_others();
        robot.poll();
        assert_eq!(robot.runner.statistics().unrelated - unrelated, 8);
    }
}
