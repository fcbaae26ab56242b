//! A table as Rust constants in `f32`.

use crate::check::refuse;
use crate::{CORNERS_ABOVE, Family, Table, TableError, hash};
#[cfg(doc)]
use hysteron_core::law_numbers::LawNumbers;
use std::fmt::Write;

/// What builds the inverse of each family from the constants.
const MPI: &str = "
pub type Inverse = hysteron_core::mpi::Mpi<f32, PLAYS>;
pub fn inverse() -> Result<Inverse, hysteron_core::error::ParamError> {
    Inverse::new(bank()?, coefficients())
}
";
const WRPI: &str = "
pub type Inverse = hysteron_core::wrpi::Wrpi<f32, PLAYS>;
pub fn inverse() -> Result<Inverse, hysteron_core::error::ParamError> {
    Inverse::new(bank()?, coefficients(), RATE_WEIGHTS_V_S_PER_UM2)
}
";
const MRPI: &str = "
pub type Inverse = hysteron_core::quick_mrpi::QuickMrpi<f32, PLAYS, crate::law::Plays>;
pub fn inverse() -> Result<Inverse, hysteron_core::error::ParamError> {
    let envelope = hysteron_core::envelope::Envelope { alpha_s: ALPHA_S, beta_s: BETA_S };
    Ok(Inverse::new(hysteron_core::mrpi::Mrpi::new(bank()?, coefficients(), envelope)?))
}
";
/// PI, MPI and MRPI of many plays.
const CORNERS: &str = "
pub type Inverse = hysteron_core::corner_mrpi::CornerMrpi<f32, PLAYS>;
pub fn inverse() -> Result<Inverse, hysteron_core::error::ParamError> {
    let envelope = hysteron_core::envelope::Envelope { alpha_s: ALPHA_S, beta_s: BETA_S };
    Inverse::new(bank()?, coefficients(), envelope)
}
";
const PLAY_POLYNOMIAL: &str = "
pub type Inverse = hysteron_core::play_polynomial::PlayPolynomial<f32, PLAYS>;
pub fn inverse() -> Result<Inverse, hysteron_core::error::ParamError> {
    let input_function =
        [LINEAR_V_PER_UM, QUADRATIC_V_PER_UM2, CUBIC_V_PER_UM3, QUARTIC_V_PER_UM4, QUINTIC_V_PER_UM5];
    let coefficients = hysteron_core::play_polynomial::PolynomialCoefficients {
        offset: OFFSET_V,
        input_function,
        linear: WEIGHTS_V_PER_UM,
        quadratic: WEIGHTS_QUADRATIC_V_PER_UM2,
        cubic: WEIGHTS_CUBIC_V_PER_UM3,
    };
    Inverse::new(bank()?, coefficients)
}
";
const COEFFICIENTS: &str = "
fn coefficients() -> hysteron_core::mpi::MpiCoefficients<f32, PLAYS> {
    hysteron_core::mpi::MpiCoefficients {
        offset: OFFSET_V,
        cubic: CUBIC_V_PER_UM3,
        linear: LINEAR_V_PER_UM,
        weights: WEIGHTS_V_PER_UM,
    }
}
";
const BANK: &str = "
pub fn bank() -> Result<hysteron_core::bank::PlayBank<f32, PLAYS>, hysteron_core::error::ParamError> {
    let thresholds = hysteron_core::thresholds::Thresholds::new(THRESHOLDS_UM)?;
    hysteron_core::bank::PlayBank::new(thresholds, INPUT_MIN_UM, INPUT_MAX_UM, SAMPLE_RATE_HZ)
}
";

