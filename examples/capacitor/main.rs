//! A burst from a super-capacitor under a referee's 60 W, on the simulator: referee system, buffer, capacitor, wheels.
//!
//! ```text
//! cargo run --release --example capacitor [FILE.svg]
//! ```
//!
//! The limit and the charge of the buffer come as frames of the referee system, the charge of the capacitor as CAN frames of its
//! controller. The pilot holds the key for a burst from 4 s to 10 s. Fails when buffer or capacitor fall below their reserve, or when the
//! burst does not bring more power.

mod drive;
#[path = "../output/mod.rs"]
mod output;
#[path = "../picture/mod.rs"]
mod picture;
mod supply;

use drive::{BUFFER_RESERVE_J, BURST_S, BURST_W, Lost, RESERVE_J, Sample, least, mean};
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;
use supply::{CAPACITOR_J, LIMIT_W};

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("capacitor");
    let samples = drive::run(true, Lost::default())?;
    plot(&path, &samples)?;
    let calm = drive::run(false, Lost::default())?;
    // The charge nears its reserve with a time constant of 0.5 s, so the burst is strong at its beginning. 3 s are one way to and fro.
    let first = (BURST_S.0, BURST_S.0 + 3.0);
    let [(without, slow), (burst, fast)] = [&calm, &samples].map(|samples| {
        let mean = |value: fn(&Sample) -> f32| mean(samples, first, value);
        (mean(|sample| sample.chassis_w), mean(|sample| sample.speed_m_s.abs()))
    });
    let (buffer, capacitor) =
        (least(&samples, |sample| sample.buffer_j), least(&samples, |sample| sample.capacitor_j));
    console::line(format_args!("limit        {LIMIT_W} W; a burst of at most {BURST_W} W more"));
    console::line(format_args!(
        "first 3 s    {without:.0} W and {slow:.2} m/s without the burst, {burst:.0} W and {fast:.2} m/s with it"
    ));
    console::line(format_args!(
        "buffer       {buffer:.1} J at least, {BUFFER_RESERVE_J} J are kept"
    ));
    console::line(format_args!(
        "capacitor    {capacitor:.0} J of {CAPACITOR_J} J at least, {RESERVE_J} J are kept"
    ));
    console::line(format_args!("{path}"));
    if buffer < BUFFER_RESERVE_J
        || capacitor < RESERVE_J
        || burst < without + 20.0
        || fast < 1.2 * slow
    {
        return Err("a reserve was not kept, or the burst brought no power".into());
    }
    Ok(())
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 4] = [
        ("speed", "m/s", 0.0, 3.0, &[(BLUE, |sample| sample.speed_m_s)]),
        (
            "power (grey: allowed, blue: chassis, red: from the supply)",
            "W",
            -100.0,
            260.0,
            &[
                (GREY, |sample| sample.allowed_w),
                (BLUE, |sample| sample.chassis_w),
                (RED, |sample| sample.supply_w),
            ],
        ),
        (
            "buffer of the referee system (red: charge, grey: reserve)",
            "J",
            0.0,
            65.0,
            &[(GREY, |_| BUFFER_RESERVE_J), (RED, |sample| sample.buffer_j)],
        ),
        (
            "capacitor (red: charge, grey: reserve)",
            "J",
            0.0,
            CAPACITOR_J,
            &[(GREY, |_| RESERVE_J), (RED, |sample| sample.capacitor_j)],
        ),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
