//! A robot of three families on two CAN buses: four M3508 wheels on the first, a Damiao pitch joint and a VESC shooter on the second.
//!
//! Each bus has one runner. The device of the second is a tuple of two motors, each of its own family. Both motors are armed, stopped
//! and watched together, and driven one by one. The robot drives and spins its shooter up; at 2.5 s the VESC reports a fault. The shooter
//! trips, the joint holds its angle and the wheels go on. The operator arms again, and at the end presses the emergency stop.
//! The drives are those of the simulator. `cargo run --release --example mixed_robot`

mod console;

use drivetrain::chassis::{Chassis, ChassisLimits, Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::damiao;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::GearRatio;
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::motor::{
    Actuator, Condition, Devices, DriveProtocol, Impedance, ImpedanceControl, MotorName,
    VelocityDrive,
};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    ChassisConfig, DamiaoDrive, DriveShaft, Line, MotorConfig, MotorKey, SimError, Simulation,
    VescDrive, Wheel,
};
use drivetrain::time::{Duration, Edge};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::vesc;
use std::error::Error;

const WHEEL_RADIUS_M: f32 = 0.076;
/// The place of the front left wheel.
const FRONT_LEFT_M: Vec2 = Vec2::new(0.20, 0.18);
/// A per rad/s and A per rad of the output shaft, as in the example `two_buses`.
const WHEEL: PidConfig = PidConfig::new(4.0, 24.0, 0.0);
/// In m/s and m/s².
const PLAN: Twist<Body> = Twist::new(0.8, 0.3, 0.0);
const ACCELERATION: f32 = 2.0;

/// The pitch joint carries the shooter: 1.2 Nm of weight.
const PITCH: Angle = Angle::from_degrees(15.0);
const WEIGHT_NM: f32 = 1.2;

/// The wheel of the shooter: 7 pole pairs, 9.55 / 270 rpm/V.
const SHOOTER: vesc::Model = vesc::Model {
    name: "5065",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.035,
    current_limit_a: 30.0,
    max_velocity: AngularVelocity::from_rpm(6_000.0),
};
/// Nm per rad/s and Nm per rad, for 0.001 kg m².
const SPIN: PidConfig = PidConfig::new(0.03, 0.1, 0.0);
const SHOT: AngularVelocity = AngularVelocity::from_rpm(4_000.0);

/// The program in ms.
const ARMED: u64 = 300;
const FAULT: u64 = 2_500;
const AGAIN: u64 = 3_500;
const STOPPED: u64 = 5_000;
const END: u64 = 5_500;

/// The wheels of the first bus.
type Wheels = MecanumWheels<Handle<M3508>>;

/// What the second bus has.
type Turret = (Actuator<damiao::Motor>, Actuator<vesc::Motor>);

fn chassis_bus() -> Result<(Bus, Wheels), Box<dyn Error>> {
    let mut bus = Bus::new();
    let left = |id| Config::<M3508>::new(id).speed_loop(WHEEL);
    let wheels = MecanumWheels {
        front_left: bus.attach(left(1))?,
        front_right: bus.attach(left(2).reversed())?,
        rear_left: bus.attach(left(3))?,
        rear_right: bus.attach(left(4).reversed())?,
    };
    Ok((bus, wheels))
}

fn turret() -> Result<Turret, Box<dyn Error>> {
    let pitch = damiao::Motor::new(damiao::Model::J4310, 1, ImpedanceControl::new(4.0)?)?;
    let shooter = vesc::Mode::current_with_speed_loop(SPIN)?;
    Ok((Actuator::new(pitch), Actuator::new(vesc::Motor::new(SHOOTER, 23, shooter)?)))
}

/// Sets the targets of the second bus. A motor that is not armed, or that tripped, refuses its target.
fn aim((pitch, shooter): &mut Turret) {
    _ = pitch.set_impedance(Impedance {
        angle: PITCH,
        stiffness: 30.0,
        damping: 1.5,
        torque_nm: WEIGHT_NM,
        ..Impedance::FREE
    });
    _ = shooter.set_velocity((), SHOT);
}

