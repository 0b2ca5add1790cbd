//! The whole snake robot: host, firmware, and what both act on.
//!
//! ```text
//! Host ══ 115200 baud, noise ══ Robot (firmware) ══ CAN 1 Mbit/s ══ 12 joints, GM6020, C610
//!  gait at 20 Hz                 1 kHz             ── 1 Mbaud ───── STS3032
//!  telemetry <─────────────────── each 50 ms       <─ 115200 baud ─ 4 IMUs
//! ```

pub(crate) mod checks;
mod driver;
pub(crate) mod gait;
pub(crate) mod host;
mod imu;
mod plant;
pub(crate) mod robot;
mod servo;
pub(crate) mod simulation;
pub(crate) mod tcp;

use drivetrain::snake::PULSES_PER_TURN;
use drivetrain::time::{Duration, Instant};

pub(crate) const JOINTS: usize = 12;

pub(crate) fn seconds(now: Instant) -> f32 {
    now.since(Instant::START).as_secs_f32()
}

pub(crate) fn at(seconds: f32) -> Instant {
    Instant::START + Duration::from_secs_f32(seconds).unwrap_or(Duration::ZERO)
}

pub(crate) fn degrees(pulses: i32) -> f32 {
    degrees_of(pulses as f32)
}

pub(crate) fn degrees_of(pulses: f32) -> f32 {
    pulses * (360.0 / PULSES_PER_TURN as f32)
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(crate) fn pulses(degrees: f32) -> i32 {
    (degrees * (PULSES_PER_TURN as f32 / 360.0)).round() as i32
}
