//! What is checked of a table, by `hysteron export` and by the firmware's build alike.

use crate::{FORMAT, Family, MOST_PLAYS, Table, TableError};
use hysteron_core::bank::PlayState;
use hysteron_core::codes::Converter;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::Hysteresis;
use hysteron_core::pi_controller::PiController;

/// Points of the sweep up and down over the input range: 0.1 % of it, well below the spacing of thresholds in use.
const SWEEP_POINTS: usize = 1000;

/// The inverse at rest over its whole range, up and down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// Smallest and largest slope; 1 / smallest is the stage's largest gain, which a feedback loop has to live with.
    pub slopes_v_per_um: [f64; 2],
    /// Highest output less the lowest, volts.
    pub span_v: f64,
}

impl Table {
    /// Checks everything that can be known before the table runs.
    ///
    /// # Errors
    /// - A field that is not finite in `f32`; limits or thresholds that do not ascend once rounded to `f32`; no plays or more than
    ///   [`MOST_PLAYS`]; lists of different lengths.
    /// - What the core's constructors refuse in `f32`.
    /// - An inverse that does not rise, or falls, with its input all over its range, both ways, at rest.
    /// - With a `[controller]`: another family, gains outside of it, a safe level other than 0 V, references outside what its inverse
    ///   was identified on.
    /// - An output at rest outside what the amplifier may be given, or a command range outside the DAC's.
    pub fn check(&self) -> Result<(), TableError> {
        self.sweep().map(|_| ())
    }

    /// As [`Table::check`], and what its sweep has seen.
    ///
    /// # Errors
    /// As [`Table::check`].
    pub fn sweep(&self) -> Result<Sweep, TableError> {
        if let Some(covered) = &self.covered {
            covered.check()?;
        }
        if self.format != FORMAT {
            return Err(refuse("format", &self.format, format!("this version reads `{FORMAT}`")));
        }
        self.finite()?;
        ascending("input_max_um", self.input_max_um, "input_min_um", self.input_min_um)?;
        ascending("output_max_v", self.output_max_v, "output_min_v", self.output_min_v)?;
        ascending("dac_top_v", self.dac_top_v, "dac_min_v", self.dac_min_v)?;
        ascending("adc_top_um", self.adc_top_um, "adc_min_um", self.adc_min_um)?;
        if self.feedback_up_to_hz <= 0.0 {
            return Err(refuse("feedback_up_to_hz", self.feedback_up_to_hz, "must be positive"));
        }
        let dac = (("dac_min_v", self.dac_min_v), ("dac_top_v", self.dac_top_v));
        within("output_min_v", self.output_min_v, dac.0, dac.1)?;
        within("output_max_v", self.output_max_v, dac.0, dac.1)?;
        within(
            "safe_v",
            self.safe_v,
            ("output_min_v", self.output_min_v),
            ("output_max_v", self.output_max_v),
        )?;
        self.check_family()?;
        for (i, pair) in self.thresholds_um.windows(2).enumerate() {
            if pair[1] as f32 <= pair[0] as f32 {
                let reason = format!(
                    "must exceed thresholds_um[{}] = {} in f32; sort the thresholds",
                    i + 1,
                    pair[0]
                );
                return Err(refuse(&format!("thresholds_um[{}]", i + 2), pair[1], reason));
            }
        }
        let rate_hz = self.sample_rate_hz as f32;
        PiController::new(
            self.proportional_v_per_um as f32,
            self.integral_v_per_um_s as f32,
            rate_hz,
        )?;
        let limiter = |slew_v_per_s: f64| {
            Limiter::new(
                self.output_min_v as f32,
                self.output_max_v as f32,
                slew_v_per_s as f32,
                rate_hz,
            )
        };
        limiter(self.slew_v_per_s)?;
        limiter(self.ramp_v_per_s)?;
        if self.ramp_v_per_s > self.slew_v_per_s {
            return Err(refuse(
                "ramp_v_per_s",
                self.ramp_v_per_s,
                "must not lie above slew_v_per_s",
            ));
        }
        Converter::new(self.dac_min_v as f32, self.dac_top_v as f32)?;
        Converter::new(self.adc_min_um as f32, self.adc_top_um as f32)?;
        let Some(part) = &self.controller else {
            return self.check_plays();
        };
        self.check_controller(part)?;
        // The inverse counts from the stage's rest.
        let from_rest = Self {
            input_min_um: self.input_min_um - part.rest_um,
            input_max_um: self.input_max_um - part.rest_um,
            controller: None,
            covered: None,
            ..self.clone()
        };
        from_rest.check_plays()
    }

