//! One pair of axes with what is drawn between them.

use plotters::chart::{ChartBuilder, LabelAreaPosition};
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{Color, RGBColor, ShapeStyle};

use crate::axis::Axis;
use crate::canvas::{Area, Drawn, px, px_width, text_px, text_style};
use crate::palette::Ink;

/// Least width for tick labels, pixels: three digits and a point, so that most panels start alike.
const LEAST_LEFT_PX: f64 = 28.0;
/// Space above the axes for the vertical axis's title, pixels.
pub(crate) const TOP_PX: f64 = 26.0;
/// Space right of the axes, pixels: half a tick label.
const RIGHT_PX: f64 = 18.0;
/// Space below the axes with tick labels and title, pixels.
pub(crate) const BELOW_PX: f64 = TICKS_PX + TITLE_PX;
/// Space below the axes for tick labels, pixels.
const TICKS_PX: f64 = 24.0;
/// Space below those for the horizontal axis's title, pixels.
const TITLE_PX: f64 = 18.0;

/// Something drawn in a panel, in the axes' coordinates.
pub(crate) enum Mark {
    /// A line through points.
    Line {
        points: Vec<(f64, f64)>,
        ink: Ink,
        width_px: f64,
    },
    /// A filled outline, let through to a share.
    Fill {
        outline: Vec<(f64, f64)>,
        ink: Ink,
        opacity: f64,
    },
    /// A filled rectangle from corner to corner.
    Cell {
        from: (f64, f64),
        to: (f64, f64),
        colour: RGBColor,
    },
    /// A dot.
    Dot { at: (f64, f64), ink: Ink, radius_px: f64 },
}

/// Space left of vertical axes for their tick labels and marks, pixels; the same for all that share a clock.
pub(crate) fn left_px(axes: &[&Axis]) -> f64 {
    let labels = axes
        .iter()
        .flat_map(|axis| &axis.ticks)
        .map(|tick| text_px(&tick.label));
    labels.fold(LEAST_LEFT_PX, f64::max) + 14.0
}

/// Width between the axes of a panel, pixels.
pub(crate) fn inner_px(width: u32, left_px: f64) -> f64 {
    (f64::from(width) - left_px - RIGHT_PX).max(16.0)
}

/// A panel: axes, titles and marks, drawn in their order.
pub(crate) struct Panel<'a> {
    pub(crate) x: &'a Axis,
    pub(crate) y: &'a Axis,
    /// Title of the horizontal axis with its unit; nothing leaves its tick labels out too (a panel below has them).
    pub(crate) x_title: Option<&'a str>,
    /// Title of the vertical axis with its unit, set above it.
    pub(crate) y_title: &'a str,
    /// Space left of the vertical axis, pixels: [`left_px`].
    pub(crate) left_px: f64,
    pub(crate) marks: Vec<Mark>,
}

impl Panel<'_> {
    /// Draws the panel into an area.
    pub(crate) fn draw(&self, area: &Area<'_>) -> Drawn {
        let (ticks_px, title_px) = if self.x_title.is_some() {
            (TICKS_PX, TITLE_PX)
        } else {
            (0.0, 8.0)
        };
        let mut chart = ChartBuilder::on(area)
            .margin_top(px(TOP_PX))
            .margin_right(px(RIGHT_PX))
            .margin_bottom(px(title_px))
            .set_label_area_size(LabelAreaPosition::Left, px(self.left_px))
            .set_label_area_size(LabelAreaPosition::Bottom, px(ticks_px))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(Ink::Rule.colour().stroke_width(px_width(1.0)))
            .max_light_lines(0)
            .axis_style(Ink::Muted.colour().stroke_width(px_width(1.0)))
            .label_style(text_style(Ink::Muted, HPos::Center, VPos::Top))
            .set_all_tick_mark_size(px(4.0))
            .draw()?;
        for mark in &self.marks {
            match mark {
                Mark::Line { points, ink, width_px } => chart.draw_series(std::iter::once(PathElement::new(
                    points.clone(),
                    ink.colour().stroke_width(px_width(*width_px)),
                )))?,
                Mark::Fill { outline, ink, opacity } => chart.draw_series(std::iter::once(Polygon::new(
                    outline.clone(),
                    ink.faint(*opacity).filled(),
                )))?,
                Mark::Cell { from, to, colour } => {
                    chart.draw_series(std::iter::once(Rectangle::new([*from, *to], colour.filled())))?
                }
                Mark::Dot { at, ink, radius_px } => chart.draw_series(std::iter::once(Circle::new(
                    *at,
                    px(*radius_px),
                    ShapeStyle::from(ink.colour()).filled(),
                )))?,
            };
        }
        let (width, height) = area.dim_in_pixel();
        area.draw(&Text::new(
            self.y_title.to_owned(),
            (px(4.0), px(4.0)),
            text_style(Ink::Text, HPos::Left, VPos::Top),
        ))?;
        if let Some(title) = self.x_title {
            let at = (width as i32 - px(RIGHT_PX), height as i32 - px(16.0));
            area.draw(&Text::new(
                title.to_owned(),
                at,
                text_style(Ink::Text, HPos::Right, VPos::Top),
            ))?;
        }
        Ok(())
    }
}
