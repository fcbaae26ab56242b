//! The chain: voltage, delay, amplifier, hysteresis, creep, structure, coupling and heat, sensor.

use crate::basis::{Basis, PlayScales};
use crate::chain_trace::Trace;
use crate::columns::Design;
use crate::effects::{Acts, Changes, Effect, EffectName, Family, RateLaw, Signals};
use crate::fading::Fading;
use crate::moving_plays::{Cells, Drive, FEW_LANES, LANES, Moving, Sums, Visit};
use crate::start_state::InitialState;
use hysteron_data::{Record, Role};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;
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

/// Columns with their numbers.
type Columns = Vec<(usize, Vec<f64>)>;

/// Numbers of one record alone, one list a link of the chain.
pub(crate) type Own = Vec<Vec<f64>>;

/// A hysteresis and effects around it, everything but the coefficients that are linear.
#[derive(Clone)]
pub(crate) struct Chain {
    pub design: Design,
    /// In the order of [`crate::effects::Place`].
    pub links: Vec<Link>,
    /// Lowest and highest voltage that the hysteresis is fitted on.
    pub range_v: [f64; 2],
}

/// The hysteresis' part of an answer, on the whole grid.
#[derive(Clone)]
pub(crate) struct Stroke {
    pub stack_v: Vec<f64>,
    pub position_um: Vec<f64>,
}

impl Chain {
    pub(crate) fn new(design: Design, mut links: Vec<Link>, range_v: [f64; 2]) -> Self {
        links.sort_by_key(|link| link.effect.description().place);
        Self { design, links, range_v }
    }

    /// Whether signals are moved in time.
    pub(crate) fn dynamic(&self) -> bool {
        self.links.iter().any(|link| link.effect.dynamic())
    }

    /// Whether the output is linear in the coefficients.
    pub(crate) fn linear(&self) -> bool {
        self.links.iter().all(|link| link.effect.acts() != Acts::Nonlinearly)
    }

    /// The functions that the coefficients belong to.
    pub(crate) fn basis(&self) -> Basis {
        Basis::new(self.design.family, self.range_v)
    }

    /// The voltage at the stack.
    pub(crate) fn stack(&self, trace: &Trace<'_>, own: &Own) -> Vec<f64> {
        let mut voltage_v = trace.voltage_v.clone();
        for (i, link) in self.links.iter().enumerate() {
            let signals = signals(trace, own, &[], i);
            link.effect.on_voltage(&link.values, &signals, &mut voltage_v);
        }
        voltage_v
    }

    /// Moves some of the plays along the voltage at the stack; `visit` sees them on the whole grid.
    fn plays<const N: usize>(&self, trace: &Trace<'_>, drive: &Drive<'_>, which: Range<usize>, visit: impl Visit<N>) {
        let own = &self.design.thresholds[which];
        let stack_v = drive.stack_v;
        if self.design.family == Family::Duhem {
            let basis = self.basis();
            // A lane to spare has no weight.
            let per_half = std::array::from_fn(|l| own.get(l).map_or(1.0, |length| basis.half() / length));
            pulp::Arch::new().dispatch(Fading {
                per_half,
                basis: &basis,
                initial: trace.initial,
                stack_v,
                run_in: trace.run_in,
                visit,
            });
            return;
        }
        let thresholds: [f64; N] = std::array::from_fn(|l| own.get(l).copied().unwrap_or(0.0));
        let before = trace.initial.before(&stack_v[..trace.run_in.max(1).min(stack_v.len())]);
        pulp::Arch::new().dispatch(Moving {
            outputs: thresholds.map(before),
            thresholds,
            drive,
            run_in: trace.run_in,
            per_s: 1.0 / trace.period_s,
            visit,
        });
    }

