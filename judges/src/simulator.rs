//! A run of the simulator, for `judges/simulator.py`.
//!
//! ```text
//! drivetrain-judges simulator     lines of text in, samples out
//!
//! motor KIND ID INERTIA FRICTION [LOWER UPPER]   m2006, m3508 or gm6020 (in volts), its rotor at 0; load, and hard stops in rad
//! steering ID ANGLE                              a gm6020 whose shaft stands at this angle in rad
//! wheel plain|mecanum MOTOR RADIUS X Y SIGN      motors count from 0; the sign is -1 for a reversed motor
//! wheel omni MOTOR RADIUS X Y SIGN DIRECTION     the direction in rad
//! wheel steered MOTOR RADIUS X Y SIGN STEERING
//! chassis MASS INERTIA FRICTION                  on the wheels above
//! at MS frame ID WORD WORD WORD WORD             the id hexadecimal
//! at MS load MOTOR NM
//! at MS push X_N Y_N
//! run MS                                         a sample each millisecond: for each motor angle in rad, velocity in rad/s and
//!                                                current in A; x, y and heading, velocities along the body's axes and about z
//! ```

use crate::Outcome;
use crate::defect::{defects, factor};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::Vec2;
use drivetrain::sim::{ChassisConfig, MotorConfig, MotorKey, Simulation, Wheel};
use drivetrain::time::Duration;
use drivetrain::units::Angle;
use embedded_can::nb::Can;
use std::io::{BufRead, Write};
use std::str::FromStr;

defects! {
    /// The chassis is heavier by a twentieth.
    Mass = "mass",
    /// The chassis is harder to turn by a tenth.
    Inertia = "inertia",
    /// The floor holds less by a twentieth.
    Grip = "grip",
    /// Wheels are larger by a twentieth.
    Radius = "radius",
    /// Loads of motors have 0.02 Nm more friction.
    Friction = "friction",
    /// Rollers of mecanum wheels lie as in an X.
    Rollers = "rollers",
    /// Commands are smaller by a twentieth.
    Command = "command",
}

/// A line that waits for its time.
struct Order {
    ms: u64,
    words: Vec<String>,
}

pub fn run(arguments: &[&str], input: impl BufRead, output: &mut impl Write) -> Outcome<()> {
    let ([], defect) = Defect::split(arguments)? else {
        return Err("see the head of judges/src/simulator.rs for the arguments".into());
    };
    let world = Simulation::new(1);
    let (mut motors, mut wheels, mut orders) = (Vec::new(), Vec::new(), Vec::new());
    for line in input.lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["motor", kind, id, inertia, friction, stops @ ..] => {
                let more = if defect == Defect::Friction { 0.02 } else { 0.0 };
                let mut motor = motor(kind, id.parse()?)?
                    .with_rotor_angle(0)
                    .with_load_inertia_kg_m2(number(inertia)?)
                    .with_load_friction_nm(number(friction)? + more);
                if let [lower, upper] = stops {
                    motor = motor.with_stops(angle(lower)?, angle(upper)?);
                }
                motors.push(world.attach(motor)?);
            }
            ["steering", id, at] => {
                let counts = number(at)?.rem_euclid(std::f32::consts::TAU) / std::f32::consts::TAU;
                let counts = (counts * 8192.0).round() as u16;
                motors.push(world.attach(motor("gm6020", id.parse()?)?.with_rotor_angle(counts))?);
            }
            ["wheel", kind, rest @ ..] => wheels.push(wheel(kind, rest, &motors, defect)?),
            ["chassis", mass, inertia, friction] => {
                let config = ChassisConfig::new(&wheels)
                    .with_mass_kg(number(mass)? * factor(defect, Defect::Mass, 1.05))
                    .with_yaw_inertia_kg_m2(number(inertia)? * factor(defect, Defect::Inertia, 1.1))
                    .with_friction(number(friction)? * factor(defect, Defect::Grip, 0.95));
                world.attach_chassis(config)?;
            }
            ["at", ms, words @ ..] => {
                let words = words.iter().map(|word| (*word).to_owned()).collect();
                orders.push(Order { ms: ms.parse()?, words });
            }
            ["run", ms] => {
                for ms in 0..parse(ms)? {
                    for order in orders.iter().filter(|order| order.ms == ms) {
                        follow(order, &world, &motors, defect)?;
                    }
                    world.advance(Duration::from_millis(1));
                    sample(&world, &motors, output)?;
                }
            }
            _ => return Err(format!("no such line: {line}").into()),
        }
    }
    Ok(())
}

