//! A joint follows targets that change on the way, and a chassis moves its path, its heading and a steering module in step.
//!
//! The joint is a simulated Damiao drive. The plan begins where the joint is armed. Its target jumps while the joint moves, then moves
//! itself, then the limits are halved: each time the motion is planned anew from where the joint is, so the drive gets an angle, a
//! velocity and the torque of the acceleration without a jump.
//! The chassis is planned only: x, y and heading end together, and a module turns by its largest steering rate.
//!
//! `cargo run --release --example motion [FILE.svg]`

mod output;
mod picture;

use drivetrain::control::{MotionFollower, MotionLimits, Motions, ProfileState};
use drivetrain::damiao::{Model, Motor};
use drivetrain::math;
use drivetrain::motor::{Actuator, AngleDrive, Devices, Impedance, ImpedanceControl};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{DamiaoDrive, DriveShaft, Line, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity};
use output::console;
use picture::{BLUE, GREY, RED};
use std::error::Error;

const MODEL: Model = Model::J4310;
/// At the shaft, in kg m², with its friction in Nm.
const INERTIA: f32 = 0.02;
const FRICTION_NM: f32 = 0.02;
/// Nm/rad, Nm s/rad and Nm.
const STIFFNESS: f32 = 30.0;
const DAMPING: f32 = 1.0;
const LIMIT_NM: f32 = 3.0;
/// rad/s, rad/s², rad/s³; then half of each.
const FAST: MotionLimits = MotionLimits::new(6.0, 60.0).with_jerk(1_200.0);
const SLOW: MotionLimits = MotionLimits::new(3.0, 30.0).with_jerk(600.0);
const DT_S: f32 = 0.001;
/// Where the joint stands when it is armed, in rad.
const START: f32 = 0.4;
/// The program in ms.
const ARMED: u64 = 300;
const FIRST: u64 = 600;
const JUMP: u64 = 850;
const MOVING: u64 = 1_500;
const HALVED: u64 = 2_500;
const BACK: u64 = 2_600;
const END: u64 = 4_500;

/// The target and the limits at a time.
fn order(ms: u64) -> (ProfileState, MotionLimits) {
    let limits = if ms < HALVED { FAST } else { SLOW };
    let target = match ms {
        ..FIRST => ProfileState::at_rest(0.0),
        FIRST..JUMP => ProfileState::at_rest(2.0),
        JUMP..MOVING => ProfileState::at_rest(-0.5),
        // 2 rad/s, as a turret that tracks.
        MOVING..BACK => ProfileState {
            position: 2.0e-3 * (ms - MOVING) as f32,
            velocity: 2.0,
            ..ProfileState::default()
        },
        _ => ProfileState::at_rest(0.5),
    };
    (target, limits)
}

struct Sample {
    time_s: f32,
    target: f32,
    planned: ProfileState,
    angle: f32,
}

fn simulate() -> Result<Vec<Sample>, Box<dyn Error>> {
    let world = Simulation::new(1);
    let mut shaft = DriveShaft::new(INERTIA, FRICTION_NM);
    shaft.set_angle(START);
    let mut drive = DamiaoDrive::of(MODEL, 1).with_shaft(shaft);
    let joint = Actuator::new(Motor::new(MODEL, 1, ImpedanceControl::new(LIMIT_NM)?)?);
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), joint);
    let mut follower = MotionFollower::new([ProfileState::default()]);
    let mut samples = Vec::new();
    for ms in 0..END {
        world.advance_drives(Duration::from_millis(1), &mut [(Line::Can1, &mut drive)])?;
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        if ms == ARMED {
            runner.arm(tick)?; // the pilot asks
        }
        if !runner.is_armed() {
            // The plan begins where the joint is armed: to a plan that is elsewhere, the joint would leap.
            let here = runner.device().angle(()).map_or(0.0, Angle::as_radians);
            follower = MotionFollower::new([ProfileState::at_rest(here)]);
        }
        let (target, limits) = order(ms);
        let [planned] = follower.update(&[target], &[limits], DT_S);
        _ = runner.device_mut().set_impedance(Impedance {
            angle: Angle::from_radians(planned.position),
            velocity: AngularVelocity::from_rad_per_s(planned.velocity),
            stiffness: STIFFNESS,
            damping: DAMPING,
            torque_nm: INERTIA * planned.acceleration,
        }); // refused until armed
        runner.tick(tick);
        while let Some(edge) = runner.device_mut().next_edge() {
            console::line(format_args!("{edge}"));
        }
        let angle = drive.shaft().angle_rad();
        samples.push(Sample { time_s: ms as f32 * DT_S, target: target.position, planned, angle });
    }
    if follower.rejected() > 0 {
        return Err("the follower refused an order".into());
    }
    Ok(samples)
}

