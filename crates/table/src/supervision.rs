//! Bounds of a table's feedback.

use crate::{Table, Trust};

impl Table {
    /// With bounds of its feedback that move the platform by `bound_um` at most where the inverse is flattest; a table without a feedback
    /// is left as it is, and so is one that cannot run.
    #[must_use]
    pub fn trusting(mut self, bound_um: f64) -> Self {
        let sweep = self.sweep();
        let feedback = self.controller.as_mut().and_then(|part| part.feedback.as_mut());
        if let (Some(feedback), Ok(sweep)) = (feedback, sweep) {
            feedback.trust = Some(Trust::within(bound_um, sweep.slopes_v_per_um[0]));
        }
        self
    }
}
