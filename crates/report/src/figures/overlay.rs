//! Measured and modelled output over time; below, on the same clock, what is left, against the noise floor.

use crate::axis::{Axis, extent};
use crate::canvas::{LegendEntry, Picture, Size, Swatch, px};
use crate::decimate::min_max_uniform;
use crate::number::{quantity, readable_unit, significant};
use crate::palette::Ink;
use crate::panel::{BELOW_PX, Mark, Panel, TOP_PX, inner_px, left_px};

/// What an overlay shows. The series have one length.
#[derive(Debug, Clone, Copy)]
pub struct OverlayData<'a> {
    /// Time of the first sample, seconds.
    pub start_s: f64,
    /// Sample period, seconds.
    pub period_s: f64,
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

/// Height for one tick of a vertical axis, pixels: two lines of text.
const TICK_PX: f64 = 30.0;
/// Height of the noise band from which its edges are told apart, pixels.
const EDGES_PX: f64 = 4.0;
/// Share of the height that the upper panel takes.
const UPPER_SHARE: f64 = 0.57;

/// The axes of the two panels and what turns values into their units.
struct Scales {
    time: Axis,
    output: Axis,
    residual: Axis,
    /// Factor and unit of time, output and residual.
    units: [(f64, String); 3],
    left_px: f64,
}

/// Draws measured and modelled output over time with the residual below. Nothing for fewer than two samples.
///
/// Series with more samples than pixels are drawn by their smallest and largest value in each column of pixels.
pub fn overlay(data: &OverlayData<'_>, size: Size) -> Option<Picture> {
    let len = data.measured.len().min(data.modelled.len());
    if len < 2 {
        return None;
    }
    let residual = |index: usize| data.measured[index] - data.modelled[index];
    let (residual_low, residual_high) = extent((0..len).map(residual))?;
    let scales = scales(data, len, (residual_low, residual_high), size)?;
    let [
        (time_factor, time_unit),
        (factor, unit),
        (residual_factor, residual_unit),
    ] = &scales.units;

    let columns = inner_px(size.width, scales.left_px) as usize;
    let line = |value: &dyn Fn(usize) -> f64, factor: f64, ink: Ink, width_px: f64| {
        let kept = min_max_uniform(len, columns, value).into_iter();
        let points = kept
            .map(|index| (at_s(data, index) * time_factor, value(index) * factor))
            .collect();
        Mark::Line { points, ink, width_px }
    };
    let upper = vec![
        line(&|i| data.measured[i], *factor, Ink::Measured, 2.5),
        line(&|i| data.modelled[i], *factor, Ink::Model, 1.25),
    ];
    let (below, above) = noise_marks(&scales, data.noise_rms * residual_factor, size);
    let mut lower = below;
    lower.push(line(&residual, *residual_factor, Ink::Residual, 1.25));
    lower.extend(above);

    let description = format!(
        "{}: measured and modelled {} over time; below, measured minus modelled, between {} and {} {residual_unit}.",
        data.name,
        data.output,
        significant(residual_low * residual_factor),
        significant(residual_high * residual_factor),
    );
    let (x_title, left_px) = (format!("time, {time_unit}"), scales.left_px);
    let (upper_title, lower_title) = (
        format!("{}, {unit}", data.output),
        format!("measured − model, {residual_unit}"),
    );
    let panels = [
        Panel {
            x: &scales.time,
            y: &scales.output,
            x_title: None,
            y_title: &upper_title,
            left_px,
            marks: upper,
        },
        Panel {
            x: &scales.time,
            y: &scales.residual,
            x_title: Some(&x_title),
            y_title: &lower_title,
            left_px,
            marks: lower,
        },
    ];
    Some(Picture::draw(size, &description, legend(data), |sheet| {
        let (above, below) = sheet.split_vertically(px(UPPER_SHARE * f64::from(size.height)));
        panels[0].draw(&above)?;
        panels[1].draw(&below)
    }))
}

/// The noise floor as a band below the residual and, where a dense residual would hide it, its edges above.
fn noise_marks(scales: &Scales, noise: f64, size: Size) -> (Vec<Mark>, Vec<Mark>) {
    if noise <= 0.0 {
        return (Vec::new(), Vec::new());
    }
    let (start, end) = (scales.time.low, scales.time.high);
    let outline = vec![(start, -noise), (end, -noise), (end, noise), (start, noise)];
    let band = vec![Mark::Fill {
        outline,
        ink: Ink::Noise,
        opacity: 0.35,
    }];
    let panel_px = (1.0 - UPPER_SHARE) * f64::from(size.height) - TOP_PX - BELOW_PX;
    let band_px = 2.0 * noise / (scales.residual.high - scales.residual.low) * panel_px;
    if band_px <= EDGES_PX {
        return (band, Vec::new());
    }
    let edge = |at: f64| Mark::Line {
        points: vec![(start, at), (end, at)],
        ink: Ink::Text,
        width_px: 0.75,
    };
    (band, vec![edge(-noise), edge(noise)])
}

/// Time of a sample, seconds.
fn at_s(data: &OverlayData<'_>, sample: usize) -> f64 {
    data.start_s + sample as f64 * data.period_s
}

fn scales(data: &OverlayData<'_>, len: usize, (residual_low, residual_high): (f64, f64), size: Size) -> Option<Scales> {
    let (low, high) = extent(data.measured[..len].iter().chain(&data.modelled[..len]).copied())?;
    let (start_s, end_s) = (data.start_s, at_s(data, len - 1));
    let largest = residual_low.abs().max(residual_high.abs()).max(data.noise_rms);
    let units = [
        readable_unit("s", start_s.abs().max(end_s.abs())),
        readable_unit(data.unit, low.abs().max(high.abs())),
        readable_unit(data.unit, largest),
    ];
    let [time, output, residual] = [units[0].0, units[1].0, units[2].0];
    let noise = data.noise_rms * residual;
    let ticks = |share: f64, around_px: f64| ((share * f64::from(size.height) - around_px) / TICK_PX).max(2.0) as usize;
    let output = Axis::padded(low * output, high * output, ticks(UPPER_SHARE, TOP_PX));
    let residual = Axis::padded(
        (residual_low * residual).min(-noise),
        (residual_high * residual).max(noise),
        ticks(1.0 - UPPER_SHARE, TOP_PX + BELOW_PX),
    );
    let left_px = left_px(&[&output, &residual]);
    let time_ticks = (inner_px(size.width, left_px) / 80.0).max(2.0) as usize;
    let time = Axis::linear(start_s * time, end_s * time, time_ticks);
    Some(Scales {
        time,
        output,
        residual,
        units,
        left_px,
    })
}

fn legend(data: &OverlayData<'_>) -> Vec<LegendEntry> {
    let mut legend = vec![
        LegendEntry::new("measured", Ink::Measured, Swatch::Line),
        LegendEntry::new("model", Ink::Model, Swatch::Line),
        LegendEntry::new("measured − model", Ink::Residual, Swatch::Line),
    ];
    if data.noise_rms > 0.0 {
        let text = format!("noise floor, ±{} rms", quantity(data.noise_rms, data.unit));
        legend.push(LegendEntry::new(text, Ink::Noise, Swatch::Area));
    }
    legend
}