    /// What moves the plays.
    fn drive<'s>(&self, trace: &Trace<'_>, stack_v: &'s [f64]) -> Drive<'s> {
        let of_link = self.links.iter().find_map(|link| {
            let envelope = link.effect.envelope(&link.values)?;
            Some((envelope, link.effect.rate_law(&link.values)))
        });
        let (envelope, law) = of_link.unwrap_or((self.design.envelope, RateLaw::LINEAR));
        Drive::new(stack_v, envelope, law, trace.run_in, 1.0 / trace.period_s)
    }

    /// Groups of plays that move side by side.
    fn groups(&self) -> Vec<Range<usize>> {
        let n = self.design.thresholds.len();
        (0..n).step_by(LANES).map(|from| from..(from + LANES).min(n)).collect()
    }

    /// The modelled position at the recorded samples, free simulation.
    pub(crate) fn respond(&self, coefficients: &[f64], trace: &Trace<'_>, own: &Own) -> Vec<f64> {
        let Stroke { stack_v, position_um } = self.stroke(coefficients, trace, own);
        self.respond_behind(coefficients, trace, own, &stack_v, position_um)
    }

    /// What the hysteresis makes of the command, before the effects on the position.
    pub(crate) fn stroke(&self, coefficients: &[f64], trace: &Trace<'_>, own: &Own) -> Stroke {
        let stack_v = self.stack(trace, own);
        let position_um = self.hysteresis(coefficients, trace, &stack_v);
        Stroke { stack_v, position_um }
    }

    /// The hysteresis alone; the offset is the sensor's, it comes after the linear effects.
    pub(crate) fn hysteresis(&self, coefficients: &[f64], trace: &Trace<'_>, stack_v: &[f64]) -> Vec<f64> {
        let drive = self.drive(trace, stack_v);
        let mut position_um = self.input_function(coefficients, stack_v);
        for group in self.groups() {
            if group.len() <= FEW_LANES {
                self.add_plays::<FEW_LANES>(coefficients, trace, &drive, group, &mut position_um);
            } else {
                self.add_plays::<LANES>(coefficients, trace, &drive, group, &mut position_um);
            }
        }
        position_um
    }

    /// Adds the part of plays that move side by side.
    fn add_plays<const N: usize>(
        &self,
        coefficients: &[f64],
        trace: &Trace<'_>,
        drive: &Drive<'_>,
        group: Range<usize>,
        into: &mut [f64],
    ) {
        let (scales, weights) = self.of_group::<N>(&group, coefficients);
        let sums = Sums {
            basis: &self.basis(),
            scales: &scales,
            weights: &weights,
            into,
        };
        self.plays(trace, drive, group, sums);
    }

    fn input_function(&self, coefficients: &[f64], stack_v: &[f64]) -> Vec<f64> {
        let inputs = self.design.family.input_powers().len();
        self.basis().input_function(&coefficients[1..=inputs], stack_v)
    }

    /// Scales and weights of the plays that move side by side.
    fn of_group<const N: usize>(&self, group: &Range<usize>, coefficients: &[f64]) -> (PlayScales<N>, [[f64; N]; 3]) {
        let basis = self.basis();
        let inputs = self.design.family.input_powers().len();
        let n = self.design.thresholds.len();
        let mut weights = [[0.0; N]; 3];
        for (power, weights) in weights.iter_mut().enumerate().take(self.functions()) {
            for (l, i) in group.clone().enumerate() {
                weights[l] = coefficients[1 + inputs + power * n + i];
            }
        }
        (basis.scales(&self.design.thresholds[group.clone()]), weights)
    }

    fn functions(&self) -> usize {
        self.design.family.coefficients_a_play()
    }

    /// The modelled position at the recorded samples from what the hysteresis made of the command.
    pub(crate) fn respond_from(&self, coefficients: &[f64], trace: &Trace<'_>, own: &Own, stroke: &Stroke) -> Vec<f64> {
        self.respond_behind(coefficients, trace, own, &stroke.stack_v, stroke.position_um.clone())
    }

