//! A HiPNUC IMU: `91` frames at 100 Hz, written from the manual's layout and not with the crate's code.

use drivetrain::math::sin_cos;
use drivetrain::sim::SerialLine;
use drivetrain::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(10);

pub(crate) struct Imu {
    pub(crate) line: SerialLine,
    due: Instant,
    sent: u32,
}

impl Imu {
    /// The sensors began at different times.
    pub(crate) fn new(seed: u64, phase: Duration) -> Self {
        Self { line: SerialLine::new(115_200, seed), due: Instant::START + phase, sent: 0 }
    }

    /// Sends the frame that is due: level, turned by `yaw_deg`.
    pub(crate) fn step(&mut self, now: Instant, yaw_deg: f32) {
        if now < self.due {
            return;
        }
        self.due = self.due + PERIOD;
        let time_ms = u32::try_from(now.as_micros() / 1_000).unwrap_or(u32::MAX);
        self.sent += u32::from(self.line.send(&frame(time_ms, yaw_deg), now) == 82);
    }

    pub(crate) fn sent(&self) -> u32 {
        self.sent
    }
}

fn frame(time_ms: u32, yaw_deg: f32) -> Vec<u8> {
    let (sine, cosine) = sin_cos(yaw_deg.to_radians() / 2.0);
    let mut payload = vec![0x91, 0, 0, 25];
    payload.extend(101_325.0_f32.to_le_bytes());
    payload.extend(time_ms.to_le_bytes());
    let acceleration_g = [0.0, 0.0, 1.0];
    let (rate, field) = ([0.0; 3], [30.0, 0.0, -40.0]);
    let euler = [0.0, 0.0, yaw_deg];
    for value in [acceleration_g, rate, field, euler].as_flattened() {
        payload.extend(value.to_le_bytes());
    }
    for part in [cosine, 0.0, 0.0, sine] {
        payload.extend(part.to_le_bytes());
    }
    let mut bytes = vec![0x5A, 0xA5];
    bytes.extend(u16::try_from(payload.len()).unwrap_or(0).to_le_bytes());
    let checked = bytes.iter().chain(&payload).copied();
    let crc = checked.fold(0_u16, |crc, byte| {
        (0..8).fold(crc ^ (u16::from(byte) << 8), |crc, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x1021 }
        })
    });
    bytes.extend(crc.to_le_bytes());
    bytes.extend(payload);
    bytes
}
