//! Referee system, buffer, power limit and super-capacitor, end to end: the example `capacitor`, as assertions.

#![cfg(test)]

#[path = "../examples/capacitor/drive.rs"]
mod drive;
#[path = "../examples/capacitor/supply.rs"]
mod supply;

use drive::{
    BUFFER_RESERVE_J, BURST_S, BURST_W, END_S, Lost, RESERVE_J, STANDS_S, Sample, least, mean, run,
};
use supply::{CAPACITOR_J, LIMIT_W};

fn chassis_w(sample: &Sample) -> f32 {
    sample.chassis_w
}

#[test]
fn a_burst_takes_from_the_capacitor_and_neither_reserve_is_touched() {
    let limit_w = f32::from(LIMIT_W);
    let samples = run(true, Lost::default()).unwrap();
    let buffer_j = least(&samples, |sample| sample.buffer_j);
    assert!(buffer_j >= BUFFER_RESERVE_J, "{buffer_j} J");
    let capacitor_j = least(&samples, |sample| sample.capacitor_j);
    assert!(capacitor_j >= RESERVE_J, "{capacitor_j} J");
    assert!(capacitor_j <= RESERVE_J + 100.0, "the burst is not used: {capacitor_j} J");

    let first = (BURST_S.0, BURST_S.0 + 3.0);
    let before = mean(&samples, (2.0, BURST_S.0), chassis_w);
    assert!(before < limit_w, "{before} W before the burst");
    assert!(mean(&samples, first, chassis_w) > before + 20.0);
    assert!(samples.iter().all(|sample| sample.allowed_w <= limit_w + BURST_W));
    // Over any second, and over all, the supply gives what the referee allows, and what the buffer has.
    let spans = (0_u8..).map(f32::from).take_while(|from_s| from_s + 1.0 <= END_S);
    for (from_s, to_s) in spans.map(|from_s| (from_s, from_s + 1.0)).chain([(0.0, END_S)]) {
        let supplied = mean(&samples, (from_s, to_s), |sample| sample.supply_w);
        let most = limit_w + (60.0 - BUFFER_RESERVE_J) / (to_s - from_s);
        assert!(supplied <= most, "{supplied} W from {from_s} to {to_s} s");
    }

    // While it stands, the capacitor charges.
    let at =
        |time_s: f32| samples.iter().find(|sample| sample.time_s >= time_s).unwrap().capacitor_j;
    assert!(at(END_S - 0.01) > at(STANDS_S + 1.0) + 50.0);

    let without = run(false, Lost::default()).unwrap();
    let speed = |samples| mean(samples, first, |sample| sample.speed_m_s.abs());
    assert!(speed(&samples) > 1.2 * speed(&without), "{} m/s", speed(&samples));
}

#[test]
fn what_is_not_heard_any_more_takes_the_burst_away_and_no_reserve() {
    for lost in [
        Lost { referee: true, capacitor: false },
        Lost { referee: false, capacitor: true },
        Lost { referee: true, capacitor: true },
    ] {
        let samples = run(true, lost).unwrap();
        let buffer_j = least(&samples, |sample| sample.buffer_j);
        assert!(buffer_j >= BUFFER_RESERVE_J, "{lost:?}: {buffer_j} J");
        let capacitor_j = least(&samples, |sample| sample.capacitor_j);
        assert!((RESERVE_J..CAPACITOR_J).contains(&capacitor_j), "{capacitor_j} J");
        let after = samples.iter().filter(|sample| sample.time_s > 6.6);
        let most = after.map(|sample| sample.allowed_w).fold(0.0, f32::max);
        // The limit that holds without the referee system is 45 W, of which a tenth is left without a charge of the buffer.
        let expected = match (lost.referee, lost.capacitor) {
            (true, true) => 41.0,
            (false, true) => 60.0,
            _ => 41.0 + BURST_W,
        };
        assert!(most <= expected, "{lost:?}: {most} W");
    }
}
