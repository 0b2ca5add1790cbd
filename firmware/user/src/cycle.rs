//! The cycle of a program: a `Runner` over a driver, and calls for each motor in between.

use crate::driver::Driver;
use crate::driver_frame::DriverFrame;
use crate::meter::{CALLS, instructions};
use crate::report::row;
use crate::wiring::{Drive, START, Targets, feedback, row_tick};
use core::cell::Cell;
use core::hint::black_box;
use cortex_m_semihosting::hprintln;
use drivetrain::dji::{Bus, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Link;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::{Clock, Duration, Instant, Tick};
use drivetrain::units::{AngularVelocity, Current};
use embedded_can::nb::Can;

struct Time<'c>(&'c Cell<Instant>);

impl Clock for Time<'_> {
    #[inline]
    fn now(&mut self) -> Instant {
        self.0.get()
    }
}

type Loop<'c> = Runner<Nb<Driver>, Time<'c>, Bus>;
type Motors = [Handle<M3508>; 8];

/// One cycle of a program: poll, due, tick.
#[unsafe(no_mangle)]
#[inline(never)]
fn runner_cycle(runner: &mut Loop<'_>) {
    runner.poll(16);
    if let Some(tick) = runner.due() {
        runner.tick(tick);
    }
}

/// The same with what a program does in between: it reads and sets the velocity of each motor, and asks for edges.
#[unsafe(no_mangle)]
#[inline(never)]
fn runner_program(runner: &mut Loop<'_>, motors: &Motors) -> f32 {
    runner.poll(16);
    let Some(tick) = runner.due() else { return 0.0 };
    let bus = runner.device_mut();
    let mut sum = 0.0;
    for motor in motors {
        sum += bus.state(*motor).map_or(0.0, |state| state.velocity.as_rad_per_s());
        _ = bus.set_velocity(*motor, AngularVelocity::from_rad_per_s(1.0));
    }
    while let Some(edge) = bus.next_edge() {
        black_box(&edge);
    }
    runner.tick(tick);
    sum
}

#[unsafe(no_mangle)]
#[inline(never)]
fn runner_poll(runner: &mut Loop<'_>) {
    runner.poll(16);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn runner_due(runner: &mut Loop<'_>) -> Option<Tick> {
    runner.due()
}

#[unsafe(no_mangle)]
#[inline(never)]
fn runner_tick(runner: &mut Loop<'_>, tick: Tick) {
    runner.tick(tick);
}

/// What the driver itself takes: calls to receive, one more than there are frames, and to transmit.
#[inline(never)]
fn driver_alone(runner: &mut Loop<'_>, commands: u32) {
    let driver = &mut runner.port_mut().0;
    while let Ok(frame) = driver.receive() {
        black_box(&frame);
    }
    let [frame, ..] = driver.received;
    for _ in 0..commands {
        _ = black_box(driver.transmit(&frame));
    }
}

fn of_driver(frame: &CanFrame) -> DriverFrame {
    frame.convert().unwrap()
}

fn driver() -> Driver {
    Driver { received: [of_driver(&feedback(1, 0, 0)); 8], next: 0, sent: 0 }
}

/// A runner with its motors and its clock.
struct Robot<'c> {
    drive: Drive,
    runner: Loop<'c>,
    now: &'c Cell<Instant>,
    error: u8,
}

impl<'c> Robot<'c> {
    /// A robot whose motors are armed and have run for 20 ms. With an `error`, each frame has this code.
    fn new(targets: Targets, now: &'c Cell<Instant>, error: u8) -> Self {
        let mut drive = Drive::new(targets, 0, START);
        now.set(drive.now);
        let bus = core::mem::take(&mut drive.bus);
        let runner = Runner::new(Nb(driver()), Time(now), bus);
        let mut robot = Self { drive, runner, now, error };
        for _ in 0..20 {
            robot.advance();
            runner_cycle(&mut robot.runner);
        }
        robot
    }

    /// A ms later: eight frames wait, and the targets are set.
    fn advance(&mut self) {
        self.pass();
        self.drive.ask_on(self.runner.device_mut());
    }

    /// A ms later: eight frames wait.
    fn pass(&mut self) {
        self.drive.pass();
        self.now.set(self.drive.now);
        let driver = &mut self.runner.port_mut().0;
        driver.next = 0;
        for (place, frame) in driver.received.iter_mut().zip(self.drive.frames()) {
            *place = of_driver(frame);
            let [.., last] = &mut place.data;
            *last = self.error;
        }
    }

    /// Cycles of 1 ms each, less what the driver takes.
    fn cycles(mut self) -> u32 {
        let before = self.runner.statistics().sent;
        let whole = instructions(runner_cycle as fn(&mut Loop<'_>), |cycle, _| {
            self.advance();
            cycle(&mut self.runner);
        });
        let sent = (self.runner.statistics().sent - before + CALLS / 2) / CALLS;
        whole - alone(&mut self.runner, 0, sent)
    }

    /// A time later, without a frame.
    fn stay_silent(&mut self, passed: Duration) {
        self.drive.now = self.drive.now + passed;
        self.now.set(self.drive.now);
    }

    /// One and the same cycle again and again.
    fn once(mut self) -> u32 {
        let next = self.runner.port_mut().0.next;
        let mut once = copy(&self.runner);
        let before = once.statistics().sent;
        runner_cycle(&mut once);
        let sent = once.statistics().sent - before;
        let whole = instructions(runner_cycle as fn(&mut Loop<'_>), |cycle, _| {
            cycle(&mut copy(&self.runner));
        });
        whole - alone(&mut self.runner, next, sent)
    }
}

/// Copies a runner, so that every call finds the same one.
fn copy<'c>(runner: &Loop<'c>) -> Loop<'c> {
    // SAFETY: it owns nothing but its bytes.
    black_box(unsafe { core::ptr::read(runner) })
}

