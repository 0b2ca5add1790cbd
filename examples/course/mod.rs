//! The course of the examples `omni` and `swerve`, its result, and its picture.

#[path = "../output/mod.rs"]
pub(crate) mod output;

#[path = "../picture/axes.rs"]
mod axes;

pub(crate) use output::console;

use axes::{Area, BLUE, RED, TIME, axes};
use drivetrain::chassis::{Chassis, Kinematics};
use drivetrain::geometry::{Heading, Pose2, Twist, Vec2, World};
use drivetrain::sim;
use plotters::prelude::*;
use std::error::Error;
use std::f32::consts::TAU;

/// A square of 1.5 m, with a turn of the body all the while; ends where it began.
const SIDE_M: f32 = 1.5;
const SIDE_S: f32 = 2.0;
const TURNS: f32 = 2.0;
/// How fast an error of the position is driven off, 1/s.
const FOLLOW: f32 = 4.0;

/// How far the robot may be off. Its loops lag by some 20 ms, at up to 1.5 m/s and a turn of 3 rad/s.
const BOUND_M: f32 = 0.03;

/// When the robot is back and stands.
const END_S: f32 = 4.0 * SIDE_S + 0.3;

/// How many steps of 100 us the whole takes: a little to arm, the square, and rest.
pub(crate) const STEPS: u32 = 90_000;

/// One millisecond.
pub(crate) struct Sample<const WHEELS: usize> {
    pub(crate) time_s: f32,
    /// Where the robot was to be, truly is, and believes to be.
    pub(crate) planned_m: Vec2,
    pub(crate) driven_m: Vec2,
    pub(crate) believed_m: Vec2,
    pub(crate) target_rpm: [f32; WHEELS],
    pub(crate) measured_rpm: [f32; WHEELS],
    /// Targets and measured angles of the modules, counter-clockwise from forward, from -180 to 180, if the wheels are steered.
    pub(crate) steering_deg: Option<[[f32; WHEELS]; 2]>,
}

/// Where the robot is to be, and how it is to move, `time_s` after the start.
pub(crate) fn plan(time_s: f32) -> (Vec2, Twist<World>) {
    const CORNERS: [Vec2; 5] = [
        Vec2::new(0.0, 0.0),
        Vec2::new(SIDE_M, 0.0),
        Vec2::new(SIDE_M, SIDE_M),
        Vec2::new(0.0, SIDE_M),
        Vec2::new(0.0, 0.0),
    ];
    let within = |side: f32| (time_s / SIDE_S - side).clamp(0.0, 1.0);
    let turning = (time_s / (4.0 * SIDE_S)).clamp(0.0, 1.0);
    let yaw_rad_s = TURNS * TAU / (4.0 * SIDE_S) * speed(turning);
    let mut position = Vec2::ZERO;
    let mut velocity = Vec2::ZERO;
    for (pair, side) in CORNERS.windows(2).zip([0.0, 1.0, 2.0, 3.0]) {
        if let [from, to] = pair {
            let way = *to - *from;
            position = position + way * progress(within(side));
            velocity = velocity + way * (speed(within(side)) / SIDE_S);
        }
    }
    (position, Twist::new(velocity.x, velocity.y, yaw_rad_s))
}

/// From 0 to 1 without a jump in speed or acceleration, and the speed of it.
fn progress(t: f32) -> f32 {
    t - (TAU * t).sin() / TAU
}

fn speed(t: f32) -> f32 {
    1.0 - (TAU * t).cos()
}

/// Commands the planned motion, and a correction of the believed position; after the end, a standstill.
pub(crate) fn command<K: Kinematics>(chassis: &mut Chassis<K>, time_s: f32, heading: Heading) {
    if time_s < END_S {
        let (position, motion) = plan(time_s);
        let error = (position - place(chassis.pose())) * FOLLOW;
        chassis.set_world(motion + Twist::new(error.x, error.y, 0.0), heading);
    } else {
        chassis.set_heading(heading);
        chassis.lock();
    }
}

pub(crate) fn place(pose: Pose2<World>) -> Vec2 {
    Vec2::new(pose.x_m, pose.y_m)
}

/// Where the robot truly is, and which way it faces; stands for the IMU.
pub(crate) fn truth(world: &sim::Simulation) -> Result<(Vec2, Heading), Box<dyn Error>> {
    let (pose, _) = world.chassis().ok_or("no chassis")?;
    Ok((place(pose), pose.heading()))
}

