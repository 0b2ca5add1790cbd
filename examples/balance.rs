//! A robot on two wheels with legs of five bars: it rises, drives, is pushed, and stands taller.
//!
//! ```text
//! cargo run --release --example balance [FILE.svg]
//! ```
//!
//! The plant is a nonlinear one in the plane, from the energies of wheels, legs and body, in steps of 0.1 ms: 20 % heavier than the
//! controller knows, and 2 ms late. Prints the largest tilt and the state at the end; fails if the body tilts by more than 15 degrees, or the robot
//! is not at rest at its length in the end. In space, with contacts and with frames of motors, `judges/balance.py` judges the same controller.

mod output;
mod picture;

use drivetrain::chassis::{BalanceModel, BalancePhase, Balancer, FiveBar, LegEffort};
use drivetrain::geometry::{Attitude, Rotation3};
use drivetrain::units::{Angle, AngularVelocity};
use output::console;
use picture::{BLUE, GREY, RED};
use std::collections::VecDeque;
use std::error::Error;

const MODEL: BalanceModel = BalanceModel {
    wheel_radius_m: 0.075,
    wheel_kg: 0.8,
    wheel_kg_m2: 0.0045,
    leg_kg: 1.1,
    leg_kg_m2: 0.012,
    leg_centre: 0.6,
    body_kg: 14.0,
    body_kg_m2: 0.25,
    body_height_m: 0.03,
};
/// Mass and inertia of the real body, as shares of those above.
const HEAVIER: f32 = 1.2;
/// Least and largest length of a leg in m; largest torques of both wheels and of both hips in Nm.
const LENGTHS_M: [f32; 2] = [0.14, 0.36];
const LIMIT_NM: [f32; 2] = [10.0, 50.0];
const GRAVITY: f32 = 9.81;
const DT_S: f32 = 0.001;
const PARTS: u16 = 10;
const DELAY: usize = 2;
/// In ms: forward and to a stop, in m/s; pushed for 50 ms, in N; taller, in m; the end.
const DRIVE: (u16, u16, f32) = (3_000, 5_000, 0.8);
const PUSH: (u16, u16, f32) = (7_000, 7_050, 200.0);
const TALLER: (u16, f32) = (9_000, 0.32);
const END: u16 = 12_000;

struct Sample {
    time_s: f32,
    target: f32,
    /// Place of the wheels, lean of the legs, their length, pitch of the body; and their rates.
    place: [f32; 4],
    rate: [f32; 4],
    wheel_nm: f32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = output::path("balance");
    let samples = drive()?;
    plot(&path, &samples)?;
    judge(&samples)?;
    console::line(format_args!("{path}"));
    Ok(())
}

fn drive() -> Result<Vec<Sample>, Box<dyn Error>> {
    let mut robot = Balancer::new(&MODEL, LENGTHS_M, LIMIT_NM, DT_S)?;
    let bars = FiveBar::new(0.075, 0.15, 0.27)?;
    let (mut place, mut rate) = ([0.0, 0.05, 0.16, 0.1], [0.0; 4]);
    let mut angles = bars.angles(place[2], place[1] - place[3]).ok_or("out of reach")?;
    let mut torques_nm = [0.0; 2];
    let mut late = VecDeque::from(vec![[0.0; 3]; DELAY]);
    let mut samples = Vec::new();
    robot.start();
    for ms in 0..END {
        let target = if (DRIVE.0..DRIVE.1).contains(&ms) { DRIVE.2 } else { 0.0 };
        robot.set_motion(target, 0.0);
        if ms == TALLER.0 {
            robot.set_length(TALLER.1);
        }
        // Both legs are alike in the plane.
        let now = bars.angles(place[2], place[1] - place[3]).ok_or("out of reach")?;
        let [front, rear] = [now[0] - angles[0], now[1] - angles[1]];
        angles = now;
        let rates =
            [front, rear].map(|way| AngularVelocity::from_rad_per_s(way.as_radians() / DT_S));
        let leg = bars.state(angles, rates, torques_nm).ok_or("the bars do not close")?;
        let pitch = Angle::from_radians(place[3]);
        let attitude = Attitude {
            rotation: Rotation3::from_roll_pitch_yaw(Angle::ZERO, pitch, Angle::ZERO),
            rates: [0.0, rate[3], 0.0].map(AngularVelocity::from_rad_per_s),
        };
        // Against the bar that carries the wheel's motor.
        let wheel = rate[0] / MODEL.wheel_radius_m - leg.carrier_rad_s - rate[3];
        let wheels = [AngularVelocity::from_rad_per_s(wheel); 2];
        let [effort, _]: [LegEffort; 2] =
            robot.update(Some(&attitude), Some([leg; 2]), wheels).ok_or("the robot fell")?;
        torques_nm = leg.torques(&effort);
        late.push_back([effort.wheel_nm, effort.hip_nm, effort.force_n].map(|of_leg| 2.0 * of_leg));
        let efforts = late.pop_front().unwrap_or_default();
        let push = if (PUSH.0..PUSH.1).contains(&ms) { PUSH.2 } else { 0.0 };
        for _ in 0..PARTS {
            let part_s = DT_S / f32::from(PARTS);
            let changes = accelerations(&place, &rate, efforts, push);
            for (rate, by) in rate.iter_mut().zip(changes) {
                *rate += by * part_s;
            }
            for (place, rate) in place.iter_mut().zip(rate) {
                *place += rate * part_s;
            }
        }
        let time_s = f32::from(ms) * DT_S;
        samples.push(Sample { time_s, target, place, rate, wheel_nm: efforts[0] });
    }
    if robot.phase() != BalancePhase::Standing {
        return Err("the robot does not stand in the end".into());
    }
    Ok(samples)
}