/// That is all of it for a real robot. From here on: the simulator.
struct Drives {
    pitch: DamiaoDrive,
    shooter: VescDrive,
}

impl Drives {
    fn new() -> Self {
        let pitch = DamiaoDrive::of(damiao::Model::J4310, 1);
        let motor = vesc::Model { max_velocity: AngularVelocity::from_rad_per_s(600.0), ..SHOOTER };
        let shooter = VescDrive::of(motor, 23)
            .with_current_max(60.0)
            .with_timeout(0.1, 0.0)
            .with_status_hz(500.0);
        Self {
            pitch: pitch.with_shaft(DriveShaft::new(0.02, 0.02)),
            shooter: shooter.with_shaft(DriveShaft::new(0.001, 0.000_2)),
        }
    }

    /// Moves the world on by 1 ms with both drives on the second bus.
    fn step(&mut self, world: &Simulation, ms: u64) -> Result<(), SimError> {
        // Held by hand until the motor does, and when it no longer does.
        let is_held = !(ARMED + 300..STOPPED).contains(&ms);
        self.pitch.shaft_mut().set_load(if is_held { 0.0 } else { -WEIGHT_NM });
        let Self { pitch, shooter } = self;
        let tick = Duration::from_millis(1);
        world.advance_drives(tick, &mut [(Line::Can2, pitch), (Line::Can2, shooter)])
    }
}

fn body(world: &Simulation) -> Result<[MotorKey; 4], Box<dyn Error>> {
    let wheel = |id| world.attach(MotorConfig::m3508(id).with_line(Line::Can1));
    let keys = [wheel(1)?, wheel(2)?, wheel(3)?, wheel(4)?];
    let [front_left, front_right, rear_left, rear_right] = keys;
    let Vec2 { x, y } = FRONT_LEFT_M;
    let mounted = |motor, x, y| Wheel::mecanum(motor, WHEEL_RADIUS_M, Vec2::new(x, y));
    world.attach_chassis(ChassisConfig::new(&[
        mounted(front_left, x, y),
        mounted(front_right, x, -y).reversed(),
        mounted(rear_left, -x, y),
        mounted(rear_right, -x, -y).reversed(),
    ]))?;
    Ok(keys)
}

/// The observations asserted at the end.
#[derive(Debug, Default)]
struct Seen {
    /// The largest errors, after each had time to settle.
    speed_m_s: f32,
    pitch_deg: f32,
    shooter_rpm: f32,
    /// How long after the fault the shooter was disarmed.
    tripped_ms: Option<u64>,
    edges: Vec<Edge<Condition, MotorName>>,
}

fn simulate() -> Result<Seen, Box<dyn Error>> {
    let world = Simulation::new(1);
    let keys = body(&world)?;
    let mut drives = Drives::new();
    let (bus, wheels) = chassis_bus()?;
    let mut lower = Runner::new(Nb(world.controller_on(Line::Can1)), world.clock(), bus);
    let mut upper = Runner::new(Nb(world.controller_on(Line::Can2)), world.clock(), turret()?);
    let mut chassis = Chassis::new(Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M)?);
    chassis.set_limits(ChassisLimits::new().with_acceleration(ACCELERATION, 10.0))?;
    let mut seen = Seen::default();
    for ms in 0..END {
        if ms == FAULT {
            drives.shooter.fail(4); // ABS_OVER_CURRENT
        }
        drives.step(&world, ms)?;
        lower.poll(16);
        upper.poll(16);
        if let Some(tick) = lower.due() {
            if ms == ARMED {
                lower.arm(tick)?; // the operator asks
            }
            chassis.set_body(PLAN);
            chassis.drive(lower.device_mut(), wheels, tick);
            lower.tick(tick);
        }
        if let Some(tick) = upper.due() {
            if ms == ARMED || ms == AGAIN {
                upper.arm(tick)?; // the same; a motor that runs goes on
            }
            aim(upper.device_mut());
            upper.tick(tick);
        }
        if ms == STOPPED {
            lower.device_mut().emergency_stop();
            upper.device_mut().emergency_stop();
        }
        while let Some(edge) = upper.device_mut().next_edge() {
            console::line(format_args!("{edge}"));
            seen.edges.push(edge);
        }
        look(&mut seen, ms, &world, &drives, upper.device_mut())?;
    }
    let words = keys.map(|key| world.motor(key).map(|motor| motor.command));
    if words.iter().any(|word| *word != Some(0)) {
        return Err(format!("the wheels are driven after the emergency stop: {words:?}").into());
    }
    Ok(seen)
}