fn parse<T: FromStr>(word: &str) -> Outcome<T> {
    word.parse().map_err(|_| format!("no number: {word}").into())
}

fn number(word: &str) -> Outcome<f32> {
    parse(word)
}

fn angle(word: &str) -> Outcome<Angle> {
    Ok(Angle::from_radians(number(word)?))
}

fn motor(kind: &str, id: u8) -> Outcome<MotorConfig> {
    Ok(match kind {
        "m2006" => MotorConfig::m2006(id),
        "m3508" => MotorConfig::m3508(id),
        "gm6020" => MotorConfig::gm6020_voltage(id),
        _ => return Err(format!("no motor {kind}").into()),
    })
}

fn wheel(kind: &str, words: &[&str], motors: &[MotorKey], defect: Defect) -> Outcome<Wheel> {
    let key = |word: &str| -> Outcome<MotorKey> {
        Ok(*motors.get(parse::<usize>(word)?).ok_or("no such motor")?)
    };
    let [motor, radius, x, y, sign, rest @ ..] = words else { return Err("a short wheel".into()) };
    let motor = key(motor)?;
    let radius = number(radius)? * factor(defect, Defect::Radius, 1.05);
    let place = Vec2::new(number(x)?, number(y)?);
    let wheel = match (kind, rest) {
        ("plain", []) => Wheel::plain(motor, radius, place),
        ("mecanum", []) if defect == Defect::Rollers => {
            let degrees = if place.x * place.y > 0.0 { 45.0 } else { -45.0 };
            Wheel::plain(motor, radius, place).with_roller_axis(Angle::from_degrees(degrees))
        }
        ("mecanum", []) => Wheel::mecanum(motor, radius, place),
        ("omni", [direction]) => Wheel::omni(motor, radius, place, angle(direction)?),
        ("steered", [steering]) => {
            Wheel::steered(motor, radius, place, key(steering)?, Angle::ZERO)
        }
        _ => return Err(format!("no wheel {kind}").into()),
    };
    Ok(if number(sign)? < 0.0 { wheel.reversed() } else { wheel })
}

fn follow(order: &Order, world: &Simulation, motors: &[MotorKey], defect: Defect) -> Outcome<()> {
    let words: Vec<&str> = order.words.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["frame", id, words @ ..] => {
            let mut data = [0; 8];
            for (place, word) in data.chunks_mut(2).zip(words) {
                let word = parse::<f32>(word)? * factor(defect, Defect::Command, 0.95);
                place.copy_from_slice(&(word as i16).to_be_bytes());
            }
            let frame = CanFrame::standard(u16::from_str_radix(id, 16)?, data).ok_or("no id")?;
            world.controller().transmit(&frame).map_err(|_| "the mailboxes are full")?;
        }
        ["load", motor, nm] => {
            let motor = motors.get(parse::<usize>(motor)?).ok_or("no such motor")?;
            world.set_load_nm(*motor, number(nm)?);
        }
        ["push", x, y] => world.push_chassis(number(x)?, number(y)?, 0.0),
        _ => return Err(format!("no such order: {words:?}").into()),
    }
    Ok(())
}

fn sample(world: &Simulation, motors: &[MotorKey], output: &mut impl Write) -> Outcome<()> {
    for motor in motors {
        let state = world.motor(*motor).ok_or("no such motor")?;
        let turns = state.position.turns() as f64;
        let angle = turns * std::f64::consts::TAU + f64::from(state.position.angle().as_radians());
        let (velocity, current) = (state.velocity.as_rad_per_s(), state.current.as_amperes());
        write!(output, "{angle} {velocity} {current} ")?;
    }
    if let Some((pose, twist)) = world.chassis() {
        let heading = pose.angle.as_radians();
        write!(
            output,
            "{} {} {} {} {} {}",
            pose.x_m, pose.y_m, heading, twist.vx_m_s, twist.vy_m_s, twist.wz_rad_s
        )?;
    }
    Ok(writeln!(output)?)
}
