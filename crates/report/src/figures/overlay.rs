//! Measured and modelled output over time; below, on the same clock, what is left, against the noise floor.

use crate::axis::{Axis, extent};
use crate::canvas::{LegendEntry, Picture, Size, Swatch};
use crate::decimate::min_max_uniform;
use crate::number::readable_unit;
use crate::palette::Ink;
use crate::panel::{LEFT_PX, Mark, Panel, RIGHT_PX};

/// What an overlay shows. The series have one length.
#[derive(Debug, Clone, Copy)]
pub struct OverlayData<'a> {
    /// Time, seconds, ascending.
    pub time_s: &'a [f64],
    /// Measured output.
    pub measured: &'a [f64],
    /// Modelled output.
    pub modelled: &'a [f64],
    /// What the output is: `position`, `voltage`.
    pub output: &'a str,
    /// Unit of the output: `um` or `V`.
    pub unit: &'a str,
    /// Noise floor, rms, in the output's unit; 0 where unknown.
    pub noise_rms: f64,
    /// The record's name, for those who cannot see the picture.
    pub name: &'a str,
}

/// Share of the height that the upper panel takes.
const UPPER_SHARE: f64 = 0.57;

/// Draws measured and modelled output over time with the residual below. Nothing for fewer than two samples.
///
/// Series with more samples than pixels are drawn by their smallest and largest value in each column of pixels.
pub fn overlay(data: &OverlayData<'_>, size: Size) -> Option<Picture> {
    let len = data.time_s.len().min(data.measured.len()).min(data.modelled.len());
    if len < 2 {
        return None;
    }
    let (low, high) = extent(data.measured[..len].iter().chain(&data.modelled[..len]).copied())?;
    let residual = |index: usize| data.measured[index] - data.modelled[index];
    let (residual_low, residual_high) = extent((0..len).map(residual))?;
    let (start_s, end_s) = extent(data.time_s[..len].iter().copied())?;

    let (time_factor, time_unit) = readable_unit("s", start_s.abs().max(end_s.abs()));
    let (factor, unit) = readable_unit(data.unit, low.abs().max(high.abs()));
    let largest = residual_low.abs().max(residual_high.abs()).max(data.noise_rms);
    let (residual_factor, residual_unit) = readable_unit(data.unit, largest);

    // A pixel a column would be enough; what is drawn wider than its pixels gains nothing from more.
    let columns = (f64::from(size.width) - LEFT_PX - RIGHT_PX).max(16.0) as usize;
    let points = |value: &dyn Fn(usize) -> f64, factor: f64| -> Vec<(f64, f64)> {
        min_max_uniform(len, columns, value)
            .into_iter()
            .map(|index| (data.time_s[index] * time_factor, value(index) * factor))
            .collect()
    };
    let time = Axis::linear(start_s * time_factor, end_s * time_factor, (columns / 80).max(2));
    let output_axis = Axis::padded(low * factor, high * factor, 5);
    let upper = vec![
        Mark::Line {
            points: points(&|i| data.measured[i], factor),
            ink: Ink::Measured,
            width_px: 2.5,
        },
        Mark::Line {
            points: points(&|i| data.modelled[i], factor),
            ink: Ink::Model,
            width_px: 1.25,
        },
    ];
    let noise = data.noise_rms * residual_factor;
    let residual_axis = Axis::padded(
        (residual_low * residual_factor).min(-noise),
        (residual_high * residual_factor).max(noise),
        4,
    );
    let mut lower = Vec::new();
    if noise > 0.0 {
        let outline = vec![
            (time.low, -noise),
            (time.high, -noise),
            (time.high, noise),
            (time.low, noise),
        ];
        lower.push(Mark::Fill {
            outline,
            ink: Ink::Noise,
            opacity: 0.35,
        });
    }
    lower.push(Mark::Line {
        points: points(&residual, residual_factor),
        ink: Ink::Residual,
        width_px: 1.25,
    });

    let description = format!(
        "{}: measured and modelled {} over time; below, measured minus modelled, between {} and {} {residual_unit}.",
        data.name,
        data.output,
        crate::number::significant(residual_low * residual_factor),
        crate::number::significant(residual_high * residual_factor),
    );
    let mut legend = vec![
        LegendEntry::new("measured", Ink::Measured, Swatch::Line),
        LegendEntry::new("model", Ink::Model, Swatch::Line),
        LegendEntry::new("measured − model", Ink::Residual, Swatch::Line),
    ];
    if noise > 0.0 {
        legend.push(LegendEntry::new("noise floor, ± rms", Ink::Noise, Swatch::Area));
    }
    Some(Picture::draw(size, &description, legend, |sheet| {
        let (above, below) = sheet.split_vertically(crate::canvas::px(UPPER_SHARE * f64::from(size.height)));
        let title = format!("{}, {unit}", data.output);
        Panel {
            x: &time,
            y: &output_axis,
            x_title: None,
            y_title: &title,
            marks: upper,
        }
        .draw(&above)?;
        let (x_title, y_title) = (
            format!("time, {time_unit}"),
            format!("measured − model, {residual_unit}"),
        );
        Panel {
            x: &time,
            y: &residual_axis,
            x_title: Some(&x_title),
            y_title: &y_title,
            marks: lower,
        }
        .draw(&below)
    }))
}