/// Fails if the plan jumps or the joint does not follow it.
fn judge(samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let (mut farthest, mut away) = (0.0_f32, 0.0_f32);
    for pair in samples.windows(2) {
        let [last, now] = pair else { continue };
        let change = now.planned.acceleration - last.planned.acceleration;
        if change.abs() > 1_200.0 * DT_S * 1.001 {
            return Err(format!("the acceleration jumps by {change} at {} s", now.time_s).into());
        }
        if last.time_s > ARMED as f32 * DT_S {
            away = away.max((now.angle - now.planned.position).abs());
        }
        if last.time_s > ARMED as f32 * DT_S + 0.25 {
            farthest = farthest.max((now.angle - now.planned.position).abs());
        }
    }
    console::line(format_args!("joint: at most {:.2}° from its plan", farthest.to_degrees()));
    // The output opens in 0.2 s, so the joint is behind its plan at first. A plan that begins at zero is 0.4 rad away.
    if away > 0.2 {
        return Err(format!("{away:.4} rad from the plan when it was armed").into());
    }
    let end = samples.last().ok_or("no samples")?;
    if farthest > 0.05 || (end.angle - 0.5).abs() > 0.005 {
        return Err(
            format!("{farthest:.4} rad from the plan, at {:.4} rad in the end", end.angle).into()
        );
    }
    Ok(())
}

/// Plans a chassis that drives already: x, y, heading, and the angle of a steering module.
fn chassis() -> Result<(), Box<dyn Error>> {
    let path = MotionLimits::new(2.5, 4.0).with_jerk(40.0); // m/s, m/s², m/s³
    let heading = MotionLimits::new(6.0, 20.0).with_jerk(200.0); // rad/s, rad/s², rad/s³
    // A module turns at 10 rad/s at most: its steering rate is the limit of velocity of its angle.
    let steering = MotionLimits::new(10.0, 150.0).with_jerk(6_000.0);
    let driving = ProfileState { velocity: 1.0, ..ProfileState::default() };
    let rest = ProfileState::default();
    let quarter = core::f32::consts::FRAC_PI_2;
    let forward = ProfileState::at_rest(2.0);
    let left = ProfileState { position: 1.0, velocity: 0.5, ..ProfileState::default() };
    // Angles are not wrapped: the shortest way from -3 rad to 2.5 rad leads over ±π.
    let from_angle = -3.0;
    let to_angle = from_angle + math::wrap_pi(2.5 - from_angle);
    let module = ProfileState { position: from_angle, ..rest };
    let motions = Motions::plan(
        &[driving, rest, rest, module],
        &[forward, left, ProfileState::at_rest(quarter), ProfileState::at_rest(to_angle)],
        &[path, path, heading, steering],
    )?;
    let duration_s = motions.duration_s();
    for tenth in 0..=10_u8 {
        let time_s = duration_s * f32::from(tenth) / 10.0;
        let [x, y, turn, module] = motions.at(time_s);
        console::line(format_args!(
            "{time_s:5.2} s: x {:5.2} m {:5.2} m/s, y {:5.2} m {:5.2} m/s, heading {:6.1}°, module {:7.1}°",
            x.position,
            x.velocity,
            y.position,
            y.velocity,
            turn.position.to_degrees(),
            module.position.to_degrees(),
        ));
    }
    let [x, y, _, module] = motions.at(duration_s);
    let errors = [x.position - 2.0, y.velocity - 0.5, module.position - to_angle];
    if errors.iter().any(|error| error.abs() > 1e-6) {
        return Err("the chassis is not where it was to be".into());
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("motion");
    let samples = simulate()?;
    judge(&samples)?;
    chassis()?;
    plot(&path, &samples)?;
    console::line(format_args!("plot: {path}"));
    Ok(())
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 3] = [
        (
            "angle (grey: target, red: plan, blue: joint)",
            "rad",
            -3.0,
            3.0,
            &[
                (GREY, |sample| sample.target),
                (RED, |sample| sample.planned.position),
                (BLUE, |sample| sample.angle),
            ],
        ),
        ("velocity of the plan", "rad/s", -8.0, 8.0, &[(RED, |sample| sample.planned.velocity)]),
        (
            "acceleration of the plan",
            "rad/s²",
            -80.0,
            80.0,
            &[(RED, |sample| sample.planned.acceleration)],
        ),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
