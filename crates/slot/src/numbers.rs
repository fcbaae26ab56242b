//! A table as plain numbers of a fixed size: what a file, an image and a slot hold of it.

use crate::chain_rules::law;
use hysteron_core::adaptation::AdaptationNumbers;
use hysteron_core::error::ParamError;
use hysteron_core::law_numbers::{CreepNumbers, FeedbackNumbers, HumNumbers, InverseNumbers, LawNumbers};
use hysteron_core::surroundings::CompleteLaw;
use hysteron_core::tracking_law::{CREEP_FAST, CREEP_SLOW, PLAYS, TAPS};

/// The families of the core, by their names in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
#[repr(u8)]
pub enum Family {
    /// Eq. 5.
    Pi = 0,
    /// Eq. 6.
    Mpi = 1,
    /// Rate-dependent weights.
    Wrpi = 2,
    /// Eq. 10.
    Mrpi = 3,
    /// A cubic of each play's output.
    PlayPolynomial = 4,
}

impl Family {
    /// All of them, by their numbers.
    pub const ALL: [Self; 5] = [Self::Pi, Self::Mpi, Self::Wrpi, Self::Mrpi, Self::PlayPolynomial];

    /// The name used in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Mpi => "mpi",
            Self::Wrpi => "wrpi",
            Self::Mrpi => "mrpi",
            Self::PlayPolynomial => "play-polynomial",
        }
    }
}

/// A table with room for `N` plays. Lists behind its own plays are zeros, but for the thresholds, which go on with the next numbers of
/// `f32`: such plays weigh nothing.
///
/// # Units
/// In the names; they are the fields of a table's file.
#[expect(missing_docs, reason = "each is the field of its name in a table's file")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers<const N: usize> {
    pub family: Family,
    /// How many of the plays are the table's.
    pub plays: usize,
    pub sample_rate_hz: f64,
    pub input_min_um: f64,
    pub input_max_um: f64,
    pub output_min_v: f64,
    pub output_max_v: f64,
    pub safe_v: f64,
    pub slew_v_per_s: f64,
    pub ramp_v_per_s: f64,
    pub proportional_v_per_um: f64,
    pub integral_v_per_um_s: f64,
    pub feedback_up_to_hz: f64,
    pub dac_min_v: f64,
    pub dac_top_v: f64,
    pub adc_min_um: f64,
    pub adc_top_um: f64,
    pub alpha_s: f64,
    pub beta_s: f64,
    pub offset_v: f64,
    /// Coefficients of the input's powers, from the first on.
    pub input_function: [f64; 5],
    pub thresholds_um: [f64; N],
    pub weights_v_per_um: [f64; N],
    pub rate_weights_v_s_per_um2: [f64; N],
    pub weights_quadratic_v_per_um2: [f64; N],
    pub weights_cubic_v_per_um3: [f64; N],
    /// The complete law around the inverse; without it the table is an inverse with PI.
    pub chain: Option<Chain>,
    /// What the records behind it cover.
    pub covered: Covered,
}

/// The `[controller]` part of a table.
#[expect(missing_docs, reason = "each is the field of its name in a table's file")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain {
    pub samples_ahead: usize,
    pub inverse_min_um: f64,
    pub inverse_max_um: f64,
    pub rest_um: f64,
    pub lag_s: f64,
    pub lag_growth: Option<[f64; 2]>,
    pub sensor_lag_s: f64,
    pub preview: [f64; TAPS],
    pub second_mode: [f64; 5],
    pub creep_shares: [f64; CREEP_FAST + CREEP_SLOW],
    pub creep_tau_s: [f64; CREEP_FAST + CREEP_SLOW],
    pub coupling: Option<[f64; 4]>,
    pub cross_um_per_um: Option<f64>,
    pub sensor: Option<[f64; 3]>,
    pub heat: Option<[f64; 4]>,
    pub model_error_um: Option<f64>,
    pub feedback: Option<FeedbackNumbers>,
    pub hum: Option<HumNumbers>,
    pub adaptation: Option<AdaptationNumbers>,
}

/// The numbers of the `[covered]` part of a table; `None` is not known.
#[expect(missing_docs, reason = "each is the field of its name in a table's file")]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Covered {
    pub voltage_v: Option<[f64; 2]>,
    pub position_um: Option<[f64; 2]>,
    pub temperature_c: Option<[f64; 2]>,
    pub slew_v_per_s: Option<f64>,
    pub swing_hz: Option<f64>,
    pub sample_rate_hz: Option<f64>,
    pub told_to_hz: Option<f64>,
}

