//! Horizontal bars with their figures beside them: shares of the error, errors of records.

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

use crate::axis::{Axis, extent};
use crate::canvas::{LegendEntry, Picture, Size, px, px_width, shortened, text_px, text_style};
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
    let figures_px = rows.iter().map(|row| text_px(&row.text)).fold(0.0, f64::max) + 10.0;
    // Labels get what they need, up to two fifths of the picture.
    let labels: Vec<String> = rows
        .iter()
        .map(|row| shortened(&row.label, 0.4 * f64::from(width)))
        .collect();
    let left = labels.iter().map(|label| text_px(label)).fold(0.0, f64::max) + 10.0;
    let span = (f64::from(width) - left - figures_px - 6.0).max(20.0);
    let axis = Axis::linear(
        0.0,
        if largest > 0.0 { largest } else { 1.0 },
        ((span / 70.0) as usize).clamp(1, 6),
    );
    let across = |value: f64| px(left + (value / axis.high).clamp(0.0, 1.0) * span);
    let bottom = px(6.0 + ROW_PX * rows.len() as f64);
    let size = Size {
        width,
        height: (6.0 + ROW_PX * rows.len() as f64 + BELOW_PX).ceil() as u32,
    };
    let told: Vec<String> = rows.iter().map(|row| format!("{}: {}", row.label, row.text)).collect();
    let description = format!("{axis_title}. {}.", told.join("; "));

    Some(Picture::draw(size, &description, legend, |sheet| {
        for tick in &axis.ticks {
            let stroke = Ink::Rule.colour().stroke_width(px_width(1.0));
            sheet.draw(&PathElement::new(
                vec![(across(tick.at), px(2.0)), (across(tick.at), bottom)],
                stroke,
            ))?;
            let style = text_style(Ink::Muted, HPos::Center, VPos::Top);
            sheet.draw(&Text::new(
                tick.label.clone(),
                (across(tick.at), bottom + px(6.0)),
                style,
            ))?;
        }
        for (index, row) in rows.iter().enumerate() {
            let top = px(6.0 + ROW_PX * index as f64);
            let (upper, lower) = (top + px(3.0), top + px(ROW_PX - 4.0));
            let middle = (upper + lower) / 2;

            let style = text_style(Ink::Text, HPos::Right, VPos::Center);
            sheet.draw(&Text::new(labels[index].clone(), (px(left - 8.0), middle), style))?;
            // A bar too short to be seen is drawn half a pixel wide.
            let end = across(row.value).max(across(0.0) + px(0.5));
            sheet.draw(&Rectangle::new(
                [(across(0.0), upper), (end, lower)],
                row.ink.colour().filled(),
            ))?;

            if let Some(reference) = row.reference {
                let at = across(reference);
                let stroke = Ink::Text.colour().stroke_width(px_width(2.0));
                sheet.draw(&PathElement::new(
                    vec![(at, top + px(1.0)), (at, top + px(ROW_PX - 2.0))],
                    stroke,
                ))?;
            }
            // In a column of their own, so that no figure can be taken for that of the reference.
            let style = text_style(Ink::Text, HPos::Right, VPos::Center);
            sheet.draw(&Text::new(
                row.text.clone(),
                (px(f64::from(width) - 2.0), middle),
                style,
            ))?;
        }
        let stroke = Ink::Muted.colour().stroke_width(px_width(1.0));
        sheet.draw(&PathElement::new(
            vec![(across(0.0), px(2.0)), (across(0.0), bottom)],
            stroke,
        ))?;
        let style = text_style(Ink::Text, HPos::Right, VPos::Top);
        sheet.draw(&Text::new(
            axis_title.to_owned(),
            (px(left + span), bottom + px(24.0)),
            style,
        ))
    }))
}
