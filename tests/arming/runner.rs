//! The runner: what it refuses itself, before it asks its device.

use crate::own::{faulty, healthy, own};
use crate::{PAUSE_MS, at_ms};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{Actuator, ArmError, Ingest, TargetError, VelocityDrive};
use drivetrain::runner::{EmergencyStop, Nb, Runner};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::ErrorKind;
use std::cell::Cell;

/// Takes everything, or nothing.
#[derive(Default)]
struct Driver {
    full: bool,
    sent: Vec<CanFrame>,
}

impl embedded_can::nb::Can for Driver {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        if self.full {
            return Err(nb::Error::WouldBlock);
        }
        self.sent.push(*frame);
        Ok(None)
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

type Motors = [Actuator<crate::own::Mine>; 2];
type Robot<'c> = Runner<Nb<Driver>, &'c Cell<Instant>, Motors>;

fn robot(clock: &Cell<Instant>) -> Robot<'_> {
    Runner::new(Nb(Driver::default()), clock, [1, 2].map(own))
}

fn now(clock: &Cell<Instant>) -> Tick {
    Tick::new(clock.get(), 0.001)
}

fn wait(robot: &mut Robot<'_>, clock: &Cell<Instant>, ms: u64) {
    for _ in 0..ms {
        clock.set(clock.get() + Duration::from_millis(1));
        let tick = now(clock);
        for number in [1, 2] {
            assert_eq!(robot.ingest(&healthy(number), tick.now()), Ingest::Taken);
        }
        robot.tick(tick);
    }
}

fn drives(robot: &mut Robot<'_>, clock: &Cell<Instant>) -> [bool; 2] {
    let before = [0, 1].map(|index| robot.device_mut()[index].motor().runs);
    for motor in robot.device_mut() {
        _ = motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
    }
    wait(robot, clock, 2);
    [0, 1].map(|index| robot.device_mut()[index].motor().runs > before[index])
}

// The runner was made to arm in spite of its emergency stop, and no test noticed: each set it a tick before.
#[test]
fn a_watched_stop_that_no_tick_has_seen_refuses_arming() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(at_ms(1_000));
    let mut robot = robot(&clock).with_emergency_stop(&STOP);
    wait(&mut robot, &clock, 5);
    STOP.set();
    assert!(!robot.device_mut().is_stopped(), "only the runner knows of it");
    assert_eq!(robot.arm(now(&clock)), Err(ArmError::Stopped));
    assert!(!robot.is_armed());
    for motor in robot.device_mut() {
        assert!(!motor.guard().is_armed());
        let outcome = motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
        assert_eq!(outcome, Err(TargetError::Disarmed));
    }
    assert_eq!(drives(&mut robot, &clock), [false; 2]);
    // Taken back where it was set: what the ticks have stopped stays so.
    STOP.clear();
    assert!(robot.device_mut().is_stopped());
    assert_eq!(robot.arm(now(&clock)), Err(ArmError::Stopped));
    STOP.set();
    robot.clear_emergency_stop();
    assert!(!STOP.is_set() && !robot.device_mut().is_stopped() && !robot.is_armed());
    wait(&mut robot, &clock, PAUSE_MS);
    assert_eq!(robot.arm(now(&clock)), Ok(()));
    assert_eq!(drives(&mut robot, &clock), [true; 2]);
}

/// Armed before, set in an interrupt, and armed again before the next tick.
#[test]
fn arming_again_does_not_take_a_watched_stop_back() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(at_ms(1_000));
    let mut robot = robot(&clock).with_emergency_stop(&STOP);
    wait(&mut robot, &clock, 5);
    robot.arm(now(&clock)).unwrap();
    assert_eq!(drives(&mut robot, &clock), [true; 2]);
    for ms in 0..2 * PAUSE_MS {
        if ms == 1 {
            STOP.set();
        }
        let refused = robot.arm(now(&clock)) == Err(ArmError::Stopped);
        assert_eq!(refused, ms > 0, "{ms}");
        assert_eq!(drives(&mut robot, &clock), [ms == 0; 2], "{ms}");
    }
    // A part that somebody cleared by itself is stopped again by the next tick.
    for motor in robot.device_mut() {
        motor.clear_emergency_stop();
    }
    assert_eq!(robot.arm(now(&clock)), Err(ArmError::Stopped));
    assert_eq!(drives(&mut robot, &clock), [false; 2]);
    assert!(robot.device_mut().is_stopped());
    STOP.clear();
}

#[test]
fn a_stop_of_one_part_refuses_arming_without_a_watched_one_too() {
    for index in [0, 1] {
        let clock = Cell::new(at_ms(1_000));
        let mut robot = robot(&clock);
        wait(&mut robot, &clock, 5);
        robot.device_mut()[index].emergency_stop();
        assert_eq!(robot.arm(now(&clock)), Err(ArmError::Stopped));
        assert_eq!(drives(&mut robot, &clock), [false; 2]);
        robot.clear_emergency_stop();
        wait(&mut robot, &clock, PAUSE_MS);
        assert_eq!(robot.arm(now(&clock)), Ok(()));
        assert_eq!(drives(&mut robot, &clock), [true; 2]);
    }
}

#[test]
fn a_bus_that_is_down_refuses_arming_until_it_takes_frames_again() {
    let clock = Cell::new(at_ms(1_000));
    let mut robot = robot(&clock);
    wait(&mut robot, &clock, 5);
    robot.port_mut().0.full = true;
    wait(&mut robot, &clock, 120);
    assert!(robot.is_bus_down());
    assert_eq!(robot.arm(now(&clock)), Err(ArmError::BusDown));
    assert!(robot.device_mut().iter_mut().all(|motor| !motor.guard().is_armed()));
    assert_eq!(drives(&mut robot, &clock), [false; 2]);
    robot.port_mut().0.full = false;
    wait(&mut robot, &clock, PAUSE_MS);
    assert_eq!(robot.arm(now(&clock)), Ok(()));
    assert_eq!(drives(&mut robot, &clock), [true; 2]);
}

#[test]
fn the_runner_refuses_what_its_device_refuses() {
    let clock = Cell::new(at_ms(1_000));
    let mut robot = robot(&clock);
    assert!(matches!(robot.arm(now(&clock)), Err(ArmError::Missing(all)) if all.total() == 2));
    wait(&mut robot, &clock, 5 + PAUSE_MS);
    clock.set(clock.get() + Duration::from_millis(1));
    for frame in [healthy(1), faulty(2)] {
        assert_eq!(robot.ingest(&frame, clock.get()), Ingest::Taken);
    }
    robot.tick(now(&clock));
    assert!(matches!(robot.arm(now(&clock)), Err(ArmError::Faulty(_))));
    assert!(!robot.is_armed());
    wait(&mut robot, &clock, PAUSE_MS);
    assert_eq!(robot.arm(now(&clock)), Ok(()));
    assert_eq!(drives(&mut robot, &clock), [true; 2]);
}
