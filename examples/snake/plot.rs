//! Wanted and true angles of the joints, and their errors, as one picture.

use super::system::JOINTS;
use super::system::simulation::{FAULT_S, Run, Sample};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const TARGET: RGBColor = RGBColor(200, 60, 40);
const MEASURED: RGBColor = RGBColor(30, 80, 180);
const FAULT: RGBColor = RGBColor(245, 225, 160);
/// So many milliseconds between two points.
const THIN: usize = 10;

pub(crate) fn write(path: &Path, run: &Run) -> Result<(), Box<dyn Error>> {
    std::fs::File::create(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let root = SVGBackend::new(path, (1200, 1000)).into_drawing_area();
    root.fill(&WHITE)?;
    let areas = root.split_evenly((JOINTS / 3 + 1, 3));
    for (joint, area) in areas.iter().take(JOINTS).enumerate() {
        let title = format!("joint {}, degrees", joint + 1);
        let pick = |sample: &Sample| {
            let value = |values: [f32; JOINTS]| values.get(joint).copied().unwrap_or(0.0);
            (value(sample.wanted_deg), value(sample.true_deg))
        };
        draw(area, run, &title, pick)?;
    }
    let titles = ["GM6020, degrees", "C610, degrees", "servo, degrees"];
    for (index, (area, title)) in areas.iter().skip(JOINTS).zip(titles).enumerate() {
        let pick = |sample: &Sample| sample.gripper_deg.get(index).copied().unwrap_or((0.0, 0.0));
        draw(area, run, title, pick)?;
    }
    root.present()?;
    Ok(())
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw(
    area: &Area<'_>,
    run: &Run,
    title: &str,
    pick: impl Fn(&Sample) -> (f32, f32),
) -> Result<(), Box<dyn Error>> {
    let end = run.setup.seconds;
    let points = || run.samples.iter().step_by(THIN).map(|sample| (sample.time_s, pick(sample)));
    let (low, high) = points().fold((-5.0_f32, 5.0_f32), |(low, high), (_, (wanted, is))| {
        (low.min(wanted).min(is), high.max(wanted).max(is))
    });
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 14))
        .margin(5)
        .x_label_area_size(20)
        .y_label_area_size(36)
        .build_cartesian_2d(0.0..end, low * 1.1..high * 1.1)?;
    if let Some(trouble) = run.setup.trouble {
        let until = FAULT_S + trouble.length_s().max(0.05);
        let shade = Rectangle::new([(FAULT_S, low * 1.1), (until, high * 1.1)], FAULT.filled());
        chart.draw_series(std::iter::once(shade))?;
    }
    chart.configure_mesh().light_line_style(TRANSPARENT).x_labels(6).y_labels(5).draw()?;
    chart.draw_series(LineSeries::new(points().map(|(x, (wanted, _))| (x, wanted)), &TARGET))?;
    chart.draw_series(LineSeries::new(points().map(|(x, (_, is))| (x, is)), &MEASURED))?;
    Ok(())
}
