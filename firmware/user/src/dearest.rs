//! The dearest tick: a script of cycles, most of them with faults, whose dearest tick is counted.
//!
//! A script is a string of bytes, [`CYCLE`] for each cycle, and any bytes are one: `search.rs` changes them at random and keeps what is
//! dearer. `dearest.txt` has what it found.

use crate::meter::instructions;
use crate::wiring::START;
use core::hint::black_box;
use cortex_m::peripheral::SYST;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Condition, HealthConfig, Reaction};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current};
use embedded_can::{Frame, StandardId};

pub const MOTORS: usize = 8;
/// Time, its argument, repetition, call before the tick; three bytes for each frame.
pub const CYCLE: usize = 4 + 3 * MOTORS;
pub const CYCLES: usize = 12;
pub type Script = [u8; CYCLE * CYCLES];

/// What the search found.
const FOUND: &str = include_str!("../dearest.txt");

static HEALTH: HealthConfig = HealthConfig::new()
    .with_soft_limits(Angle::from_degrees(-3_600.0), Angle::from_degrees(3_600.0))
    .with_stall(0.3, 0.1, Duration::from_millis(200))
    .with_reaction(Condition::Stalled, Reaction::Report);

struct World {
    bus: Bus,
    frames: [CanFrame; MOTORS],
    count: usize,
    tick: Tick,
    motors: [Handle<M3508>; MOTORS],
    angles: [u16; MOTORS],
    now: Instant,
    turn: u8,
}

/// As a tick on the bench, with as many frames as there are.
#[unsafe(no_mangle)]
#[inline(never)]
fn dearest_tick(bus: &mut Bus, frames: &[CanFrame], tick: Tick) {
    for frame in frames {
        _ = bus.ingest(frame, tick.now());
    }
    bus.update(tick);
    while let Some(frame) = bus.next_frame() {
        black_box(&frame);
    }
}

type Work = fn(&mut Bus, &[CanFrame], Tick);

impl World {
    /// Eight motors with two loops each and limits of their way, heard and armed.
    fn new() -> Self {
        let speed = PidConfig::new(0.8, 4.0, 0.001);
        let position = PidConfig::new(10.0, 0.5, 0.01);
        let ids: [u8; MOTORS] = core::array::from_fn(|index| index as u8 + 1);
        let configs = ids.map(|id| {
            Config::<M3508>::new(black_box(id)).position_loop(position, speed).with_health(&HEALTH)
        });
        let mut bus = Bus::new();
        let motors = bus.attach_all(configs).unwrap();
        let mut world = Self {
            bus,
            frames: [crate::wiring::feedback(1, 0, 0); MOTORS],
            count: 0,
            tick: Tick::new(START, 0.001),
            motors,
            angles: [0; MOTORS],
            now: START,
            turn: 0,
        };
        for _ in 0..3 {
            world.prepare(&[0; CYCLE]);
            world.run();
        }
        for motor in world.motors {
            _ = world.bus.set_present_position(motor, Position::ZERO);
        }
        world.bus.arm(world.now).unwrap();
        world
    }

    /// The tick that was prepared.
    fn run(&mut self) {
        dearest_tick(&mut self.bus, &self.frames[..self.count], self.tick);
    }

    /// Makes time, frames and targets of a cycle; its tick is then to be run.
    fn prepare(&mut self, cycle: &[u8]) {
        let [time, argument, _, call, frames @ ..] = cycle else { return };
        let before = self.now;
        let passed = match time % 16 {
            0..=6 => Duration::from_millis(1),
            7 => Duration::from_micros(u64::from(*argument) * 16),
            8 => Duration::from_micros(10_001),
            9 => Duration::from_micros(100_001),
            10 => Duration::from_millis((*argument).into()),
            11 => Duration::from_secs((*argument).into()),
            12 => Duration::ZERO,
            13 => Duration::from_micros(99_000),
            14 => Duration::from_micros(9_000),
            _ => {
                // The clock goes back.
                let back = before.as_micros().saturating_sub(u64::from(*argument) * 1_000);
                self.now = Instant::from_micros(back);
                Duration::ZERO
            }
        };
        self.now = self.now + passed;
        // As a `Ticker` measures it.
        let dt_s = if self.now > before { self.now.since(before).as_secs_f32() } else { 0.0 };
        self.tick = Tick::new(self.now, dt_s);
        self.frames_of(frames);
        self.call(*call);
    }