    fn finite(&self) -> Result<(), TableError> {
        let single = [
            ("sample_rate_hz", self.sample_rate_hz),
            ("input_min_um", self.input_min_um),
            ("input_max_um", self.input_max_um),
            ("output_min_v", self.output_min_v),
            ("output_max_v", self.output_max_v),
            ("safe_v", self.safe_v),
            ("slew_v_per_s", self.slew_v_per_s),
            ("ramp_v_per_s", self.ramp_v_per_s),
            ("proportional_v_per_um", self.proportional_v_per_um),
            ("integral_v_per_um_s", self.integral_v_per_um_s),
            ("feedback_up_to_hz", self.feedback_up_to_hz),
            ("dac_min_v", self.dac_min_v),
            ("dac_top_v", self.dac_top_v),
            ("adc_min_um", self.adc_min_um),
            ("adc_top_um", self.adc_top_um),
            ("alpha_s", self.alpha_s),
            ("beta_s", self.beta_s),
            ("offset_v", self.offset_v),
            ("linear_v_per_um", self.linear_v_per_um),
            ("quadratic_v_per_um2", self.quadratic_v_per_um2),
            ("cubic_v_per_um3", self.cubic_v_per_um3),
            ("quartic_v_per_um4", self.quartic_v_per_um4),
            ("quintic_v_per_um5", self.quintic_v_per_um5),
        ];
        let list = |name: &'static str, values: &[f64]| {
            let named = values.iter().enumerate();
            named
                .map(move |(i, &value)| (format!("{name}[{}]", i + 1), value))
                .collect::<Vec<_>>()
        };
        single
            .iter()
            .map(|&(name, value)| (name.to_owned(), value))
            .chain(list("thresholds_um", &self.thresholds_um))
            .chain(list("weights_v_per_um", &self.weights_v_per_um))
            .chain(list("rate_weights_v_s_per_um2", &self.rate_weights_v_s_per_um2))
            .chain(list("weights_quadratic_v_per_um2", &self.weights_quadratic_v_per_um2))
            .chain(list("weights_cubic_v_per_um3", &self.weights_cubic_v_per_um3))
            .find(|(_, value)| !(*value as f32).is_finite())
            .map_or(Ok(()), |(name, value)| {
                Err(refuse(&name, value, "must be finite in f32"))
            })
    }

    /// Runs the core's own constructors and a sweep; plays that the table does not have weigh nothing.
    fn check_plays(&self) -> Result<Sweep, TableError> {
        match self.thresholds_um.len() {
            1..=10 => self.check_sweep::<10>(),
            11..=MOST_PLAYS => self.check_sweep::<MOST_PLAYS>(),
            other => Err(refuse(
                "thresholds_um",
                format!("{other} values"),
                format!("a table has 1 to {MOST_PLAYS} plays; fit with fewer by --plays"),
            )),
        }
    }

    /// Slopes are between neighbouring points.
    fn check_sweep<const N: usize>(&self) -> Result<Sweep, TableError> {
        let (bank, inverse) = self.inverse::<N>(true)?;
        // With the rate, too, the core must take it.
        self.inverse::<N>(false)?;
        let (low, high) = (self.input_min_um as f32, self.input_max_um as f32);
        let mut state = PlayState::remanent(&bank, low, 0.0);
        let mut last = inverse.step(&mut state, low);
        self.within_amplifier(low, last)?;
        let points = (1..=SWEEP_POINTS).map(|k| (k, true));
        let spacing_um = f64::from(high - low) / SWEEP_POINTS as f64;
        let mut slopes = [f64::INFINITY, 0.0_f64];
        let mut ends = [last, last];
        for (k, up) in points.chain((0..SWEEP_POINTS).rev().map(|k| (k, false))) {
            let input = low + (high - low) * (k as f32 / SWEEP_POINTS as f32);
            let output = inverse.step(&mut state, input);
            self.within_amplifier(input, output)?;
            // Where the plays stand still after the turn, the input's own term has to carry the output.
            if (up && output <= last) || (!up && output >= last) {
                return Err(refuse(
                    self.input_terms(),
                    format!("flat or turning at {input} um"),
                    "the inverse must rise and fall with its input over the whole range; narrow the range with --input-min and \
                     --input-max, or fit anew",
                ));
            }
            let slope = f64::from(output - last).abs() / spacing_um;
            slopes = [slopes[0].min(slope), slopes[1].max(slope)];
            ends = [ends[0].min(output), ends[1].max(output)];
            last = output;
        }
        Ok(Sweep {
            slopes_v_per_um: slopes,
            span_v: f64::from(ends[1] - ends[0]),
        })
    }

    /// The terms that have to carry the output, by their fields.
    fn input_terms(&self) -> &'static str {
        match self.family {
            Family::Pi => "linear_v_per_um, weights_v_per_um",
            Family::PlayPolynomial => {
                "linear_v_per_um to quintic_v_per_um5, weights_v_per_um to weights_cubic_v_per_um3"
            }
            _ => "linear_v_per_um, cubic_v_per_um3, weights_v_per_um",
        }
    }

    /// What the family has must be there, and nothing else.
    fn check_family(&self) -> Result<(), TableError> {
        let family = self.family;
        let (polynomial, rate) = (family == Family::PlayPolynomial, family == Family::Wrpi);
        let numbers = [
            ("alpha_s", self.alpha_s, family == Family::Mrpi),
            ("beta_s", self.beta_s, family == Family::Mrpi),
            ("quadratic_v_per_um2", self.quadratic_v_per_um2, polynomial),
            ("cubic_v_per_um3", self.cubic_v_per_um3, family != Family::Pi),
            ("quartic_v_per_um4", self.quartic_v_per_um4, polynomial),
            ("quintic_v_per_um5", self.quintic_v_per_um5, polynomial),
        ];
        for (field, value, has) in numbers {
            if !has && value != 0.0 {
                let reason = format!("family {} has no such term; take the line out", family.name());
                return Err(refuse(field, value, reason));
            }
        }
        let plays = self.thresholds_um.len();
        let lists = [
            ("weights_v_per_um", &self.weights_v_per_um, true),
            ("rate_weights_v_s_per_um2", &self.rate_weights_v_s_per_um2, rate),
            (
                "weights_quadratic_v_per_um2",
                &self.weights_quadratic_v_per_um2,
                polynomial,
            ),
            ("weights_cubic_v_per_um3", &self.weights_cubic_v_per_um3, polynomial),
        ];
        for (field, values, has) in lists {
            let found = format!("{} values", values.len());
            if has && values.len() != plays {
                return Err(refuse(
                    field,
                    found,
                    format!("there are {plays} thresholds; give each play one weight"),
                ));
            }
            if !has && !values.is_empty() {
                let reason = format!("family {} has no such weights; take the line out", family.name());
                return Err(refuse(field, found, reason));
            }
        }
        Ok(())
    }

    fn within_amplifier(&self, input: f32, output: f32) -> Result<(), TableError> {
        if output >= self.output_min_v as f32 && output <= self.output_max_v as f32 {
            return Ok(());
        }
        let reason = format!(
            "asks for {output} V at {input} um, outside output_min_v to output_max_v; narrow the range with --input-min and --input-max"
        );
        Err(refuse(
            "input_min_um, input_max_um",
            format!("{}, {}", self.input_min_um, self.input_max_um),
            reason,
        ))
    }
}

pub(crate) fn refuse(field: &str, value: impl ToString, reason: impl Into<String>) -> TableError {
    TableError::Field {
        field: field.to_owned(),
        value: value.to_string(),
        reason: reason.into(),
    }
}

fn within(field: &str, value: f64, lowest: (&str, f64), highest: (&str, f64)) -> Result<(), TableError> {
    if value < lowest.1 {
        return Err(refuse(field, value, format!("must not lie below {}", lowest.0)));
    }
    if value > highest.1 {
        return Err(refuse(field, value, format!("must not lie above {}", highest.0)));
    }
    Ok(())
}

fn ascending(field: &str, value: f64, lower: &str, than: f64) -> Result<(), TableError> {
    if value as f32 > than as f32 {
        Ok(())
    } else {
        Err(refuse(field, value, format!("must exceed {lower} = {than}")))
    }
}
