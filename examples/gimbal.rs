//! A gimbal keeps its direction while the chassis swings and spins: the outer loop runs on an IMU.
//!
//! ```text
//! cargo run --release --example gimbal [--fault dead-imu] [FILE.svg]
//! ```
//!
//! The GM6020's own encoder tells the angle between gimbal and chassis, which is of no use here. The IMU sits on the gimbal
//! and sends its yaw and rate as frames of its own on the same bus; the runner hands them over as frames of others. When it
//! dies, the command is zero two frames later, without anybody asking for it. The program fails when the gimbal is
//! further off than it may be, or is driven by an IMU that is dead.

mod arguments;
mod console;
mod picture;

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Measured, TargetError};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Line, MotorConfig, MotorKey, Simulation};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};
use lexopt::Arg::{Long, Short, Value};
use picture::{BLUE, GREY, RED};
use std::error::Error;
use std::f32::consts::TAU;

/// rad/s per rad; V per rad/s and V per rad.
const ANGLE: PidConfig = PidConfig::new(20.0, 0.0, 0.0).with_output_limit(8.0);
const RATE: PidConfig = PidConfig::new(3.0, 40.0, 0.0);

const IMU_ID: u16 = 0x310;
/// Counts of a turn, and of a rad/s.
const TURN_COUNTS: f32 = 65_536.0;
const RATE_COUNTS: f32 = 1_000.0;

/// Of what the motor turns, and of its own rotor, kg m².
const LOAD: f32 = 0.02;
const INERTIA: f32 = LOAD + 0.8e-3;

const END_S: f32 = 12.0;
const FAULT_S: f32 = 9.0;
/// Once it has settled.
const BOUND_DEG: f32 = 1.0;

/// Where the chassis looks, and how it turns, in rad and s: it stands, swings, and spins.
fn chassis(time_s: f32) -> (f32, f32, f32) {
    const SWING: (f32, f32) = (1.0, 3.0); // rad, rad/s
    const SPIN: (f32, f32) = (8.0, 6.0); // rad/s², up to rad/s
    match time_s {
        time if time < 3.0 => (0.0, 0.0, 0.0),
        time if time < 3.0 + TAU => {
            let (amplitude, rate) = (SWING.0 / 2.0, SWING.1);
            let (sin, cos) = (rate * (time - 3.0)).sin_cos();
            (amplitude * (1.0 - cos), amplitude * rate * sin, amplitude * rate * rate * cos)
        }
        time => {
            let (time, rising) = (time - 3.0 - TAU, SPIN.1 / SPIN.0);
            let risen = time.min(rising);
            let angle = SPIN.0 * risen * risen / 2.0 + SPIN.1 * (time - risen);
            (angle, SPIN.0 * risen, if time < rising { SPIN.0 } else { 0.0 })
        }
    }
}

/// Where it is to look.
fn target(time_s: f32) -> Angle {
    Angle::from_degrees(if time_s < 1.5 { 0.0 } else { 170.0 })
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    time_s: f32,
    chassis_deg: f32,
    yaw_deg: f32,
    error_deg: f32,
    raw: i32,
}

/// The gimbal in the world: the chassis under it turns as it likes, and its acceleration is felt at the shaft.
struct Gimbal<'w> {
    world: &'w Simulation,
    key: MotorKey,
    noise: u32,
}

impl Gimbal<'_> {
    fn time_s(&self) -> f32 {
        self.world.now().since(Instant::START).as_secs_f32()
    }

    fn advance(&self, duration: Duration) {
        // In the chassis' own frame, a chassis that speeds up pulls the gimbal the other way.
        let (_, _, acceleration) = chassis(self.time_s());
        self.world.set_load_nm(self.key, -INERTIA * acceleration);
        self.world.advance(duration);
    }

    /// The true yaw in the world, and its rate.
    fn truth(&self) -> Option<(f32, f32)> {
        let motor = self.world.motor(self.key)?;
        let (angle, rate, _) = chassis(self.time_s());
        let relative = motor.position.as_angle().as_radians();
        Some((relative + angle, motor.velocity.as_rad_per_s() + rate))
    }

    /// What the IMU sends: rounded, with a noise of 0.05° and 0.02 rad/s at most.
    fn imu_frame(&mut self) -> Option<CanFrame> {
        let (yaw, rate) = self.truth()?;
        let yaw = (yaw + self.noise(0.05_f32.to_radians())) / TAU;
        let rate = rate + self.noise(0.02);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounds")]
        let counts = ((yaw - yaw.floor()) * TURN_COUNTS) as u16;
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let rate = (rate * RATE_COUNTS) as i16;
        let ([a, b], [c, d]) = (counts.to_be_bytes(), rate.to_be_bytes());
        CanFrame::standard(IMU_ID, [a, b, c, d, 0, 0, 0, 0])
    }

    /// Numbers without pattern, within ±`amplitude`: xorshift.
    fn noise(&mut self, amplitude: f32) -> f32 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 17;
        self.noise ^= self.noise << 5;
        amplitude * (self.noise as f32 / (u32::MAX / 2) as f32 - 1.0)
    }
}

fn decode(frame: &CanFrame, at: Instant) -> Option<Measured<Angle>> {
    if frame.header() != u32::from(IMU_ID) || frame.length() != 8 {
        return None;
    }
    let [a, b, c, d, ..] = *frame.bytes();
    let (angle, rate) = (u16::from_be_bytes([a, b]), i16::from_be_bytes([c, d]));
    Some(Measured {
        angle: Angle::from_turns(f32::from(angle) / TURN_COUNTS),
        velocity: AngularVelocity::from_rad_per_s(f32::from(rate) / RATE_COUNTS),
        at,
    })
}

