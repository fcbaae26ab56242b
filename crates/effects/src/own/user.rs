//! Effects of the user's own, from effect files; see `docs/effect-files.md`.

use super::user_file::{DU, Definition, Equations, MOST_STATES, STARTS, TEMPERATURE, V, V2};
use super::user_states::{Inputs, Machine, settle};
use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Changes, Description, Effect, Facts, Place, Signals};
use crate::effect_file::{EffectFile, FileParameter};
use crate::id::EffectName;
use crate::series::peak_to_peak;
use std::fmt;
use std::sync::Arc;

/// An effect from an effect file: small, and the same for the same content.
#[derive(Clone, Copy)]
pub struct UserEffect(pub(super) &'static Definition);

impl PartialEq for UserEffect {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0)
    }
}

impl fmt::Debug for UserEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("UserEffect").field(&self.0.description.name).finish()
    }
}

impl UserEffect {
    /// As the fit of chains takes it.
    pub fn effect(self) -> Arc<dyn Effect> {
        Arc::new(self)
    }

    /// Whether it acts on the position; the others act on the voltage.
    pub fn acts_on_position(&self) -> bool {
        !self.before_hysteresis()
    }

    /// Whether its equations have `v`, the voltage at the stack.
    pub fn uses_stack_voltage(&self) -> bool {
        self.0.equations.uses(V)
    }

    /// Whether the output at a sample depends on the input at that sample alone, whatever else it depends on.
    pub fn is_pointwise(&self) -> bool {
        self.0.equations.is_pointwise()
    }

    /// Points at which a search looks first, at most 128.
    pub fn starts(&self) -> Vec<Vec<f64>> {
        starts(&self.0.file.parameters)
    }

    /// Each parameter's way between its bounds, 0 to 1: in ratios where they lie decades apart.
    pub fn shares(&self, values: &[f64]) -> Vec<f64> {
        let share = |(parameter, value): (&FileParameter, &f64)| {
            let FileParameter { min, max, .. } = *parameter;
            if in_ratios(parameter) {
                (value / min).ln() / (max / min).ln()
            } else {
                (value - min) / (max - min)
            }
        };
        self.0.file.parameters.iter().zip(values).map(share).collect()
    }

    /// The values at such shares, within the bounds.
    pub fn values(&self, shares: &[f64]) -> Vec<f64> {
        let pairs = self.0.file.parameters.iter().zip(shares);
        pairs
            .map(|(parameter, share)| between_bounds(parameter, *share))
            .collect()
    }

    /// Refuses records that lack a column which the equations need.
    ///
    /// # Errors
    /// In words, that not every record has a temperature, or that none has another axis that moves.
    pub fn needs(&self, with_temperature: bool, with_axis: bool) -> Result<(), String> {
        if self.0.equations.uses(TEMPERATURE) && !with_temperature {
            return Err(
                "its equations have `temperature`, and not every record has a temperature column; import one, or write \
                 the equation without it"
                    .to_owned(),
            );
        }
        if self.0.equations.uses(V2) && !with_axis {
            return Err(
                "its equations have `v2`, and no record has a voltage of the other axis that moves; import one, or write \
                 the equation without it"
                    .to_owned(),
            );
        }
        Ok(())
    }

    fn before_hysteresis(&self) -> bool {
        self.0.description.place < Place::Hysteresis
    }

    /// Whether it has no time in it.
    fn memoryless(&self) -> bool {
        self.0.equations.motions.is_empty() && !self.0.equations.uses(DU)
    }

    /// Runs over a record, in place.
    fn run(&self, parameters: &[f64], signals: &Signals<'_>, series: &mut [f64]) {
        let input = series.to_vec();
        self.run_into(parameters, signals, &input, series, None);
    }

    /// The output at every sample, or its slope over so much of the input.
    fn run_into(
        &self,
        parameters: &[f64],
        signals: &Signals<'_>,
        input: &[f64],
        output: &mut [f64],
        apart: Option<f64>,
    ) {
        let lacks_temperature = self.0.equations.uses(TEMPERATURE) && signals.temperature_c.is_none();
        if input.is_empty() || lacks_temperature {
            // A record without the column is left as it is; fits refuse such a dataset beforehand.
            output.copy_from_slice(input);
            return;
        }
        let inputs = Inputs {
            period_s: signals.period_s,
            run_in: signals.run_in.min(input.len() - 1),
            input,
            stack_v: Some(signals.at_stack_v).filter(|_| self.0.equations.uses(V)),
            temperature_c: signals.temperature_c,
            voltage2_v: signals.voltage2_v,
        };
        let equations = self.0.equations.with(signals.period_s, parameters);
        match equations.motions.len() {
            0 => over_record::<0>(&equations, inputs, output, apart),
            1 => over_record::<1>(&equations, inputs, output, apart),
            2 => over_record::<2>(&equations, inputs, output, apart),
            3 => over_record::<3>(&equations, inputs, output, apart),
            _ => over_record::<MOST_STATES>(&equations, inputs, output, apart),
        }
    }

