//! Curves over time, one chart below the other, and where the picture goes.

#[path = "../output/mod.rs"]
pub(crate) mod output;

pub(crate) use output::console;

use plotters::prelude::*;
use std::error::Error;

pub(crate) const BLUE: RGBColor = RGBColor(30, 80, 180);
pub(crate) const RED: RGBColor = RGBColor(200, 60, 40);
pub(crate) const GREY: RGBColor = RGBColor(160, 160, 160);

/// A curve: its colour, and its value of a sample.
pub(crate) type Curve<S> = (RGBColor, fn(&S) -> f32);

/// A chart: its caption, its lowest and its highest value, beyond which curves are cut, and its curves.
pub(crate) type Chart<'a, S> = (&'a str, f32, f32, &'a [Curve<S>]);

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
    for (area, (caption, lowest, highest, curves)) in
        root.split_evenly((charts.len(), 1)).iter().zip(charts)
    {
        let mut chart = ChartBuilder::on(area)
            .caption(caption, ("sans-serif", 16))
            .margin(6)
            .x_label_area_size(20)
            .y_label_area_size(52)
            .build_cartesian_2d(time_s(first)..time_s(last), *lowest..*highest)?;
        chart.configure_mesh().light_line_style(TRANSPARENT).y_labels(5).draw()?;
        for (color, value) in *curves {
            let point = |sample: &S| (time_s(sample), value(sample).clamp(*lowest, *highest));
            // About 800 points: one for each pixel.
            let points = samples.iter().step_by(samples.len() / 800 + 1).map(point);
            chart.draw_series(LineSeries::new(points, *color))?;
        }
    }
    root.present()?;
    Ok(())
}
