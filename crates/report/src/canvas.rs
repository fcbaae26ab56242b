//! The sheet a picture is drawn on: plotters' SVG backend, made to fit into a page.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, TextStyle};

use crate::palette::Ink;

/// Drawing units per pixel: the backend has whole units, and a curve in whole pixels would be a staircase.
pub(crate) const UNITS: i32 = 4;

/// Height of all text in pictures, pixels.
const TEXT_PX: f64 = 12.0;

/// The backend divides a font's size by this before it writes it.
const BACKEND_FONT_RATIO: f64 = 1.24;

/// A part of the sheet.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Drawing into memory: never fails in practice.
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Width and height of a picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

/// How a legend shows its series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Swatch {
    /// A line.
    Line,
    /// A band that lets the grid through.
    Area,
    /// A bar.
    Bar,
    /// A short upright stroke.
    Stroke,
}

/// One series of a legend.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LegendEntry {
    /// What it is.
    pub text: String,
    /// Its colour.
    pub ink: Ink,
    /// Its shape.
    pub swatch: Swatch,
}

impl LegendEntry {
    /// An entry.
    pub fn new(text: impl Into<String>, ink: Ink, swatch: Swatch) -> Self {
        Self {
            text: text.into(),
            ink,
            swatch,
        }
    }
}

/// A drawn picture: SVG that stands in a page, and its legend, which the page sets as text above it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    pub(crate) svg: String,
    pub(crate) legend: Vec<LegendEntry>,
}

impl Picture {
    /// The picture as an SVG element.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// Draws a picture. `description` is what a reader who cannot see it is told.
    pub(crate) fn draw(
        size: Size,
        description: &str,
        legend: Vec<LegendEntry>,
        draw: impl FnOnce(&Area<'_>) -> Drawn,
    ) -> Self {
        let (width, height) = (size.width.max(1), size.height.max(1));
        let units = (width * UNITS as u32, height * UNITS as u32);
        let mut raw = String::new();
        let outcome = {
            let sheet = SVGBackend::with_string(&mut raw, units).into_drawing_area();
            draw(&sheet).and_then(|()| sheet.present())
        };
        let body = match outcome {
            Ok(()) => raw
                .split_once('>')
                .map_or("", |(_, rest)| rest)
                .replace(" opacity=\"1\"", "")
                .replace(">\n", ">"),
            Err(_) => "</svg>".to_owned(),
        };
        let label = maud::html! { (description) }.into_string();
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" width=\"{width}\" height=\"{height}\" \
             style=\"min-width:{}px\" role=\"img\" aria-label=\"{label}\">{body}",
            units.0,
            units.1,
            width * 3 / 5
        );
        Self { svg, legend }
    }
}

/// Pixels as drawing units.
pub(crate) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(UNITS)).round() as i32
}

/// Pixels as a width in drawing units.
pub(crate) fn px_width(pixels: f64) -> u32 {
    px(pixels).max(1) as u32
}

/// The style of all text, anchored.
pub(crate) fn text_style(ink: Ink, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    TextStyle {
        font: ("sans-serif", TEXT_PX * BACKEND_FONT_RATIO * f64::from(UNITS)).into_font(),
        color: ink.colour().to_backend_color(),
        pos: Pos::new(horizontal, vertical),
    }
}

/// Width of a text, pixels: an upper estimate from DejaVu Sans, the widest of the fonts that browsers fall back to, as only
/// the reader's browser knows the true one.
pub(crate) fn text_px(text: &str) -> f64 {
    let em = |character: char| match character {
        '.' | ',' | ':' | ';' | '\'' | '|' | 'i' | 'j' | 'l' | ' ' | '\u{a0}' => 0.34,
        '\u{202f}' => 0.2,
        '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' | '⁻' => 0.45,
        'm' | 'w' | 'M' | 'W' | '%' | '@' | '…' => 1.0,
        '−' | '×' | '+' | '=' => 0.84,
        'A'..='Z' => 0.72,
        character if character.is_ascii() => 0.64,
        // Other scripts are about as wide as they are high.
        _ => 1.0,
    };
    TEXT_PX * text.chars().map(em).sum::<f64>()
}

/// A text that is at most `limit_px` wide, with an ellipsis in its middle where characters are left out.
pub(crate) fn shortened(text: &str, limit_px: f64) -> String {
    if text_px(text) <= limit_px {
        return text.to_owned();
    }
    let characters: Vec<char> = text.chars().collect();
    // The narrowest character is wider than a pixel, so that no more than this can fit.
    let mut kept = characters.len().min(limit_px.max(0.0) as usize);
    loop {
        let mut short: String = characters[..kept / 2].iter().collect();
        short.push('…');
        short.extend(&characters[characters.len() - (kept - kept / 2)..]);
        if text_px(&short) <= limit_px || kept == 0 {
            return short;
        }
        kept -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::{shortened, text_px};

    #[test]
    fn prop_shortened_texts_fit_and_keep_their_ends() {
        assert_eq!(shortened("sine.csv", 200.0), "sine.csv");
        let long = format!("start{}end.csv", "-µ".repeat(100_000));
        let short = shortened(&long, 200.0);
        assert!(text_px(&short) <= 200.0);
        assert!(
            short.starts_with("start") && short.contains('…') && short.ends_with("end.csv"),
            "{short}"
        );
        assert_eq!(shortened("abc", 0.0), "…");
    }
}