/// Prints how far the robot was off.
///
/// # Errors
/// When that is more than it may be.
pub(crate) fn judge<const WHEELS: usize>(samples: &[Sample<WHEELS>]) -> Result<(), Box<dyn Error>> {
    let last = samples.last().ok_or("no samples")?;
    let off = |sample: &Sample<WHEELS>| (sample.driven_m - sample.planned_m).norm();
    let most = samples.iter().map(off).fold(0.0, f32::max);
    let odometry = (last.believed_m - last.driven_m).norm();
    let wheels = samples
        .iter()
        .flat_map(|sample| sample.measured_rpm)
        .fold(0.0_f32, |fastest, rpm| fastest.max(rpm.abs()));
    console::line(format_args!(
        "tracking     {:.1} mm off at most, {:.1} mm at the end",
        most * 1e3,
        off(last) * 1e3
    ));
    console::line(format_args!("odometry     {:.1} mm off at the end", odometry * 1e3));
    console::line(format_args!("wheels       {wheels:.0} rpm at most"));
    if most <= BOUND_M {
        Ok(())
    } else {
        Err(format!("{most:.3} m off the plan, {BOUND_M} m are allowed").into())
    }
}

const COLORS: [RGBColor; 4] = [RED, BLUE, RGBColor(40, 140, 60), RGBColor(150, 90, 170)];

/// Draws target (pale) and speed of every wheel, its steering angle, and the path.
pub(crate) fn plot<const WHEELS: usize>(
    path: &str,
    names: [&str; WHEELS],
    samples: &[Sample<WHEELS>],
) -> Result<(), Box<dyn Error>> {
    // Created first: a path that cannot be written is an error of the file, not of the drawing.
    std::fs::File::create(path).map_err(|error| format!("{path}: {error}"))?;
    let steers = samples.iter().any(|sample| sample.steering_deg.is_some());
    let root = SVGBackend::new(path, (1200, if steers { 900 } else { 560 })).into_drawing_area();
    root.fill(&WHITE)?;
    let (curves, map) = root.split_horizontally(680);
    let rpm = |sample: &Sample<WHEELS>| Some([sample.target_rpm, sample.measured_rpm]);
    let speeds = ("wheels (pale: target)", "rpm");
    if steers {
        let end = samples.last().map_or(END_S, |sample| sample.time_s);
        let (above, below) = curves.split_vertically(450);
        plot_wheels(&above, speeds, names, samples, None, rpm)?;
        let angles = ("steering (pale: target, shaded: locked)", "degrees from forward");
        plot_wheels(&below, angles, names, samples, Some((END_S, end)), |sample| {
            sample.steering_deg
        })?;
    } else {
        plot_wheels(&curves, speeds, names, samples, None, rpm)?;
    }
    let (map, _) = map.split_vertically(560);
    let side = -0.2..SIDE_M + 0.2;
    let title = "path (red: planned, blue: driven)";
    let mut chart = axes(&map, title, ("x, m", side.clone()), ("y, m", side), None)?;
    for (color, place) in COLORS
        .into_iter()
        .zip([(|sample| sample.planned_m) as fn(&Sample<WHEELS>) -> Vec2, |sample| sample.driven_m])
    {
        let points = samples.iter().step_by(5).map(place).map(|place| (place.x, place.y));
        chart.draw_series(LineSeries::new(points, color))?;
    }
    root.present()?;
    console::line(format_args!("plot         {path}"));
    Ok(())
}

/// Draws the targets and the measured values that `values` takes of a sample.
fn plot_wheels<const WHEELS: usize>(
    area: &Area<'_>,
    (caption, unit): (&str, &str),
    names: [&str; WHEELS],
    samples: &[Sample<WHEELS>],
    shaded: Option<(f32, f32)>,
    values: fn(&Sample<WHEELS>) -> Option<[[f32; WHEELS]; 2]>,
) -> Result<(), Box<dyn Error>> {
    let end = samples.last().map_or(1.0, |sample| sample.time_s);
    let every = samples.iter().filter_map(values).flatten().flatten();
    let reach = every.fold(10.0_f32, |reach, value| reach.max(1.1 * value.abs()));
    let mut chart = axes(area, caption, (TIME, 0.0..end), (unit, -reach..reach), shaded)?;
    for ((wheel, name), color) in names.into_iter().enumerate().zip(COLORS) {
        let lines = |of: usize, color: RGBAColor| {
            let points = samples.iter().step_by(5).filter_map(|sample| {
                Some((sample.time_s, *values(sample)?.get(of)?.get(wheel)?))
                    .filter(|(_, value)| value.is_finite())
            });
            let points: Vec<_> = points.collect();
            // An angle that wraps is two lines.
            let parts = points.chunk_by(|(_, from), (_, to)| (to - from).abs() < 180.0);
            parts.map(|part| PathElement::new(part, color)).collect::<Vec<_>>()
        };
        chart.draw_series(lines(0, color.mix(0.3)))?;
        chart
            .draw_series(lines(1, color.mix(1.0)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    Ok(())
}
