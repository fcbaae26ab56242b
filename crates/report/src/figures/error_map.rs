//! Where in the plane of position and rate the model fails: a heat map with its colour bar.

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use crate::axis::{Axis, Tick, extent};
use crate::canvas::{Area, Drawn, Picture, Size, px, px_width, text_style};
use crate::number::{readable_unit, significant};
use crate::palette::{Ink, heat};
use crate::panel::{BELOW_PX, Mark, Panel, TOP_PX, left_px};

/// What an error map shows.
#[derive(Debug, Clone, Copy)]
pub struct ErrorMapData<'a> {
    /// Edges of the columns, ascending; one more than columns.
    pub x_edges: &'a [f64],
    /// Edges of the rows, ascending; one more than rows. Edges that are not evenly spaced are drawn evenly and labelled.
    pub y_edges: &'a [f64],
    /// Error of each cell, row by row, from the lowest; nothing where no sample fell.
    pub values: &'a [Vec<Option<f64>>],
    /// Title of the horizontal axis with its unit.
    pub x_title: &'a str,
    /// Title of the vertical axis with its unit.
    pub y_title: &'a str,
    /// Unit of the error.
    pub unit: &'a str,
}

/// Width of the colour bar with its labels, pixels.
const COLOUR_BAR_PX: f64 = 96.0;
/// Ratio of the largest error to the smallest from which the colours are logarithmic.
const LOG_FROM: f64 = 10.0;
/// Range of logarithmic colours: three powers of ten, which viridis still tells apart.
const LOG_RANGE: f64 = 1e-3;
/// Steps of the colour bar.
const COLOUR_STEPS: usize = 32;

/// Draws the map. Nothing where no cell has a value.
pub fn error_map(data: &ErrorMapData<'_>, size: Size) -> Option<Picture> {
    let cells = || {
        data.values.iter().enumerate().flat_map(|(row, line)| {
            line.iter()
                .enumerate()
                .filter_map(move |(column, value)| value.map(|value| (row, column, value)))
        })
    };
    let (_, largest) = extent(cells().map(|(_, _, value)| value))?;
    if data.x_edges.len() < 2 || data.y_edges.len() < 2 {
        return None;
    }
    let (factor, unit) = readable_unit(data.unit, largest);
    let smallest = extent(cells().map(|(_, _, value)| value).filter(|value| *value > 0.0)).map_or(0.0, |range| range.0);
    let scale = colour_scale(smallest * factor, largest * factor);
    let map_px = (f64::from(size.width) - COLOUR_BAR_PX).max(100.0);
    let (x, x_at) = edges_axis(data.x_edges, (map_px / 70.0) as usize);
    let (y, y_at) = edges_axis(data.y_edges, 8);
    let marks = cells()
        .filter(|(row, column, value)| value.is_finite() && row + 1 < y_at.len() && column + 1 < x_at.len())
        .map(|(row, column, value)| Mark::Cell {
            from: (x_at[column], y_at[row]),
            to: (x_at[column + 1], y_at[row + 1]),
            colour: heat((scale.coordinate(value * factor) - scale.low) / (scale.high - scale.low)),
        })
        .collect();
    let worst = cells().max_by(|a, b| a.2.total_cmp(&b.2))?;
    let description = format!(
        "Error over {} and {}; the largest, {} {unit} rms, at {} and {}.",
        data.x_title,
        data.y_title,
        significant(largest * factor),
        middle(data.x_edges, worst.1),
        middle(data.y_edges, worst.0),
    );
    Some(Picture::draw(size, &description, Vec::new(), |sheet| {
        let (map, bar) = sheet.split_horizontally(px(map_px));
        Panel {
            x: &x,
            y: &y,
            x_title: Some(data.x_title),
            y_title: data.y_title,
            left_px: left_px(&[&y]),
            marks,
        }
        .draw(&map)?;
        colour_bar(&bar, &scale, &format!("error, {unit} rms"))
    }))
}

/// From zero, so that a map of even error looks even; logarithmic where a few cells would leave all others dark.
fn colour_scale(smallest: f64, largest: f64) -> Axis {
    if smallest > 0.0 && largest > LOG_FROM * smallest {
        Axis::logarithmic(smallest.max(largest * LOG_RANGE), largest, 5)
    } else {
        Axis::linear(0.0, if largest > 0.0 { largest } else { 1.0 }, 5)
    }
}

/// The middle of a bin, in words.
fn middle(edges: &[f64], bin: usize) -> String {
    edges
        .get(bin..bin + 2)
        .map_or_else(String::new, |pair| significant(0.5 * (pair[0] + pair[1])))
}

/// An axis for bins and the coordinates of their edges: linear where bins are of one width, else every bin as wide as the
/// next with labels at the edges.
fn edges_axis(edges: &[f64], ticks: usize) -> (Axis, Vec<f64>) {
    let widths = || edges.windows(2).map(|pair| pair[1] - pair[0]);
    let (narrowest, widest) = extent(widths()).unwrap_or((0.0, 0.0));
    if widest <= 1.5 * narrowest {
        return (Axis::linear(edges[0], edges[edges.len() - 1], ticks), edges.to_vec());
    }
    let at: Vec<f64> = (0..edges.len()).map(|index| index as f64).collect();
    let bins = edges.len() - 1;
    let mut axis = Axis::linear(0.0, bins as f64, ticks);
    let stride = bins.div_ceil(ticks.max(1));
    // Counted from both ends, so that an axis through zero is labelled alike on both sides.
    axis.ticks = (0..edges.len())
        .filter(|index| index.min(&(bins - index)) % stride == 0)
        .map(|index| Tick {
            at: index as f64,
            label: significant(edges[index]),
        })
        .collect();
    (axis, at)
}

/// The colour bar, as high as the panel beside it.
fn colour_bar(area: &Area<'_>, scale: &Axis, title: &str) -> Drawn {
    let (_, height) = area.dim_in_pixel();
    let (top, bottom) = (px(TOP_PX), height as i32 - px(BELOW_PX));
    let (left, right) = (px(4.0), px(18.0));
    let at = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
    for step in 0..COLOUR_STEPS {
        let (from, to) = (
            step as f64 / COLOUR_STEPS as f64,
            (step + 1) as f64 / COLOUR_STEPS as f64,
        );
        area.draw(&Rectangle::new(
            [(left, at(to)), (right, at(from))],
            heat(0.5 * (from + to)).filled(),
        ))?;
    }
    for tick in &scale.ticks {
        let height = at((tick.at - scale.low) / (scale.high - scale.low));
        let stroke = Ink::Muted.colour().stroke_width(px_width(1.0));
        area.draw(&PathElement::new(
            vec![(right, height), (right + px(4.0), height)],
            stroke,
        ))?;
        let style = text_style(Ink::Muted, HPos::Left, VPos::Center);
        area.draw(&Text::new(tick.label.clone(), (right + px(7.0), height), style))?;
    }
    area.draw(&Text::new(
        title.to_owned(),
        (left - px(18.0), px(4.0)),
        text_style(Ink::Text, HPos::Left, VPos::Top),
    ))
}
