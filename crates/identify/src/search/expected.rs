//! What a free shape is expected to be where the records are silent: close to a smooth one.
//!
//! A ridge on coefficients says nothing of what they do: on records between the same two voltages, functions that cancel each other there
//! cost it little and fly apart on any other path. So it is the answer that is held, on a path over the whole range with loops of all
//! sizes: what a smooth density of plays (or of fading elements) behind a cubic cannot give costs its square.

use crate::chain::Chain;
use crate::chain_trace::Trace;
use crate::normal::Normal;
use crate::start_state::InitialState;
use hysteron_data::{Record, Role};
use nalgebra::DMatrix;
use std::borrow::Cow;
use std::sync::Arc;

/// Longest step of the path, in half ranges.
const STEP: f64 = 0.08;

/// Loops of pseudo-random size on the path.
const LOOPS: usize = 60;

/// What a straight input and one loop cannot give, but a smooth shape can, costs this share.
const SMOOTH_COSTS: f64 = 0.3;

/// Powers of the input, and of an element's place among the others, of a smooth shape.
const SMOOTH_POWERS: usize = 3;

/// How strongly, and to what, coefficients are held.
#[derive(Clone, Copy)]
pub(super) struct Held<'e> {
    /// What departures from a smooth shape cost, where the hysteresis is a free one.
    pub expected: Option<&'e DMatrix<f64>>,
    /// Times that cost; without it the ridge on scaled columns.
    pub by: f64,
}

impl Held<'_> {
    /// A system with what departures cost.
    pub(super) fn onto(self, system: &Normal) -> Cow<'_, Normal> {
        match self.expected {
            Some(costs) => Cow::Owned(system.with_costs(costs, self.by)),
            None => Cow::Borrowed(system),
        }
    }

    /// The ridge on scaled columns.
    pub(super) fn ridge(self) -> f64 {
        if self.expected.is_some() { 0.0 } else { self.by }
    }
}

/// The quadratic form of a free shape's coefficients that is the mean square of what a smooth shape cannot give on [`path`], in strokes;
/// `None` for the families that are linear in their plays.
pub(super) fn expected(chain: &Chain, stroke_um: f64) -> Option<Arc<DMatrix<f64>>> {
    let design = &chain.design;
    if !design.family.is_free() || stroke_um <= 0.0 {
        return None;
    }
    let bare = Chain::new(design.clone(), Vec::new(), chain.range_v);
    let record = Record::new("", Role::Validate, 1.0, path(chain.range_v), Vec::new());
    let trace = Trace::new(&record, InitialState::REST, false);
    let rows: Vec<usize> = (0..record.voltage_v.len()).collect();
    let none = vec![0.0; design.columns()];
    let (_, columns) = bare.stroke_and_columns(&none, &trace, &Vec::new(), &rows, None);
    let inputs = design.family.input_powers().len();
    let elements = design.thresholds.len();
    let smooth = |powers: usize, weights: usize| {
        let mut directions = DMatrix::zeros(columns.ncols(), 1 + powers + weights);
        for j in 0..=powers {
            directions[(j, j)] = 1.0;
        }
        for k in 0..weights {
            for i in 0..elements {
                let place = (i as f64 + 0.5) / elements as f64;
                directions[(1 + inputs + i, 1 + powers + k)] = place.powi(k as i32);
            }
        }
        directions
    };
    let mut cost = beyond(&columns, &smooth(SMOOTH_POWERS, SMOOTH_POWERS));
    cost += beyond(&columns, &smooth(1, 1)) * SMOOTH_COSTS;
    Some(Arc::new(cost / (rows.len() as f64 * stroke_um.powi(2))))
}

/// The Gram matrix of what columns give beyond some of their directions.
fn beyond(columns: &DMatrix<f64>, directions: &DMatrix<f64>) -> DMatrix<f64> {
    let q = (columns * directions).qr().q();
    let across = q.tr_mul(columns);
    columns.tr_mul(columns) - across.tr_mul(&across)
}

