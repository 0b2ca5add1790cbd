//! Wanted and true angles of the joints, and their errors, as one picture.

#[path = "../picture/axes.rs"]
mod axes;

use super::system::JOINTS;
use super::system::robot::Event;
use super::system::simulation::{FAULT_S, Run, Sample};
use axes::{Area, BLUE, RED, TIME, axes};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// So many milliseconds between two points.
const THIN: usize = 10;

pub(crate) fn write(path: &Path, run: &Run) -> Result<(), Box<dyn Error>> {
    std::fs::File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let root = SVGBackend::new(path, (1200, 1000)).into_drawing_area();
    root.fill(&WHITE)?;
    let areas = root.split_evenly((JOINTS / 3 + 1, 3));
    let shade = if run.setup.trouble.is_some() { ", shaded: fault" } else { "" };
    let colors = format!("red: wanted, blue: true{shade}");
    for (joint, area) in areas.iter().take(JOINTS).enumerate() {
        let title = format!("joint {} ({colors})", joint + 1);
        let pick = |sample: &Sample| {
            let value = |values: [f32; JOINTS]| values.get(joint).copied().unwrap_or(0.0);
            (value(sample.wanted_deg), value(sample.true_deg))
        };
        draw(area, run, &title, pick)?;
    }
    let titles = ["GM6020", "C610", "servo"];
    for (index, (area, title)) in areas.iter().skip(JOINTS).zip(titles).enumerate() {
        let pick = |sample: &Sample| sample.gripper_deg.get(index).copied().unwrap_or((0.0, 0.0));
        draw(area, run, &format!("{title} ({colors})"), pick)?;
    }
    root.present()?;
    Ok(())
}

fn draw(
    area: &Area<'_>,
    run: &Run,
    title: &str,
    pick: impl Fn(&Sample) -> (f32, f32),
) -> Result<(), Box<dyn Error>> {
    let end = run.setup.seconds;
    let points = || run.samples.iter().step_by(THIN).map(|sample| (sample.time_s, pick(sample)));
    // Without a zero the angle counts from where the joint began, and is cut where it leaves the scale.
    let zeroed = || run.events.iter().filter(|(_, event)| *event == Event::Zeroed);
    let first_s = zeroed().next().map_or(0.0, |(time_s, _)| *time_s);
    let last_s = zeroed().next_back().map_or(0.0, |(time_s, _)| *time_s);
    let scaled =
        points().filter(|(time_s, _)| *time_s > first_s && !(FAULT_S..=last_s).contains(time_s));
    let (low, high) = scaled
        .map(|(_, (wanted, is))| (wanted.min(is), wanted.max(is)))
        .reduce(|(low, high), (least, most)| (low.min(least), high.max(most)))
        .unwrap_or((0.0, 0.0));
    let margin = (0.1 * (high - low)).max(5.0);
    let (low, high) = (low - margin, high + margin);
    let shaded = run.setup.trouble.map(|trouble| (FAULT_S, FAULT_S + trouble.length_s().max(0.05)));
    let mut chart = axes(area, title, (TIME, 0.0..end), ("degrees", low..high), shaded)?;
    chart.draw_series(LineSeries::new(points().map(|(x, (wanted, _))| (x, wanted)), &RED))?;
    chart.draw_series(LineSeries::new(points().map(|(x, (_, is))| (x, is)), &BLUE))?;
    Ok(())
}
