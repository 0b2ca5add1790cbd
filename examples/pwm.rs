//! Motors that are not on CAN: two brushed motors with encoders as a chassis, and the ESC of a fan, on pins that stand for a board's.
//!
//! ```text
//! cargo run --example pwm
//! ```
//!
//! The robot drives 0.3 m/s for 2 s, then a wire of the left encoder breaks. Fails when the way of the second one is more than 1 % off, when
//! the pulse of the ESC is not that of half throttle, or when the left motor still drives 0.6 s after its wire broke.

mod console;

use drivetrain::chassis::{Chassis, ChassisStatus, Differential};
use drivetrain::control::PidConfig;
use drivetrain::geometry::Twist;
use drivetrain::motor::{Condition, Health};
use drivetrain::pwm::{Brushed, BrushedConfig, RcPwm};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_hal::{digital, pwm};
use std::convert::Infallible;
use std::error::Error;
use std::f32::consts::TAU;

/// A channel of a timer, or a pin: what it was set to.
#[derive(Debug, Default)]
struct Pin(u16);

impl pwm::ErrorType for Pin {
    type Error = Infallible;
}

impl pwm::SetDutyCycle for Pin {
    /// Counts microseconds of a period of 20 ms.
    fn max_duty_cycle(&self) -> u16 {
        20_000
    }
    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0 = duty;
        Ok(())
    }
}

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0 = 0;
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0 = 1;
        Ok(())
    }
}

/// A bridge with two pins, as a TB6612FNG has.
type Wheel = Brushed<Pin, (Pin, Pin)>;

/// 11 lines, counted fourfold, behind a gear of 30.
const COUNTS_PER_TURN: f32 = 11.0 * 4.0 * 30.0;
/// At full duty, without load.
const NO_LOAD: AngularVelocity = AngularVelocity::from_rpm(330.0);
/// Of full duty, per rad/s and per rad.
const SPEED: PidConfig = PidConfig::new(0.02, 0.4, 0.0);
const RADIUS_M: f32 = 0.033;
const SPEED_M_S: f32 = 0.3;

/// The shaft behind a bridge: nears the speed of its duty within 0.05 s.
#[derive(Debug, Default)]
struct Shaft {
    rad_per_s: f32,
    angle_rad: f32,
}

impl Shaft {
    fn turn(&mut self, wheel: &Wheel, dt_s: f32) {
        let way = f32::from(wheel.direction().0.0) - f32::from(wheel.direction().1.0);
        let duty = way * f32::from(wheel.channel().0) / 20_000.0;
        self.rad_per_s += (duty * NO_LOAD.as_rad_per_s() - self.rad_per_s) * dt_s / 0.05;
        self.angle_rad += self.rad_per_s * dt_s;
    }

    /// The counter of a timer, 16 bits.
    fn counter(&self) -> u32 {
        #[expect(clippy::cast_possible_truncation, reason = "some 5000 counts")]
        let counts = (self.angle_rad / TAU * COUNTS_PER_TURN) as i32;
        counts.cast_unsigned() & 0xFFFF
    }
}

fn wheel(id: u8) -> Result<Wheel, Box<dyn Error>> {
    let config = BrushedConfig::new(id)
        .with_encoder(COUNTS_PER_TURN, 16)
        .with_speed_loop(SPEED)
        .with_no_load_speed(NO_LOAD);
    Ok(Brushed::new(Pin::default(), Default::default(), config)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut wheels = [wheel(1)?, wheel(2)?];
    let mut shafts = [Shaft::default(), Shaft::default()];
    let mut chassis = Chassis::new(Differential::new(RADIUS_M, 0.16)?);
    let mut fan = RcPwm::new(Pin::default());
    let (mut left_counter, mut start_m) = (0, 0.0);

    for ms in 1..=4_600_u32 {
        let tick = Tick::new(Instant::from_micros(u64::from(ms) * 1_000), 0.001);
        // The wire of the left encoder breaks at 4 s: its counter stands.
        left_counter = if ms < 4_000 { shafts[0].counter() } else { left_counter };
        wheels[0].ingest_counts(left_counter, tick.now());
        wheels[1].ingest_counts(shafts[1].counter(), tick.now());

        if ms == 1 {
            // By itself, which only a robot on a desk may. The ESC gets its neutral pulse for 2 s first.
            wheels.iter_mut().try_for_each(|wheel| wheel.arm(tick.now()))?;
            fan.arm()?;
        }
        let speed = if ms > 2_000 { SPEED_M_S } else { 0.0 };
        chassis.set_body(Twist::new(speed, 0.0, 0.0));
        chassis.drive(&mut wheels, [(0, ()), (1, ())], tick);
        if fan.is_armed() {
            fan.set_throttle(0.5)?;
        }
        for (wheel, shaft) in wheels.iter_mut().zip(&mut shafts) {
            wheel.update(tick)?;
            shaft.turn(wheel, tick.dt_s());
        }
        fan.update(tick)?;

        if ms == 3_000 {
            start_m = chassis.pose().x_m;
        }
        if ms == 4_000 {
            let way_m = chassis.pose().x_m - start_m;
            console::line(format_args!(
                "1 s at {SPEED_M_S} m/s: {way_m:.3} m; the fan has {} us",
                fan.channel().0
            ));
            if (way_m - SPEED_M_S).abs() > 0.003 || fan.channel().0 != 1_750 {
                return Err("another way, or another pulse".into());
            }
        }
    }
    let edge = wheels[0].next_edge().ok_or("no edge")?;
    console::line(format_args!("{edge}; {}", told(&wheels[0].health(), chassis.status())));
    let is_at_rest = wheels[0].channel().0 == 0 && chassis.status().refused == 1;
    if edge.condition != Condition::Stalled || !is_at_rest {
        return Err("the left motor goes on".into());
    }
    Ok(())
}

fn told(left: &Health, chassis: &ChassisStatus) -> String {
    let motor = if left.armed { "is armed" } else { "rests" };
    format!("the motor {motor}, the chassis drives {} of 2", 2 - chassis.refused)
}