    /// The same, in place of the stroke.
    pub(crate) fn respond_behind(
        &self,
        coefficients: &[f64],
        trace: &Trace<'_>,
        own: &Own,
        stack_v: &[f64],
        mut position_um: Vec<f64>,
    ) -> Vec<f64> {
        self.behind(coefficients[0], trace, own, stack_v, &mut position_um, |_, _| ());
        if trace.is_the_record() {
            return position_um;
        }
        recorded(trace, &position_um)
    }

    /// The effects on the position, in place; `before(link, position)` at each nonlinear one.
    fn behind(
        &self,
        offset: f64,
        trace: &Trace<'_>,
        own: &Own,
        stack_v: &[f64],
        position: &mut [f64],
        mut before: impl FnMut(usize, &[f64]),
    ) {
        for nonlinear in [false, true] {
            for (i, link) in self.links.iter().enumerate() {
                if (link.effect.acts() == Acts::Nonlinearly) == nonlinear {
                    if nonlinear {
                        before(i, position);
                    }
                    link.effect
                        .on_position(&link.values, &signals(trace, own, stack_v, i), position);
                }
            }
            if !nonlinear {
                position.iter_mut().for_each(|y| *y += offset);
            }
        }
    }

    /// The response to a voltage alone: no effect has a number of the record's own.
    pub(crate) fn respond_to_voltage(
        &self,
        coefficients: &[f64],
        voltage_v: &[f64],
        period_s: f64,
        initial: InitialState,
    ) -> Vec<f64> {
        let record = Record::new(
            "",
            Role::Validate,
            period_s,
            voltage_v.to_vec(),
            vec![0.0; voltage_v.len()],
        );
        self.respond_to_drive(coefficients, &record, initial)
    }

    /// The response to what drives a record: no effect has a number of the record's own.
    pub(crate) fn respond_to_drive(&self, coefficients: &[f64], record: &Record, initial: InitialState) -> Vec<f64> {
        let trace = Trace::new(record, initial, self.dynamic());
        self.respond(coefficients, &trace, &vec![Vec::new(); self.links.len()])
    }

    /// The response of a chain in which one link has changed since `before`; where the voltage at the stack and the plays stay,
    /// they are not run again.
    pub(crate) fn respond_again(
        &self,
        link: usize,
        coefficients: &[f64],
        trace: &Trace<'_>,
        own: &Own,
        before: &Stroke,
    ) -> Vec<f64> {
        let changed = &self.links[link];
        if changed.effect.envelope(&changed.values).is_none() {
            let stack_v = self.stack(trace, own);
            if stack_v == before.stack_v {
                return self.respond_from(coefficients, trace, own, before);
            }
            let position_um = self.hysteresis(coefficients, trace, &stack_v);
            return self.respond_behind(coefficients, trace, own, &stack_v, position_um);
        }
        self.respond(coefficients, trace, own)
    }

