//! What is checked of a table, on the host, in the firmware's build and on the board alike.

use crate::{Chain, Family, Numbers, Refusal, Rule};
use hysteron_core::bank::PlayState;
use hysteron_core::codes::Converter;
use hysteron_core::error::ParamError;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::Hysteresis;
use hysteron_core::pi_controller::PiController;
use hysteron_core::tracking_law::PLAYS;

/// Most plays that a table may have: up to 509 instructions a tick on a Cortex-M4F for PI, MPI and MRPI, which remember corners above
/// [`CORNERS_ABOVE`] plays, 1300 for the others (`cargo xtask firmware bench`), of the 3400 that 20 us are at 170 MHz.
pub const MOST_PLAYS: usize = 100;

/// From about this number of plays on it is faster in the worst case to remember corners than to touch the plays that move: 206 + 18
/// for each play above 10 against 509 on a Cortex-M4F.
pub const CORNERS_ABOVE: usize = 27;

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

pub(crate) type Checked<T = ()> = Result<T, Refusal<'static>>;

impl<const N: usize> Numbers<N> {
    /// Checks everything that can be known before the table runs, and says what its sweep has seen.
    ///
    /// # Errors
    /// - A field that is not finite in `f32`; limits or thresholds that do not ascend once rounded to `f32`.
    /// - What the core's constructors refuse in `f32`.
    /// - An inverse that does not rise, or falls, with its input all over its range, both ways, at rest.
    /// - With a complete law: another family, gains outside of it, a safe level other than 0 V, references outside what its inverse
    ///   was identified on.
    /// - An output at rest outside what the amplifier may be given, or a command range outside the DAC's.
    #[cold]
    pub fn sweep(&self) -> Checked<Sweep> {
        self.sweep_as(self.family)
    }

    /// The same of a family that is known to be the table's.
    #[inline(always)]
    pub(crate) fn sweep_as(&self, family: Family) -> Checked<Sweep> {
        self.covered.check()?;
        self.finite()?;
        self.limits()?;
        self.check_terms()?;
        self.check_plays()?;
        self.buildable()?;
        let rest_um = match &self.chain {
            Some(chain) => {
                self.check_chain(chain)?;
                chain.rest_um
            }
            None => 0.0,
        };
        // The inverse counts from the stage's rest.
        self.check_sweep(family, [self.input_min_um - rest_um, self.input_max_um - rest_um])
    }

    #[inline(never)]
    fn limits(&self) -> Checked {
        ascending("input_max_um", self.input_max_um, "input_min_um", self.input_min_um)?;
        ascending("output_max_v", self.output_max_v, "output_min_v", self.output_min_v)?;
        ascending("dac_top_v", self.dac_top_v, "dac_min_v", self.dac_min_v)?;
        ascending("adc_top_um", self.adc_top_um, "adc_min_um", self.adc_min_um)?;
        if self.feedback_up_to_hz <= 0.0 {
            return Err(Refusal::new(
                Rule::NotPositive,
                "feedback_up_to_hz",
                self.feedback_up_to_hz,
            ));
        }
        let dac = (("dac_min_v", self.dac_min_v), ("dac_top_v", self.dac_top_v));
        within("output_min_v", self.output_min_v, dac.0, dac.1)?;
        within("output_max_v", self.output_max_v, dac.0, dac.1)?;
        let output = (("output_min_v", self.output_min_v), ("output_max_v", self.output_max_v));
        within("safe_v", self.safe_v, output.0, output.1)
    }

