//! Curves over time, one chart below the other.

mod axes;

pub(crate) use axes::{BLUE, RED};

use plotters::prelude::*;
use std::error::Error;

pub(crate) const GREY: RGBColor = RGBColor(160, 160, 160);

/// A curve: its colour, and its value of a sample.
pub(crate) type Curve<S> = (RGBColor, fn(&S) -> f32);

/// A chart: its caption, the title of its values, the lowest and the highest, beyond which curves are cut, and its curves.
pub(crate) type Chart<'a, S> = (&'a str, &'a str, f32, f32, &'a [Curve<S>]);

/// Draws the charts below each other, from the first to the last time in s.
pub(crate) fn draw<S>(
    path: &str,
    samples: &[S],
    time_s: fn(&S) -> f32,
    charts: &[Chart<'_, S>],
) -> Result<(), Box<dyn Error>> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err("nothing to draw".into());
    };
    let height = u32::try_from(charts.len())? * 220;
    let root = SVGBackend::new(path, (900, height)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, &(caption, title, lowest, highest, curves)) in
        root.split_evenly((charts.len(), 1)).iter().zip(charts)
    {
        let time = (axes::TIME, time_s(first)..time_s(last));
        let mut chart = axes::axes(area, caption, time, (title, lowest..highest), None)?;
        for (color, value) in curves {
            let point = |sample: &S| (time_s(sample), value(sample).clamp(lowest, highest));
            // About 800 points: one for each pixel.
            let points = samples.iter().step_by(samples.len() / 800 + 1).map(point);
            chart.draw_series(LineSeries::new(points, *color))?;
        }
    }
    root.present()?;
    Ok(())
}
