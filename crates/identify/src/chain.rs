//! The chain: voltage, delay, amplifier, hysteresis, creep, structure, coupling and heat, sensor.

use crate::chain_trace::Trace;
use crate::columns::{Design, fill, output};
use crate::effects::{Acts, Effect, EffectName, Signals};
use crate::start_state::InitialState;
use hysteron_core::envelope::Envelope;
use hysteron_core::play;
use std::sync::Arc;

/// An effect with its parameters.
#[derive(Clone)]
pub(crate) struct Link {
    pub effect: Arc<dyn Effect>,
    pub values: Vec<f64>,
}

impl Link {
    /// Whether it is the effect of this name; what a family has of its own is none.
    pub(crate) fn is(&self, name: &EffectName) -> bool {
        !self.is_of_family() && self.effect.name() == *name
    }

    /// Whether it is a part of the hysteresis' family that is fitted with the effects.
    pub(crate) fn is_of_family(&self) -> bool {
        self.effect.outside_family().is_some()
    }
}

/// A hysteresis and effects around it, everything but the coefficients that are linear.
#[derive(Clone)]
pub(crate) struct Chain {
    pub design: Design,
    /// In the order of [`crate::effects::Place`].
    pub links: Vec<Link>,
    /// Span of the voltages, volts.
    pub span_v: f64,
}

/// The hysteresis' part of an answer, on the whole grid.
pub(crate) struct Stroke {
    pub stack_v: Vec<f64>,
    pub position_um: Vec<f64>,
}

/// The answer of a chain at the recorded samples, and how it changes with each coefficient.
pub(crate) struct Tangent {
    pub output: Vec<f64>,
    pub columns: Vec<Vec<f64>>,
}

impl Chain {
    pub(crate) fn new(design: Design, mut links: Vec<Link>, span_v: f64) -> Self {
        links.sort_by_key(|link| link.effect.description().place);
        Self { design, links, span_v }
    }

    /// Whether signals are moved in time.
    pub(crate) fn dynamic(&self) -> bool {
        self.links.iter().any(|link| link.effect.dynamic())
    }

    /// Whether the output is linear in the coefficients.
    pub(crate) fn linear(&self) -> bool {
        self.links.iter().all(|link| link.effect.acts() != Acts::Nonlinearly)
    }

    /// The voltage at the stack.
    pub(crate) fn stack(&self, trace: &Trace<'_>) -> Vec<f64> {
        let mut voltage_v = trace.voltage_v.clone();
        for (i, link) in self.links.iter().enumerate() {
            let signals = signals(trace, &[], i);
            link.effect.on_voltage(&link.values, &signals, &mut voltage_v);
        }
        voltage_v
    }

    /// Moves the plays along the voltage at the stack; `visit(sample, input, rate, outputs)` on the whole grid.
    fn plays(&self, trace: &Trace<'_>, stack_v: &[f64], mut visit: impl FnMut(usize, f64, f64, &[f64])) {
        let thresholds = &self.design.thresholds;
        let first = stack_v.first().copied().unwrap_or(0.0);
        let before = trace.initial.before(&stack_v[..trace.run_in.max(1).min(stack_v.len())]);
        let of_link = self.links.iter().find_map(|link| {
            let envelope = link.effect.envelope(&link.values)?;
            Some((envelope, link.effect.narrow_share() * self.span_v))
        });
        let (envelope, narrow_v) = of_link.unwrap_or((self.design.envelope, 0.0));
        let wide = thresholds.partition_point(|&r| r < narrow_v);
        let still = Envelope {
            alpha_s: 0.0,
            beta_s: 0.0,
        };
        let mut outputs: Vec<f64> = thresholds.iter().map(|&r| before(r)).collect();
        let mut last = first;
        let mut advance = |input: f64, outputs: &mut [f64]| {
            let rate = (input - last) / trace.period_s;
            last = input;
            let (narrow_outputs, wide_outputs) = outputs.split_at_mut(wide);
            let (left, right) = still.bounds(input, rate);
            play::advance(&thresholds[..wide], narrow_outputs, left, right);
            let (left, right) = envelope.bounds(input, rate);
            play::advance(&thresholds[wide..], wide_outputs, left, right);
            rate
        };
        // After one whole period both extremes have been passed, and all memory from before is wiped out.
        for &input in &stack_v[..trace.run_in] {
            advance(input, &mut outputs);
        }
        for (k, &input) in stack_v.iter().enumerate() {
            let rate = advance(input, &mut outputs);
            visit(k, input, rate, &outputs);
        }
    }

    /// The modelled position at the recorded samples, free simulation.
    pub(crate) fn respond(&self, coefficients: &[f64], trace: &Trace<'_>) -> Vec<f64> {
        self.respond_from(coefficients, trace, &self.stroke(coefficients, trace))
    }

    /// What the hysteresis makes of the command, before the effects on the position.
    pub(crate) fn stroke(&self, coefficients: &[f64], trace: &Trace<'_>) -> Stroke {
        let stack_v = self.stack(trace);
        let mut position_um = vec![0.0; stack_v.len()];
        // The offset is the sensor's: it comes after the linear effects.
        let mut moving = coefficients.to_vec();
        moving[0] = 0.0;
        self.plays(trace, &stack_v, |k, input, rate, outputs| {
            position_um[k] = output(self.design.family, &moving, input, rate, outputs);
        });
        Stroke { stack_v, position_um }
    }

