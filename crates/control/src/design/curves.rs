//! The loop over frequency: what a picture of its margins shows.

use super::Controller;
use super::feedback::{GAIN_FACTORS, MODE_FACTORS, around};
use hysteron_identify::SmallSignalResponse;
use hysteron_identify::control::ControlModel;
use realfft::num_complex::Complex64;
use serde::Serialize;
use std::f64::consts::TAU;

/// Points of a curve.
const POINTS: usize = 400;
/// Its lowest frequency, hertz.
const FROM_HZ: f64 = 1.0;
/// Its highest, as a share of half the rate, where the loop ends.
const TO_SHARE: f64 = 0.98;

/// A loop over frequency.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopCurves {
    /// Frequency, hertz.
    pub frequency_hz: Vec<f64>,
    /// Size of the loop's gain.
    pub gain: Vec<f64>,
    /// Its phase, degrees, without jumps.
    pub phase_deg: Vec<f64>,
    /// What is left of a disturbance.
    pub sensitivity: Vec<f64>,
    /// The most that is left over modes +-10 % and loop gain 0.6 to 1.3.
    pub worst_sensitivity: Vec<f64>,
    /// How far it stays from swinging.
    pub margins: Margins,
}

/// How far a loop stays from swinging, each with the frequency where it is so, hertz; none where the curves do not go as far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Margins {
    /// The least phase above -180 degrees, of those where the gain crosses 1; degrees.
    pub phase_deg: Option<(f64, f64)>,
    /// By what factor the gain may grow where the phase crosses -180 degrees, the least of them; dB.
    pub gain_db: Option<(f64, f64)>,
    /// The largest sensitivity.
    pub sensitivity: Option<(f64, f64)>,
}

impl Margins {
    /// Of a loop at rising frequencies, its phase without jumps. Between two frequencies the logarithm of the gain and the phase run straight
    /// over the logarithm of the frequency.
    ///
    /// # Reference
    /// Astrom, Murray, Feedback Systems (Princeton 2008), section 9.3.
    fn of(frequency_hz: &[f64], around: &[Complex64]) -> Self {
        let log_gain: Vec<f64> = around.iter().map(|once| once.norm().ln()).collect();
        let phase = unwrapped(around);
        let between = |k: usize, share: f64, of: &dyn Fn(usize) -> f64| of(k) + share * (of(k + 1) - of(k));
        let hz = |k: usize, share: f64| between(k, share, &|k| frequency_hz[k].ln()).exp();
        let crossings = |of: &dyn Fn(usize) -> f64| -> Vec<(usize, f64)> {
            let each = (0..around.len().saturating_sub(1)).map(|k| (k, of(k), of(k + 1)));
            each.filter(|(_, a, b)| a * b <= 0.0 && a != b)
                .map(|(k, a, b)| (k, a / (a - b)))
                .collect()
        };
        let least = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0);
        let phases = crossings(&|k| log_gain[k]).into_iter().map(|(k, share)| {
            // The nearest odd number of half turns.
            let above = between(k, share, &|k| phase[k]).rem_euclid(360.0) - 180.0;
            (above.abs(), hz(k, share))
        });
        let turns = phase.iter().map(|phase| ((phase + 180.0) / 360.0).floor());
        let (lowest, highest) = turns.fold((0.0_f64, 0.0_f64), |(low, high), turn| (low.min(turn), high.max(turn)));
        let gains = (lowest as i32 - 1..=highest as i32 + 1).flat_map(|turn| {
            let critical = 360.0 * f64::from(turn) - 180.0;
            crossings(&|k| phase[k] - critical).into_iter().map(|(k, share)| {
                let gain = between(k, share, &|k| log_gain[k]);
                (-20.0 * gain / std::f64::consts::LN_10, hz(k, share))
            })
        });
        // A crossing with a gain above 1 is one of a loop that turns about the point: how far it may fall is another question.
        let gains = gains.filter(|(db, _)| *db > 0.0);
        let left = around.iter().zip(frequency_hz).map(|(once, hz)| (left(*once), *hz));
        Self {
            phase_deg: phases.min_by(least),
            gain_db: gains.min_by(least),
            sensitivity: left.max_by(least),
        }
    }
}