/// A mass of the plant: how its point moves with each coordinate, forward and up, and its acceleration without theirs.
struct Point {
    kg: f32,
    by: [[f32; 2]; 4],
    bias: [f32; 2],
}

/// Accelerations of place, lean, length and pitch, under the efforts of wheels, hips and legs, and a push at the body.
fn accelerations(
    &[_, lean, length, pitch]: &[f32; 4],
    &[_, lean_rate, length_rate, pitch_rate]: &[f32; 4],
    [wheel_nm, hip_nm, force_n]: [f32; 3],
    push_n: f32,
) -> [f32; 4] {
    let along @ [along_x, along_z] = [lean.sin(), lean.cos()];
    let across @ [across_x, across_z] = [lean.cos(), -lean.sin()];
    let height = MODEL.body_height_m;
    // At this share of the leg, from the wheel.
    let on_leg = |kg: f32, share: f32| Point {
        kg,
        by: [
            [1.0, 0.0],
            across.map(|part| share * length * part),
            along.map(|part| share * part),
            [0.0; 2],
        ],
        bias: [
            share * lean_rate * (2.0 * length_rate * across_x - length * lean_rate * along_x),
            share * lean_rate * (2.0 * length_rate * across_z - length * lean_rate * along_z),
        ],
    };
    let mut body = on_leg(HEAVIER * MODEL.body_kg, 1.0);
    body.by[3] = [height * pitch.cos(), -height * pitch.sin()];
    body.bias[0] -= height * pitch_rate * pitch_rate * pitch.sin();
    body.bias[1] -= height * pitch_rate * pitch_rate * pitch.cos();

    let radius = MODEL.wheel_radius_m;
    let mut mass = [[0.0; 4]; 4];
    mass[0][0] = 2.0 * (MODEL.wheel_kg + MODEL.wheel_kg_m2 / (radius * radius));
    mass[1][1] = 2.0 * MODEL.leg_kg_m2;
    mass[3][3] = HEAVIER * MODEL.body_kg_m2;
    let mut force = [wheel_nm / radius, hip_nm - wheel_nm, force_n, -hip_nm];
    for (force, by) in force.iter_mut().zip(&body.by) {
        *force += push_n * by[0];
    }
    for Point { kg, by, bias } in [on_leg(2.0 * MODEL.leg_kg, MODEL.leg_centre), body] {
        for ((row, force), own) in mass.iter_mut().zip(&mut force).zip(&by) {
            *force -= kg * (own[0] * bias[0] + own[1] * (bias[1] + GRAVITY));
            for (entry, other) in row.iter_mut().zip(&by) {
                *entry += kg * (own[0] * other[0] + own[1] * other[1]);
            }
        }
    }
    solved(mass, force)
}

/// Solves `mass x = force` of a symmetric, positive matrix by conjugate gradients.
fn solved(mass: [[f32; 4]; 4], force: [f32; 4]) -> [f32; 4] {
    let (mut found, mut rest, mut way) = ([0.0; 4], force, force);
    for _ in 0..8 {
        let size = dot(&rest, &rest);
        let gone = mass.map(|row| dot(&row, &way));
        let share = size / dot(&way, &gone);
        if !share.is_finite() {
            break;
        }
        found = plus(found, share, way);
        rest = plus(rest, -share, gone);
        way = plus(rest, dot(&rest, &rest) / size, way);
    }
    found
}

fn dot(a: &[f32; 4], b: &[f32; 4]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn plus(mut a: [f32; 4], share: f32, b: [f32; 4]) -> [f32; 4] {
    for (a, b) in a.iter_mut().zip(b) {
        *a += share * b;
    }
    a
}

fn judge(samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let tilt = samples.iter().fold(0.0_f32, |most, sample| most.max(sample.place[3].abs()));
    let end = samples.last().ok_or("no samples")?;
    let [place, _, length, _] = end.place;
    console::line(format_args!(
        "tilt of at most {:.1} degrees; in the end {:.2} m/s at {place:.2} m, legs of {length:.3} m",
        tilt.to_degrees(),
        end.rate[0],
    ));
    let is_at_rest = end.rate[0].abs() < 0.05 && (length - TALLER.1).abs() < 0.03;
    if tilt.to_degrees() > 15.0 || !is_at_rest {
        return Err("the robot tilts too far, or is not at rest at its length".into());
    }
    Ok(())
}

fn plot(path: &str, samples: &[Sample]) -> Result<(), Box<dyn Error>> {
    let charts: [picture::Chart<'_, Sample>; 4] = [
        (
            "blue: pitch of the body, red: lean of the legs",
            "degrees",
            -15.0,
            15.0,
            &[
                (RED, |sample| sample.place[1].to_degrees()),
                (BLUE, |sample| sample.place[3].to_degrees()),
            ],
        ),
        (
            "velocity (grey: target, blue: measured)",
            "m/s",
            -1.5,
            1.5,
            &[(GREY, |sample| sample.target), (BLUE, |sample| sample.rate[0])],
        ),
        ("length of the legs", "m", 0.1, 0.4, &[(BLUE, |sample| sample.place[2])]),
        ("torque of both wheels", "Nm", -10.0, 10.0, &[(BLUE, |sample| sample.wheel_nm)]),
    ];
    picture::draw(path, samples, |sample| sample.time_s, &charts)
}
