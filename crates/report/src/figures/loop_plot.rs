//! Output against input: the hysteresis loop, measured and modelled.

use crate::axis::{Axis, extent};
use crate::canvas::{LegendEntry, Picture, Size, Swatch};
use crate::decimate::path;
use crate::number::readable_unit;
use crate::palette::Ink;
use crate::panel::{BELOW_PX, Mark, Panel, TOP_PX, inner_px, left_px};

/// What a loop plot shows. The series have one length.
#[derive(Debug, Clone, Copy)]
pub struct LoopData<'a> {
    /// Input.
    pub input: &'a [f64],
    /// Measured output.
    pub measured: &'a [f64],
    /// Modelled output.
    pub modelled: &'a [f64],
    /// What the input is: `voltage`, `position`.
    pub input_name: &'a str,
    /// Unit of the input.
    pub input_unit: &'a str,
    /// What the output is.
    pub output_name: &'a str,
    /// Unit of the output.
    pub output_unit: &'a str,
    /// The record's name, for those who cannot see the picture.
    pub name: &'a str,
}

/// Points of a curve beyond which the path is drawn on a coarser grid, for a picture of 100 000 square pixels.
const POINTS: f64 = 1500.0;

/// Draws output against input. Nothing where the input does not move, or for fewer than two samples.
pub fn loop_plot(data: &LoopData<'_>, size: Size) -> Option<Picture> {
    let len = data.input.len().min(data.measured.len()).min(data.modelled.len());
    let (input_low, input_high) = extent(data.input[..len].iter().copied())?;
    if len < 2 || input_high <= input_low {
        return None;
    }
    let (low, high) = extent(data.measured[..len].iter().chain(&data.modelled[..len]).copied())?;
    let (input_factor, input_unit) = readable_unit(data.input_unit, input_low.abs().max(input_high.abs()));
    let (factor, unit) = readable_unit(data.output_unit, low.abs().max(high.abs()));

    let y = Axis::padded(low * factor, high * factor, 6);
    let left_px = left_px(&[&y]);
    let (width_px, height_px) = (
        inner_px(size.width, left_px),
        f64::from(size.height) - TOP_PX - BELOW_PX,
    );
    let x = Axis::padded(
        input_low * input_factor,
        input_high * input_factor,
        (width_px / 60.0) as usize,
    );
    let budget = (POINTS * (width_px * height_px / 1e5).max(0.2)) as usize;
    let mut marks = Vec::new();
    for (output, ink, width) in [(data.measured, Ink::Measured, 2.5), (data.modelled, Ink::Model, 1.25)] {
        let at = |index: usize| (data.input[index] * input_factor, output[index] * factor);
        let place = |index: usize| {
            let (across, up) = at(index);
            (
                (across - x.low) / (x.high - x.low) * width_px,
                (up - y.low) / (y.high - y.low) * height_px,
            )
        };
        for line in path(len, budget, place) {
            marks.push(Mark::Line {
                points: line.into_iter().map(at).collect(),
                ink,
                width_px: width,
            });
        }
    }

    let description = format!(
        "{}: {} against {}, measured and modelled.",
        data.name, data.output_name, data.input_name
    );
    let legend = vec![
        LegendEntry::new("measured", Ink::Measured, Swatch::Line),
        LegendEntry::new("model", Ink::Model, Swatch::Line),
    ];
    Some(Picture::draw(size, &description, legend, |sheet| {
        let (x_title, y_title) = (
            format!("{}, {input_unit}", data.input_name),
            format!("{}, {unit}", data.output_name),
        );
        Panel {
            x: &x,
            y: &y,
            x_title: Some(&x_title),
            y_title: &y_title,
            left_px,
            marks,
        }
        .draw(sheet)
    }))
}