/// A loop through what the stage answers to small signals, in place of its model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasuredLoop {
    /// The lines that are known well enough, hertz.
    pub frequency_hz: Vec<f64>,
    /// Size of the loop's gain.
    pub gain: Vec<f64>,
    /// Its phase, degrees, without jumps.
    pub phase_deg: Vec<f64>,
    /// What is left of a disturbance.
    pub sensitivity: Vec<f64>,
    /// How far it stays from swinging, as far as it is known.
    pub margins: Margins,
}

/// A line of a response is known where its standard deviation is at most this share of its size.
const KNOWN: f64 = 0.2;

impl MeasuredLoop {
    /// Of a controller at the stage that answered so; none without feedback, or where fewer than two lines below half the rate are known.
    pub fn of(controller: &Controller, found: &SmallSignalResponse) -> Option<Self> {
        let (design, model) = (controller.feedback.as_ref()?, &controller.model);
        let to_hz = TO_SHARE * 0.5 / model.sample_period_s;
        let lines = found.frequency_hz.iter().zip(&found.deviation);
        let known = lines.zip(found.measured.iter().zip(&found.modelled));
        let known = known.filter(|((hz, deviation), _)| (0.0..to_hz).contains(*hz) && **deviation <= KNOWN);
        // The model's part stands at the gain of the small signals, the loop's at the mean one.
        let each = known.map(|((hz, _), (measured, modelled))| {
            let once = around(model, design, TAU * hz) * (measured / modelled) * found.gain;
            (*hz, once)
        });
        let (frequency_hz, around): (Vec<f64>, Vec<Complex64>) = each.filter(|(_, once)| once.is_finite()).unzip();
        let first = *frequency_hz.first()?;
        (around.len() > 1).then(|| Self {
            gain: around.iter().map(|once| once.norm()).collect(),
            phase_deg: {
                // Which turn the first line is in, the model says.
                let below = (0..POINTS).map(|k| FROM_HZ * (first / FROM_HZ).powf(k as f64 / (POINTS - 1) as f64));
                let below = below.map(|hz| super::feedback::around(model, design, TAU * hz));
                let whole: Vec<Complex64> = below.chain(around.iter().copied()).collect();
                unwrapped(&whole).split_off(POINTS)
            },
            sensitivity: around.iter().map(|once| left(*once)).collect(),
            margins: Margins::of(&frequency_hz, &around),
            frequency_hz,
        })
    }
}

impl LoopCurves {
    /// Of a controller; none without feedback.
    pub fn of(controller: &Controller) -> Option<Self> {
        let (design, model) = (controller.feedback.as_ref()?, &controller.model);
        let to_hz = TO_SHARE * 0.5 / model.sample_period_s;
        let at = |k: usize| FROM_HZ * (to_hz / FROM_HZ).powf(k as f64 / (POINTS - 1) as f64);
        let frequency_hz: Vec<f64> = (0..POINTS).map(at).collect();
        let over = |model: &ControlModel| -> Vec<Complex64> {
            frequency_hz.iter().map(|hz| around(model, design, TAU * hz)).collect()
        };
        let nominal = over(model);
        let mut worst_sensitivity = vec![0.0; POINTS];
        for factor in MODE_FACTORS {
            let mut changed = model.clone();
            for mode in &mut changed.linear.modes {
                mode.frequency_hz *= factor;
            }
            for (worst, once) in worst_sensitivity.iter_mut().zip(over(&changed)) {
                *worst = GAIN_FACTORS.iter().map(|gain| left(gain * once)).fold(*worst, f64::max);
            }
        }
        Some(Self {
            gain: nominal.iter().map(|once| once.norm()).collect(),
            phase_deg: unwrapped(&nominal),
            sensitivity: nominal.iter().map(|once| left(*once)).collect(),
            worst_sensitivity,
            margins: Margins::of(&frequency_hz, &nominal),
            frequency_hz,
        })
    }
}

