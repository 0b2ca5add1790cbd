//! Shows that a figure does not depend on what a motor has seen.

use crate::meter::instructions;
use crate::report::row;
use crate::rows::{row_decode, tick};
use crate::snake;
use crate::wiring::{START, Targets, feedback};
use core::hint::black_box;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, Gm6020Voltage, M2006, M3508, Model};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::Ingest;
use drivetrain::snake::IDS;
use drivetrain::time::{Duration, Instant, Tick};

const TURNS: [i64; 3] = [0, 1_000_000, 1_000_000_000_000];

/// Soon after power-on, across 2^32 µs (72 minutes), and after 13 days.
pub const UP_TIMES: [Instant; 3] =
    [START, Instant::from_micros((1 << 32) - 500_000), Instant::from_micros(1 << 40)];

const PERIOD: Duration = Duration::from_millis(1);

/// Every id, number of turns and up-time in turn; and ticks for the latter two.
pub fn show() {
    decode_of::<M3508>("constant_decode");
    decode_of::<M2006>("constant_decode_m2006");
    decode_of::<Gm6020Current>("constant_decode_gm6020");
    decode_of::<Gm6020Voltage>("constant_decode_gm6020_voltage");
    joints();
    let mut ticks = [[0; 9]; 2];
    for (case, (turns, start)) in cases(TURNS).enumerate() {
        ticks[0][case] = tick(Targets::Speed, turns, start);
        ticks[1][case] = tick(Targets::Position, turns, start);
    }
    row("constant_tick_speed", &ticks[0]);
    row("constant_tick_cascade", &ticks[1]);
}

fn cases<T: Copy>(turns: [T; 3]) -> impl Iterator<Item = (T, Instant)> {
    turns.into_iter().flat_map(|turns| UP_TIMES.into_iter().map(move |start| (turns, start)))
}

/// One frame of each motor of a full bus of its model.
fn decode_of<M: Model>(name: &str) {
    let mut figures = [0; 72];
    let cases = (1..=M::FACTS.ids).flat_map(|id| cases(TURNS).map(move |case| (id, case)));
    let mut count = 0;
    for (figure, (id, (turns, start))) in figures.iter_mut().zip(cases) {
        *figure = decode::<M>(id, turns, start);
        count += 1;
    }
    row(name, &figures[..count]);
}

fn decode<M: Model>(id: u8, turns: i64, start: Instant) -> u32 {
    let of = |id: u8| M::FACTS.feedback_base - 0x200 + u16::from(id);
    let mut bus = Bus::new();
    for id in 1..=M::FACTS.ids {
        let gains = PidConfig::new(0.8, 4.0, 0.0);
        let motor = bus.attach(Config::<M>::new(black_box(id)).speed_loop(gains)).unwrap();
        assert_eq!(bus.ingest(&feedback(of(id), 100, 0), start), Ingest::Taken);
        bus.set_present_position(motor, Position::from_turns(turns)).unwrap();
    }
    bus.arm(start).unwrap();
    bus.update(Tick::new(start + PERIOD, 0.001));
    let (mut now, mut angle) = (start + PERIOD, 126);
    instructions(row_decode as fn(&mut Bus, &CanFrame, Instant) -> Ingest, |decode, _| {
        angle += 3;
        now = now + PERIOD;
        _ = decode(&mut bus, &feedback(of(id), angle % 8192, 191), now);
    })
}

/// Joints of a full bus, up to the end of their counter.
fn joints() {
    const TURNS: [i32; 3] = [0, 1_000, 32_000];
    let mut decoded = [0; 9 * IDS as usize];
    let of_all = (1..=IDS).flat_map(|id| cases(TURNS).map(move |case| (id, case)));
    for (figure, (id, (turns, start))) in decoded.iter_mut().zip(of_all) {
        *figure = snake::ingest(id, turns, start);
    }
    row("constant_decode_joint", &decoded);
    let mut ticks = [0; 9];
    for (figure, (turns, start)) in ticks.iter_mut().zip(cases(TURNS)) {
        *figure = snake::tick(turns, start);
    }
    row("constant_tick_joints", &ticks);
}