/// A path over a range of voltages: two cycles, loops that decay to its middle, then loops everywhere.
fn path([low, high]: [f64; 2]) -> Vec<f64> {
    let cycles = [-1.0, 1.0, -1.0, 1.0];
    let decaying = (1..10).map(|k| f64::from(10 - k) / 10.0 * if k % 2 == 1 { -1.0 } else { 1.0 });
    // The fractions of multiples of the golden ratio lie evenly, whatever their number.
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    let loops = (1..=LOOPS).map(|k| 2.0 * (k as f64 * golden).fract() - 1.0);
    let mut turns = cycles.into_iter().chain(decaying).chain(loops);
    let mut last = turns.next().unwrap_or(0.0);
    let mut path = vec![last];
    for turn in turns {
        let steps = ((turn - last) / STEP).abs().ceil().max(1.0);
        path.extend((1..=steps as usize).map(|k| last + (turn - last) * k as f64 / steps));
        last = turn;
    }
    path.iter()
        .map(|u| 0.5 * (low + high) + 0.5 * (high - low) * u)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::system::within_bounds;
    use super::*;
    use crate::columns::Design;
    use crate::family::Family;
    use crate::placement::{fading_lengths, free_thresholds};
    use nalgebra::DVector;

    const RANGE_V: [f64; 2] = [-20.0, 100.0];

    fn chain(family: Family) -> Chain {
        let drive: &[&[f64]] = &[&RANGE_V];
        let thresholds = match family {
            Family::Duhem => fading_lengths(4, drive),
            _ => free_thresholds(18, drive),
        };
        Chain::new(Design::still(family, thresholds), Vec::new(), RANGE_V)
    }

    fn columns(chain: &Chain, voltage_v: Vec<f64>) -> DMatrix<f64> {
        let record = Record::new("", Role::Validate, 1.0, voltage_v, Vec::new());
        let trace = Trace::new(&record, InitialState::REST, false);
        let rows: Vec<usize> = (0..record.voltage_v.len()).collect();
        let none = vec![0.0; chain.design.columns()];
        chain.stroke_and_columns(&none, &trace, &Vec::new(), &rows, None).1
    }

    /// A straight line, whatever its offset, costs nothing; one coefficient more costs the mean square of what it adds on the path, in
    /// strokes, less what line and loop could give of it, and less than all of it.
    #[test]
    fn val_what_a_departure_costs() {
        for family in [Family::PlayPolynomial, Family::Duhem] {
            let chain = chain(family);
            let costs = expected(&chain, 5.0).unwrap();
            let cost = |x: &DVector<f64>| x.dot(&(&*costs * x));
            let mut line = DVector::zeros(chain.design.columns());
            (line[0], line[1]) = (40.0, 7.0);
            assert!(cost(&line).abs() < 1e-9, "{family}: {}", cost(&line));
            let along = columns(&chain, path(RANGE_V));
            let last = chain.design.columns() - 1;
            let mut other = line.clone();
            other[last] = 3.0;
            let adds = 9.0 * along.column(last).norm_squared() / along.nrows() as f64 / 25.0;
            assert!(
                cost(&other) > 1e-3 * adds && cost(&other) < (1.0 + SMOOTH_COSTS) * adds,
                "{family}: {} {adds}",
                cost(&other)
            );
        }
    }

    /// Three periods between the same two voltages of a stage of three plays with a bent output, with noise: what is not told there stays
    /// smooth on loops of all sizes, where a ridge lets it fly apart.
    #[test]
    fn val_one_loop_does_not_fly_apart_elsewhere() {
        let sine: Vec<f64> = (0..600)
            .map(|k| 40.0 - 60.0 * (f64::from(k) * std::f64::consts::TAU / 200.0).cos())
            .collect();
        let truth = |voltage_v: &[f64]| -> Vec<f64> {
            let mut plays = [RANGE_V[0]; 3];
            let of = |&v: &f64| {
                for (play, threshold) in plays.iter_mut().zip([8.0, 20.0, 45.0]) {
                    *play = play.min(v).max(v - threshold);
                }
                let bent = |w: f64| w + 1e-3 * w * w;
                0.05 * v + 0.02 * plays.into_iter().map(bent).sum::<f64>()
            };
            voltage_v.iter().map(of).collect()
        };
        let noise = |k: usize| 2e-3 * (((k * 7919) % 1000) as f64 / 500.0 - 1.0);
        let measured: Vec<f64> = truth(&sine).iter().enumerate().map(|(k, y)| y + noise(k)).collect();
        let everywhere = truth(&path(RANGE_V));
        let stroke_um = 14.0;
        for family in [Family::PlayPolynomial, Family::Duhem] {
            let chain = chain(family);
            let system = Normal::of_columns(&columns(&chain, sine.clone()), &DVector::from_column_slice(&measured));
            let mut weighed = Normal::new(system.columns());
            weighed.add_scaled(&system, 1.0 / (600.0 * (2e-3_f64 * stroke_um).powi(2)));
            let costs = expected(&chain, stroke_um).unwrap();
            let along = columns(&chain, path(RANGE_V));
            let error = |held: Held<'_>| {
                let x = within_bounds(&weighed, system.columns(), held, 0.0, &[]).unwrap();
                let foretold = &along * DVector::from_vec(x);
                let squares: f64 = foretold.iter().zip(&everywhere).map(|(a, b)| (a - b).powi(2)).sum();
                (squares / everywhere.len() as f64).sqrt() / stroke_um
            };
            let expected = Some(&*costs);
            let [held, ridge] = [
                Held { expected, by: 1e2 },
                Held {
                    expected: None,
                    by: 1e-9,
                },
            ]
            .map(error);
            assert!(held < 0.03 && held < 0.5 * ridge, "{family}: {held} {ridge}");
        }
    }

    #[test]
    fn val_families_that_are_linear_in_their_plays_expect_nothing() {
        let linear = Chain::new(Design::still(Family::Mpi, vec![5.0, 10.0]), Vec::new(), RANGE_V);
        assert!(expected(&linear, 5.0).is_none());
    }
}
