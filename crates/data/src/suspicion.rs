//! What looks wrong about a record, though it can be read: the errors that laboratories make, said before a model is
//! fitted to them.

use std::fmt;

use crate::place::brief;
use crate::record::Record;

/// Something that looks wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Suspicion {
    /// The position stays the same while the voltage moves.
    Stuck {
        /// How far the voltage moves, volts.
        voltage_v: f64,
    },
    /// The position stays at an end of its range while the voltage moves on.
    Clipped {
        /// The end, micrometres.
        position_um: f64,
        /// Samples at it.
        samples: usize,
        /// Whether it is the highest.
        highest: bool,
    },
    /// The stroke is none that a piezo stage has.
    Stroke {
        /// The stroke, micrometres.
        stroke_um: f64,
    },
    /// The voltage moves by less than any amplifier is used for.
    Drive {
        /// How far it moves, volts.
        voltage_v: f64,
    },
    /// The loops run the wrong way round.
    Leads,
    /// A column changes every n-th sample only.
    Held {
        /// Whether it is the position, else the voltage.
        position: bool,
        /// Samples from change to change.
        every: usize,
    },
}

/// Strokes of piezo stages, micrometres: from a nanometre to the millimetres of the longest lever designs.
const STROKES_UM: std::ops::Range<f64> = 1e-3..3e3;

/// A voltage that moves no stage by what a sensor sees: a tenth of a nanometre at 100 nm/V.
const LEAST_DRIVE_V: f64 = 1e-3;

/// Samples at an end that are believed to be a sensor's, not a turning point's.
const LEAST_CLIPPED: usize = 20;

/// How many times more samples are at an end than in the band beside it, where the sensor ends there. A sine has fewer at
/// its end than beside it.
const CLIPPED_TIMES: usize = 3;

/// Part of the range by which voltages must turn to be a reversal.
const REVERSAL: f64 = 0.1;

/// Reversals that make loops, and samples that one must have so that no delay or resonance turns it round.
const LEAST_REVERSALS: usize = 4;
const SAMPLES_A_LOOP: usize = 100;

/// Area of a loop that is seen, in parts of its frame: a stage's are 0.05 to 0.15 of it.
const LEAST_AREA: f64 = 0.01;

/// Changes that a rhythm needs, and the part of them that keeps it.
const LEAST_CHANGES: usize = 20;
const IN_RHYTHM: f64 = 0.95;

/// The longest rhythm that is looked for.
const MOST_HELD: usize = 64;

impl fmt::Display for Suspicion {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Suspicion::Stuck { voltage_v } => write!(
                out,
                "the position does not move while the voltage moves by {} V: is the sensor connected, is this its column?",
                brief(voltage_v)
            ),
            Suspicion::Clipped {
                position_um,
                samples,
                highest,
            } => {
                let end = if highest { "highest" } else { "lowest" };
                write!(
                    out,
                    "the position stays at its {end}, {} µm, for {samples} samples while the voltage moves: the sensor's \
                     range may end there",
                    brief(position_um)
                )
            }
            Suspicion::Stroke { stroke_um } => {
                let why = if stroke_um < STROKES_UM.start {
                    "is the unit m or mm, taken for µm?"
                } else {
                    "is the unit nm, taken for µm?"
                };
                write!(out, "the position moves by {} µm in all: {why}", brief(stroke_um))
            }
            Suspicion::Drive { voltage_v } => write!(
                out,
                "the voltage moves by {} V in all: is it in kV, or a monitor output without its gain?",
                brief(voltage_v)
            ),
            Suspicion::Leads => out.write_str(
                "the position is ahead of the voltage: the columns may be swapped, or the voltage be recorded late",
            ),
            Suspicion::Held { position, every } => {
                let column = if position { "position" } else { "voltage" };
                write!(
                    out,
                    "the {column} changes every {every} samples only: it was sampled more slowly than recorded"
                )
            }
        }
    }
}

/// What looks wrong about a record.
///
/// # Cost
/// A few passes.
pub fn suspicions(record: &Record) -> Vec<Suspicion> {
    let (u, y) = (&record.voltage_v, &record.position_um);
    let ([u_low, u_high], [y_low, y_high]) = (range(u), range(y));
    let (drive, stroke) = (u_high - u_low, y_high - y_low);
    if drive <= 0.0 {
        return Vec::new(); // a rest
    }
    if drive < LEAST_DRIVE_V {
        return vec![Suspicion::Drive { voltage_v: drive }];
    }
    if stroke <= 0.0 {
        return vec![Suspicion::Stuck { voltage_v: drive }];
    }
    let mut found = Vec::new();
    if !STROKES_UM.contains(&stroke) {
        found.push(Suspicion::Stroke { stroke_um: stroke });
    }
    for (end, highest) in [(y_high, true), (y_low, false)] {
        let samples = record.stuck_at(end);
        if samples >= LEAST_CLIPPED && samples >= CLIPPED_TIMES * beside(y, end, stroke) {
            found.push(Suspicion::Clipped {
                position_um: end,
                samples,
                highest,
            });
        }
    }
    if leads(u, y, drive, stroke) {
        found.push(Suspicion::Leads);
    }
    for (column, position) in [(y, true), (u, false)] {
        if let Some(every) = held(column) {
            found.push(Suspicion::Held { position, every });
        }
    }
    found
}

fn range(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| {
            [low.min(value), high.max(value)]
        })
}

/// Samples beside an end, in a hundredth of the range or the three steps of a coarse converter that are next to it.
fn beside(y: &[f64], end: f64, stroke: f64) -> usize {
    let step = y
        .iter()
        .map(|value| (value - end).abs())
        .filter(|off| *off > 0.0)
        .fold(f64::INFINITY, f64::min);
    let band = (0.01 * stroke).max(3.0 * step) * (1.0 + 1e-9);
    y.iter()
        .filter(|&&value| value != end && (value - end).abs() <= band)
        .count()
}