    #[inline(never)]
    fn finite(&self) -> Checked {
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
        ];
        for (name, value) in single
            .into_iter()
            .chain(INPUT_TERMS.into_iter().zip(self.input_function))
        {
            number(name, value)?;
        }
        list("thresholds_um", self.own(&self.thresholds_um))?;
        list("weights_v_per_um", self.own(&self.weights_v_per_um))?;
        list("rate_weights_v_s_per_um2", self.own(&self.rate_weights_v_s_per_um2))?;
        list(
            "weights_quadratic_v_per_um2",
            self.own(&self.weights_quadratic_v_per_um2),
        )?;
        list("weights_cubic_v_per_um3", self.own(&self.weights_cubic_v_per_um3))
    }

    /// What the family has not must not be there.
    ///
    /// # Errors
    /// The first such term.
    pub fn check_terms(&self) -> Checked {
        let family = self.family;
        let polynomial = family == Family::PlayPolynomial;
        let [_, quadratic, cubic, quartic, quintic] = self.input_function;
        let numbers = [
            ("alpha_s", self.alpha_s, family == Family::Mrpi),
            ("beta_s", self.beta_s, family == Family::Mrpi),
            ("quadratic_v_per_um2", quadratic, polynomial),
            ("cubic_v_per_um3", cubic, family != Family::Pi),
            ("quartic_v_per_um4", quartic, polynomial),
            ("quintic_v_per_um5", quintic, polynomial),
        ];
        for (field, value, has) in numbers {
            if !has && value != 0.0 {
                return Err(Refusal::new(Rule::NoSuchTerm, field, value).against(family.name()));
            }
        }
        Ok(())
    }

    #[inline(never)]
    fn check_plays(&self) -> Checked {
        if self.plays == 0 || self.plays > N.min(MOST_PLAYS) {
            return Err(Refusal::new(Rule::Plays, "thresholds_um", self.plays as f64));
        }
        let thresholds_um = self.own(&self.thresholds_um);
        for (i, (&before, &value)) in thresholds_um.iter().zip(thresholds_um.iter().skip(1)).enumerate() {
            if value as f32 <= before as f32 {
                let refused = Refusal::new(Rule::Unsorted, "thresholds_um", value);
                return Err(refused.at(i + 2).allowed([before, 0.0, 0.0]));
            }
        }
        Ok(())
    }

    /// Runs the constructors of what stands around the law.
    #[inline(never)]
    fn buildable(&self) -> Checked {
        let core = |error: ParamError| Refusal::of_core("", error);
        let rate_hz = self.sample_rate_hz as f32;
        let (proportional, integral) = (self.proportional_v_per_um as f32, self.integral_v_per_um_s as f32);
        PiController::new(proportional, integral, rate_hz).map_err(core)?;
        self.limiter(self.slew_v_per_s).map_err(core)?;
        self.limiter(self.ramp_v_per_s).map_err(core)?;
        if self.ramp_v_per_s > self.slew_v_per_s {
            return Err(Refusal::new(Rule::Above, "ramp_v_per_s", self.ramp_v_per_s).against("slew_v_per_s"));
        }
        Converter::new(self.dac_min_v as f32, self.dac_top_v as f32).map_err(core)?;
        Converter::new(self.adc_min_um as f32, self.adc_top_um as f32).map_err(core)?;
        Ok(())
    }

    /// The command's range with a slew.
    ///
    /// # Errors
    /// What the core refuses in `f32`.
    pub fn limiter(&self, slew_v_per_s: f64) -> Result<Limiter<f32>, ParamError> {
        Limiter::new(
            self.output_min_v as f32,
            self.output_max_v as f32,
            slew_v_per_s as f32,
            self.sample_rate_hz as f32,
        )
    }

    /// Slopes are between neighbouring points.
    #[inline(always)]
    fn check_sweep(&self, family: Family, range_um: [f64; 2]) -> Checked<Sweep> {
        let core = |error: ParamError| Refusal::of_core("", error);
        let (bank, inverse) = self.inverse_over(family, range_um, true).map_err(core)?;
        // With the rate, too, the core must take it.
        self.inverse_over(family, range_um, false).map_err(core)?;
        let [low, high] = range_um.map(|um| um as f32);
        let mut state = PlayState::remanent(&bank, low, 0.0);
        let spacing_um = f64::from(high - low) / SWEEP_POINTS as f64;
        let mut slopes = [f64::INFINITY, 0.0_f64];
        let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
        let mut last = 0.0;
        let up = (1..=SWEEP_POINTS).map(|k| (k, Some(true)));
        let down = (0..SWEEP_POINTS).rev().map(|k| (k, Some(false)));
        for (k, up) in core::iter::once((0, None)).chain(up).chain(down) {
            let input = low + (high - low) * (k as f32 / SWEEP_POINTS as f32);
            let output = inverse.step(&mut state, input);
            self.within_amplifier(range_um, input, output)?;
            if let Some(up) = up {
                // Where the plays stand still after the turn, the input's own term has to carry the output.
                if (up && output <= last) || (!up && output >= last) {
                    return Err(Refusal::new(Rule::Flat, self.input_terms(), f64::from(input)));
                }
                let slope = f64::from(output - last).abs() / spacing_um;
                slopes = [slopes[0].min(slope), slopes[1].max(slope)];
            }
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

    fn within_amplifier(&self, [min_um, max_um]: [f64; 2], input: f32, output: f32) -> Checked {
        if output >= self.output_min_v as f32 && output <= self.output_max_v as f32 {
            return Ok(());
        }
        let refused = Refusal::new(Rule::BeyondAmplifier, "input_min_um, input_max_um", min_um);
        Err(refused.allowed([f64::from(input), max_um, f64::from(output)]))
    }

    /// What a table with a complete law must hold beside what every table must.
    #[inline(never)]
    fn check_chain(&self, chain: &Chain) -> Checked {
        if self.family != Family::PlayPolynomial {
            let family = f64::from(self.family as u8);
            return Err(Refusal::new(Rule::NotPolynomial, "family", family));
        }
        for (field, value) in [
            ("proportional_v_per_um", self.proportional_v_per_um),
            ("integral_v_per_um_s", self.integral_v_per_um_s),
        ] {
            if value != 0.0 {
                return Err(Refusal::new(Rule::GainsElsewhere, field, value));
            }
        }
        if self.safe_v != 0.0 {
            return Err(Refusal::new(Rule::SafeElsewhere, "safe_v", self.safe_v));
        }
        chain.finite()?;
        let (low, high) = (chain.inverse_min_um, chain.inverse_max_um);
        for (field, value) in [("input_min_um", self.input_min_um), ("input_max_um", self.input_max_um)] {
            let above_um = value - chain.rest_um;
            if !(low..=high).contains(&above_um) {
                let refused = Refusal::new(Rule::BeyondInverse, field, above_um + chain.rest_um);
                return Err(refused.allowed([low, high, above_um]));
            }
        }
        if self.plays != PLAYS {
            return Err(Refusal::new(Rule::LawPlays, "thresholds_um", self.plays as f64));
        }
        match self.law_numbers() {
            Some(numbers) => chain.buildable(&numbers),
            None => Ok(()),
        }
    }
}

/// The fields of the input function.
const INPUT_TERMS: [&str; 5] = [
    "linear_v_per_um",
    "quadratic_v_per_um2",
    "cubic_v_per_um3",
    "quartic_v_per_um4",
    "quintic_v_per_um5",
];

pub(crate) fn number(name: &'static str, value: f64) -> Checked {
    if (value as f32).is_finite() {
        Ok(())
    } else {
        Err(Refusal::new(Rule::NotFinite, name, value))
    }
}

pub(crate) fn list(name: &'static str, values: &[f64]) -> Checked {
    for (i, &value) in values.iter().enumerate() {
        number(name, value).map_err(|refused| refused.at(i + 1))?;
    }
    Ok(())
}

fn within(field: &'static str, value: f64, lowest: (&'static str, f64), highest: (&'static str, f64)) -> Checked {
    if value < lowest.1 {
        return Err(Refusal::new(Rule::Below, field, value).against(lowest.0));
    }
    if value > highest.1 {
        return Err(Refusal::new(Rule::Above, field, value).against(highest.0));
    }
    Ok(())
}

fn ascending(field: &'static str, value: f64, lower: &'static str, than: f64) -> Checked {
    if value as f32 > than as f32 {
        return Ok(());
    }
    let refused = Refusal::new(Rule::MustExceed, field, value);
    Err(refused.against(lower).allowed([than, 0.0, 0.0]))
}