    /// The hysteresis' part of the answer, and how the modelled position changes with each coefficient at some of the recorded
    /// samples: both from one pass of the plays where no nonlinear effect needs the position first. `known` is that part.
    pub(crate) fn stroke_and_columns(
        &self,
        coefficients: &[f64],
        trace: &Trace<'_>,
        own: &Own,
        rows: &[usize],
        known: Option<Stroke>,
    ) -> (Stroke, DMatrix<f64>) {
        let (stack_v, mut known) = match known {
            Some(Stroke { stack_v, position_um }) => (stack_v, Some(position_um)),
            None => (self.stack(trace, own), None),
        };
        let mut bends: Vec<(usize, Vec<f64>)> = Vec::new();
        if !self.linear() {
            let position_um = known.unwrap_or_else(|| self.hysteresis(coefficients, trace, &stack_v));
            let mut position = position_um.clone();
            self.behind(coefficients[0], trace, own, &stack_v, &mut position, |i, position| {
                bends.push((i, position.to_vec()));
            });
            known = Some(position_um);
        }
        let bends: Vec<Changes<'_>> = bends
            .iter()
            .map(|(i, position)| {
                let (link, signals) = (&self.links[*i], signals(trace, own, &stack_v, *i));
                link.effect.on_changes(&link.values, signals, position)
            })
            .collect();
        let at: Vec<usize> = rows.iter().map(|&k| trace.at(k)).collect();
        let moved = self.links.iter().any(|link| link.effect.acts() == Acts::Linearly);
        let passing = Passing {
            chain: self,
            trace,
            own,
            drive: self.drive(trace, &stack_v),
            bends: &bends,
            at: &at,
            // Without memory behind the hysteresis the other samples need not be known.
            direct: !moved && bends.is_empty(),
            weights: known.is_none().then_some(coefficients),
        };
        let mut columns = DMatrix::zeros(rows.len(), self.design.columns());
        let mut place = |parts: Columns| {
            for (j, series) in parts {
                columns.column_mut(j).copy_from_slice(&series);
            }
        };
        place(passing.of_input());
        let groups: Vec<(Columns, Vec<f64>)> = self
            .groups()
            .into_par_iter()
            .map(|group| {
                if group.len() <= FEW_LANES {
                    passing.of_plays::<FEW_LANES>(&group)
                } else {
                    passing.of_plays::<LANES>(&group)
                }
            })
            .collect();
        let mut sum = known.unwrap_or_else(|| self.input_function(coefficients, &stack_v));
        for (parts, of_group) in groups {
            place(parts);
            sum.iter_mut().zip(&of_group).for_each(|(sum, own)| *sum += own);
        }
        let stroke = Stroke {
            stack_v: stack_v.clone(),
            position_um: sum,
        };
        (stroke, columns)
    }

    /// The numbers of each effect that belong to this record alone.
    pub(crate) fn settle(&self, coefficients: &[f64], trace: &Trace<'_>) -> Own {
        let none = vec![Vec::new(); self.links.len()];
        if self.links.iter().any(|link| link.effect.has_own_numbers()) {
            let stroke = self.stroke(coefficients, trace, &none);
            return self.settle_behind(coefficients, trace, &stroke.stack_v, &stroke.position_um);
        }
        none
    }

    /// [`Self::settle`] behind a hysteresis that is known; effects on the voltage have no numbers of a record's own. The offset, which belongs
    /// to all records, is left to the fit: a number that undid it would undo every change of it.
    pub(crate) fn settle_behind(
        &self,
        coefficients: &[f64],
        trace: &Trace<'_>,
        stack_v: &[f64],
        stroke_um: &[f64],
    ) -> Own {
        let mut own = vec![Vec::new(); self.links.len()];
        let with_own: Vec<usize> = (0..self.links.len())
            .filter(|&i| self.links[i].effect.has_own_numbers())
            .collect();
        let mut coefficients = coefficients.to_vec();
        if let Some(offset) = coefficients.first_mut() {
            *offset = 0.0;
        }
        // Of several the first is chosen again once the others are there: a zero beside the phases of a hum.
        let passes = if with_own.len() > 1 { 2 } else { 1 };
        for &i in with_own.iter().cycle().take(passes * with_own.len()) {
            let link = &self.links[i];
            let mut without = self.clone();
            without.links.remove(i);
            let mut others = own.clone();
            others.remove(i);
            let modelled = without.respond_behind(&coefficients, trace, &others, stack_v, stroke_um.to_vec());
            let measured = &trace.record.position_um;
            let unexplained: Vec<f64> = measured.iter().zip(&modelled).map(|(y, m)| y - m).collect();
            own[i] = link.effect.settle(
                &link.values,
                &signals(trace, &own, stack_v, i),
                &unexplained,
                trace.every,
            );
        }
        own
    }
}