/// Share of a disturbance that is left.
fn left(around: Complex64) -> f64 {
    1.0 / (1.0 + around).norm()
}

/// Phases, each within half a turn of the one before.
fn unwrapped(responses: &[Complex64]) -> Vec<f64> {
    let mut before = Complex64::new(1.0, 0.0);
    let mut phase = 0.0;
    responses
        .iter()
        .map(|now| {
            phase += (now / before).arg();
            before = *now;
            phase.to_degrees()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::feedback::FeedbackDesign;
    use crate::design::{FORMAT, ReferenceKind};

    /// Off by default; asked for, the law has it, and the file says so.
    #[test]
    fn val_adaptation_is_off_until_it_is_asked_for() {
        let plain = Controller::design(&crate::design::stands::tests::rigid(), ReferenceKind::Previewed).unwrap();
        assert_eq!(plain.adaptation, None);
        assert!(!plain.to_toml().unwrap().contains("adaptation"));
        let adapting = plain.adapting(0.05);
        let part = adapting.adaptation.clone().unwrap().numbers();
        // A twentieth of the stroke of 20 um.
        assert!(
            part.gain_bound == 0.05 && (part.zero_bound_um - 1.0).abs() < 1e-9,
            "{part:?}"
        );
        assert!(adapting.to_toml().unwrap().contains("gain_bound = 0.05"));
        let asked = crate::design::source::Wishes {
            adapt_percent: Some(50.0),
            ..crate::design::source::Wishes::default()
        };
        assert!(
            asked
                .check()
                .unwrap_err()
                .to_string()
                .starts_with("`adapt_percent` 50: 0.01 to 20 percent")
        );
    }

    /// An integral that crosses 1 after one latency, on a stage of 0.1 um/V.
    fn integral(model: ControlModel) -> Controller {
        let through = [1.0, 0.0, 0.0, 0.0, 0.0];
        Controller {
            format: FORMAT,
            reference: ReferenceKind::Live,
            samples_ahead: 0,
            preview: Vec::new(),
            feedback: Some(FeedbackDesign {
                structure: "integral".to_owned(),
                integral_v_per_um_s: 1.0 / model.latency_s / 0.1,
                series: [through; 2],
                damping: [0.0; 5],
                peak_sensitivity: 2.0,
                rejection_hz: 100.0,
                helps_to_hz: 150.0,
                told_to_hz: 1000.0,
                noise_nm: 0.1,
            }),
            open_loop: None,
            adaptation: None,
            model,
        }
    }

    /// `K / (s (1 + s / p)^2)`: the phase is -180 degrees at p, where the gain is K / 2p; it crosses 1 where `w (1 + (w / p)^2) = K`.
    #[test]
    fn val_margins_of_a_loop_in_closed_form() {
        let (k, p) = (0.5, 1.0);
        let once = |w: f64| {
            let s = Complex64::new(0.0, w);
            k / (s * (1.0 + s / p) * (1.0 + s / p))
        };
        let hz: Vec<f64> = (0..4000)
            .map(|i| 0.01 * 1000.0_f64.powf(f64::from(i) / 3999.0) / TAU)
            .collect();
        let around: Vec<Complex64> = hz.iter().map(|hz| once(TAU * hz)).collect();
        let margins = Margins::of(&hz, &around);
        let near = |found: Option<(f64, f64)>, wanted: (f64, f64)| {
            let (value, at) = found.unwrap();
            assert!(
                (value - wanted.0).abs() < 1e-3 * wanted.0 && (at - wanted.1).abs() < 1e-3 * wanted.1,
                "{found:?} {wanted:?}"
            );
        };
        near(margins.gain_db, (20.0 * (2.0 * p / k).log10(), p / TAU));
        // w (1 + w^2) = 0.5.
        let mut crossing = 0.4_f64;
        for _ in 0..50 {
            crossing -= (crossing * (1.0 + crossing * crossing) - k) / (1.0 + 3.0 * crossing * crossing);
        }
        let phase = 90.0 - 2.0 * crossing.atan().to_degrees();
        near(margins.phase_deg, (phase, crossing / TAU));
        // Where the curves end before the gain or the phase crosses, nothing is said of it.
        let low = Margins::of(&hz[..1000], &around[..1000]);
        assert_eq!((low.phase_deg, low.gain_db), (None, None));
        // A gain three times as large leaves a third of the margin; one five times as large none.
        let times = |factor: f64| around.iter().map(|once| factor * once).collect::<Vec<_>>();
        near(
            Margins::of(&hz, &times(3.0)).gain_db,
            (20.0 * (2.0 * p / k / 3.0).log10(), p / TAU),
        );
        assert_eq!(Margins::of(&hz, &times(5.0)).gain_db, None);
    }

    /// A stage that answers as its model does, at a smaller gain, has the loop of the model at that gain; lines that are not known are left out.
    #[test]
    fn val_a_loop_through_the_measured_response() {
        let mut model = crate::design::stands::tests::rigid();
        model.latency_s = 100e-6;
        let controller = integral(model);
        let design = controller.feedback.as_ref().unwrap();
        let hz = vec![10.0, 100.0, 1000.0, 2000.0];
        let of_stage = Complex64::from_polar(0.05, -0.4);
        let found = SmallSignalResponse {
            record: "small".to_owned(),
            measured: vec![of_stage; 4],
            modelled: vec![of_stage; 4],
            deviation: vec![0.01, 0.01, 0.01, 0.5],
            gain: 0.7,
            told_to_hz: None,
            frequency_hz: hz.clone(),
        };
        let measured = MeasuredLoop::of(&controller, &found).unwrap();
        assert_eq!(measured.frequency_hz, hz[..3]);
        for (k, hz) in hz[..3].iter().enumerate() {
            let wanted = 0.7 * around(&controller.model, design, TAU * hz);
            assert!((measured.gain[k] / wanted.norm() - 1.0).abs() < 1e-12);
            assert!((measured.sensitivity[k] / left(wanted) - 1.0).abs() < 1e-12);
        }
        let unknown = SmallSignalResponse {
            deviation: vec![0.5; 4],
            ..found
        };
        assert_eq!(MeasuredLoop::of(&controller, &unknown), None);
    }

    /// An integral behind a latency: `|L| = K / w`, its phase `-90 degrees - w T`, and `1 / |1 + g L|` is what is left. The sum of samples
    /// leads the integral by half of one.
    #[test]
    fn val_an_integral_behind_a_latency_has_the_curves_of_its_closed_form() {
        let mut model = crate::design::stands::tests::rigid();
        model.latency_s = 500e-6;
        let per_s = 1.0 / model.latency_s;
        let mut controller = integral(model);
        let feedback = controller.feedback.take();
        assert_eq!(LoopCurves::of(&controller), None);
        controller.feedback = feedback;
        let curves = LoopCurves::of(&controller).unwrap();
        let lag_s = controller.model.latency_s - 0.5 * controller.model.sample_period_s;
        for (k, hz) in curves.frequency_hz.iter().enumerate() {
            let omega = TAU * hz;
            let lag = std::f64::consts::FRAC_PI_2 + omega * lag_s;
            let once = |gain: f64| Complex64::from_polar(gain * per_s / omega, -lag);
            let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 1e-9;
            assert!(
                near(curves.gain[k], once(1.0).norm()),
                "{hz} Hz: gain {}",
                curves.gain[k]
            );
            assert!(
                near(curves.phase_deg[k], -lag.to_degrees()),
                "{hz} Hz: phase {}",
                curves.phase_deg[k]
            );
            let worst = GAIN_FACTORS.map(|gain| left(once(gain)));
            let worst = worst.into_iter().fold(0.0, f64::max);
            let found = [curves.sensitivity[k], curves.worst_sensitivity[k]];
            assert!(
                near(found[0], left(once(1.0))) && near(found[1], worst),
                "{hz} Hz: {found:?}"
            );
        }
    }
}
