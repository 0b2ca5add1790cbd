//! Headings, wheels, power and path of a drive in a mode, as one picture.

use super::modes::{Drive, Outcome, Sample};
use super::plot::COLORS;
use super::plot::axes::{Area, BLUE, TIME, axes};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

type Curve = fn(&Sample) -> f32;

pub(crate) fn write(path: &Path, drive: &Drive, outcome: &Outcome) -> Result<(), Box<dyn Error>> {
    // Created first: a path that cannot be written is an error of the file, not of the drawing.
    std::fs::File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let root = SVGBackend::new(path, (1200, 900)).into_drawing_area();
    root.fill(&WHITE)?;
    let (curves, map) = root.split_horizontally(760);
    let samples = &outcome.samples;
    let limit = drive.power_limit_w.map_or(String::new(), |limit| format!(" (limit: {limit} W)"));
    let rows: [(String, &str, Vec<Curve>); 4] = [
        (
            "heading (red: gimbal, blue: chassis)".into(),
            "degrees",
            vec![|s| s.gimbal_deg, |s| s.heading_deg],
        ),
        (
            "wheels (red, blue: front left, right; green, violet: rear left, right)".into(),
            "rpm",
            vec![
                |s| s.wheel_rpm.front_left,
                |s| s.wheel_rpm.front_right,
                |s| s.wheel_rpm.rear_left,
                |s| s.wheel_rpm.rear_right,
            ],
        ),
        (format!("power{limit}"), "W", vec![|s| s.power_w]),
        (
            "red: buffer, blue: outputs let through".into(),
            "J, %",
            vec![|s| s.buffer_j, |s| 100.0 * s.scale],
        ),
    ];
    for (area, (title, unit, lines)) in curves.split_evenly((4, 1)).iter().zip(rows) {
        draw(area, &title, unit, samples, &lines)?;
    }
    let (map, _) = map.split_vertically(440);
    super::plot::draw_map(
        &map,
        "path",
        &[(BLUE, &samples.iter().map(|s| s.position_m).collect::<Vec<_>>())],
    )?;
    root.present()?;
    Ok(())
}

fn draw(
    area: &Area<'_>,
    title: &str,
    unit: &str,
    samples: &[Sample],
    lines: &[Curve],
) -> Result<(), Box<dyn Error>> {
    let end = samples.last().map_or(1.0, |sample| sample.time_s);
    let values = || lines.iter().flat_map(|line| samples.iter().map(line));
    let (low, high) =
        values().fold((0.0_f32, 10.0_f32), |(low, high), v| (low.min(v), high.max(v)));
    let mut chart = axes(area, title, (TIME, 0.0..end), (unit, 1.1 * low..1.1 * high), None)?;
    for (line, color) in lines.iter().zip(COLORS) {
        let points = samples.iter().step_by(5).map(|sample| (sample.time_s, line(sample)));
        chart.draw_series(LineSeries::new(points, color))?;
    }
    Ok(())
}
