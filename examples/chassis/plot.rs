//! Targets and speeds of the wheels, and the path, as one picture.

use super::scenario::{Run, Sample};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const TITLES: [&str; 4] =
    ["front left, rpm", "front right, rpm", "rear left, rpm", "rear right, rpm"];
/// Makes the map as high as it is wide, so that a square looks like one.
const MAP_HEIGHT: i32 = 440;
pub(crate) const TARGET: RGBColor = RGBColor(200, 60, 40);
pub(crate) const MEASURED: RGBColor = RGBColor(30, 80, 180);
const FAULT: RGBColor = RGBColor(245, 225, 160);

pub(crate) fn write(path: &Path, run: &Run) -> Result<(), Box<dyn Error>> {
    // Created first: a path that cannot be written is an error of the file, not of the drawing.
    std::fs::File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let root = SVGBackend::new(path, (1200, 900)).into_drawing_area();
    root.fill(&WHITE)?;
    let (wheels, map) = root.split_horizontally(760);
    let rows = wheels.split_evenly((4, 1));
    for (wheel, (area, title)) in rows.iter().zip(TITLES).enumerate() {
        draw_wheel(area, run, wheel, title)?;
    }
    let (map, _) = map.split_vertically(MAP_HEIGHT);
    let line = |place: fn(&Sample) -> (f32, f32)| run.samples.iter().map(place).collect::<Vec<_>>();
    let (planned, driven) = (line(|sample| sample.planned_m), line(|sample| sample.position_m));
    let title = "path, m (red: planned, blue: driven)";
    draw_map(&map, title, &[(TARGET, &planned), (MEASURED, &driven)])?;
    root.present()?;
    Ok(())
}

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw_wheel(area: &Area<'_>, run: &Run, wheel: usize, title: &str) -> Result<(), Box<dyn Error>> {
    let end = run.samples.last().map_or(1.0, |sample| sample.time_s);
    let rpm = |values: [f32; 4]| values.get(wheel).copied().unwrap_or(0.0);
    let targets =
        || run.samples.iter().map(|sample| (sample.time_s, rpm(sample.target_rpm.into_array())));
    let measured =
        || run.samples.iter().map(|sample| (sample.time_s, rpm(sample.measured_rpm.into_array())));
    let reach =
        targets().chain(measured()).fold(10.0_f32, |reach, (_, rpm)| reach.max(rpm.abs())) * 1.1;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(6)
        .x_label_area_size(24)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..end, -reach..reach)?;
    if let Some((_, from, until)) = run.trouble {
        let shade = Rectangle::new([(from, -reach), (until.min(end), reach)], FAULT.filled());
        chart.draw_series(std::iter::once(shade))?;
    }
    chart.configure_mesh().light_line_style(TRANSPARENT).x_labels(11).y_labels(5).draw()?;
    chart.draw_series(LineSeries::new(targets().step_by(5), &TARGET))?;
    chart.draw_series(LineSeries::new(measured().step_by(5), &MEASURED))?;
    Ok(())
}

pub(crate) fn draw_map(
    area: &Area<'_>,
    title: &str,
    lines: &[(RGBColor, &[(f32, f32)])],
) -> Result<(), Box<dyn Error>> {
    let (mut low, mut high) = (-0.2_f32, 0.2_f32);
    for &(x, y) in lines.iter().flat_map(|(_, line)| *line) {
        low = low.min(x - 0.2).min(y - 0.2);
        high = high.max(x + 0.2).max(y + 0.2);
    }
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(24)
        .y_label_area_size(46)
        .build_cartesian_2d(low..high, low..high)?;
    chart.configure_mesh().light_line_style(TRANSPARENT).draw()?;
    for (color, line) in lines {
        chart.draw_series(LineSeries::new(line.iter().step_by(5).copied(), color))?;
    }
    Ok(())
}