fn drive(imu_dies: bool) -> Result<(Vec<Sample>, u32), Box<dyn Error>> {
    let world = Simulation::new(5);
    let motor = MotorConfig::gm6020_voltage(1).with_load_inertia_kg_m2(LOAD);
    let key = world.attach(motor)?;
    let mut gimbal = Gimbal { world: &world, key, noise: 0x5EED };
    let mut bus = Bus::new();
    let yaw = bus.attach(Config::<Gm6020Voltage>::new(1).position_loop(ANGLE, RATE))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);

    let (mut samples, mut imu, mut stale) = (Vec::new(), None, 0);
    while gimbal.time_s() < END_S {
        gimbal.advance(Duration::from_micros(500));
        let time_s = gimbal.time_s();
        if !(imu_dies && time_s >= FAULT_S) {
            if let Some(frame) = gimbal.imu_frame() {
                world.inject(Line::Can1, frame)?;
            }
        }
        gimbal.advance(Duration::from_micros(500));

        let now = world.now();
        runner.poll_with(16, |frame| imu = decode(frame, now).or(imu));
        let Some(tick) = runner.due() else { continue };
        // This robot arms by itself, which only a simulated one may.
        let _not_yet = runner.is_armed() || runner.arm(tick).is_ok();
        if let Some(measured) = imu {
            match runner.device_mut().set_angle_measured(yaw, target(time_s), measured) {
                Ok(()) | Err(TargetError::Disarmed | TargetError::NoFeedback) => {}
                Err(TargetError::StaleMeasurement) => stale += 1,
                Err(other) => return Err(other.into()),
            }
        }
        runner.tick(tick);
        let (yaw_rad, _) = gimbal.truth().ok_or("no motor")?;
        let error = Angle::from_radians(yaw_rad) - target(time_s);
        samples.push(Sample {
            time_s,
            chassis_deg: chassis(time_s).0.to_degrees(),
            yaw_deg: yaw_rad.to_degrees(),
            error_deg: drivetrain::math::wrap_pi(error.as_radians()).to_degrees(),
            raw: world.motor(key).ok_or("no motor")?.command,
        });
    }
    Ok((samples, stale))
}

/// The largest error within a time, in degrees.
fn worst(samples: &[Sample], from_s: f32, until_s: f32) -> f32 {
    let within = samples.iter().filter(|sample| (from_s..until_s).contains(&sample.time_s));
    within.map(|sample| sample.error_deg.abs()).fold(0.0, f32::max)
}

fn main() -> Result<(), Box<dyn Error>> {
    const USAGE: &str = "usage: gimbal [--fault dead-imu] [FILE.svg]";
    let (mut imu_dies, mut path) = (false, String::from("gimbal.svg"));
    let mut options = arguments::of("gimbal");
    loop {
        match options.next() {
            Ok(Some(Long("fault"))) => match options.value() {
                Ok(name) if name == "dead-imu" => imu_dies = true,
                _ => arguments::refuse("gimbal", USAGE),
            },
            Ok(Some(Value(file))) => path = file.to_string_lossy().into_owned(),
            Ok(Some(Short('h') | Long("help"))) => {
                console::line(format_args!("{USAGE}"));
                return Ok(());
            }
            Ok(None) => break,
            Ok(Some(_)) | Err(_) => arguments::refuse("gimbal", USAGE),
        }
    }
    let (samples, stale) = drive(imu_dies)?;
    plot(&path, &samples)?;
    let spins_s = 3.0 + TAU;
    let held_until = if imu_dies { FAULT_S } else { END_S };
    let mut wrong = Vec::new();
    for (what, from_s, until_s) in [
        ("chassis stands, gimbal at 0°", 1.0, 1.5),
        ("chassis stands, gimbal at 170°", 2.5, 3.0),
        ("chassis swings by 57°", 3.0, spins_s.min(held_until)),
        ("chassis spins at 6 rad/s", spins_s.min(held_until), held_until),
    ] {
        if from_s < until_s {
            let worst = worst(&samples, from_s, until_s);
            console::line(format_args!("{what:<32} at most {worst:.2}° off"));
            if worst > BOUND_DEG {
                wrong.push(format!("{what}: {worst:.2}° off, not {BOUND_DEG}°"));
            }
        }
    }
    if imu_dies {
        let driven = samples.iter().filter(|sample| sample.raw != 0).map(|sample| sample.time_s);
        let last = driven.fold(0.0, f32::max);
        let after_ms = (last - FAULT_S) * 1e3;
        console::line(format_args!(
            "the IMU died at {FAULT_S} s; driven for {after_ms:.0} ms more, {stale} targets refused"
        ));
        // The last frame is up to 1 ms older, and 20 ms old is too old; a command takes 1 ms to the motor.
        if !(0.0..=22.0).contains(&after_ms) || stale < 2_900 {
            wrong.push(format!("driven for {after_ms} ms by a dead IMU, {stale} refused"));
        }
    } else if stale > 0 {
        wrong.push(format!("{stale} measurements of a healthy IMU were too old"));
    }
    console::line(format_args!("{path}"));
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ").into()) }
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 3] = [
        (
            "yaw in the world (red: gimbal, grey: chassis)",
            "degrees",
            -100.0,
            1_100.0,
            &[(GREY, |sample| sample.chassis_deg), (RED, |sample| sample.yaw_deg)],
        ),
        ("error", "degrees", -2.0, 2.0, &[(BLUE, |sample| sample.error_deg)]),
        ("command", "raw", -25_000.0, 25_000.0, &[(BLUE, |sample| sample.raw as f32)]),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
