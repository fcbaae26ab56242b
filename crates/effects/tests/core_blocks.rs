//! The form that is fitted is the block that runs on the chip: a series through the effect, and sample by sample through the core.
#![allow(clippy::unwrap_used, reason = "a test that cannot build its block fails")]

use hysteron_core::effects::Block;
use hysteron_core::effects::backlash::Backlash;
use hysteron_core::effects::coupling::Coupling;
use hysteron_core::effects::creep::Creep;
use hysteron_core::effects::delay::Delay;
use hysteron_core::effects::hum::Hum;
use hysteron_core::effects::lag::{GrowingLag, Lag};
use hysteron_core::effects::resonance::{Mode, TwoModes};
use hysteron_core::effects::restoring::{Memory, RestoringMode, RestoringNumbers};
use hysteron_core::effects::saturation::Saturation;
use hysteron_core::effects::sensor::SensorCurve;
use hysteron_core::effects::slew::SlewLimit;
use hysteron_core::effects::thermal::Thermal;
use hysteron_effects::{EffectId, Facts, Family, Signals};
use proptest::prelude::*;
use std::f64::consts::TAU;

const PERIOD_S: f64 = 2e-4;
const RATE_HZ: f64 = 1.0 / PERIOD_S;

fn facts() -> Facts {
    Facts {
        voltage_v: [0.0, 100.0],
        position_um: [0.0, 10.0],
        finest_period_s: PERIOD_S,
        finest_grid_s: PERIOD_S,
        longest_s: 10.0,
        peak_rate_v_per_s: 1e4,
        temperature_c: Some([20.0, 20.5, 21.0]),
        voltage2_v: Some([0.0, 100.0]),
        rests: true,
        family: Family::Pi,
    }
}

/// A record from rest.
struct Played {
    voltage_v: Vec<f64>,
    position_um: Vec<f64>,
    temperature_c: Vec<f64>,
    voltage2_v: Vec<f64>,
    phases: [f64; 5],
}

fn through<B: Block<f64>>(block: &B, series: &[f64]) -> Vec<f64> {
    let mut state = block.rest_at(series[0]);
    series.iter().map(|&x| block.step(&mut state, x)).collect()
}

fn mode_of(values: &[f64]) -> RestoringNumbers {
    RestoringNumbers {
        frequency_hz: values[0],
        damping: values[1],
        middle: 0.0,
        half: 1.0,
        stiffness: [0.0; 2],
        memory: Memory::default(),
    }
}

/// `None` for a spring that would push: the core refuses it, and the effect leaves the position alone.
fn restored(numbers: &RestoringNumbers, position_um: &[f64]) -> Option<Vec<f64>> {
    let mode = RestoringMode::<f64>::new(numbers, RATE_HZ).ok()?;
    Some(through(&mode, position_um))
}

fn slew_limit(values: &[f64]) -> SlewLimit<f64> {
    match values[1] {
        0.0 => SlewLimit::new(values[0], RATE_HZ).unwrap(),
        falling => SlewLimit::unequal(values[0], falling, RATE_HZ).unwrap(),
    }
}

