//! Colours with fixed meanings, told apart by the colour-blind, in a light and a dark set.
//!
//! Pictures are drawn in the light colours, as SVG attributes. The stylesheet redefines each of them by an attribute
//! selector with a variable, so that a picture in the page follows the reader's preference and prints in the light set,
//! and one cut out of the page still has its colours.

use plotters::style::colors::colormaps::{ColorMap, ViridisRGB};
use plotters::style::{Color, RGBAColor, RGBColor};

/// What a line, an area or a text stands for. Colours are those of Okabe and Ito, lightened or darkened for contrast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// What the sensor said.
    Measured,
    /// What the model says.
    Model,
    /// Measured minus modelled.
    Residual,
    /// The sensor's noise: below it nothing can be told.
    Noise,
    /// Records the model was fitted to.
    Identify,
    /// Records the model is judged on.
    Validate,
    /// One of several series that have no fixed meaning; counted from 0, six are told apart.
    Series(usize),
    /// Text and emphasised lines.
    Text,
    /// Axes and secondary text.
    Muted,
    /// Grid lines.
    Rule,
}

/// The six colours of series without a fixed meaning.
const SERIES: [(&str, [u8; 3], [u8; 3]); 6] = [
    ("series-0", [0x00, 0x72, 0xB3], [0x6C, 0xBE, 0xF0]),
    ("series-1", [0xD5, 0x5E, 0x01], [0xF5, 0x9A, 0x4C]),
    ("series-2", [0x00, 0x8F, 0x6A], [0x3D, 0xCF, 0xA6]),
    ("series-3", [0xB2, 0x5E, 0x92], [0xDF, 0x9C, 0xC4]),
    ("series-4", [0x8C, 0x76, 0x00], [0xE6, 0xD8, 0x55]),
    ("series-5", [0x4A, 0x50, 0x58], [0xC3, 0xCA, 0xD2]),
];

/// Every ink once, for the stylesheet.
const ALL: [Ink; 15] = [
    Ink::Measured,
    Ink::Model,
    Ink::Residual,
    Ink::Noise,
    Ink::Identify,
    Ink::Validate,
    Ink::Series(0),
    Ink::Series(1),
    Ink::Series(2),
    Ink::Series(3),
    Ink::Series(4),
    Ink::Series(5),
    Ink::Text,
    Ink::Muted,
    Ink::Rule,
];

impl Ink {
    /// The stylesheet's name, the light colour and the dark one. Light colours differ from each other in at least one
    /// bit, as the stylesheet finds the meaning by the colour.
    fn entry(self) -> (&'static str, [u8; 3], [u8; 3]) {
        match self {
            Ink::Measured => ("measured", [0x00, 0x72, 0xB2], [0x6C, 0xBE, 0xF0]),
            Ink::Model => ("model", [0xD5, 0x5E, 0x00], [0xF5, 0x9A, 0x4C]),
            Ink::Residual => ("residual", [0x00, 0x8F, 0x69], [0x33, 0xBD, 0x97]),
            Ink::Noise => ("noise", [0x6E, 0x77, 0x81], [0x9A, 0xA4, 0xAF]),
            Ink::Identify => ("identify", [0x56, 0xA4, 0xD9], [0x3F, 0x8F, 0xC4]),
            Ink::Validate => ("validate", [0xB2, 0x5E, 0x91], [0xC9, 0x7F, 0xAC]),
            Ink::Series(index) => SERIES[index % SERIES.len()],
            Ink::Text => ("text", [0x1B, 0x1F, 0x24], [0xE6, 0xEA, 0xEF]),
            Ink::Muted => ("muted", [0x59, 0x63, 0x6E], [0x9E, 0xA8, 0xB3]),
            Ink::Rule => ("rule", [0xDD, 0xE2, 0xE7], [0x30, 0x36, 0x3D]),
        }
    }

    /// The name of the stylesheet's class and variable.
    pub(crate) fn name(self) -> &'static str {
        self.entry().0
    }

    /// The colour drawn with.
    pub(crate) fn colour(self) -> RGBColor {
        let [red, green, blue] = self.entry().1;
        RGBColor(red, green, blue)
    }

    /// The colour drawn with, let through to a share.
    pub(crate) fn faint(self, opacity: f64) -> RGBAColor {
        self.colour().mix(opacity)
    }
}

/// The colour of a share 0 to 1 of the error map's range: viridis, which rises evenly in lightness.
pub(crate) fn heat(share: f64) -> RGBColor {
    ViridisRGB.get_color(share.clamp(0.0, 1.0) as f32)
}

/// The stylesheet's rules for all inks: variables light and dark, and the attribute selectors that use them.
pub(crate) fn stylesheet() -> String {
    let variables = |pick: fn(Ink) -> [u8; 3]| -> String {
        ALL.iter()
            .map(|ink| format!("--{}:{};", ink.name(), hex(pick(*ink))))
            .collect()
    };
    let rules: String = ALL
        .iter()
        .map(|ink| {
            let (name, colour) = (ink.name(), hex(ink.entry().1));
            format!("svg [stroke=\"{colour}\"]{{stroke:var(--{name})}}svg [fill=\"{colour}\"]{{fill:var(--{name})}}\n")
        })
        .collect();
    format!(
        ":root{{{}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{}}}}}\n{rules}",
        variables(|ink| ink.entry().1),
        variables(|ink| ink.entry().2)
    )
}

/// As the SVG backend writes colours: upper case.
fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

#[cfg(test)]
mod tests {
    use super::{ALL, hex};

    /// Relative luminance of sRGB, WCAG 2.2.
    fn luminance(colour: [u8; 3]) -> f64 {
        let linear = colour.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.040_45 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    fn contrast(a: [u8; 3], b: [u8; 3]) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn prop_every_ink_has_a_light_colour_of_its_own() {
        let mut colours: Vec<String> = ALL.iter().map(|ink| hex(ink.entry().1)).collect();
        colours.sort();
        colours.dedup();
        assert_eq!(colours.len(), ALL.len());
    }

    #[test]
    fn val_contrast_is_at_least_what_wcag_asks() {
        // WCAG 2.2: 3:1 for graphics (1.4.11), 4.5:1 for text (1.4.3). The grid is decoration and has no limit; bars of
        // the fitted records carry their figure as text beside them and have 2.6:1.
        for ink in ALL {
            let (name, light, dark) = ink.entry();
            let least = match name {
                "rule" => continue,
                "text" | "muted" => 4.5,
                "identify" => 2.6,
                _ => 3.0,
            };
            assert!(
                contrast(light, [0xFF; 3]) >= least,
                "{name} light {}",
                contrast(light, [0xFF; 3])
            );
            assert!(
                contrast(dark, [0x11, 0x15, 0x1A]) >= least,
                "{name} dark {}",
                contrast(dark, [0x11, 0x15, 0x1A])
            );
        }
    }
}
