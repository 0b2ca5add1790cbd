//! Simulated motors for the virtual board of `firmware/virtual/run`: a line in, a line out.
//!
//! ```text
//! motor m3508 1 can1              attaches a motor; motors and joints count from 0   ok
//! joint 3                         attaches a joint of a snake robot to can1          ok
//! body 1 0 2 3 20                 a mecanum chassis of these four motors, 20 kg      ok
//! aboard 4 0.02                   a shaft that turns this inertia on the body        ok
//! fault silent 0 5000 9000        from 5000 to 9000 us; see `fault`                  ok
//! heat 0 150                      the winding is that warm, in °C                    ok
//! run 1200 1:200#0666000000000000 takes these frames now, and goes on to 1200 us     1043 1:201#1FFF..., or nothing
//! state 0                         velocity in rpm, current in A, command, degrees, is enabled
//! pose                            of the body: heading in degrees, m/s ahead, left, degrees/s
//! ```
//! The line of the simulation takes no time here: 1 Gbit/s. The line that counts is that of the virtual board.

mod parse;

use drivetrain::frame::CanFrame;
use drivetrain::geometry::Vec2;
use drivetrain::sim::{ChassisConfig, Line, MotorConfig, MotorKey, Sender, Simulation, Wheel};
use drivetrain::time::Instant;
use parse::{Outcome, fault, frame, instant, line};
use std::fmt::Write as _;
use std::io::{self, BufRead, Write};
use std::process::ExitCode;

/// Wheel radius, and the front left wheel from the centre, in m: those of `pilot`.
const RADIUS_M: f32 = 0.076;
const AHEAD_M: f32 = 0.20;
const LEFT_M: f32 = 0.18;

struct World {
    simulation: Simulation,
    motors: Vec<MotorKey>,
    /// Shafts that feel how the body under them speeds up: each with its inertia in kg m².
    aboard: Vec<(MotorKey, f32)>,
    turning_rad_s: f32,
}

impl World {
    fn answer(&mut self, text: &str) -> Outcome<String> {
        let mut words = text.split_whitespace();
        let mut next = || words.next().ok_or("a word is missing");
        let done = || Ok("ok".into());
        match next()? {
            "motor" => {
                let config = match (next()?, next()?.parse()?) {
                    ("m2006", id) => MotorConfig::m2006(id),
                    ("m3508", id) => MotorConfig::m3508(id),
                    // Looks ahead at power-on.
                    ("gm6020", id) => MotorConfig::gm6020_voltage(id).with_rotor_angle(0),
                    _ => return Err("no such motor".into()),
                };
                let config = config.with_line(line(next()?)?);
                let config = match words.next() {
                    Some(inertia) => config.with_load_inertia_kg_m2(inertia.parse()?),
                    None => config,
                };
                self.motors.push(self.simulation.attach(config)?);
                done()
            }
            "joint" => {
                let joint = self.simulation.attach_joint(Line::Can1, next()?.parse()?, None)?;
                self.motors.push(joint);
                done()
            }
            "body" => {
                let [front_right, front_left, rear_left, rear_right] =
                    [next()?, next()?, next()?, next()?].map(|index| self.motor(index));
                let wheel = |motor, x, y| Wheel::mecanum(motor, RADIUS_M, Vec2::new(x, y));
                let wheels = [
                    wheel(front_right?, AHEAD_M, -LEFT_M).reversed(),
                    wheel(front_left?, AHEAD_M, LEFT_M),
                    wheel(rear_left?, -AHEAD_M, LEFT_M),
                    wheel(rear_right?, -AHEAD_M, -LEFT_M).reversed(),
                ];
                let config = ChassisConfig::new(&wheels).with_mass_kg(next()?.parse()?);
                self.simulation.attach_chassis(config)?;
                done()
            }
            "aboard" => {
                self.aboard.push((self.motor(next()?)?, next()?.parse()?));
                done()
            }
            "fault" => {
                let (kind, motor) = (next()?, self.motor(next()?)?);
                let window = instant(next()?)?..instant(next()?)?;
                self.simulation.fault(fault(kind, motor)?, window)?;
                done()
            }
            "heat" => {
                self.simulation.set_temperature_c(self.motor(next()?)?, next()?.parse()?);
                done()
            }
            "run" => self.run(instant(next()?)?, words),
            "state" => {
                let motor = self.motor(next()?)?;
                let state = self.simulation.motor(motor).ok_or("no such motor")?;
                let (rpm, amperes) = (state.velocity.as_rpm(), state.current.as_amperes());
                let (degrees, on) = (state.position.as_turns() * 360.0, state.is_enabled);
                Ok(format!("{rpm:.3} {amperes:.3} {} {degrees:.4} {}", state.command, u8::from(on)))
            }
            "pose" => {
                let (pose, twist) = self.simulation.chassis().ok_or("no body")?;
                let heading = pose.angle.as_degrees();
                let turning = twist.wz_rad_s.to_degrees();
                Ok(format!("{heading:.4} {:.4} {:.4} {turning:.4}", twist.vx_m_s, twist.vy_m_s))
            }
            _ => Err("no such word".into()),
        }
    }

    fn motor(&self, index: &str) -> Outcome<MotorKey> {
        Ok(*self.motors.get(index.parse::<usize>()?).ok_or("no such motor")?)
    }

    fn run<'a>(
        &mut self,
        until: Instant,
        frames: impl Iterator<Item = &'a str>,
    ) -> Outcome<String> {
        for text in frames {
            let (at, frame): (Line, CanFrame) = frame(text)?;
            self.simulation.inject(at, frame).map_err(|_| "too many frames")?;
        }
        let mut heard = String::new();
        let span = until.since(self.simulation.now());
        self.simulation.advance_with(span, |record| {
            if let (Sender::Motor(_), true) = (record.sender, record.delivered) {
                let (at, header) = (record.at.as_micros(), record.frame.header());
                let place = if record.line == Line::Can1 { 1 } else { 2 };
                _ = write!(heard, "{at} {place}:{header:03X}#");
                for byte in &record.frame.bytes()[..usize::from(record.frame.length())] {
                    _ = write!(heard, "{byte:02X}");
                }
                heard.push(' ');
            }
        });
        self.turn_the_body(span.as_secs_f32());
        Ok(heard)
    }

    /// A body that speeds up pulls what stands on it the other way.
    fn turn_the_body(&mut self, dt_s: f32) {
        let Some((_, twist)) = self.simulation.chassis() else { return };
        let before = std::mem::replace(&mut self.turning_rad_s, twist.wz_rad_s);
        let acceleration = (twist.wz_rad_s - before) / dt_s;
        for (motor, inertia) in &self.aboard {
            self.simulation.set_load_nm(*motor, -inertia * acceleration);
        }
    }
}

fn serve() -> Outcome<()> {
    const BITS_A_S: u32 = 1_000_000_000;
    let simulation =
        Simulation::new(7).with_bit_rate(Line::Can1, BITS_A_S).with_bit_rate(Line::Can2, BITS_A_S);
    let mut world =
        World { simulation, motors: Vec::new(), aboard: Vec::new(), turning_rad_s: 0.0 };
    let mut out = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let answer = world.answer(&line?)?;
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

fn main() -> ExitCode {
    match serve() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("world: {error}");
            ExitCode::FAILURE
        }
    }
}