fn alone(runner: &mut Loop<'_>, next: usize, commands: u32) -> u32 {
    instructions(driver_alone as fn(&mut Loop<'_>, u32), |driver, _| {
        runner.port_mut().0.next = next;
        driver(runner, commands);
    })
}

fn program() -> u32 {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    let motors = robot.drive.motors();
    while robot.runner.device_mut().next_edge().is_some() {}
    let whole = instructions(runner_program as fn(&mut Loop<'_>, &Motors) -> f32, |cycle, _| {
        robot.advance();
        _ = cycle(&mut robot.runner, &motors);
    });
    whole - alone(&mut robot.runner, 0, 2)
}

fn disarmed() -> u32 {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    robot.runner.device_mut().disarm();
    robot.cycles()
}

/// Three cycles of motors that were driven: the cycle in which the feedback of all gets late, a cycle of late feedback, and the cycle in
/// which all are heard again.
fn late() -> [u32; 3] {
    [0, 3, 4].map(|cycles| {
        let now = Cell::new(START);
        let mut robot = Robot::new(Targets::Speed, &now, 0);
        let wheel = robot.drive.motors()[0];
        robot.stay_silent(Duration::from_micros(10_001));
        for _ in 0..cycles {
            runner_cycle(&mut robot.runner);
            robot.stay_silent(Duration::from_millis(1));
        }
        let is_late = robot.runner.device().link(wheel) == Some(Link::Late);
        assert_eq!(is_late, cycles > 0);
        if cycles == 4 {
            robot.advance();
        }
        robot.once()
    })
}

/// The cycle in which the targets of all motors expire: the first without a current.
fn expires() -> u32 {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    let wheel = robot.drive.motors()[0];
    for _ in 0..200 {
        robot.pass();
        let mut once = copy(&robot.runner);
        runner_cycle(&mut once);
        if once.device().commanded_current(wheel) == Some(Current::ZERO) {
            return robot.once();
        }
        runner_cycle(&mut robot.runner);
    }
    panic!("no target expires")
}

/// The cycle in which the drives of all motors report a fault.
fn fails() -> u32 {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    robot.error = 2;
    robot.advance();
    robot.once()
}

/// The three parts of a cycle, each alone: `poll`, `due` when a step is due and when none is, `tick`.
fn parts() -> [u32; 4] {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    robot.advance();
    let runner = &mut robot.runner;
    let poll = instructions(runner_poll as fn(&mut Loop<'_>), |poll, _| poll(&mut copy(runner)));
    let poll = poll - alone(runner, 0, 0);
    runner.port_mut().0.next = 0;
    runner.poll(16);
    let due = |runner: &Loop<'_>| {
        instructions(runner_due as fn(&mut Loop<'_>) -> _, |due, _| _ = due(&mut copy(runner)))
    };
    let is_due = due(runner);
    let tick = runner.due().unwrap();
    let work = runner_tick as fn(&mut Loop<'_>, Tick);
    let step = instructions(work, |step, _| step(&mut copy(runner), tick));
    let step = step - (alone(runner, 8, 2) - alone(runner, 8, 0));
    runner.tick(tick);
    now.set(now.get() + Duration::from_micros(100));
    [poll, is_due, due(runner), step]
}

/// One of eight frames of another device.
fn foreign() -> u32 {
    let now = Cell::new(START);
    let mut robot = Robot::new(Targets::Speed, &now, 0);
    for place in &mut robot.runner.port_mut().0.received {
        *place = of_driver(&CanFrame::standard(0x100, [0; 8]).unwrap());
    }
    let whole = instructions(runner_poll as fn(&mut Loop<'_>), |poll, _| {
        robot.runner.port_mut().0.next = 0;
        poll(&mut robot.runner);
    });
    (whole - alone(&mut robot.runner, 0, 0)) / 8
}

/// The bus without a runner.
fn bus(targets: Targets) -> u32 {
    let mut drive = Drive::new(targets, 0, START);
    instructions(row_tick as fn(&mut Bus, &[CanFrame; 8], Tick), |tick, _| {
        drive.advance();
        let (bus, frames, now) = drive.parts();
        tick(bus, frames, now);
    })
}

pub fn rows() {
    let now = Cell::new(START);
    let cycles = |targets, error| Robot::new(targets, &now, error).cycles();
    row("program", &[program()]);
    row("cycle_speed", &[cycles(Targets::Speed, 0)]);
    row("cycle_cascade", &[cycles(Targets::Position, 0)]);
    row("cycle_speed_limit", &[cycles(Targets::HighSpeed, 0)]);
    row("cycle_cascade_limit", &[cycles(Targets::FarPosition, 0)]);
    row("cycle_disarmed", &[disarmed()]);
    let [gets_late, late, recovers] = late();
    row("cycle_late", &[late]);
    row("cycle_gets_late", &[gets_late]);
    row("cycle_recovers", &[recovers]);
    row("cycle_expires", &[expires()]);
    row("cycle_fails", &[fails()]);
    // A warning, with which the motors run on.
    row("cycle_error", &[cycles(Targets::Speed, 8)]);
    row("foreign_runner", &[foreign()]);
    let [poll, is_due, not_due, step] = parts();
    row("poll", &[poll]);
    row("due", &[is_due]);
    row("not_due", &[not_due]);
    row("step", &[step]);
    row("tick_speed", &[bus(Targets::Speed)]);
    row("tick_cascade", &[bus(Targets::Position)]);
    hprintln!(
        "size Runner {}",
        size_of::<Loop<'_>>() - size_of::<Bus>() - size_of::<Driver>() - size_of::<Time<'_>>()
    );
}
