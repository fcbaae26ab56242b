//! Fading elements of a controller's model, as they are kept.

use hysteron_core::error::ParamError;
use hysteron_core::fading::{FADING_DEGREE, FadingInverse, FadingModel, FadingNumbers};
use hysteron_core::real::Real;
use hysteron_core::tracking_law::FADING;
use serde::{Deserialize, Serialize};

/// Fading elements: voltage behind the lag in, position before creep out; powers are of u, from -1 to 1 over the voltages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FadingPart {
    /// Lowest voltage of the records, volts.
    pub min_v: f64,
    /// Highest voltage of the records, volts.
    pub max_v: f64,
    /// Constant, micrometres.
    pub offset_um: f64,
    /// Coefficients of u, u^2, u^3 without memory, micrometres.
    pub input_function_um: [f64; FADING_DEGREE],
    /// Path over which each element forgets, volts.
    pub lengths_v: [f64; FADING],
    /// Coefficients of u, u^2, u^3 of what each element follows, micrometres.
    pub curves_um: [[f64; FADING_DEGREE]; FADING],
    /// What each element holds at rest at 0 V, micrometres.
    pub rest_um: [f64; FADING],
}

impl FadingPart {
    /// The elements as the core takes them.
    ///
    /// # Errors
    /// Values that the core refuses.
    pub(super) fn forward<T: Real>(&self) -> Result<FadingModel<T, FADING>, ParamError> {
        FadingModel::new(&FadingNumbers {
            min_v: self.min_v,
            max_v: self.max_v,
            offset: self.offset_um,
            input_function: self.input_function_um,
            lengths_v: self.lengths_v,
            curves: self.curves_um,
            rest: self.rest_um,
        })
    }

    /// Displacement over voltage over the whole identified range, micrometres per volt; NaN of values that the core refuses.
    pub fn mean_gain_um_per_v(&self) -> f64 {
        self.forward::<f64>().map_or(f64::NAN, |model| {
            let [high, low] = [self.max_v, self.min_v].map(|volts| model.cycled(volts, true).output());
            (high - low) / (self.max_v - self.min_v)
        })
    }

    /// The inverse as the core takes it.
    ///
    /// # Errors
    /// Elements that do not rise everywhere, values that the core refuses.
    pub fn to_core<T: Real>(&self) -> Result<FadingInverse<T, FADING>, ParamError> {
        FadingInverse::new(self.forward()?)
    }
}
