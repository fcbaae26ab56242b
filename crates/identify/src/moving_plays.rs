//! Plays on their way along a voltage, by the widest vectors of the processor.

use crate::basis::{Basis, PlayScales, by_weight};
use crate::effects::RateLaw;
use hysteron_core::envelope::Envelope;

/// Plays that move side by side: each one's next output waits for its last.
pub(crate) const LANES: usize = 8;

/// The same where no more are left.
pub(crate) const FEW_LANES: usize = 4;

/// Plays on their way along a voltage.
pub(crate) struct Moving<'m, V, const N: usize> {
    pub thresholds: [f64; N],
    pub outputs: [f64; N],
    pub drive: &'m Drive<'m>,
    pub run_in: usize,
    /// Samples of the grid a second.
    pub per_s: f64,
    pub visit: V,
}

/// What moves plays: a voltage, and how far its rate opens their envelopes.
pub(crate) struct Drive<'d> {
    pub stack_v: &'d [f64],
    envelope: Envelope<f64>,
    /// What stands in the envelope at each sample in place of the speed: a power takes longer than all plays of a group, and is the same
    /// for every group.
    speeds: Vec<f64>,
}

impl<'d> Drive<'d> {
    /// A voltage whose first `run_in` samples are a period that came before it; `per_s` samples a second.
    pub(crate) fn new(stack_v: &'d [f64], envelope: Envelope<f64>, law: RateLaw, run_in: usize, per_s: f64) -> Self {
        let mut last = stack_v.get(run_in.max(1) - 1).copied().unwrap_or(0.0);
        let (mut last_speed, mut lawful) = (0.0, law.of(0.0));
        let of_sample = |&input: &f64| {
            let speed = ((input - last) * per_s).abs();
            last = input;
            // Rests and ramps need a power once.
            if speed != last_speed {
                (last_speed, lawful) = (speed, law.of(speed));
            }
            lawful
        };
        let speeds = stack_v.iter().map(of_sample).collect();
        Self {
            stack_v,
            envelope,
            speeds,
        }
    }
}

/// What looks at plays on their way; compiled into the loop that moves them.
pub(crate) trait Visit<const N: usize> {
    /// Outputs at a sample of the grid, and the voltage's rate there, volts per second.
    fn at(&mut self, sample: usize, rate: f64, w: &[f64; N]);

    /// Functions of elements that are no plays.
    fn functions(&mut self, sample: usize, functions: &[[f64; N]; 3]);
}

/// Adds the plays' part of the position; nothing where there is nothing to add it to.
pub(crate) struct Sums<'v, const N: usize> {
    pub basis: &'v Basis,
    pub scales: &'v PlayScales<N>,
    pub weights: &'v [[f64; N]; 3],
    pub into: &'v mut [f64],
}

impl<const N: usize> Visit<N> for Sums<'_, N> {
    #[inline(always)]
    fn at(&mut self, sample: usize, rate: f64, w: &[f64; N]) {
        if let Some(sum) = self.into.get_mut(sample) {
            *sum += total(&self.basis.weighed(self.scales, self.weights, w, rate));
        }
    }

    #[inline(always)]
    fn functions(&mut self, sample: usize, functions: &[[f64; N]; 3]) {
        if let Some(sum) = self.into.get_mut(sample) {
            *sum += total(&by_weight(functions, self.weights));
        }
    }
}

/// In pairs, so that no sum waits for all the others.
#[inline(always)]
fn total<const N: usize>(parts: &[f64; N]) -> f64 {
    let mut four = [0.0; FEW_LANES];
    for l in 0..N {
        four[l % FEW_LANES] += parts[l];
    }
    (four[0] + four[2]) + (four[1] + four[3])
}

/// The same, and keeps all functions of the plays.
pub(crate) struct Cells<'v, const N: usize> {
    pub sums: Sums<'v, N>,
    /// The samples that are kept, ascending; `None`: all.
    pub only: Option<&'v [usize]>,
    pub next: usize,
    /// Plays that there are.
    pub count: usize,
    /// A series for each play and power, power by power.
    pub series: &'v mut [Vec<f64>],
}

impl<const N: usize> Visit<N> for Cells<'_, N> {
    #[inline(always)]
    fn at(&mut self, sample: usize, rate: f64, w: &[f64; N]) {
        self.sums.at(sample, rate, w);
        if self.wants(sample) {
            self.keep(&self.sums.basis.plays(self.sums.scales, w, rate));
        }
    }

    #[inline(always)]
    fn functions(&mut self, sample: usize, functions: &[[f64; N]; 3]) {
        self.sums.functions(sample, functions);
        if self.wants(sample) {
            self.keep(functions);
        }
    }
}

impl<const N: usize> Cells<'_, N> {
    #[inline(always)]
    fn wants(&self, sample: usize) -> bool {
        self.only.is_none_or(|only| only.get(self.next) == Some(&sample))
    }

    #[inline(always)]
    fn keep(&mut self, functions: &[[f64; N]; 3]) {
        for (of_power, own) in self.series.chunks_exact_mut(self.count).zip(functions) {
            for (cells, value) in of_power.iter_mut().zip(own) {
                cells[self.next] = *value;
            }
        }
        self.next += 1;
    }
}

impl<V: Visit<N>, const N: usize> pulp::NullaryFnOnce for Moving<'_, V, N> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let Drive {
            stack_v,
            envelope: Envelope { alpha_s, beta_s },
            ref speeds,
        } = *self.drive;
        let mut last = stack_v.first().copied().unwrap_or(0.0);
        let mut w = self.outputs;
        let mut advance = |input: f64, speed: f64, w: &mut [f64; N]| {
            let rate = (input - last) * self.per_s;
            last = input;
            let (left, right) = (input - alpha_s * speed, input + beta_s * speed);
            for (w, threshold) in w.iter_mut().zip(self.thresholds) {
                // Comparisons compile to selections where `max` and `min` must think of NaN.
                let held = if *w > right { right } else { *w };
                let left = left - threshold;
                *w = if held < left { left } else { held };
            }
            rate
        };
        let moves = || stack_v.iter().zip(speeds);
        // After one whole period both extremes have been passed, and all memory from before is wiped out. It begins at rest.
        for (k, (&input, &speed)) in moves().take(self.run_in).enumerate() {
            advance(input, if k == 0 { 0.0 } else { speed }, &mut w);
        }
        for (k, (&input, &speed)) in moves().enumerate() {
            let rate = advance(input, speed, &mut w);
            self.visit.at(k, rate, &w);
        }
    }
}
