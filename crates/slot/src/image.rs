//! What an image is made for, and whether a table fits it.

use crate::{Family, Numbers, Refusal, Rule};

/// What all tables of an image have in common with its first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Image {
    /// The family of the inverse.
    pub family: Family,
    /// Number of plays.
    pub plays: usize,
    /// Whether its law is a complete one.
    pub complete: bool,
    /// Rate, lowest and highest command, safe level, slew, ramp, DAC's ends, ADC's ends, in this order.
    pub common: [f64; 10],
}

/// The fields of [`Image::common`].
const COMMON: [&str; 10] = [
    "sample_rate_hz",
    "output_min_v",
    "output_max_v",
    "safe_v",
    "slew_v_per_s",
    "ramp_v_per_s",
    "dac_min_v",
    "dac_top_v",
    "adc_min_um",
    "adc_top_um",
];

impl Image {
    /// Of the image whose first table this is.
    pub const fn of<const N: usize>(first: &Numbers<N>) -> Self {
        Self {
            family: first.family,
            plays: first.plays,
            complete: first.chain.is_some(),
            common: common(first),
        }
    }

    /// Whether it can hold a table beside its first: one control law, of one size, at one rate, with one set of limits and converters.
    /// References, gains and what the inverse is made of are each table's own.
    ///
    /// # Errors
    /// The first field that differs in `f32`.
    #[cold]
    pub fn holds<const N: usize>(&self, table: &Numbers<N>) -> Result<(), Refusal<'static>> {
        self.has_room(table.family, table.plays, table.chain.is_some())?;
        for ((field, mine), its) in COMMON.into_iter().zip(common(table)).zip(self.common) {
            if mine as f32 != its as f32 {
                return Err(Refusal::new(Rule::OtherNumber, field, mine).allowed([its, 0.0, 0.0]));
            }
        }
        Ok(())
    }

    /// Whether a table of this family and size is one for the image.
    ///
    /// # Errors
    /// The first that differs.
    pub fn has_room(&self, family: Family, plays: usize, complete: bool) -> Result<(), Refusal<'static>> {
        if family != self.family {
            let refused = Refusal::new(Rule::OtherFamily, "family", f64::from(family as u8));
            return Err(refused.against(self.family.name()));
        }
        if plays != self.plays {
            let refused = Refusal::new(Rule::OtherPlays, "thresholds_um", plays as f64);
            return Err(refused.allowed([self.plays as f64, 0.0, 0.0]));
        }
        match (complete, self.complete) {
            (true, false) => Err(Refusal::new(Rule::LawPresent, "controller", 1.0)),
            (false, true) => Err(Refusal::new(Rule::LawMissing, "controller", 0.0)),
            _ => Ok(()),
        }
    }

    /// Whether what a table's records cover lies within the image's converters, and it needs nothing that boards have not.
    ///
    /// # Errors
    /// Commands or positions beyond the converters; heat.
    #[cold]
    pub fn reaches<const N: usize>(&self, table: &Numbers<N>) -> Result<(), Refusal<'static>> {
        if table.chain.as_ref().is_some_and(|chain| chain.heat.is_some()) {
            return Err(Refusal::new(Rule::Heat, "controller.heat", 1.0));
        }
        let [.., dac_min_v, dac_top_v, adc_min_um, adc_top_um] = self.common;
        for (field, ends, converter, [min, top]) in [
            (
                "covered.voltage_v",
                table.covered.voltage_v,
                "DAC",
                [dac_min_v, dac_top_v],
            ),
            (
                "covered.position_um",
                table.covered.position_um,
                "ADC",
                [adc_min_um, adc_top_um],
            ),
        ] {
            // A NaN fails the comparisons.
            if let Some([low, high]) = ends.filter(|[low, high]| !(*low >= min && *high <= top)) {
                let refused = Refusal::new(Rule::BeyondConverters, field, low).against(converter);
                return Err(refused.allowed([min, high, top]));
            }
        }
        Ok(())
    }
}

const fn common<const N: usize>(table: &Numbers<N>) -> [f64; 10] {
    [
        table.sample_rate_hz,
        table.output_min_v,
        table.output_max_v,
        table.safe_v,
        table.slew_v_per_s,
        table.ramp_v_per_s,
        table.dac_min_v,
        table.dac_top_v,
        table.adc_min_um,
        table.adc_top_um,
    ]
}
