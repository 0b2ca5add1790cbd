//! An arm of three Damiao joints: base, shoulder and elbow, first without and then with its weight compensated.
//!
//! Each joint is a spring and a damper of the drive. Without compensation the arm sags until the springs hold its weight; with it
//! the torque that the weight needs, from axes and masses (`SerialArm`), is sent beside them, and the springs have only the motion to
//! do. In between the base moves, and
//! at the end there is an emergency stop. The drives are those of the simulator, written from the manual.
//!
//! `cargo run --release --example arm [FILE.svg]`

mod output;
mod picture;

use drivetrain::damiao::{Model, Motor};
use drivetrain::error::ConfigError;
use drivetrain::geometry::Vec3;
use drivetrain::manipulator::{ArmJoint, SerialArm};
use drivetrain::motor::{Actuator, AngleDrive, Devices, Impedance, ImpedanceControl};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{DamiaoDrive, DriveShaft, Line, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::Angle;
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

const GRAVITY: f32 = 9.81;
/// Upper arm and forearm: mass in kg, length in m, with the mass in the middle.
const UPPER: (f32, f32) = (0.6, 0.25);
const FOREARM: (f32, f32) = (0.4, 0.20);
/// Motor, load and gains of a joint.
#[derive(Debug, Clone, Copy)]
struct Part {
    id: u8,
    model: Model,
    /// Nm/rad and Nm s/rad.
    stiffness: f32,
    damping: f32,
    limit_nm: f32,
    /// At the shaft, in kg m².
    inertia: f32,
}

const BASE: Part = Part {
    id: 1,
    model: Model::J4310,
    stiffness: 15.0,
    damping: 1.0,
    limit_nm: 3.0,
    inertia: 0.02,
};
const SHOULDER: Part = Part {
    id: 2,
    model: Model::J4340,
    stiffness: 25.0,
    damping: 2.0,
    limit_nm: 7.0,
    inertia: 0.05,
};
const ELBOW: Part = Part { id: 3, inertia: 0.01, ..BASE };
const PARTS: [Part; 3] = [BASE, SHOULDER, ELBOW];
/// Where the arm is to be, in degrees: the elbow against the upper arm.
const POSE_DEG: [f32; 3] = [0.0, 30.0, 45.0];
const BASE_DEG: f32 = 60.0;
/// The program in ms: armed, compensated, the base turned, stopped.
const ARMED: u64 = 300;
const COMPENSATED: u64 = 2_000;
const TURNED: u64 = 3_500;
const STOPPED: u64 = 5_000;
const END: u64 = 5_300;

type Joint = Actuator<Motor>;

fn joint(part: Part) -> Result<Joint, Box<dyn Error>> {
    let mode = ImpedanceControl::new(part.limit_nm)?;
    Ok(Actuator::new(Motor::new(part.model, part.id, mode)?))
}

/// Axes and masses in the zero pose: level, stretched along x, shoulder and elbow lift with positive angles.
fn arm() -> Result<SerialArm<3>, ConfigError> {
    let ((upper_kg, upper_m), (fore_kg, fore_m)) = (UPPER, FOREARM);
    let along = |x_m| Vec3::new(x_m, 0.0, 0.0);
    let lifting = Vec3::new(0.0, -1.0, 0.0);
    Ok(SerialArm::new([
        ArmJoint::revolute(Vec3::new(0.0, 0.0, 1.0), Vec3::ZERO)?,
        ArmJoint::revolute(lifting, Vec3::ZERO)?.with_mass(upper_kg, along(0.5 * upper_m))?,
        ArmJoint::revolute(lifting, along(upper_m))?
            .with_mass(fore_kg, along(upper_m + 0.5 * fore_m))?,
    ]))
}

/// What a joint is told: to hold its angle, with the weight beside it or not.
fn target(part: Part, angle_deg: f32, weight_nm: f32, compensates: bool) -> Impedance {
    Impedance {
        angle: Angle::from_degrees(angle_deg),
        stiffness: part.stiffness,
        damping: part.damping,
        torque_nm: if compensates { weight_nm } else { 0.0 },
        ..Impedance::FREE
    }
}

// That is all of it for a real arm. From here on: the simulator.

/// The torque by which the simulated arm resists gravity at these angles, in Nm: by hand, so that the two can differ.
fn weight_nm([_, shoulder, elbow]: [f32; 3]) -> [f32; 3] {
    let ((upper_kg, upper_m), (fore_kg, fore_m)) = (UPPER, FOREARM);
    let at_elbow = fore_kg * GRAVITY * 0.5 * fore_m * (shoulder + elbow).cos();
    let at_shoulder = (0.5 * upper_kg + fore_kg) * GRAVITY * upper_m * shoulder.cos();
    [0.0, at_shoulder + at_elbow, at_elbow]
}

struct Sample {
    time_s: f32,
    angles_deg: [f32; 3],
    torques_nm: [f32; 3],
}

fn drive(part: Part, angle_deg: f32) -> DamiaoDrive {
    let shaft = DriveShaft::new(part.inertia, 0.02);
    let mut drive = DamiaoDrive::of(part.model, part.id).with_shaft(shaft);
    drive.shaft_mut().set_angle(angle_deg.to_radians());
    drive
}

fn simulate() -> Result<Vec<Sample>, Box<dyn Error>> {
    let world = Simulation::new(1);
    let [base, shoulder, elbow] = POSE_DEG;
    let mut drives = [drive(BASE, base), drive(SHOULDER, shoulder), drive(ELBOW, elbow)];
    let model = arm()?;
    let arm = [joint(BASE)?, joint(SHOULDER)?, joint(ELBOW)?];
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), arm);
    let mut samples = Vec::new();
    for ms in 0..END {
        let angles = drives.map(|drive| drive.shaft().angle_rad());
        for (drive, weight_nm) in drives.iter_mut().zip(weight_nm(angles)) {
            // Held by hand until the motors do.
            drive.shaft_mut().set_load(if ms > ARMED + 200 { -weight_nm } else { 0.0 });
        }
        let mut on_bus = drives.each_mut().map(|drive| (Line::Can1, drive as _));
        world.advance_drives(Duration::from_millis(1), &mut on_bus)?;
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == ARMED {
            runner.arm(tick)?; // the pilot asks
        }
        if ms == STOPPED {
            runner.device_mut().emergency_stop();
        }
        let pose = [if ms < TURNED { base } else { BASE_DEG }, shoulder, elbow];
        let joints = runner.device_mut();
        let measured = joints.each_ref().map(|joint| joint.angle(()));
        // An angle that is not known gives no torque: before the first feedback, and while the joint is not heard.
        let positions = measured.map(|angle| angle.map_or(f32::NAN, Angle::as_radians));
        let weights = model.holding_efforts(&positions).unwrap_or_default();
        let compensates = ms >= COMPENSATED;
        for (((joint, part), angle), weight) in joints.iter_mut().zip(PARTS).zip(pose).zip(weights)
        {
            _ = joint.set_impedance(target(part, angle, weight, compensates)); // refused until armed
        }
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            console::line(format_args!("{edge}"));
        }
        samples.push(Sample {
            time_s: ms as f32 * 1e-3,
            angles_deg: drives.map(|drive| drive.shaft().angle_rad().to_degrees()),
            torques_nm: drives.map(|drive| drive.shaft().torque_nm()),
        });
    }
    if drives.iter().any(DamiaoDrive::is_enabled) {
        return Err("a drive is enabled after the emergency stop".into());
    }
    Ok(samples)
}