/// The paper's law around the inverse.
const PAPER: &str = "
pub type Law = crate::law::Paper<Inverse>;
#[inline(always)]
pub fn law() -> Result<Law, hysteron_core::error::ParamError> {
    let feedback = hysteron_core::pi_controller::PiController::new(
        PROPORTIONAL_V_PER_UM, INTEGRAL_V_PER_UM_S, SAMPLE_RATE_HZ)?;
    let limiter = hysteron_core::limiter::Limiter::new(OUTPUT_MIN_V, OUTPUT_MAX_V, SLEW_V_PER_S, SAMPLE_RATE_HZ)?;
    Ok(Law::new(inverse()?, feedback, limiter))
}
";
/// The table as the controller takes it. Inlined to where it stays: each call would have all of it on main's stack once more.
const PARAMETERS: &str = "
#[inline(always)]
pub fn parameters() -> Result<crate::parameters::Parameters<Law>, hysteron_core::error::ParamError> {
    use hysteron_core::codes::Converter;
    use hysteron_core::limiter::Limiter;
    Ok(crate::parameters::Parameters {
        law: law()?,
        ramp: Limiter::new(OUTPUT_MIN_V, OUTPUT_MAX_V, RAMP_V_PER_S, SAMPLE_RATE_HZ)?,
        rise_um: RAMP_V_PER_S / SAMPLE_RATE_HZ / SLOPES_V_PER_UM[1],
        scales: crate::monitor::Scales {
            range_um: INPUT_MAX_UM - INPUT_MIN_UM,
            um_per_code: (ADC_TOP_UM - ADC_MIN_UM) / 65_535.0,
            slopes_v_per_um: SLOPES_V_PER_UM,
            span_v: SPAN_V,
            departure_v: DEPARTURE_V,
            overshoot: OVERSHOOT,
        },
        dac: Converter::new(DAC_MIN_V, DAC_TOP_V)?,
        adc: Converter::new(ADC_MIN_UM, ADC_TOP_UM)?,
        range_um: [INPUT_MIN_UM, INPUT_MAX_UM],
        sample_rate_hz: SAMPLE_RATE_HZ,
        feedback_up_to_hz: FEEDBACK_UP_TO_HZ,
        safe_v: SAFE_V,
    })
}
pub fn hello() -> crate::wire::Hello {
    crate::wire::Hello {
        hash: HASH,
        sample_rate_hz: SAMPLE_RATE_HZ,
        input_min_um: INPUT_MIN_UM,
        input_max_um: INPUT_MAX_UM,
        bank: BANK,
        banks: BANKS as u8,
        axes: 1,
        complete: COMPLETE,
    }
}
";
/// The complete law, which has an inverse of its own; its numbers follow.
const COMPLETE: &str = "
pub type Law = crate::law::Complete;
#[inline(always)]
pub fn law() -> Result<Law, hysteron_core::error::ParamError> {
    Ok(Law::new(NUMBERS.law()?, SLOPES_V_PER_UM[0]))
}
#[allow(unused_imports, reason = \"a law without a part has no numbers of it\")]
use hysteron_core::law_numbers::{
    AdaptationNumbers, CreepNumbers, FeedbackNumbers, HumNumbers, InverseNumbers, LawNumbers, TrustNumbers,
};
";

