//! Spectra of the residual, the measurement and the noise floor, on logarithmic axes.

use crate::axis::{Axis, extent};
use crate::canvas::{LegendEntry, Picture, Size, Swatch};
use crate::decimate::min_max;
use crate::number::unit_text;
use crate::palette::Ink;
use crate::panel::{Mark, Panel, inner_px, left_px};

/// What a spectrum shows: amplitude spectral densities, one-sided. The series have the frequencies' length, or none.
#[derive(Debug, Clone, Copy)]
pub struct SpectrumData<'a> {
    /// Frequencies, hertz, ascending; zero is left out.
    pub frequency_hz: &'a [f64],
    /// Of the residual.
    pub residual: &'a [f64],
    /// Of the measured output.
    pub measured: &'a [f64],
    /// Of the noise floor.
    pub noise: &'a [f64],
    /// Unit of the output: `um` or `V`.
    pub unit: &'a str,
}

/// Range shown below the largest value: 10^-7 of it, below the best 24-bit sensor's resolution.
const RANGE: f64 = 1e-7;

/// Draws the spectra. Nothing for fewer than two frequencies above zero, or where nothing is above zero.
pub fn spectrum(data: &SpectrumData<'_>, size: Size) -> Option<Picture> {
    let first = data.frequency_hz.iter().position(|frequency| *frequency > 0.0)?;
    let frequency_hz = &data.frequency_hz[first..];
    let (lowest, highest) = extent(frequency_hz.iter().copied())?;
    let series = [
        (data.measured, Ink::Measured, "measured", 1.5),
        (data.noise, Ink::Noise, "noise floor", 2.0),
        (data.residual, Ink::Residual, "measured − model", 1.5),
    ];
    let series = series.map(|(values, ink, name, width)| (values.get(first..).unwrap_or(&[]), ink, name, width));
    let positive = || {
        series
            .iter()
            .flat_map(|(values, ..)| values.iter().copied())
            .filter(|value| *value > 0.0)
    };
    let (low, high) = extent(positive())?;
    if highest <= lowest {
        return None;
    }
    let x = Axis::logarithmic(lowest, highest, 8);
    // Half a decade to spare above; below, what is drawn and no more than the range.
    let y = Axis::logarithmic((low / 1.5).max(high * RANGE), high * 2.0, 7);
    let left_px = left_px(&[&y]);
    let columns = inner_px(size.width, left_px);
    let column = |index: usize| ((x.coordinate(frequency_hz[index]) - x.low) / (x.high - x.low) * columns) as usize;

    let mut marks = Vec::new();
    let mut legend = Vec::new();
    for (values, ink, name, width_px) in series {
        let len = values.len().min(frequency_hz.len());
        if !values[..len].iter().any(|value| *value > 0.0) {
            continue;
        }
        let points = min_max(len, column, |index| values[index])
            .into_iter()
            .map(|index| (x.coordinate(frequency_hz[index]), y.coordinate(values[index])))
            .collect();
        marks.push(Mark::Line { points, ink, width_px });
        legend.push(LegendEntry::new(name, ink, Swatch::Line));
    }
    let unit = unit_text(data.unit);
    let description = "Spectra of measured output, residual and noise floor over frequency.";
    Some(Picture::draw(size, description, legend, |sheet| {
        let y_title = format!("amplitude density, {unit}/√Hz");
        Panel {
            x: &x,
            y: &y,
            x_title: Some("frequency, Hz"),
            y_title: &y_title,
            left_px,
            marks,
        }
        .draw(sheet)
    }))
}
