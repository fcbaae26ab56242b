//! Horizontal bars with their figures beside them: shares of the error, errors of records.

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use crate::axis::{Axis, extent};
use crate::canvas::{Area, Drawn, LegendEntry, Picture, Size, px, px_width, shortened, text_px, text_style};
use crate::palette::Ink;

/// One bar.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// What it stands for.
    pub label: String,
    /// Its length; not negative.
    pub value: f64,
    /// The length as text.
    pub text: String,
    /// Something to compare with, drawn as an upright stroke.
    pub reference: Option<f64>,
    /// Colour of the bar.
    pub ink: Ink,
}

/// Height of a bar with its space, pixels.
const ROW_PX: f64 = 22.0;
/// Space below for tick labels and title, pixels.
const BELOW_PX: f64 = 42.0;

/// Draws bars below each other on an axis from zero. Nothing without bars. `width` is in pixels; the height follows.
pub fn bars(rows: &[Bar], axis_title: &str, legend: Vec<LegendEntry>, width: u32) -> Option<Picture> {
    let values = rows.iter().flat_map(|row| [Some(row.value), row.reference]).flatten();
    let (_, largest) = extent(values)?;
    let layout = Layout::new(rows, largest, f64::from(width));
    let height = (6.0 + ROW_PX * rows.len() as f64 + BELOW_PX).ceil() as u32;
    let told: Vec<String> = rows.iter().map(|row| format!("{}: {}", row.label, row.text)).collect();
    let description = format!("{axis_title}. {}.", told.join("; "));
    Some(Picture::draw(Size { width, height }, &description, legend, |sheet| {
        layout.draw_grid(sheet)?;
        for (index, row) in rows.iter().enumerate() {
            layout.draw_row(sheet, index, row)?;
        }
        layout.draw_axis(sheet, axis_title)
    }))
}

/// Where things are: labels, bars, figures from left to right; pixels, but for the bottom.
struct Layout {
    labels: Vec<String>,
    left: f64,
    span: f64,
    width: f64,
    axis: Axis,
    /// Lower end of the rows, drawing units.
    bottom: i32,
}

impl Layout {
    fn new(rows: &[Bar], largest: f64, width: f64) -> Self {
        let figures = rows.iter().map(|row| text_px(&row.text)).fold(0.0, f64::max) + 10.0;
        // Labels get what they need, up to two fifths of the picture.
        let labels: Vec<String> = rows.iter().map(|row| shortened(&row.label, 0.4 * width)).collect();
        let left = labels.iter().map(|label| text_px(label)).fold(0.0, f64::max) + 10.0;
        let span = (width - left - figures - 6.0).max(20.0);
        let ticks = ((span / 70.0) as usize).clamp(1, 6);
        let axis = Axis::linear(0.0, if largest > 0.0 { largest } else { 1.0 }, ticks);
        Self {
            labels,
            left,
            span,
            width,
            axis,
            bottom: px(6.0 + ROW_PX * rows.len() as f64),
        }
    }

    /// The drawing unit of a value.
    fn across(&self, value: f64) -> i32 {
        px(self.left + (value / self.axis.high).clamp(0.0, 1.0) * self.span)
    }

    fn draw_grid(&self, sheet: &Area<'_>) -> Drawn {
        for tick in &self.axis.ticks {
            let at = self.across(tick.at);
            let stroke = Ink::Rule.colour().stroke_width(px_width(1.0));
            sheet.draw(&PathElement::new(vec![(at, px(2.0)), (at, self.bottom)], stroke))?;
            let style = text_style(Ink::Muted, HPos::Center, VPos::Top);
            sheet.draw(&Text::new(tick.label.clone(), (at, self.bottom + px(6.0)), style))?;
        }
        Ok(())
    }

    fn draw_row(&self, sheet: &Area<'_>, index: usize, row: &Bar) -> Drawn {
        let top = px(6.0 + ROW_PX * index as f64);
        let (upper, lower) = (top + px(3.0), top + px(ROW_PX - 4.0));
        let middle = (upper + lower) / 2;
        let style = text_style(Ink::Text, HPos::Right, VPos::Center);
        sheet.draw(&Text::new(
            self.labels[index].clone(),
            (px(self.left - 8.0), middle),
            style.clone(),
        ))?;
        // A bar too short to be seen is drawn half a pixel wide.
        let start = self.across(0.0);
        let end = self.across(row.value).max(start + px(0.5));
        sheet.draw(&Rectangle::new(
            [(start, upper), (end, lower)],
            row.ink.colour().filled(),
        ))?;
        if let Some(reference) = row.reference {
            let at = self.across(reference);
            let stroke = Ink::Text.colour().stroke_width(px_width(2.0));
            sheet.draw(&PathElement::new(
                vec![(at, top + px(1.0)), (at, top + px(ROW_PX - 2.0))],
                stroke,
            ))?;
        }
        // In a column of their own, so that no figure can be taken for that of the reference.
        sheet.draw(&Text::new(row.text.clone(), (px(self.width - 2.0), middle), style))
    }

    fn draw_axis(&self, sheet: &Area<'_>, title: &str) -> Drawn {
        let start = self.across(0.0);
        let stroke = Ink::Muted.colour().stroke_width(px_width(1.0));
        sheet.draw(&PathElement::new(vec![(start, px(2.0)), (start, self.bottom)], stroke))?;
        let at = (px(self.left + self.span), self.bottom + px(24.0));
        sheet.draw(&Text::new(
            title.to_owned(),
            at,
            text_style(Ink::Text, HPos::Right, VPos::Top),
        ))
    }
}
