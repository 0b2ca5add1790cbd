//! A BMI088 on the board as a source of attitude: the driver `bmi088` reads it over SPI, the filter `vqf-rs` computes the attitude, and
//! drivetrain's trait [`AttitudeSource`] hands it to a chassis or a gimbal.
//!
//! ```text
//! SPI, two chip selects ──> bmi088 ──raw──> units, checks ──> vqf-rs ──> AttitudeSource
//! ```
//!
//! Call [`Bmi088::poll`] once a millisecond. Each call takes two transfers, 15 bytes in all: 13 µs at 10 MHz. The yaw has no magnetometer,
//! so it drifts by what is left of the gyroscope's bias, which the filter estimates while the board rests.
//!
//! What is checked: a bus error, a time step that is none, and a sensor that repeats itself. An attitude that is older than 20 ms is none.
//!
//! Chosen of the crates on the registry: `bmi088` 0.2 is the one over `embedded-hal` 1; `vqf-rs` has no dependency but `libm`, while
//! `ahrs` and `uf-ahrs` bring `nalgebra`. **Known of `bmi088` 0.2.1:** its `setup` asks for 1000 Hz and writes the value of 2000 Hz with a
//! filter of 230 Hz, since its `set_bandwidth` has the two exchanged. At one sample in 1 ms that does no harm.
#![no_std]

use bmi088::{Accelerometer, Builder, Gyroscope, SpiInterface};
use drivetrain::geometry::{Attitude, AttitudeSource, Rotation3};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use vqf_rs::VQF;

/// rad/s of a count of the gyroscope at 2000 degrees/s, which `setup` chooses: 16.384 counts for a degree/s (data sheet, table 2).
const RATE: f32 = core::f32::consts::PI / 180.0 / 16.384;
/// m/s² of a count of the accelerometer at 6 g, its range after a reset (data sheet, register 0x41).
const ACCELERATION: f32 = 6.0 * 9.806_65 / 32_768.0;

/// The usual time between two samples, in s: that of the filter's accelerometer part.
const PERIOD_S: f32 = 0.001;
/// A longer time between two samples moves nothing: the turn of the board meanwhile is unknown.
const LONGEST: Duration = Duration::from_millis(20);
/// A sensor whose six values repeat this often is frozen: its noise moves the last bits.
const REPEATS: u8 = 50;

/// What went wrong in a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImuError {
    /// The bus returned an error, or the chip did not answer with its id.
    Bus,
    /// The values have repeated 50 times.
    Frozen,
}

/// Accelerometer, gyroscope and filter.
pub struct Bmi088<A, G> {
    accelerometer: Accelerometer<SpiInterface<A>>,
    gyroscope: Gyroscope<SpiInterface<G>>,
    filter: VQF,
    raw: [[i16; 3]; 2],
    repeats: u8,
    sampled: Option<Instant>,
    latest: Option<(Attitude, Instant)>,
}

impl<A: SpiDevice, G: SpiDevice> Bmi088<A, G> {
    /// Resets and sets up both parts of the chip; takes about 160 ms.
    ///
    /// # Errors
    /// [`ImuError::Bus`] when one of them does not answer.
    pub fn new(accelerometer: A, gyroscope: G, delay: &mut impl DelayNs) -> Result<Self, ImuError> {
        let mut accelerometer = Builder::new_accel_spi(accelerometer);
        let mut gyroscope = Builder::new_gyro_spi(gyroscope);
        accelerometer.setup(delay).map_err(|_| ImuError::Bus)?;
        gyroscope.setup(delay).map_err(|_| ImuError::Bus)?;
        Ok(Self {
            accelerometer,
            gyroscope,
            filter: VQF::new(PERIOD_S, None, None, None),
            raw: [[0; 3]; 2],
            repeats: 0,
            sampled: None,
            latest: None,
        })
    }

    /// Reads both parts and steps the filter by the time since the call before.
    ///
    /// A time that does not lie after that of the call before, and one more than 20 ms later, moves nothing: the attitude goes on from the
    /// one before with the next call. Gravity then corrects roll and pitch; the yaw stays off by the turn of the board during the pause.
    ///
    /// # Errors
    /// Says why there is no new attitude; the one before holds for 20 ms.
    pub fn poll(&mut self, now: Instant) -> Result<(), ImuError> {
        let gyroscope = self.gyroscope.get_gyro().map_err(|_| ImuError::Bus)?;
        let accelerometer = self.accelerometer.get_accel().map_err(|_| ImuError::Bus)?;
        let raw = [gyroscope, accelerometer];
        self.repeats = if raw == self.raw { self.repeats.saturating_add(1) } else { 0 };
        self.raw = raw;
        if self.repeats >= REPEATS {
            self.latest = None;
            return Err(ImuError::Frozen);
        }
        let before = self.sampled.replace(now);
        let Some(step) = before.filter(|before| *before < now).map(|before| now.since(before))
        else {
            return Ok(());
        };
        // A filter that begins anew has another yaw: the room would turn.
        if step > LONGEST {
            return Ok(());
        }
        let rates = gyroscope.map(|count| f32::from(count) * RATE);
        self.filter.update_gyr_with_ts(rates, step.as_secs_f32());
        self.filter.update_acc(accelerometer.map(|count| f32::from(count) * ACCELERATION));
        let quaternion = self.filter.quat_6d();
        let rotation =
            Rotation3::from_quaternion(quaternion.0, quaternion.1, quaternion.2, quaternion.3);
        let (bias, _) = self.filter.bias_estimate();
        let [x, y, z] = rates;
        let rates = [x - bias[0], y - bias[1], z - bias[2]].map(AngularVelocity::from_rad_per_s);
        self.latest = rotation.ok().map(|rotation| (Attitude { rotation, rates }, now));
        Ok(())
    }
}

impl<A, G> AttitudeSource for Bmi088<A, G> {
    fn attitude(&self, now: Instant) -> Option<Attitude> {
        let (attitude, at) = self.latest?;
        (now >= at && now.since(at) <= LONGEST).then_some(attitude)
    }
}
