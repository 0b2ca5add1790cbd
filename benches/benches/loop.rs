//! The 1 kHz loop on the host: time, and its share of a millisecond.
//!
//! `cargo bench -p drivetrain-benches`. Times depend on the machine and judge nothing: the verdict is that of `instructions.rs`,
//! and the figures that count are those of the target, see `firmware/qemu`. Cycles with outputs at a limit, late feedback, errors and
//! recovery are counted there alone. The pace of the simulator is one second by the time of a simulated second.

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use drivetrain::chassis::Mecanum;
use drivetrain::control::{Pid, PidConfig};
use drivetrain::encoder::Position;
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::time::{Tick, TimeStep};
use drivetrain::units::AngularVelocity;
use drivetrain_benches::{Eight, Robot, Targets, run_second, simulated};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Time, with its share of the control period beside it.
struct Share;

impl Measurement for Share {
    type Intermediate = Instant;
    type Value = Duration;

    fn start(&self) -> Instant {
        WallTime.start()
    }

    fn end(&self, start: Instant) -> Duration {
        WallTime.end(start)
    }

    fn add(&self, one: &Duration, other: &Duration) -> Duration {
        WallTime.add(one, other)
    }

    fn zero(&self) -> Duration {
        WallTime.zero()
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        &Shares
    }
}

struct Shares;

impl ValueFormatter for Shares {
    fn format_value(&self, nanos: f64) -> String {
        format!("{nanos:.2} ns = {:.5} % of 1 ms", nanos / 1e4)
    }

    fn scale_values(&self, typical: f64, values: &mut [f64]) -> &'static str {
        WallTime.formatter().scale_values(typical, values)
    }

    fn scale_throughputs(
        &self,
        typical: f64,
        per: &Throughput,
        values: &mut [f64],
    ) -> &'static str {
        WallTime.formatter().scale_throughputs(typical, per, values)
    }

    fn scale_for_machines(&self, values: &mut [f64]) -> &'static str {
        WallTime.formatter().scale_for_machines(values)
    }
}

type Bench = Criterion<Share>;

fn program(criterion: &mut Bench) {
    let mut robot = Robot::new(Targets::Speed);
    criterion.bench_function("program: cycle, each velocity read, edges", |b| {
        b.iter(|| robot.program())
    });
    for (name, targets) in [
        ("cycle of Runner, 8 speed loops", Targets::Speed),
        ("cycle of Runner, 8 position and speed loops", Targets::Position),
        ("cycle of Runner, disarmed", Targets::Disarmed),
    ] {
        let mut robot = Robot::new(targets);
        criterion.bench_function(name, |b| b.iter(|| robot.cycle()));
    }
    let mut robot = Robot::new(Targets::Speed).of_others();
    criterion
        .bench_function("8 frames of another device through Runner", |b| b.iter(|| robot.poll()));
}

fn bus(criterion: &mut Bench) {
    let mut eight = Eight::new(Targets::Speed);
    let (mut frames, frame) = (0_u32, drivetrain_benches::feedback(6, 0));
    criterion.bench_function("decode one of eight", |b| {
        b.iter(|| {
            // Frames are counted, and compared one by one once there are too many between two updates.
            frames = frames.wrapping_add(1);
            if frames.is_multiple_of(1_024) {
                eight.tick();
            }
            eight.bus.ingest(black_box(&frame), eight.now)
        });
    });
    let mut eight = Eight::new(Targets::Speed);
    let mut updates = 0_u32;
    criterion.bench_function("update and pack 8", |b| {
        b.iter(|| {
            updates = updates.wrapping_add(1);
            if updates.is_multiple_of(4_096) {
                // Before feedback and targets are too old.
                eight.tick();
            }
            eight.now = eight.now + drivetrain::time::Duration::from_micros(1);
            eight.bus.update(Tick::new(eight.now, 0.001));
            while let Some(frame) = eight.bus.next_frame() {
                black_box(frame);
            }
        });
    });
    for (name, targets) in [
        ("whole tick, 8 speed loops", Targets::Speed),
        ("whole tick, 8 position and speed loops", Targets::Position),
    ] {
        let mut eight = Eight::new(targets);
        criterion.bench_function(name, |b| b.iter(|| eight.tick()));
    }
    let mut eight = Eight::new(Targets::Speed);
    let motor = eight.motors[5];
    criterion
        .bench_function("state, every field", |b| b.iter(|| eight.bus.state(black_box(motor))));
    criterion.bench_function("state, its velocity only", |b| {
        b.iter(|| eight.bus.state(black_box(motor)).map(|state| state.velocity));
    });
    criterion.bench_function("set_velocity", |b| {
        b.iter(|| {
            eight
                .bus
                .set_velocity(black_box(motor), black_box(AngularVelocity::from_rad_per_s(1.0)))
        });
    });
    criterion.bench_function("set_position", |b| {
        b.iter(|| eight.bus.set_position(black_box(motor), black_box(Position::ZERO)));
    });
    criterion.bench_function("next_edge, none waits", |b| b.iter(|| eight.bus.next_edge()));
}

fn simulator(criterion: &mut Bench) {
    for motors in [1, 4, 8] {
        let world = simulated(motors);
        criterion.bench_function(&format!("simulated second, {motors} motors"), |b| {
            b.iter(|| run_second(&world));
        });
    }
}

fn parts(criterion: &mut Bench) {
    let mut pid = Pid::new(PidConfig::new(0.5, 4.0, 0.0)).expect("valid gains");
    let step = TimeStep::new(0.001, 0.1);
    criterion.bench_function("pid step", |b| {
        b.iter(|| pid.step(black_box(1.0), black_box(0.5), &step));
    });
    criterion.bench_function("pid step with its time", |b| {
        b.iter(|| pid.step(black_box(1.0), black_box(0.5), &TimeStep::of(black_box(0.001))));
    });
    let mecanum = Mecanum::new(0.076, Vec2::new(0.2, 0.18)).expect("a real chassis");
    let twist = Twist::<Body>::new(1.0, -0.5, 0.7);
    let wheels = mecanum.inverse(twist);
    criterion.bench_function("mecanum inverse", |b| b.iter(|| mecanum.inverse(black_box(twist))));
    criterion.bench_function("mecanum forward", |b| b.iter(|| mecanum.forward(black_box(wheels))));
}

criterion_group! {
    name = all;
    config = Criterion::default().with_measurement(Share);
    targets = program, bus, simulator, parts
}
criterion_main!(all);