    /// What the output changes by a change of the input, `(F(y + e c) - F(y)) / e`; `e c` is at most this share of the span.
    fn directions(&self, values: &[f64], signals: &Signals<'_>, position_um: &[f64], columns: &mut [Vec<f64>]) {
        /// Between rounding (1e-16 of the position) and the bends of the finest ripple of interest, a hundredth of the span.
        const APART: f64 = 1e-6;
        let largest = |series: &[f64]| series.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let span = peak_to_peak(position_um).max(1e-3 * largest(position_um)).max(1e-9);
        let lacks = self.0.equations.uses(TEMPERATURE) && signals.temperature_c.is_none();
        if lacks {
            return;
        }
        if self.is_pointwise() {
            let mut slope = vec![0.0; position_um.len()];
            self.run_into(values, signals, position_um, &mut slope, Some(APART * span));
            for column in columns {
                column.iter_mut().zip(&slope).for_each(|(c, s)| *c *= s);
            }
            return;
        }
        let mut here = position_um.to_vec();
        self.run(values, signals, &mut here);
        for column in columns {
            let most = largest(column);
            if most > 0.0 {
                let share = APART * span / most;
                column
                    .iter_mut()
                    .zip(position_um)
                    .for_each(|(c, y)| *c = y + share * *c);
                self.run(values, signals, column);
                column.iter_mut().zip(&here).for_each(|(c, y)| *c = (*c - y) / share);
            }
        }
    }
}

/// Equations of `N` states over a record; as [`UserEffect::run_into`].
fn over_record<const N: usize>(equations: &Equations, inputs: Inputs<'_>, output: &mut [f64], apart: Option<f64>) {
    let mut machine: Machine<'_, N> = Machine::at_rest(equations, inputs);
    if inputs.run_in > 0 && N > 0 {
        settle(&mut machine);
    }
    for (k, output) in output.iter_mut().enumerate() {
        *output = match apart {
            Some(apart) => machine.slope(k, apart),
            None => machine.output(k),
        };
        if k + 1 < inputs.input.len() {
            machine.advance(k);
        }
    }
}

impl Effect for UserEffect {
    fn name(&self) -> EffectName {
        EffectName::Own(self.0.description.name.to_owned())
    }

    fn description(&self) -> &'static Description {
        &self.0.description
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        self.needs(facts.temperature_c.is_some(), facts.voltage2_v.is_some())?;
        Ok(self.0.file.parameters.iter().map(bounds).collect())
    }

    fn starts(&self, _: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        starts(&self.0.file.parameters)
    }

    fn on_voltage(&self, values: &[f64], signals: &Signals<'_>, voltage_v: &mut [f64]) {
        if self.before_hysteresis() {
            self.run(values, signals, voltage_v);
        }
    }

    fn acts(&self) -> Acts {
        if self.before_hysteresis() {
            Acts::Not
        } else {
            Acts::Nonlinearly
        }
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        if !self.before_hysteresis() {
            self.run(values, signals, position_um);
        }
    }

    fn on_change(&self, values: &[f64], signals: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        let mut columns = [change.to_vec()];
        self.directions(values, signals, position_um, &mut columns);
        change.copy_from_slice(&columns[0]);
    }

    fn on_changes<'a>(&'a self, values: &'a [f64], signals: Signals<'a>, position_um: &'a [f64]) -> Changes<'a> {
        Box::new(move |columns| self.directions(values, &signals, position_um, columns))
    }

    fn dynamic(&self) -> bool {
        !self.memoryless()
    }

    fn outlasts_records(&self) -> bool {
        !self.0.equations.motions.is_empty()
    }

    fn needs_columns(&self) -> bool {
        self.0.description.place == Place::Coupling || self.0.equations.uses(TEMPERATURE) || self.0.equations.uses(V2)
    }

    fn file(&self) -> Option<&EffectFile> {
        Some(&self.0.file)
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::none("an effect of your own has no inverse of its own; the feedback takes what it can of it")
    }
}

/// Bounds whose ends lie farther apart than this, as a ratio, are searched in ratios.
const DECADES: f64 = 50.0;

fn in_ratios(parameter: &FileParameter) -> bool {
    parameter.min > 0.0 && parameter.max > DECADES * parameter.min
}

fn between_bounds(parameter: &FileParameter, share: f64) -> f64 {
    let FileParameter { min, max, .. } = *parameter;
    let value = if in_ratios(parameter) {
        (min.ln() + share * (max / min).ln()).exp()
    } else {
        min + share * (max - min)
    };
    value.clamp(min, max)
}

fn bounds(parameter: &FileParameter) -> Bounds {
    let FileParameter { min, max, .. } = *parameter;
    // A hundredth of the bounds; of a parameter that is searched in ratios its smallest value, lest derivatives step over it.
    let scale = if in_ratios(parameter) {
        min.max(1e-6 * (max - min))
    } else {
        0.01 * (max - min)
    };
    Bounds::new(min, max, scale, parameter.neutral.unwrap_or(0.0).clamp(min, max))
}

/// Points spread evenly over the bounds (J. H. Halton, 1960, Numer. Math. 2, 84): every parameter takes as many different
/// values as there are points, which finds a narrow valley along one of them sooner than a grid.
fn starts(parameters: &[FileParameter]) -> Vec<Vec<f64>> {
    const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
    let quantile = |parameter: &FileParameter, share: f64| match &parameter.starts {
        Some(list) => list[((share * list.len() as f64) as usize).min(list.len() - 1)],
        None => between_bounds(parameter, share),
    };
    let mut all: Vec<Vec<f64>> = Vec::with_capacity(STARTS);
    for k in 1..=STARTS {
        let pairs = parameters.iter().zip(PRIMES);
        let point: Vec<f64> = pairs
            .map(|(parameter, prime)| quantile(parameter, radical_inverse(k, prime)))
            .collect();
        if !all.contains(&point) {
            all.push(point);
        }
    }
    all
}

/// The digits of `k` mirrored at the point.
fn radical_inverse(mut k: usize, base: usize) -> f64 {
    let (mut share, mut digit) = (0.0, 1.0);
    while k > 0 {
        digit /= base as f64;
        share += digit * (k % base) as f64;
        k /= base;
    }
    share
}