/// Columns on their way from the hysteresis to the rows that are asked for.
struct Passing<'p> {
    chain: &'p Chain,
    trace: &'p Trace<'p>,
    own: &'p Own,
    drive: Drive<'p>,
    /// What each nonlinear link makes of small changes.
    bends: &'p [Changes<'p>],
    at: &'p [usize],
    direct: bool,
    /// Coefficients, where the plays' part of the position is wanted as well.
    weights: Option<&'p [f64]>,
}

impl Passing<'_> {
    /// Offset and input function.
    fn of_input(&self) -> Columns {
        let basis = self.chain.basis();
        let inputs = self.chain.design.family.input_powers().len();
        let samples: Vec<usize> = if self.direct {
            self.at.to_vec()
        } else {
            (0..self.drive.stack_v.len()).collect()
        };
        let mut series = vec![vec![0.0; samples.len()]; inputs];
        let mut cells = vec![0.0; inputs];
        for (place, &k) in samples.iter().enumerate() {
            basis.input(self.drive.stack_v[k], &mut cells);
            series.iter_mut().zip(&cells).for_each(|(s, &x)| s[place] = x);
        }
        let mut offset = [vec![1.0; samples.len()]];
        self.bend(&mut offset);
        let [offset] = offset;
        let columns = std::iter::once(self.at_rows(offset)).chain(self.through(series));
        columns.enumerate().collect()
    }

    /// All functions of some of the plays, and their part of the position.
    fn of_plays<const N: usize>(&self, group: &Range<usize>) -> (Columns, Vec<f64>) {
        let chain = self.chain;
        let (basis, n) = (chain.basis(), chain.design.thresholds.len());
        let inputs = chain.design.family.input_powers().len();
        let functions = chain.functions();
        let count = group.len();
        let none = vec![0.0; chain.design.columns()];
        let (scales, weights) = chain.of_group::<N>(group, self.weights.unwrap_or(&none));
        let mut sum = vec![
            0.0;
            if self.weights.is_some() {
                self.drive.stack_v.len()
            } else {
                0
            }
        ];
        let samples = if self.direct {
            self.at.len()
        } else {
            self.drive.stack_v.len()
        };
        let mut series = vec![vec![0.0; samples]; functions * count];
        let sums = Sums {
            basis: &basis,
            scales: &scales,
            weights: &weights,
            into: &mut sum,
        };
        let visit = Cells {
            sums,
            only: self.direct.then_some(self.at),
            next: 0,
            count,
            series: &mut series,
        };
        chain.plays(self.trace, &self.drive, group.clone(), visit);
        let columns = self
            .through(series)
            .into_iter()
            .enumerate()
            .map(|(place, column)| {
                let (power, l) = (place / count, place % count);
                (1 + inputs + power * n + group.start + l, column)
            })
            .collect();
        (columns, sum)
    }

    /// Columns through all that stands behind the hysteresis, at the rows.
    fn through(&self, mut series: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if self.direct {
            return series;
        }
        for (i, link) in self.chain.links.iter().enumerate() {
            if link.effect.acts() == Acts::Linearly {
                let signals = signals(self.trace, self.own, self.drive.stack_v, i);
                link.effect.on_positions(&link.values, &signals, &mut series);
            }
        }
        self.bend(&mut series);
        series.into_iter().map(|column| self.at_rows(column)).collect()
    }

    fn bend(&self, series: &mut [Vec<f64>]) {
        self.bends.iter().for_each(|changed| changed(series));
    }

    fn at_rows(&self, column: Vec<f64>) -> Vec<f64> {
        if self.direct {
            return column;
        }
        self.at.iter().map(|&k| column[k]).collect()
    }
}

fn signals<'a>(trace: &'a Trace<'_>, own: &'a Own, stack_v: &'a [f64], link: usize) -> Signals<'a> {
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
        own: own.get(link).map_or(&[], Vec::as_slice),
    }
}

/// The grid's values at the recorded samples.
fn recorded(trace: &Trace<'_>, series: &[f64]) -> Vec<f64> {
    (0..trace.record.len()).map(|k| series[trace.at(k)]).collect()
}