/// The first numbers of a list, as many as there is room for.
pub fn first<const K: usize>(values: &[f64]) -> [f64; K] {
    core::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

impl Chain {
    /// All zeros, no part there.
    pub const NOTHING: Self = Self {
        samples_ahead: 0,
        inverse_min_um: 0.0,
        inverse_max_um: 0.0,
        rest_um: 0.0,
        lag_s: 0.0,
        lag_growth: None,
        sensor_lag_s: 0.0,
        preview: [0.0; TAPS],
        second_mode: [0.0; 5],
        creep_shares: [0.0; CREEP_FAST + CREEP_SLOW],
        creep_tau_s: [0.0; CREEP_FAST + CREEP_SLOW],
        coupling: None,
        cross_um_per_um: None,
        sensor: None,
        heat: None,
        model_error_um: None,
        feedback: None,
        hum: None,
        adaptation: None,
    };

    /// Elements of creep: shares and time constants of the fast ones, and of the slow ones.
    pub(crate) fn creep(&self) -> (CreepNumbers<CREEP_FAST>, CreepNumbers<CREEP_SLOW>) {
        let slow = |values: &[f64; CREEP_FAST + CREEP_SLOW]| first(values.get(CREEP_FAST..).unwrap_or(&[]));
        let fast = CreepNumbers {
            shares: first(&self.creep_shares),
            tau_s: first(&self.creep_tau_s),
        };
        let slow = CreepNumbers {
            shares: slow(&self.creep_shares),
            tau_s: slow(&self.creep_tau_s),
        };
        (fast, slow)
    }
}

impl<const N: usize> Numbers<N> {
    /// A table of zeros.
    pub const fn empty(family: Family, plays: usize) -> Self {
        Self {
            family,
            plays,
            sample_rate_hz: 0.0,
            input_min_um: 0.0,
            input_max_um: 0.0,
            output_min_v: 0.0,
            output_max_v: 0.0,
            safe_v: 0.0,
            slew_v_per_s: 0.0,
            ramp_v_per_s: 0.0,
            proportional_v_per_um: 0.0,
            integral_v_per_um_s: 0.0,
            feedback_up_to_hz: 0.0,
            dac_min_v: 0.0,
            dac_top_v: 0.0,
            adc_min_um: 0.0,
            adc_top_um: 0.0,
            alpha_s: 0.0,
            beta_s: 0.0,
            offset_v: 0.0,
            input_function: [0.0; 5],
            thresholds_um: [0.0; N],
            weights_v_per_um: [0.0; N],
            rate_weights_v_s_per_um2: [0.0; N],
            weights_quadratic_v_per_um2: [0.0; N],
            weights_cubic_v_per_um3: [0.0; N],
            chain: None,
            covered: Covered {
                voltage_v: None,
                position_um: None,
                temperature_c: None,
                slew_v_per_s: None,
                swing_hz: None,
                sample_rate_hz: None,
                told_to_hz: None,
            },
        }
    }

    /// The table's own part of a list.
    pub(crate) fn own<'a>(&self, list: &'a [f64; N]) -> &'a [f64] {
        list.get(..self.plays).unwrap_or(list)
    }

    /// The numbers of the complete law; `None` in a table without one. Of another number of plays than the law has, the first.
    pub fn law_numbers(&self) -> Option<LawNumbers> {
        let chain = self.chain.as_ref()?;
        let (creep_fast, creep_slow) = chain.creep();
        let list = |values: &[f64; N]| first::<PLAYS>(values);
        Some(LawNumbers {
            sample_rate_hz: self.sample_rate_hz,
            samples_ahead: chain.samples_ahead,
            preview: chain.preview,
            second_mode: chain.second_mode,
            creep_fast,
            creep_slow,
            inverse: InverseNumbers {
                min_um: chain.inverse_min_um,
                max_um: chain.inverse_max_um,
                thresholds_um: list(&self.thresholds_um),
                offset_v: self.offset_v,
                input_function: self.input_function,
                linear: list(&self.weights_v_per_um),
                quadratic: list(&self.weights_quadratic_v_per_um2),
                cubic: list(&self.weights_cubic_v_per_um3),
            },
            lag_s: chain.lag_s,
            lag_growth: chain.lag_growth,
            feedback: chain.feedback,
            command_min_v: self.output_min_v,
            command_max_v: self.output_max_v,
            slew_v_per_s: self.slew_v_per_s,
            rest_um: chain.rest_um,
            sensor_lag_s: chain.sensor_lag_s,
            coupling: chain.coupling,
            cross_um_per_um: chain.cross_um_per_um,
            hum: chain.hum,
            heat: chain.heat,
            sensor: chain.sensor,
            adaptation: chain.adaptation,
        })
    }

    /// The complete law as a chip runs it. By itself: its numbers are on the stack while it is made, and no longer.
    ///
    /// # Errors
    /// Values that the core refuses; a table without such a law.
    #[cold]
    #[inline(never)]
    pub fn law(&self) -> Result<CompleteLaw<f32>, ParamError> {
        match &self.law_numbers() {
            Some(numbers) => law(numbers),
            None => Err(ParamError::Unbounded {
                name: "a complete law",
                input: 0.0,
            }),
        }
    }
}