    /// The modelled position at the recorded samples from what the hysteresis made of the command.
    pub(crate) fn respond_from(&self, coefficients: &[f64], trace: &Trace<'_>, stroke: &Stroke) -> Vec<f64> {
        let (stack_v, mut position) = (&stroke.stack_v, stroke.position_um.clone());
        for nonlinear in [false, true] {
            for (i, link) in self.links.iter().enumerate() {
                if (link.effect.acts() == Acts::Nonlinearly) == nonlinear {
                    link.effect
                        .on_position(&link.values, &signals(trace, stack_v, i), &mut position);
                }
            }
            if !nonlinear {
                position.iter_mut().for_each(|y| *y += coefficients[0]);
            }
        }
        recorded(trace, &position)
    }

    /// What a link adds to the position at the recorded samples, whatever the position is.
    pub(crate) fn addition(&self, trace: &Trace<'_>, link: usize) -> Vec<f64> {
        let stack_v = self.stack(trace);
        let mut position = vec![0.0; stack_v.len()];
        let Link { effect, values } = &self.links[link];
        effect.on_position(values, &signals(trace, &stack_v, link), &mut position);
        recorded(trace, &position)
    }

    /// The response of a chain in which one link has changed since `before`; where the voltage at the stack and the plays stay,
    /// they are not run again.
    pub(crate) fn respond_again(
        &self,
        link: usize,
        coefficients: &[f64],
        trace: &Trace<'_>,
        before: &Stroke,
    ) -> Vec<f64> {
        let changed = &self.links[link];
        let same_plays = changed.effect.envelope(&changed.values).is_none();
        if same_plays && self.stack(trace) == before.stack_v {
            self.respond_from(coefficients, trace, before)
        } else {
            self.respond(coefficients, trace)
        }
    }

    /// The modelled position, and its change with each coefficient.
    pub(crate) fn tangent(&self, coefficients: &[f64], trace: &Trace<'_>, stroke: &Stroke) -> Tangent {
        let stack_v = &stroke.stack_v;
        let n = stack_v.len();
        let mut columns = vec![vec![0.0; n]; self.design.columns()];
        let mut row = vec![0.0; columns.len()];
        self.plays(trace, stack_v, |k, input, rate, outputs| {
            fill(self.design.family, input, rate, outputs, &mut row);
            for (column, &value) in columns.iter_mut().zip(&row) {
                column[k] = value;
            }
        });
        for (i, link) in self.links.iter().enumerate() {
            if link.effect.acts() == Acts::Linearly {
                link.effect
                    .on_positions(&link.values, &signals(trace, stack_v, i), &mut columns[1..]);
            }
        }
        if !self.linear() {
            self.bend(coefficients, trace, stack_v, &mut columns);
        }
        Tangent {
            output: self.respond_from(coefficients, trace, stroke),
            columns: columns.iter().map(|column| recorded(trace, column)).collect(),
        }
    }

    /// What the nonlinear effects make of the columns, around the modelled position.
    fn bend(&self, coefficients: &[f64], trace: &Trace<'_>, stack_v: &[f64], columns: &mut [Vec<f64>]) {
        let mut position = vec![0.0; stack_v.len()];
        for (column, &c) in columns.iter().zip(coefficients) {
            position.iter_mut().zip(column).for_each(|(y, x)| *y += c * x);
        }
        for (i, link) in self.links.iter().enumerate() {
            if link.effect.acts() == Acts::Adds {
                link.effect
                    .on_position(&link.values, &signals(trace, stack_v, i), &mut position);
            }
        }
        for (i, link) in self.links.iter().enumerate() {
            if link.effect.acts() == Acts::Nonlinearly {
                let signals = signals(trace, stack_v, i);
                link.effect.on_changes(&link.values, &signals, &position, columns);
                link.effect.on_position(&link.values, &signals, &mut position);
            }
        }
    }

    /// Lets each effect choose its numbers that belong to this record alone. The offset, which belongs to all of them, is left
    /// to the fit: a number that undid it would undo every change of it.
    pub(crate) fn settle(&self, coefficients: &[f64], trace: &mut Trace<'_>) {
        trace.own = vec![Vec::new(); self.links.len()];
        let with_own: Vec<usize> = (0..self.links.len())
            .filter(|&i| self.links[i].effect.has_own_numbers())
            .collect();
        if with_own.is_empty() {
            return;
        }
        let mut coefficients = coefficients.to_vec();
        if let Some(offset) = coefficients.first_mut() {
            *offset = 0.0;
        }
        let stack_v = self.stack(trace);
        // Of several the first is chosen again once the others are there: a zero beside the phases of a hum.
        let passes = if with_own.len() > 1 { 2 } else { 1 };
        for &i in with_own.iter().cycle().take(passes * with_own.len()) {
            let link = &self.links[i];
            let mut without = self.clone();
            without.links.remove(i);
            let mut other = trace.clone();
            other.own.remove(i);
            let modelled = without.respond(&coefficients, &other);
            let measured = &trace.record.position_um;
            let unexplained: Vec<f64> = measured.iter().zip(&modelled).map(|(y, m)| y - m).collect();
            let own = link
                .effect
                .settle(&link.values, &signals(trace, &stack_v, i), &unexplained, trace.every);
            trace.own[i] = own;
        }
    }
}

fn signals<'a>(trace: &'a Trace<'_>, stack_v: &'a [f64], link: usize) -> Signals<'a> {
    Signals {
        period_s: trace.period_s,
        run_in: trace.run_in,
        rested: trace.rested,
        fraction: match trace.initial {
            InitialState::Remanent { fraction } => fraction,
            InitialState::Periodic { .. } => 0.0,
        },
        at_stack_v: stack_v,
        temperature_c: trace.temperature_c.as_deref(),
        voltage2_v: trace.voltage2_v.as_deref(),
        own: trace.own.get(link).map_or(&[], Vec::as_slice),
    }
}

/// The grid's values at the recorded samples.
fn recorded(trace: &Trace<'_>, series: &[f64]) -> Vec<f64> {
    (0..trace.record.len()).map(|k| series[trace.at(k)]).collect()
}
