//! Shows that a figure does not depend on what a motor has seen.

use crate::report::row;
use crate::rows::{decode, tick};
use crate::wiring::{START, Targets};
use drivetrain::time::Instant;

const TURNS: [i64; 3] = [0, 1_000_000, 1_000_000_000_000];

/// Soon after power-on, across 2^32 µs (72 minutes), and after 13 days.
const UP_TIMES: [Instant; 3] =
    [START, Instant::from_micros((1 << 32) - 500_000), Instant::from_micros(1 << 40)];

/// Every id, number of turns and up-time in turn; and ticks for the latter two.
pub fn show() {
    let mut figures = [0; 72];
    let mut ticks = [[0; 9]; 2];
    let cases = TURNS.iter().flat_map(|turns| UP_TIMES.iter().map(move |start| (*turns, *start)));
    for (case, (turns, start)) in cases.enumerate() {
        for id in 0..8 {
            figures[case * 8 + id] = decode(id as u16 + 1, turns, start);
        }
        ticks[0][case] = tick(Targets::Speed, turns, start);
        ticks[1][case] = tick(Targets::Position, turns, start);
    }
    row("constant_decode", &figures);
    row("constant_tick_speed", &ticks[0]);
    row("constant_tick_cascade", &ticks[1]);
}