/// What the core's blocks make of voltage and position; `None` where the effect leaves it alone or has no block.
fn by_the_core(id: EffectId, values: &[f64], played: &Played) -> [Option<Vec<f64>>; 2] {
    let (voltage_v, position_um) = (&played.voltage_v, &played.position_um);
    match id {
        EffectId::Delay => [
            Some(through(
                &Delay::<f64, 4096>::new(values[0], RATE_HZ).unwrap(),
                voltage_v,
            )),
            None,
        ],
        EffectId::FirstOrderLag => {
            let lag = |tau_s: f64, series: &[f64]| Some(through(&Lag::<f64>::new(tau_s, RATE_HZ).unwrap(), series));
            let growing = GrowingLag::<f64>::new(values[0], values[2], values[3], RATE_HZ).unwrap();
            [Some(through(&growing, voltage_v)), lag(values[1], position_um)]
        }
        EffectId::SlewLimit => [Some(through(&slew_limit(values), voltage_v)), None],
        EffectId::Saturation => {
            let limit = |at: usize, series: &[f64]| {
                Some(through(&Saturation::new(values[at], values[at + 1]).unwrap(), series))
            };
            // A stop that gives way lets its share through.
            let stopped = limit(2, position_um).unwrap();
            let let_through = stopped.iter().zip(position_um).map(|(s, y)| s + values[4] * (y - s));
            [limit(0, voltage_v), Some(let_through.collect())]
        }
        EffectId::Creep => {
            let taus: [f64; 4] = std::array::from_fn(|i| values[0] * 10f64.powi(i as i32));
            let creep = Creep::<f64, 4>::new(values[1..].try_into().unwrap(), taus, RATE_HZ, 1).unwrap();
            [None, Some(through(&creep, position_um))]
        }
        EffectId::Resonance => {
            let mode = |at: usize| Mode::<f64>::new(values[at], values[at + 1], RATE_HZ).unwrap();
            let modes = TwoModes::new([mode(0), mode(2)], values[4]).unwrap();
            [None, Some(through(&modes, position_um))]
        }
        EffectId::CrossCoupling => {
            let coupling = Coupling::<f64>::new(values[0], values[1], values[2], values[3], RATE_HZ).unwrap();
            let from_other = through(&coupling, &played.voltage2_v);
            [
                None,
                Some(position_um.iter().zip(from_other).map(|(y, c)| y + c).collect()),
            ]
        }
        EffectId::ThermalDrift => {
            let heat = Thermal::<f64>::new(values[2], values[3], values[0], values[1], RATE_HZ).unwrap();
            let mut state = heat.settled_at(played.temperature_c[0]);
            let pairs = position_um.iter().zip(&played.temperature_c);
            [None, Some(pairs.map(|(&y, &t)| heat.step(&mut state, y, t)).collect())]
        }
        EffectId::MainsHum => {
            // The record's own phases stand at its middle.
            let middle_s = 0.5 * position_um.len() as f64 * PERIOD_S;
            let at_start = std::array::from_fn(|k| {
                (played.phases[k] - TAU * (k + 1) as f64 * values[0] * middle_s).rem_euclid(TAU)
            });
            let hum = Hum::<f64, 5>::new(values[0], values[1..].try_into().unwrap(), at_start, RATE_HZ).unwrap();
            let mut state = hum.start();
            [
                None,
                Some(position_um.iter().map(|y| y + hum.step(&mut state)).collect()),
            ]
        }
        EffectId::Backlash => [None, Some(through(&Backlash::new(values[0]).unwrap(), position_um))],
        EffectId::SensorNonlinearity => {
            let curve = SensorCurve::new(values[1], values[2]).unwrap();
            let reading = |y: &f64| values[0] + curve.reading(y - values[0]);
            [None, Some(position_um.iter().map(reading).collect())]
        }
        EffectId::NonlinearStiffness => {
            let numbers = RestoringNumbers {
                middle: values[2],
                half: values[3],
                stiffness: [values[4], values[5]],
                ..mode_of(values)
            };
            [None, restored(&numbers, position_um)]
        }
        EffectId::Friction => {
            let memory = Memory {
                stiffness: values[2] / values[3],
                fading: 1.0 / values[3],
                lean: 0.0,
                sticking: values[4],
                sticking_to: values[5],
            };
            let numbers = RestoringNumbers {
                memory,
                ..mode_of(values)
            };
            [None, restored(&numbers, position_um)]
        }
        EffectId::ModeHysteresis => {
            let memory = Memory {
                stiffness: values[2],
                fading: values[3],
                lean: values[4],
                ..Memory::default()
            };
            let numbers = RestoringNumbers {
                memory,
                ..mode_of(values)
            };
            [None, restored(&numbers, position_um)]
        }
        // Parts of the hysteresis itself: the models of the core have them.
        EffectId::RateDependence | EffectId::Asymmetry | EffectId::AmplitudeGain | EffectId::HysteresisShape => {
            [None, None]
        }
    }
}

/// Steps between -1 and 1 summed up, within a range.
fn walk(steps: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let mut at = 0.5 * (low + high);
    let size = 0.05 * (high - low);
    steps
        .iter()
        .map(|step| {
            at = (at + size * step).clamp(low, high);
            at
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// For every effect, at any physical values, over any record from rest: to rounding, 1e-9 of ranges of 10 to 100.
    #[test]
    fn prop_the_fitted_form_is_the_block_of_the_core(
        shares in prop::array::uniform6(0.0..=1.0f64),
        steps in prop::collection::vec(-1.0..=1.0f64, 50..400),
        phases in prop::array::uniform5(0.0..TAU),
    ) {
        let backwards: Vec<f64> = steps.iter().rev().copied().collect();
        let played = Played {
            voltage_v: walk(&steps, [0.0, 100.0]),
            position_um: walk(&steps, [0.0, 10.0]),
            temperature_c: walk(&backwards, [20.0, 21.0]),
            voltage2_v: walk(&backwards, [0.0, 100.0]),
            phases,
        };
        for id in EffectId::ALL {
            let effect = id.effect();
            let bounds = effect.bounds(&facts()).unwrap();
            let values: Vec<f64> = bounds.iter().zip(shares).map(|(b, share)| b.min + share * (b.max - b.min)).collect();
            let own: &[f64] = if effect.adds_line_spectrum() { &phases } else { &[] };
            let signals = Signals {
                period_s: PERIOD_S,
                run_in: 0,
                rested: true,
                // In the middle of its play.
                fraction: 0.5,
                at_stack_v: &played.voltage_v,
                temperature_c: Some(&played.temperature_c),
                voltage2_v: Some(&played.voltage2_v),
                own,
            };
            let (mut voltage_v, mut position_um) = (played.voltage_v.clone(), played.position_um.clone());
            effect.on_voltage(&values, &signals, &mut voltage_v);
            effect.on_position(&values, &signals, &mut position_um);
            for (found, wanted) in [voltage_v, position_um].iter().zip(by_the_core(id, &values, &played)) {
                for (k, (found, wanted)) in found.iter().zip(wanted.iter().flatten()).enumerate() {
                    prop_assert!((found - wanted).abs() < 1e-9, "{id} at {values:?}, sample {k}: {found} {wanted}");
                }
            }
        }
    }
}
