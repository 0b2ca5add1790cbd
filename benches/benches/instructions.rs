//! The verdict of `cargo bench`: instructions of the 1 kHz loop and of the simulator on the host, counted by callgrind, against a budget.
//!
//! Needs valgrind, and `cargo install gungraun-runner` in the version of Cargo.toml. Counts are of an x86-64 without extensions, and of
//! the compiler: a budget lies a twentieth above what Rust 1.95 takes, for other compilers and for the copy functions of the C library,
//! which choose by the processor. On another architecture there is no budget, and no verdict.

use drivetrain::chassis::Mecanum;
use drivetrain::control::{Pid, PidConfig};
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::sim::Simulation;
use drivetrain::time::TimeStep;
use drivetrain_benches::{Eight, Robot, Targets, run_second, simulated};
use gungraun::prelude::*;
use gungraun::{Callgrind, EventKind};
use std::hint::black_box;

/// In each measurement: what happens in some cycles only is in the mean.
const CYCLES: u32 = 1_000;

fn robot(targets: Targets) -> Box<Robot> {
    Box::new(Robot::new(targets))
}

fn others(targets: Targets) -> Box<Robot> {
    Box::new(Robot::new(targets).of_others())
}

fn eight(targets: Targets) -> Box<Eight> {
    Box::new(Eight::new(targets))
}

/// At most so many instructions in a thousand cycles.
fn at_most(instructions: u64) -> LibraryBenchmarkConfig {
    let mut callgrind = Callgrind::default();
    if cfg!(target_arch = "x86_64") {
        callgrind.hard_limits([(EventKind::Ir, instructions)]);
    }
    let mut config = LibraryBenchmarkConfig::default();
    config.tool(callgrind);
    config
}

#[library_benchmark]
#[bench::speed(args = (Targets::Speed), setup = robot, config = at_most(2_125_000))]
#[bench::cascade(args = (Targets::Position), setup = robot, config = at_most(3_261_000))]
#[bench::disarmed(args = (Targets::Disarmed), setup = robot, config = at_most(1_755_000))]
fn cycle(mut robot: Box<Robot>) -> Box<Robot> {
    (0..CYCLES).for_each(|_| robot.cycle());
    robot
}

#[library_benchmark]
#[bench::speed(args = (Targets::Speed), setup = robot, config = at_most(2_340_000))]
fn program(mut robot: Box<Robot>) -> Box<Robot> {
    for _ in 0..CYCLES {
        black_box(robot.program());
    }
    robot
}

#[library_benchmark]
#[bench::foreign(args = (Targets::Speed), setup = others, config = at_most(803_000))]
fn poll(mut robot: Box<Robot>) -> Box<Robot> {
    (0..CYCLES).for_each(|_| robot.poll());
    robot
}

#[library_benchmark]
#[bench::speed(args = (Targets::Speed), setup = eight, config = at_most(1_394_000))]
#[bench::cascade(args = (Targets::Position), setup = eight, config = at_most(2_530_000))]
fn tick(mut eight: Box<Eight>) -> Box<Eight> {
    (0..CYCLES).for_each(|_| eight.tick());
    eight
}

fn pid() -> Pid {
    Pid::new(PidConfig::new(0.5, 4.0, 0.0)).expect("valid gains")
}

#[library_benchmark]
#[bench::plain(setup = pid, config = at_most(43_300))]
fn pid_step(mut pid: Pid) -> Pid {
    let step = TimeStep::new(0.001, 0.1);
    for _ in 0..CYCLES {
        black_box(pid.step(black_box(1.0), black_box(0.5), &step));
    }
    pid
}

#[library_benchmark]
#[bench::inverse(config = at_most(23_100))]
fn mecanum() {
    let mecanum = Mecanum::new(0.076, Vec2::new(0.2, 0.18)).expect("a real chassis");
    for _ in 0..CYCLES {
        black_box(mecanum.inverse(black_box(Twist::<Body>::new(1.0, -0.5, 0.7))));
    }
}

// A simulated second at 1 kHz: commands out, all feedback in.
#[library_benchmark]
#[bench::one(args = (1), setup = simulated, config = at_most(7_150_000))]
#[bench::four(args = (4), setup = simulated, config = at_most(17_220_000))]
#[bench::eight(args = (8), setup = simulated, config = at_most(28_640_000))]
fn simulator(world: Box<Simulation>) -> Box<Simulation> {
    run_second(&world);
    world
}

library_benchmark_group!(name = control; benchmarks = cycle, program, poll, tick, pid_step, mecanum, simulator);
mod harness {
    use super::control;
    gungraun::main!(library_benchmark_groups = control);

    pub(super) fn run() {
        main();
    }
}

fn main() {
    // `cargo bench -- --quick` is for the other bench of this package.
    let (quick, others): (Vec<_>, Vec<_>) =
        std::env::args_os().skip(1).partition(|it| it == "--quick");
    if quick.is_empty() {
        return harness::run();
    }
    let program = std::env::current_exe().expect("a program has a path");
    let status =
        std::process::Command::new(program).args(others).status().expect("it runs already");
    std::process::exit(status.code().unwrap_or(1));
}
