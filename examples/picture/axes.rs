//! An empty chart with titles on its axes.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf32;
use plotters::prelude::*;
use std::error::Error;
use std::ops::Range;

pub(crate) const BLUE: RGBColor = RGBColor(30, 80, 180);
pub(crate) const RED: RGBColor = RGBColor(200, 60, 40);
const SHADE: RGBColor = RGBColor(245, 225, 160);
pub(crate) const TIME: &str = "time, s";

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Plane<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf32, RangedCoordf32>>;
/// Title, with the unit, and the range of the values.
pub(crate) type Axis<'a> = (&'a str, Range<f32>);

/// Draws caption, axes and a grid, and shades the range `shaded` of x, as far as the chart has it.
pub(crate) fn axes<'a, 'b>(
    area: &'a Area<'b>,
    caption: &str,
    (x_title, x): Axis<'_>,
    (y_title, y): Axis<'_>,
    shaded: Option<(f32, f32)>,
) -> Result<Plane<'a, 'b>, Box<dyn Error>> {
    let (width, height) = area.dim_in_pixel();
    let (columns, rows) = (usize::try_from(width / 64)?, usize::try_from(height / 40)?);
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 16))
        .margin(6)
        .x_label_area_size(36)
        .y_label_area_size(58)
        .build_cartesian_2d(x, y.clone())?;
    if let Some((from, until)) = shaded {
        let corners = [(from, y.start), (until, y.end)];
        chart.draw_series(std::iter::once(Rectangle::new(corners, SHADE.filled())))?;
    }
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_labels(columns)
        .y_labels(rows)
        .axis_desc_style(("sans-serif", 13))
        .x_desc(x_title)
        .y_desc(y_title)
        .draw()?;
    Ok(chart)
}
