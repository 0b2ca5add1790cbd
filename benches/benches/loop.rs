//! The 1 kHz loop on the host: each figure, and its share of a millisecond.
//!
//! `cargo bench -p drivetrain-benches`. The figures that count are instruction counts on the target: see
//! `firmware/qemu`.

use criterion::{Criterion, criterion_group, criterion_main};
use drivetrain::chassis::Mecanum;
use drivetrain::control::{Pid, PidConfig};
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::time::TimeStep;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::AngularVelocity;
use std::hint::black_box;
use std::time::{Duration, Instant as HostInstant};

const SPEED: PidConfig = PidConfig::new(0.5, 4.0, 0.0);

struct Eight {
    bus: Bus,
    motors: [Handle<M3508>; 8],
    frames: [CanFrame; 8],
    now_us: u64,
}

impl Eight {
    fn new() -> Self {
        let mut bus = Bus::new();
        let ids = [1_u8, 2, 3, 4, 5, 6, 7, 8];
        let motors = bus
            .attach_all(ids.map(|id| {
                // As in all ticks but the first 200 after arming.
                Config::new(id).speed_loop(SPEED).with_opening(drivetrain::time::Duration::ZERO)
            }))
            .expect("eight free ids");
        let frames = ids.map(|id| {
            CanFrame::standard(0x200 + u16::from(id), [0x0E, 0x16, 0x03, 0xE8, 0, 40, 30, 0])
                .expect("an 11-bit id")
        });
        let mut eight = Self { bus, motors, frames, now_us: 1_000 };
        eight.hear();
        eight.bus.arm(eight.now()).expect("all were heard");
        eight
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    fn hear(&mut self) {
        for frame in &self.frames {
            _ = self.bus.ingest(black_box(frame), Instant::from_micros(self.now_us));
        }
    }

    fn target(&mut self) {
        for motor in self.motors {
            self.bus
                .set_velocity(motor, AngularVelocity::from_rad_per_s(10.0))
                .expect("armed and heard");
        }
    }

    fn tick(&mut self) {
        self.now_us += 1_000;
        self.hear();
        self.bus.update(Tick::new(self.now(), 0.001));
        while let Some(frame) = self.bus.next_frame() {
            black_box(frame);
        }
    }
}

/// Measures once by hand, so that the share of the control period stands beside criterion's own lines.
fn share(name: &str, mut work: impl FnMut()) {
    const ROUNDS: u32 = 100_000;
    if !std::env::args_os().any(|argument| argument == "--bench") {
        return work(); // once, in test mode
    }
    let start = HostInstant::now();
    for _ in 0..ROUNDS {
        work();
    }
    let each = start.elapsed() / ROUNDS;
    let percent = each.as_secs_f64() / Duration::from_millis(1).as_secs_f64() * 100.0;
    println!("{name:<24} {:>7} ns = {percent:.4} % of 1 ms", each.as_nanos());
}

fn measure(criterion: &mut Criterion, name: &str, mut work: impl FnMut()) {
    share(name, &mut work);
    criterion.bench_function(name, |bencher| bencher.iter(&mut work));
}

fn benches(criterion: &mut Criterion) {
    let mut eight = Eight::new();
    measure(criterion, "decode one of eight", || {
        _ = eight.bus.ingest(black_box(&eight.frames[5]), Instant::from_micros(eight.now_us));
    });

    let mut pid = Pid::new(SPEED).expect("valid gains");
    let step = TimeStep::new(0.001, 0.1);
    measure(criterion, "pid step", || {
        black_box(pid.step(black_box(1.0), black_box(0.5), &step));
    });
    measure(criterion, "pid step with its time", || {
        black_box(pid.step(black_box(1.0), black_box(0.5), &TimeStep::of(black_box(0.001))));
    });

    let mut eight = Eight::new();
    let mut updates = 0_u32;
    measure(criterion, "update and pack 8", || {
        if updates.is_multiple_of(4096) {
            // Before feedback and targets are too old.
            eight.hear();
            eight.target();
        }
        updates = updates.wrapping_add(1);
        eight.now_us += 1;
        eight.bus.update(Tick::new(Instant::from_micros(eight.now_us), 0.001));
        while let Some(frame) = eight.bus.next_frame() {
            black_box(frame);
        }
    });

    let mut eight = Eight::new();
    let mut ticks = 0;
    measure(criterion, "whole tick, 8 motors", || {
        if ticks % 64 == 0 {
            eight.target();
        }
        ticks += 1;
        eight.tick();
    });

    let mecanum = Mecanum::new(0.076, Vec2::new(0.2, 0.18)).expect("a real chassis");
    let twist = Twist::<Body>::new(1.0, -0.5, 0.7);
    let wheels = mecanum.inverse(twist);
    measure(criterion, "mecanum inverse", || {
        black_box(mecanum.inverse(black_box(twist)));
    });
    measure(criterion, "mecanum forward", || {
        black_box(mecanum.forward(black_box(wheels)));
    });
}

criterion_group!(all, benches);
criterion_main!(all);
