//! Several series over one axis: tracking errors over frequency, frequency responses.

use crate::axis::{Axis, Tick, extent};
use crate::canvas::{LegendEntry, Picture, Size, Swatch};
use crate::decimate::min_max;
use crate::palette::Ink;
use crate::panel::{Mark, Panel, inner_px, left_px};

/// One series.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// Its points, ascending in the first coordinate or along a path.
    pub points: Vec<(f64, f64)>,
    /// Its colour: a meaning, or [`Ink::Series`].
    pub ink: Ink,
}

/// The axes of a line plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lines<'a> {
    /// Title of the horizontal axis with its unit.
    pub x_title: &'a str,
    /// Title of the vertical axis with its unit.
    pub y_title: &'a str,
    /// Whether the horizontal axis is logarithmic.
    pub x_log: bool,
    /// Whether the vertical axis is logarithmic.
    pub y_log: bool,
    /// What the picture shows, for those who cannot see it.
    pub description: &'a str,
}

/// Points up to which each gets a dot, so that it is seen where measured and where only joined.
const DOTTED: usize = 40;

/// Draws series as lines over common axes. Points that a logarithmic axis cannot show are left out; nothing without points.
pub fn lines(series: &[Line], axes: &Lines<'_>, size: Size) -> Option<Picture> {
    let shown =
        |&(x, y): &(f64, f64)| x.is_finite() && y.is_finite() && (!axes.x_log || x > 0.0) && (!axes.y_log || y > 0.0);
    let points = || {
        series
            .iter()
            .flat_map(|line| line.points.iter().filter(|point| shown(point)))
    };
    let (x_low, x_high) = extent(points().map(|point| point.0))?;
    let (y_low, y_high) = extent(points().map(|point| point.1))?;

    let y = if axes.y_log {
        Axis::logarithmic(y_low / 1.3, y_high * 1.3, 6)
    } else {
        Axis::padded(y_low, y_high, 6)
    };
    let left_px = left_px(&[&y]);
    let columns = inner_px(size.width, left_px);
    let ticks = (columns / 80.0) as usize;
    let mut x = if axes.x_log {
        Axis::logarithmic(x_low, x_high, ticks)
    } else {
        Axis::linear(x_low, x_high, ticks)
    };
    // Counted things, such as steps, have nothing between them.
    if !axes.x_log && x_high - x_low <= ticks as f64 && points().all(|point| point.0.fract() == 0.0) {
        let tick = |at: i64| Tick {
            at: at as f64,
            label: at.to_string(),
        };
        x.ticks = (x_low as i64..=x_high as i64).map(tick).collect();
    }
    let mut marks = Vec::new();
    let mut legend = Vec::new();
    for line in series {
        let points = line.points.iter().filter(|point| shown(point));
        let placed: Vec<(f64, f64)> = points
            .map(|point| (x.coordinate(point.0), y.coordinate(point.1)))
            .collect();
        let column = |index: usize| ((placed[index].0 - x.low) / (x.high - x.low) * columns) as usize;
        let kept = min_max(placed.len(), column, |index| placed[index].1);
        if placed.len() <= DOTTED {
            marks.extend(placed.iter().map(|at| Mark::Dot {
                at: *at,
                ink: line.ink,
                radius_px: 2.75,
            }));
        }
        let points = kept.into_iter().map(|index| placed[index]).collect();
        marks.push(Mark::Line {
            points,
            ink: line.ink,
            width_px: 1.75,
        });
        legend.push(LegendEntry::new(line.name.clone(), line.ink, Swatch::Line));
    }
    Some(Picture::draw(size, axes.description, legend, |sheet| {
        Panel {
            x: &x,
            y: &y,
            x_title: Some(axes.x_title),
            y_title: axes.y_title,
            left_px,
            marks,
        }
        .draw(sheet)
    }))
}
