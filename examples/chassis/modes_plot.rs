//! Headings, wheels, power and path of a drive in a mode, as one picture.

use super::modes::{Drive, Outcome, Sample};
use super::plot::{Area, COLORS, MEASURED};
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
    let limit = drive.power_limit_w.map_or(String::new(), |limit| format!(", limit {limit} W"));
    let rows: [(String, Vec<Curve>); 4] = [
        ("degrees (red: gimbal, blue: chassis)".into(), vec![|s| s.gimbal_deg, |s| s.heading_deg]),
        (
            "wheels, rpm (red, blue: front left, right; green, violet: rear)".into(),
            vec![
                |s| s.wheel_rpm.front_left,
                |s| s.wheel_rpm.front_right,
                |s| s.wheel_rpm.rear_left,
                |s| s.wheel_rpm.rear_right,
            ],
        ),
        (format!("power, W{limit}"), vec![|s| s.power_w]),
        (
            "buffer, J (red), and outputs let through, % (blue)".into(),
            vec![|s| s.buffer_j, |s| 100.0 * s.scale],
        ),
    ];
    for (area, (title, lines)) in curves.split_evenly((4, 1)).iter().zip(rows) {
        draw(area, &title, samples, &lines)?;
    }
    let (map, _) = map.split_vertically(440);
    super::plot::draw_map(
        &map,
        "path, m",
        &[(MEASURED, &samples.iter().map(|s| s.position_m).collect::<Vec<_>>())],
    )?;
    root.present()?;
    Ok(())
}

fn draw(
    area: &Area<'_>,
    title: &str,
    samples: &[Sample],
    lines: &[Curve],
) -> Result<(), Box<dyn Error>> {
    let end = samples.last().map_or(1.0, |sample| sample.time_s);
    let values = || lines.iter().flat_map(|line| samples.iter().map(line));
    let (low, high) =
        values().fold((0.0_f32, 10.0_f32), |(low, high), v| (low.min(v), high.max(v)));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(6)
        .x_label_area_size(24)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..end, 1.1 * low..1.1 * high)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).x_labels(11).y_labels(5).draw()?;
    for (line, color) in lines.iter().zip(COLORS) {
        let points = samples.iter().step_by(5).map(|sample| (sample.time_s, line(sample)));
        chart.draw_series(LineSeries::new(points, color))?;
    }
    Ok(())
}
