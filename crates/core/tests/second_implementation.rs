//! The core against a second, naive implementation written from the paper's equations with no shared code, and `f32`
//! against `f64`.

#![expect(clippy::unwrap_used, reason = "a test that cannot build its subject fails")]

use hysteron_core::bank::{PlayBank, PlayState};
use hysteron_core::envelope::Envelope;
use hysteron_core::model::Hysteresis;
use hysteron_core::mpi::{Mpi, MpiCoefficients};
use hysteron_core::mrpi::Mrpi;
use hysteron_core::pi_model::Pi;
use hysteron_core::play_polynomial::{PlayPolynomial, PolynomialCoefficients};
use hysteron_core::real::Real;
use hysteron_core::thresholds::Thresholds;
use hysteron_core::wrpi::Wrpi;
use proptest::prelude::*;

const N: usize = 6;
const RATE_HZ: f64 = 50e3;
const RANGE: f64 = 2.0;

/// Random parameters of all models at once.
#[derive(Debug, Clone)]
struct Parameters {
    gaps: [f64; N],
    first: [f64; N],
    second: [f64; N],
    third: [f64; N],
    g: [f64; 5],
    alpha_s: f64,
    beta_s: f64,
}

impl Parameters {
    fn thresholds(&self) -> [f64; N] {
        let mut sum = 0.0;
        self.gaps.map(|gap| {
            sum += gap;
            sum
        })
    }
}

prop_compose! {
    fn parameters()(
        gaps in prop::array::uniform6(0.01..0.3),
        first in prop::array::uniform6(-1.0..1.0),
        second in prop::array::uniform6(-1.0..1.0),
        third in prop::array::uniform6(-1.0..1.0),
        g in prop::array::uniform5(-1.0..1.0),
        alpha_s in 0.0..5e-4,
        beta_s in 0.0..5e-4,
    ) -> Parameters {
        Parameters { gaps, first, second, third, g, alpha_s, beta_s }
    }
}

/// A wandering drive whose largest step is that of a 1 kHz sine over the range: |v'| <= 2 pi 1000.
fn drive() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-0.125..0.125_f64, 2..300).prop_map(|steps: Vec<f64>| {
        let mut v: f64 = 0.3;
        steps
            .into_iter()
            .map(|step| {
                v = f64::clamp(v + step, -1.5, 1.5);
                v
            })
            .collect()
    })
}

/// The paper's equations, sample by sample, with std's own max and min.
struct Naive {
    w: [f64; N],
    last: f64,
}

impl Naive {
    fn new() -> Self {
        Self { w: [0.0; N], last: 0.0 }
    }

    fn plays(&mut self, p: &Parameters, v: f64, alpha: f64, beta: f64) -> f64 {
        let rate = (v - self.last) * RATE_HZ;
        self.last = v;
        let (left, right) = (v - alpha * rate.abs(), v + beta * rate.abs());
        for (w, r) in self.w.iter_mut().zip(p.thresholds()) {
            *w = f64::max(left - r, f64::min(right, *w));
        }
        rate
    }

    fn sum(&self, c: &[f64; N], power: i32) -> f64 {
        c.iter().zip(&self.w).map(|(c, w)| c * w.powi(power)).sum()
    }
}

fn bank<T: Real>(p: &Parameters) -> PlayBank<T, N> {
    let thresholds = Thresholds::new(p.thresholds().map(T::from_f64)).unwrap();
    PlayBank::new(
        thresholds,
        T::from_f64(-RANGE),
        T::from_f64(RANGE),
        T::from_f64(RATE_HZ),
    )
    .unwrap()
}

fn mpi_coefficients<T: Real>(p: &Parameters) -> MpiCoefficients<T, N> {
    MpiCoefficients {
        offset: T::from_f64(p.g[4]),
        cubic: T::from_f64(p.g[2]),
        linear: T::from_f64(p.g[0]),
        weights: p.first.map(T::from_f64),
    }
}