/// Compares what is true with what was asked for.
fn look(
    seen: &mut Seen,
    ms: u64,
    world: &Simulation,
    drives: &Drives,
    (pitch, shooter): &mut Turret,
) -> Result<(), Box<dyn Error>> {
    let (_, truth) = world.chassis().ok_or("no chassis")?;
    let (pitch_shaft, wheel) = (drives.pitch.shaft(), drives.shooter.shaft());
    let rpm = AngularVelocity::from_rad_per_s(wheel.velocity_rad_per_s()).as_rpm();
    if (1_500..STOPPED).contains(&ms) {
        let error = (truth.vx_m_s - PLAN.vx_m_s).hypot(truth.vy_m_s - PLAN.vy_m_s);
        seen.speed_m_s = seen.speed_m_s.max(error);
        let error = pitch_shaft.angle_rad().to_degrees() - PITCH.as_degrees();
        seen.pitch_deg = seen.pitch_deg.max(error.abs());
        if !Devices::is_armed(pitch) {
            return Err(format!("the joint is disarmed at {ms} ms").into());
        }
    }
    if (1_500..FAULT).contains(&ms) || (AGAIN + 1_000..STOPPED).contains(&ms) {
        seen.shooter_rpm = seen.shooter_rpm.max((rpm - SHOT.as_rpm()).abs());
    }
    if ms >= FAULT && seen.tripped_ms.is_none() && !Devices::is_armed(shooter) {
        seen.tripped_ms = Some(ms - FAULT);
    }
    let is_tripped = seen.tripped_ms.is_some() && ms < AGAIN;
    if (is_tripped && ms > FAULT + 100 || ms > STOPPED + 2) && wheel.torque_nm() != 0.0 {
        return Err(format!("the shooter has {} Nm at {ms} ms", wheel.torque_nm()).into());
    }
    if ms > STOPPED + 5 && pitch_shaft.torque_nm().abs() > 0.01 {
        return Err(format!("the joint has {} Nm at {ms} ms", pitch_shaft.torque_nm()).into());
    }
    if ms % 500 == 499 {
        let degrees = pitch_shaft.angle_rad().to_degrees();
        console::line(format_args!(
            "{:>5} ms   {:5.2} m/s ahead, {:5.2} m/s to the left   pitch {degrees:6.2}°   shooter {rpm:6.0} rpm, motor says {:?}",
            ms + 1,
            truth.vx_m_s,
            truth.vy_m_s,
            shooter.motor().velocity().as_rpm().round(),
        ));
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let seen = simulate()?;
    let Seen { speed_m_s, pitch_deg, shooter_rpm, tripped_ms, edges } = &seen;
    console::line(format_args!(
        "off by at most {speed_m_s:.3} m/s, {pitch_deg:.2}° and {shooter_rpm:.0} rpm; the shooter tripped after {tripped_ms:?} ms"
    ));
    if !(*speed_m_s < 0.06 && *pitch_deg < 0.5 && *shooter_rpm < 40.0) {
        return Err("a target was not kept".into());
    }
    // The status frames have no fault code: the motor asks for it with each 50th command.
    if !tripped_ms.is_some_and(|ms| ms <= 55) {
        return Err(format!("the shooter tripped after {tripped_ms:?} ms").into());
    }
    let faults = |began| {
        edges
            .iter()
            .filter(|edge| edge.condition == Condition::Fault && edge.began == began)
            .count()
    };
    if (faults(true), faults(false)) != (1, 1) {
        return Err(format!("{edges:?}").into());
    }
    Ok(())
}