    fn frames_of(&mut self, bytes: &[u8]) {
        self.count = 0;
        for (index, bytes) in bytes.chunks_exact(3).enumerate() {
            let [kind, motion, fault] = *bytes else { return };
            let motor = match kind % 16 {
                10 | 11 => usize::from(motion) % MOTORS,
                _ => index,
            };
            let angle = &mut self.angles[motor];
            let (step, rpm) = match motion {
                0..=127 => (26, 191),
                128..=191 => (u16::from(motion - 128) * 128, i16::from(motion - 160) * 256),
                192..=223 => (0, 0),
                _ => (8_192 - u16::from(motion - 223) * 96, -700 * i16::from(motion - 223)),
            };
            *angle = (*angle + step) % 8_192;
            let (temperature, error) = match fault {
                0..=127 => (35, 0),
                128..=143 => (35, fault - 128),
                144..=199 => (fault, 0),
                _ => (fault, fault % 16),
            };
            let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
            let data = [a, b, c, d, motion, fault, temperature, error];
            let id = 0x201 + motor as u16;
            let frame = match kind % 16 {
                0..=7 | 10 | 11 => CanFrame::standard(id, data),
                8 | 9 => None,
                12 => CanFrame::standard(if motion % 2 == 0 { 0x200 } else { 0x1FF }, data),
                13 => CanFrame::standard(0x100 + u16::from(motion), data),
                14 => CanFrame::standard(id, [0xFF; 8]),
                _ => StandardId::new(id).and_then(|id| CanFrame::new(id, &data[..7])),
            };
            if let (Some(frame), Some(place)) = (frame, self.frames.get_mut(self.count)) {
                *place = frame;
                self.count += 1;
            }
        }
    }

    fn call(&mut self, call: u8) {
        let (bus, now) = (&mut self.bus, self.now);
        self.turn = self.turn.wrapping_add(1);
        for (index, motor) in self.motors.into_iter().enumerate() {
            // In the upper half of the codes each second motor is left out.
            if call >= 128 && index % 2 == usize::from(call % 2) {
                continue;
            }
            _ = match call % 16 {
                0 | 1 => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(1.0)),
                2 => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(45.0)),
                3 => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(-45.0)),
                4 => bus.set_position(motor, Position::from_turns(-1_000)),
                5 => bus.set_position(motor, Position::from_turns(9)),
                6 => bus.set_angle(motor, Angle::from_degrees(10.0)),
                7 => bus.set_current(motor, Current::from_amperes(20.0)),
                8 => bus.set_velocity(motor, AngularVelocity::from_rad_per_s(f32::NAN)),
                9 => bus.set_current(motor, Current::from_amperes(-1.0)),
                _ => Ok(()),
            };
        }
        match call % 16 {
            10 | 11 => _ = bus.arm(now),
            12 => bus.disarm(),
            13 => bus.emergency_stop(),
            14 => bus.clear_emergency_stop(),
            _ => {}
        }
    }
}

/// Runs a script and hands each of its ticks to `tick`, which has to run it.
fn play(script: &[u8], mut tick: impl FnMut(&mut World)) {
    let mut world = World::new();
    for cycle in script.chunks_exact(CYCLE) {
        for _ in 0..=cycle[2] % 16 {
            world.prepare(cycle);
            tick(&mut world);
        }
    }
}

/// Copies a bus, so that every call finds the same one.
fn copy(bus: &Bus) -> Bus {
    // SAFETY: a bus owns nothing but its bytes.
    black_box(unsafe { core::ptr::read(bus) })
}

/// The instructions of the tick that a world has just run, `before` it.
fn count(world: &World, before: &Bus) -> u32 {
    let frames = &world.frames[..world.count];
    instructions(dearest_tick as Work, |work, _| work(&mut copy(before), frames, world.tick))
}

/// Reads hexadecimal digits; all else is skipped.
fn parse(text: &str, script: &mut Script) {
    let digits = text.bytes().filter_map(|byte| char::from(byte).to_digit(16));
    let mut high = None;
    let mut places = script.iter_mut();
    for digit in digits {
        match high.take() {
            None => high = Some(digit),
            Some(high) => {
                if let Some(place) = places.next() {
                    *place = (high * 16 + digit) as u8;
                }
            }
        }
    }
}

/// The dearest tick of a script, in steps of the timer of 40 instructions.
pub fn dearest(script: &Script) -> u32 {
    let mut most = 0;
    play(script, |world| {
        let start = timer();
        world.run();
        most = most.max(since(start));
    });
    most
}

/// The exact count of the dearest tick of a script: of those that are within two steps of the timer from it.
pub fn exact(script: &Script) -> u32 {
    let (near, mut most) = (dearest(script), 0);
    play(script, |world| {
        let before = copy(&world.bus);
        let start = timer();
        world.run();
        if since(start) + 2 >= near {
            most = most.max(count(world, &before));
        }
    });
    most
}

fn timer() -> u32 {
    SYST::get_current()
}

fn since(start: u32) -> u32 {
    start.wrapping_sub(timer()) & 0xFF_FFFF
}

/// The script that the search found last.
pub fn found() -> Script {
    let mut script = [0; CYCLE * CYCLES];
    parse(FOUND, &mut script);
    script
}