fn at(samples: &[Sample], ms: u64) -> Result<&Sample, Box<dyn Error>> {
    let time_s = ms as f32 * 1e-3;
    samples.iter().rfind(|sample| sample.time_s < time_s).ok_or_else(|| "no sample".into())
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("arm");
    let samples = simulate()?;
    for (what, ms) in [
        ("without compensation", COMPENSATED),
        ("with compensation", TURNED),
        ("the base turned", STOPPED),
    ] {
        let Sample { angles_deg: [base, shoulder, elbow], torques_nm, .. } = at(&samples, ms)?;
        console::line(format_args!(
            "{what:>20}: base {base:6.2}°, shoulder {shoulder:6.2}°, elbow {elbow:6.2}°, torques {torques_nm:.2?} Nm"
        ));
    }
    let [_, wanted, _] = POSE_DEG;
    let sag =
        |ms| at(&samples, ms).map(|Sample { angles_deg: [_, shoulder, _], .. }| wanted - shoulder);
    let (off, on) = (sag(COMPENSATED)?, sag(TURNED)?);
    if off < 3.0 || on.abs() > 0.3 {
        return Err(format!("the shoulder sags by {off:.2} and {on:.2} degrees").into());
    }
    let [base, ..] = at(&samples, STOPPED)?.angles_deg;
    if (base - BASE_DEG).abs() > 1.0 {
        return Err(format!("the base is at {base:.2} degrees").into());
    }
    plot(&path, &samples)?;
    console::line(format_args!("plot: {path}"));
    Ok(())
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 2] = [
        (
            "angles (grey: base, red: shoulder, blue: elbow)",
            "degrees",
            -10.0,
            80.0,
            &[
                (GREY, |sample| sample.angles_deg[0]),
                (RED, |sample| sample.angles_deg[1]),
                (BLUE, |sample| sample.angles_deg[2]),
            ],
        ),
        (
            "torques (grey: base, red: shoulder, blue: elbow)",
            "Nm",
            -4.0,
            4.0,
            &[
                (GREY, |sample| sample.torques_nm[0]),
                (RED, |sample| sample.torques_nm[1]),
                (BLUE, |sample| sample.torques_nm[2]),
            ],
        ),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
