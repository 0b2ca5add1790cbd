//! The bus that is measured: eight M3508, and the feedback that they send.

#![allow(dead_code, reason = "two benches use it, each in part")]

use core::hint::black_box;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::Ingest;
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};

pub const START: Instant = Instant::from_micros(1_000_000);

const MOTORS: usize = 8;
const PERIOD: Duration = Duration::from_millis(1);

/// A rotor that turns at 191 rpm moves by 26 counts a period; the output shaft then turns at 1.04 rad/s.
const RPM: i16 = 191;
const COUNTS: u16 = 26;

/// Targets of the motors.
#[derive(Clone, Copy)]
pub enum Targets {
    Speed,
    Position,
    /// Positions so far off that the output of the outer loop is at its limit, as on every long way.
    FarPosition,
    /// Speeds so high that the output of the loop is at its limit.
    HighSpeed,
}

pub struct Drive {
    pub bus: Bus,
    pub now: Instant,
    motors: [Handle<M3508>; MOTORS],
    frames: [CanFrame; MOTORS],
    angle: u16,
    targets: Targets,
}

impl Drive {
    /// Makes an armed bus whose motors stand at `turns`, heard for the first time at `now`; its loop runs.
    pub fn new(targets: Targets, turns: i64, now: Instant) -> Self {
        let speed = PidConfig::new(0.8, 4.0, 0.001);
        let position = PidConfig::new(10.0, 0.5, 0.01);
        let ids: [u8; MOTORS] = core::array::from_fn(|index| index as u8 + 1);
        let configs = ids.map(|id| {
            // The range is open from the first tick on, as it is in all but the first 200.
            Config::<M3508>::new(black_box(id))
                .position_loop(position, speed)
                .with_opening(Duration::ZERO)
        });
        let mut bus = Bus::new();
        let motors = bus.attach_all(configs).unwrap();
        let mut drive =
            Self { bus, now, motors, frames: [feedback(1, 100, 0); MOTORS], angle: 100, targets };
        drive.advance();
        drive.hear();
        for motor in drive.motors {
            drive.bus.set_present_position(motor, Position::from_turns(turns)).unwrap();
        }
        drive.bus.arm(drive.now).unwrap();
        drive.bus.update(Tick::new(drive.now, 0.001));
        drive.advance();
        drive.hear();
        drive
    }

    /// Lets a period pass: new feedback waits, and the targets are set again.
    pub fn advance(&mut self) {
        self.pass();
        let (motors, targets) = (self.motors, self.targets);
        ask(&mut self.bus, motors, targets);
    }

    /// Sets the targets on a bus that stands somewhere else.
    pub fn ask_on(&self, bus: &mut Bus) {
        ask(bus, self.motors, self.targets);
    }

    /// Lets a period pass, without targets.
    pub fn pass(&mut self) {
        self.now = self.now + PERIOD;
        self.angle = (self.angle + COUNTS) % 8192;
        for (id, frame) in (1..).zip(&mut self.frames) {
            *frame = feedback(id, self.angle, RPM);
        }
    }

    pub fn motors(&self) -> [Handle<M3508>; MOTORS] {
        self.motors
    }

    pub fn frames(&self) -> &[CanFrame; MOTORS] {
        &self.frames
    }

    pub fn hear(&mut self) {
        for frame in &self.frames {
            assert_eq!(self.bus.ingest(frame, self.now), Ingest::Taken);
        }
    }

    /// Returns the arguments of a tick.
    pub fn parts(&mut self) -> (&mut Bus, &[CanFrame; MOTORS], Tick) {
        (&mut self.bus, &self.frames, Tick::new(self.now, 0.001))
    }
}

fn ask(bus: &mut Bus, motors: [Handle<M3508>; MOTORS], targets: Targets) {
    for motor in motors {
        _ = match targets {
            Targets::Speed => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(1.0)),
            Targets::HighSpeed => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(45.0)),
            Targets::Position => {
                let ahead = bus.state(motor).map_or(Position::ZERO, |state| state.position)
                    + Angle::from_degrees(1.0);
                bus.set_position(motor, ahead)
            }
            Targets::FarPosition => bus.set_position(motor, Position::from_turns(-1000)),
        };
    }
}

pub fn feedback(id: u16, angle: u16, rpm: i16) -> CanFrame {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    CanFrame::standard(0x200 + id, [a, b, c, d, 0, 100, 35, 0]).unwrap()
}

/// The whole tick: feedback in, loops, command frames out.
#[unsafe(no_mangle)]
#[inline(never)]
pub fn row_tick(bus: &mut Bus, frames: &[CanFrame; MOTORS], tick: Tick) {
    for frame in frames {
        _ = bus.ingest(frame, tick.now());
    }
    bus.update(tick);
    while let Some(frame) = bus.next_frame() {
        black_box(&frame);
    }
}