/// Outputs of all five models over a drive.
fn outputs<T: Real>(p: &Parameters, drive: &[f64]) -> Vec<[f64; 5]> {
    let c = mpi_coefficients::<T>(p);
    let pi = Pi::new(bank(p), c.offset, c.linear, c.weights).unwrap();
    let mpi = Mpi::new(bank(p), c).unwrap();
    let wrpi = Wrpi::new(bank(p), c, p.second.map(|l| T::from_f64(1e-3 * l))).unwrap();
    let envelope = Envelope {
        alpha_s: T::from_f64(p.alpha_s),
        beta_s: T::from_f64(p.beta_s),
    };
    let mrpi = Mrpi::new(bank(p), c, envelope).unwrap();
    let polynomial = PlayPolynomial::new(
        bank(p),
        PolynomialCoefficients {
            offset: c.offset,
            input_function: p.g.map(T::from_f64),
            linear: c.weights,
            quadratic: p.second.map(T::from_f64),
            cubic: p.third.map(T::from_f64),
        },
    )
    .unwrap();
    let mut states = [PlayState::virgin(); 5];
    drive
        .iter()
        .map(|&v| {
            let v = T::from_f64(v);
            let [a, b, c, d, e] = &mut states;
            [
                pi.step(a, v),
                mpi.step(b, v),
                wrpi.step(c, v),
                mrpi.step(d, v),
                polynomial.step(e, v),
            ]
            .map(T::to_f64)
        })
        .collect()
}

fn naive_outputs(p: &Parameters, drive: &[f64]) -> Vec<[f64; 5]> {
    let (mut fixed, mut moving) = (Naive::new(), Naive::new());
    let c = p.g[4];
    drive
        .iter()
        .map(|&v| {
            let rate = fixed.plays(p, v, 0.0, 0.0);
            moving.plays(p, v, p.alpha_s, p.beta_s);
            let cubic = p.g[2] * v.powi(3) + p.g[0] * v;
            let g: f64 = (1..).zip(p.g).map(|(power, c)| c * v.powi(power)).sum();
            let rate_weights = p.second.map(|l| 1e-3 * l);
            [
                c + p.g[0] * v + fixed.sum(&p.first, 1),
                c + cubic + fixed.sum(&p.first, 1),
                c + cubic + fixed.sum(&p.first, 1) + rate * fixed.sum(&rate_weights, 1),
                c + cubic + moving.sum(&p.first, 1),
                c + g + fixed.sum(&p.first, 1) + fixed.sum(&p.second, 2) + fixed.sum(&p.third, 3),
            ]
        })
        .collect()
}

/// Largest sum of magnitudes of the terms of any model: inputs to 1.5, plays to 3.3 (threshold sum 1.8), rates to
/// 6250 a second times 1e-3; the cubic play term with 6 x 36 rules, MRPI's plays reach 1.5 + 1.8 + 3.1.
const LARGEST_TERM_SUM: f64 = 400.0;

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn val_core_equals_the_naive_implementation(p in parameters(), drive in drive()) {
        for (found, wanted) in outputs::<f64>(&p, &drive).iter().zip(naive_outputs(&p, &drive)) {
            for (found, wanted) in found.iter().zip(wanted) {
                // 1e-12 of the terms' size: some thirty roundings of 1.1e-16 each.
                prop_assert!((found - wanted).abs() <= 1e-12 * wanted.abs().max(1.0), "{found} {wanted}");
            }
        }
    }

    /// The stated bound: rounding the inputs, parameters and some 30 operations to f32 (2^-24 each) of terms whose
    /// magnitudes sum to at most 400 leaves less than 35 x 400 x 2^-24 = 8.4e-4.
    #[test]
    fn prop_f32_stays_within_its_bound_of_f64(p in parameters(), drive in drive()) {
        let bound = 35.0 * LARGEST_TERM_SUM * 2f64.powi(-24);
        for (single, double) in outputs::<f32>(&p, &drive).iter().zip(outputs::<f64>(&p, &drive)) {
            for (single, double) in single.iter().zip(double) {
                prop_assert!((single - double).abs() <= bound, "{single} {double}");
            }
        }
    }
}
