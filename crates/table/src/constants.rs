//! A table as Rust constants in `f32`.

use crate::{CORNERS_ABOVE, Family, MOST_PLAYS, Table, TableError, hash};
use hysteron_slot::Image;
use std::fmt::Write;

/// What builds the inverse of each family from the numbers of a table.
const MPI: &str = "
pub type Inverse = hysteron_core::mpi::Mpi<f32, PLAYS>;
pub fn inverse_of(table: &Numbers<PLAYS>) -> Result<Inverse, ParamError> {
    Inverse::new(table.bank()?, table.coefficients())
}
";
const WRPI: &str = "
pub type Inverse = hysteron_core::wrpi::Wrpi<f32, PLAYS>;
pub fn inverse_of(table: &Numbers<PLAYS>) -> Result<Inverse, ParamError> {
    Inverse::new(table.bank()?, table.coefficients(), table.rate_weights())
}
";
const MRPI: &str = "
pub type Inverse = hysteron_core::quick_mrpi::QuickMrpi<f32, PLAYS, crate::law::Plays>;
pub fn inverse_of(table: &Numbers<PLAYS>) -> Result<Inverse, ParamError> {
    let model = hysteron_core::mrpi::Mrpi::new(table.bank()?, table.coefficients(), table.envelope())?;
    Ok(Inverse::new(model))
}
";
/// PI, MPI and MRPI of many plays.
const CORNERS: &str = "
pub type Inverse = hysteron_core::corner_mrpi::CornerMrpi<f32, PLAYS>;
pub fn inverse_of(table: &Numbers<PLAYS>) -> Result<Inverse, ParamError> {
    Inverse::new(table.bank()?, table.coefficients(), table.envelope())
}
";
const PLAY_POLYNOMIAL: &str = "
pub type Inverse = hysteron_core::play_polynomial::PlayPolynomial<f32, PLAYS>;
pub fn inverse_of(table: &Numbers<PLAYS>) -> Result<Inverse, ParamError> {
    Inverse::new(table.bank()?, table.polynomial())
}
";

/// The paper's law around the inverse.
const PAPER: &str = "
pub type Law = crate::law::Paper<Inverse>;
pub fn inverse() -> Result<Inverse, ParamError> {
    inverse_of(&TABLE)
}
#[inline(always)]
pub fn law() -> Result<Law, ParamError> {
    Law::of(inverse()?, &TABLE)
}
pub fn put_law(table: &Numbers<PLAYS>, _: &Sweep, place: &mut Law) -> Result<(), ParamError> {
    *place = Law::of(inverse_of(table)?, table)?;
    Ok(())
}
";
/// The table as the controller takes it. Inlined to where it stays: each call would have all of it on main's stack once more.
const PARAMETERS: &str = "
#[inline(always)]
pub fn parameters() -> Result<crate::parameters::Parameters<Law>, ParamError> {
    crate::parameters::Parameters::of(law()?, &TABLE, &SWEEP)
}
pub fn hello() -> crate::wire::Hello {
    crate::wire::Hello::of(&TABLE, HASH, BANK, BANKS)
}
";
/// The complete law, which has an inverse of its own. The compiled-in one is made of constants, so that what it has no part of is left out.
const COMPLETE: &str = "
pub type Law = crate::law::Complete;
#[inline(always)]
pub fn law() -> Result<Law, ParamError> {
    Ok(Law::new(NUMBERS.law()?, SLOPES_V_PER_UM[0]))
}
pub fn put_law(table: &Numbers<PLAYS>, sweep: &Sweep, place: &mut Law) -> Result<(), ParamError> {
    place.put(table, sweep)
}
";
/// Names of what follows.
const USED: &str = "
#[allow(unused_imports, reason = \"a table without a part has no numbers of it\")]
use hysteron_core::adaptation::AdaptationNumbers;
#[allow(unused_imports, reason = \"as above\")]
use hysteron_core::law_numbers::{
    CreepNumbers, FeedbackNumbers, HumNumbers, InverseNumbers, LawNumbers, TrustNumbers,
};
use hysteron_core::error::ParamError;
use hysteron_slot::{Covered, Numbers, Sweep};
#[allow(unused_imports, reason = \"as above\")]
use hysteron_slot::{Chain, Family::*};
";

impl Table {
    /// The constants that the firmware includes: one `pub const` a field, the functions that build the inverse from them, and the
    /// hash of `text`, the table's file. `BANK` and `BANKS`, which they use, [`crate::constants_of_banks`] adds.
    ///
    /// All numbers stand in `TABLE` as well, in `f64`, as a slot of a board has them: from them the law is made, whichever of both it is of.
    ///
    /// Values are written by their shortest decimal that gives the same `f32`.
    ///
    /// # Errors
    /// As [`Table::check`].
    pub fn constants(&self, text: &str) -> Result<String, TableError> {
        let sweep = self.sweep()?;
        let numbers = self.numbers::<MOST_PLAYS>();
        Image::of(&numbers).reaches(&numbers)?;
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
        let _ = writeln!(source, "pub const HASH: [u8; 32] = {:?};{USED}{PARAMETERS}", hash(text));
        // Numbers as the core's own types print them: the shortest decimals that give the same f64.
        let _ = writeln!(source, "pub const TABLE: Numbers<PLAYS> = {};", self.as_source());
        let _ = writeln!(source, "pub const SWEEP: Sweep = {sweep:?};");
        if let Some(numbers) = self.law_numbers()? {
            let _ = writeln!(source, "{COMPLETE}pub const NUMBERS: LawNumbers = {numbers:?};");
            return Ok(source);
        }
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

    /// Its numbers as Rust, with room for its own plays.
    fn as_source(&self) -> String {
        let plays = self.thresholds_um.len();
        let list = |name: &'static str, values: &[f64]| -> (&str, Vec<f64>) {
            let zeros = std::iter::repeat(0.0);
            (name, values.iter().copied().chain(zeros).take(plays).collect())
        };
        let lists = [
            list("thresholds_um", &self.thresholds_um),
            list("weights_v_per_um", &self.weights_v_per_um),
            list("rate_weights_v_s_per_um2", &self.rate_weights_v_s_per_um2),
            list("weights_quadratic_v_per_um2", &self.weights_quadratic_v_per_um2),
            list("weights_cubic_v_per_um3", &self.weights_cubic_v_per_um3),
        ];
        // Without room for plays every list prints as none, and has its numbers put in.
        let said = format!("{:?}", self.numbers::<0>());
        lists.into_iter().fold(said, |said, (name, list)| {
            said.replace(&format!(" {name}: [], "), &format!(" {name}: {list:?}, "))
        })
    }
}
