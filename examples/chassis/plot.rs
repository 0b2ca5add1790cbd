//! Targets and speeds of the wheels, the path, and the currents of the ESCs, as one picture.

#[path = "../picture/axes.rs"]
pub(crate) mod axes;

use super::report::NAMES;
use super::scenario::{Run, Sample};
use axes::{Area, BLUE, RED, TIME, axes};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const TITLES: [&str; 4] = ["front left", "front right", "rear left", "rear right"];
/// Makes the map as high as it is wide, so that a square looks like one.
const MAP_HEIGHT: i32 = 440;
/// Of the wheels, in the order of [`TITLES`].
pub(crate) const COLORS: [RGBColor; 4] = [RED, BLUE, RGBColor(40, 140, 60), RGBColor(150, 90, 170)];
/// Samples of 1 ms between two points of a line: with fewer the picture is several times as large.
const STEP: usize = 25;

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
    let (map, currents) = map.split_vertically(MAP_HEIGHT);
    let line = |place: fn(&Sample) -> (f32, f32)| run.samples.iter().map(place).collect::<Vec<_>>();
    let (planned, driven) = (line(|sample| sample.planned_m), line(|sample| sample.position_m));
    let title = "path (red: planned, blue: driven)";
    draw_map(&map, title, &[(RED, &planned), (BLUE, &driven)])?;
    draw_currents(&currents, &Currents::of(run))?;
    root.present()?;
    Ok(())
}

/// The currents of the ESCs around the time without a command; if they missed none, those of the whole run.
pub(crate) struct Currents {
    pub(crate) title: &'static str,
    pub(crate) from_s: f32,
    pub(crate) until_s: f32,
    pub(crate) shaded_s: Option<(f32, f32)>,
    /// In s and A.
    pub(crate) lines: [Vec<(f32, f32)>; 4],
}

impl Currents {
    pub(crate) fn of(run: &Run) -> Self {
        const MARGIN_S: f32 = 0.2;
        let end_s = run.samples.last().map_or(1.0, |sample| sample.time_s);
        let (title, from_s, until_s, step) = match &run.silence {
            Some(silence) => (
                "current of the ESCs (shaded: no command reaches them)",
                (silence.from_s - MARGIN_S).max(0.0),
                (silence.until_s + MARGIN_S).min(end_s),
                1,
            ),
            None => ("current of the ESCs", 0.0, end_s, STEP),
        };
        let within = || {
            let samples = run.samples.iter();
            samples.filter(|sample| (from_s..=until_s).contains(&sample.time_s)).step_by(step)
        };
        let lines = std::array::from_fn(|wheel| {
            let point =
                |sample: &Sample| Some((sample.time_s, *sample.current_a.into_array().get(wheel)?));
            within().filter_map(point).collect()
        });
        let missed = run.silence.map(|silence| (silence.from_s, silence.until_s));
        let shaded_s = missed.or(run.trouble.map(|(_, from_s, until_s)| (from_s, until_s)));
        Self { title, from_s, until_s, shaded_s, lines }
    }
}

fn draw_currents(area: &Area<'_>, currents: &Currents) -> Result<(), Box<dyn Error>> {
    let values = currents.lines.iter().flatten();
    let reach = values.fold(1.0_f32, |reach, (_, amperes)| reach.max(amperes.abs())) * 1.1;
    let time = (TIME, currents.from_s..currents.until_s);
    let mut chart = axes(area, currents.title, time, ("A", -reach..reach), currents.shaded_s)?;
    for ((line, color), name) in currents.lines.iter().zip(COLORS).zip(NAMES) {
        chart
            .draw_series(LineSeries::new(line.iter().copied(), color))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    Ok(())
}

fn draw_wheel(area: &Area<'_>, run: &Run, wheel: usize, title: &str) -> Result<(), Box<dyn Error>> {
    let end = run.samples.last().map_or(1.0, |sample| sample.time_s);
    let rpm = |values: [f32; 4]| values.get(wheel).copied().unwrap_or(0.0);
    let targets =
        || run.samples.iter().map(|sample| (sample.time_s, rpm(sample.target_rpm.into_array())));
    let measured =
        || run.samples.iter().map(|sample| (sample.time_s, rpm(sample.measured_rpm.into_array())));
    let reach =
        targets().chain(measured()).fold(10.0_f32, |reach, (_, rpm)| reach.max(rpm.abs())) * 1.1;
    let shade = if run.trouble.is_some() { ", shaded: fault" } else { "" };
    let title = format!("{title} (red: target, blue: measured{shade})");
    let shaded = run.trouble.map(|(_, from, until)| (from, until));
    let mut chart = axes(area, &title, (TIME, 0.0..end), ("rpm", -reach..reach), shaded)?;
    chart.draw_series(LineSeries::new(targets().step_by(STEP), &RED))?;
    chart.draw_series(LineSeries::new(measured().step_by(STEP), &BLUE))?;
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
    let mut chart = axes(area, title, ("x, m", low..high), ("y, m", low..high), None)?;
    for (color, line) in lines {
        chart.draw_series(LineSeries::new(line.iter().step_by(STEP).copied(), color))?;
    }
    Ok(())
}