impl Table {
    /// The constants that the firmware includes: one `pub const` a field, the functions that build the inverse from them, and the
    /// hash of `text`, the table's file. `BANK` and `BANKS`, which they use, [`crate::constants_of_banks`] adds.
    ///
    /// Those of a complete law are in `f64`, as [`LawNumbers`] has them, from which the core makes its `f32`.
    ///
    /// Values are written by their shortest decimal that gives the same `f32`.
    ///
    /// # Errors
    /// As [`Table::check`].
    pub fn constants(&self, text: &str) -> Result<String, TableError> {
        let sweep = self.sweep()?;
        if self.controller.as_ref().is_some_and(|part| part.heat.is_some()) {
            let reason = "boards have no thermometer; leave it out";
            return Err(refuse("controller.heat", "present", reason));
        }
        let slopes = sweep.slopes_v_per_um.map(|slope| slope as f32);
        let mut source = String::new();
        let scalars = [
            ("SAMPLE_RATE_HZ", self.sample_rate_hz),
            ("INPUT_MIN_UM", self.input_min_um),
            ("INPUT_MAX_UM", self.input_max_um),
            ("OUTPUT_MIN_V", self.output_min_v),
            ("OUTPUT_MAX_V", self.output_max_v),
            ("SAFE_V", self.safe_v),
            ("SLEW_V_PER_S", self.slew_v_per_s),
            ("RAMP_V_PER_S", self.ramp_v_per_s),
            ("PROPORTIONAL_V_PER_UM", self.proportional_v_per_um),
            ("INTEGRAL_V_PER_UM_S", self.integral_v_per_um_s),
            ("FEEDBACK_UP_TO_HZ", self.feedback_up_to_hz),
            ("DAC_MIN_V", self.dac_min_v),
            ("DAC_TOP_V", self.dac_top_v),
            ("ADC_MIN_UM", self.adc_min_um),
            ("ADC_TOP_UM", self.adc_top_um),
            ("OFFSET_V", self.offset_v),
            ("LINEAR_V_PER_UM", self.linear_v_per_um),
            ("CUBIC_V_PER_UM3", self.cubic_v_per_um3),
        ];
        // Writing to a String does not fail.
        let mut scalar = |name: &str, value: f64| {
            let _ = writeln!(source, "pub const {name}: f32 = {:?};", value as f32);
        };
        for (name, value) in scalars {
            scalar(name, value);
        }
        let corners = self.thresholds_um.len() >= CORNERS_ABOVE;
        if self.family == Family::Mrpi || corners {
            scalar("ALPHA_S", self.alpha_s);
            scalar("BETA_S", self.beta_s);
        }
        if self.family == Family::PlayPolynomial {
            scalar("QUADRATIC_V_PER_UM2", self.quadratic_v_per_um2);
            scalar("QUARTIC_V_PER_UM4", self.quartic_v_per_um4);
            scalar("QUINTIC_V_PER_UM5", self.quintic_v_per_um5);
        }
        let _ = writeln!(source, "pub const SLOPES_V_PER_UM: [f32; 2] = {slopes:?};");
        let _ = writeln!(source, "pub const SPAN_V: f32 = {:?};", sweep.span_v as f32);
        let (departure_v, overshoot) = (self.departure_v(&sweep) as f32, self.overshoot() as f32);
        let _ = writeln!(source, "pub const DEPARTURE_V: f32 = {departure_v:?};");
        let _ = writeln!(source, "pub const OVERSHOOT: f32 = {overshoot:?};");
        let _ = writeln!(source, "pub const PLAYS: usize = {};", self.thresholds_um.len());
        let lists = [
            ("THRESHOLDS_UM", &self.thresholds_um),
            ("WEIGHTS_V_PER_UM", &self.weights_v_per_um),
            ("RATE_WEIGHTS_V_S_PER_UM2", &self.rate_weights_v_s_per_um2),
            ("WEIGHTS_QUADRATIC_V_PER_UM2", &self.weights_quadratic_v_per_um2),
            ("WEIGHTS_CUBIC_V_PER_UM3", &self.weights_cubic_v_per_um3),
        ];
        for (name, values) in lists.into_iter().filter(|(_, values)| !values.is_empty()) {
            let values: Vec<String> = values.iter().map(|&v| format!("{:?}", v as f32)).collect();
            let _ = writeln!(source, "pub const {name}: [f32; PLAYS] = [{}];", values.join(", "));
        }
        let _ = writeln!(source, "pub const COMPLETE: bool = {};", self.controller.is_some());
        let _ = writeln!(source, "pub const HASH: [u8; 32] = {:?};{PARAMETERS}", hash(text));
        if let Some(numbers) = self.law_numbers()? {
            // Numbers as the core's own types print them: the shortest decimals that give the same f64.
            let _ = writeln!(source, "{COMPLETE}pub const NUMBERS: LawNumbers = {numbers:?};");
            return Ok(source);
        }
        source += BANK;
        source += match self.family {
            Family::PlayPolynomial => "",
            _ => COEFFICIENTS,
        };
        source += match self.family {
            Family::Pi | Family::Mpi | Family::Mrpi if corners => CORNERS,
            Family::Pi | Family::Mpi => MPI,
            Family::Wrpi => WRPI,
            Family::Mrpi => MRPI,
            Family::PlayPolynomial => PLAY_POLYNOMIAL,
        };
        source += PAPER;
        Ok(source)
    }
}