/// Whether the loops run round as those of a position that is ahead; where the position falls with the voltage, the other way round.
fn leads(u: &[f64], y: &[f64], drive: f64, stroke: f64) -> bool {
    let reversals = reversals(u, REVERSAL * drive);
    if reversals < LEAST_REVERSALS || u.len() < SAMPLES_A_LOOP * reversals / 2 {
        return false;
    }
    // twice the area of the path, closed by its last step; counted from the first sample so that offsets cancel
    let twice: f64 = (0..u.len())
        .map(|k| {
            let next = (k + 1) % u.len();
            (u[k] - u[0]) * (y[next] - y[0]) - (u[next] - u[0]) * (y[k] - y[0])
        })
        .sum();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (u_mean, y_mean) = (mean(u), mean(y));
    let along: f64 = u.iter().zip(y).map(|(u, y)| (u - u_mean) * (y - y_mean)).sum();
    along.signum() * twice / 2.0 < -LEAST_AREA * drive * stroke * (reversals / 2) as f64
}

/// How often a column turns round by more than so much.
fn reversals(values: &[f64], least: f64) -> usize {
    let (mut count, mut rising, mut extreme) = (0, None, values[0]);
    for &value in values {
        let further = match rising {
            Some(true) => value > extreme,
            Some(false) => value < extreme,
            None => false,
        };
        if further {
            extreme = value;
        } else if (value - extreme).abs() > least {
            count += usize::from(rising.is_some());
            rising = Some(value > extreme);
            extreme = value;
        }
    }
    count
}

/// From how many samples to how many a column changes, if that is more than one and nearly always the same.
fn held(values: &[f64]) -> Option<usize> {
    let changes: Vec<usize> = (1..values.len()).filter(|&k| values[k] != values[k - 1]).collect();
    if changes.len() < LEAST_CHANGES {
        return None;
    }
    let mut gaps = [0usize; MOST_HELD + 1];
    for pair in changes.windows(2) {
        gaps[(pair[1] - pair[0]).min(MOST_HELD)] += 1;
    }
    let (every, count) = gaps.iter().copied().enumerate().max_by_key(|(_, count)| *count)?;
    let steady = count as f64 >= IN_RHYTHM * (changes.len() - 1) as f64;
    ((2..MOST_HELD).contains(&every) && steady).then_some(every)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Role;

    /// 5 periods of a sine and a position that lags, with noise of the last digit.
    fn record() -> Record {
        let samples = 5000;
        let phase = |k: usize| std::f64::consts::TAU * k as f64 / 1000.0;
        let noise = |k: usize| 1e-5 * ((k * 7919 % 1013) as f64 / 1013.0);
        Record {
            file: "a.csv".into(),
            role: Role::Identify,
            excitation: String::new(),
            start_s: 0.0,
            period_s: 1e-4,
            voltage_v: (0..samples).map(|k| 50.0 - 50.0 * phase(k).cos()).collect(),
            position_um: (0..samples)
                .map(|k| 5.0 - 5.0 * (phase(k) - 0.15).cos() + noise(k))
                .collect(),
            reference_um: None,
            temperature_c: None,
            voltage2_v: None,
        }
    }

    fn check(change: impl Fn(&mut Record), expect: &[Suspicion]) {
        let mut record = record();
        change(&mut record);
        assert_eq!(suspicions(&record), expect);
    }

    #[test]
    fn val_errors_of_laboratories_are_seen() {
        check(|_| {}, &[]);
        // A stage whose position falls with the voltage has its loops the other way round.
        check(|r| r.position_um.iter_mut().for_each(|y| *y = 1.0 - *y), &[]);
        check(
            |r| std::mem::swap(&mut r.voltage_v, &mut r.position_um),
            &[Suspicion::Leads],
        );
        check(|r| r.position_um.fill(2.5), &[Suspicion::Stuck { voltage_v: 100.0 }]);
        check(|r| r.voltage_v.fill(2.5), &[]);
        let mut kilovolts = record();
        kilovolts.voltage_v.iter_mut().for_each(|v| *v *= 1e-6);
        // 100 V times 1e-6, to the rounding of the product
        assert!(
            matches!(suspicions(&kilovolts).as_slice(), [Suspicion::Drive { voltage_v }] if (voltage_v - 1e-4).abs() < 1e-15)
        );
        let mut clipped = record();
        clipped.position_um.iter_mut().for_each(|y| *y = y.min(9.0));
        let found = suspicions(&clipped);
        assert!(
            matches!(
                found.as_slice(),
                [Suspicion::Clipped {
                    position_um: 9.0,
                    highest: true,
                    samples: 900..1100,
                }]
            ),
            "{found:?}"
        );
        let mut metres = record();
        metres.position_um.iter_mut().for_each(|y| *y *= 1e-6);
        assert!(matches!(suspicions(&metres).as_slice(), [Suspicion::Stroke { stroke_um }] if *stroke_um < 2e-5));
        check(
            |r| {
                for k in 0..r.len() {
                    r.position_um[k] = r.position_um[k / 4 * 4];
                }
            },
            &[Suspicion::Held {
                position: true,
                every: 4,
            }],
        );
    }

    /// A coarse converter stays on its last code at a turning point, and that is no end of its range.
    #[test]
    fn val_a_coarse_sensor_is_not_called_clipped() {
        for step_um in [0.001, 0.02, 0.1, 0.5] {
            check(
                |r| {
                    r.position_um
                        .iter_mut()
                        .for_each(|y| *y = (*y / step_um).round() * step_um)
                },
                &[],
            );
        }
    }
}
