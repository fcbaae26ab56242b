//! The rows of a record of the board's telemetry: what stands beside a reading, the command having been held for a sample.

use crate::chip::RATE_HZ;
use crate::programme::Piece;
use hysteron_board::Player;
use hysteron_data::Record;

/// What the readings show of the converter's staircase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Hold {
    /// The stage follows within a sample: a reading answers the command that was held until then, as if that had come in a straight
    /// line to the instant of the reading.
    Followed,
    /// The stage is slower: a reading answers a straight line from command to command that is half a sample late, whose voltage
    /// then is midway between the command so far and the next one.
    Smoothed,
}

impl Hold {
    /// Followed where the steps of the readings go best with those of the command before them, better than with the one after and
    /// the one before that; steps, so that hum and creep do not matter.
    pub(super) fn of(multisine: &Kept) -> Self {
        let moved = multisine.position_um.windows(2).map(|pair| pair[1] - pair[0]);
        let alike = |late: usize| {
            let steps = multisine.held_v.windows(2).map(|pair| pair[1][late] - pair[0][late]);
            correlation(steps, moved.clone())
        };
        if alike(1) > alike(0) && alike(1) > alike(2) {
            Self::Followed
        } else {
            Self::Smoothed
        }
    }
}

/// Pearson's correlation.
fn correlation(a: impl Iterator<Item = f64> + Clone, b: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = a.clone().count().max(1) as f64;
    let (mean_a, mean_b) = (a.clone().sum::<f64>() / n, b.clone().sum::<f64>() / n);
    let pairs = a.zip(b).map(|(a, b)| (a - mean_a, b - mean_b));
    let [aa, bb, ab] = pairs.fold([0.0; 3], |[aa, bb, ab], (a, b)| [aa + a * a, bb + b * b, ab + a * b]);
    ab / (aa * bb).sqrt().max(f64::MIN_POSITIVE)
}

/// The rows of a record.
pub(super) struct Kept {
    /// The command that the board gives at each reading, and those of the two ticks before, volts.
    held_v: Vec<[f64; 3]>,
    /// The same of the other axis.
    held2_v: Vec<[f64; 3]>,
    position_um: Vec<f64>,
}

impl Kept {
    pub(super) fn of(piece: &Piece, player: &Player) -> Self {
        let from = player.ticks_before() as usize;
        let begun = player.begun().unwrap_or(from).max(from);
        let to = (begun + (piece.kept_s * RATE_HZ).round() as usize).min(player.played.len());
        let ticks = &player.played;
        let rows = || (from..to).step_by(piece.every);
        let held = |k: usize| [k, k.saturating_sub(1), k.saturating_sub(2)].map(|k| &ticks[k]);
        Self {
            held_v: rows().map(|k| held(k).map(|tick| tick.voltage_v)).collect(),
            held2_v: rows().map(|k| held(k).map(|tick| tick.voltage2_v)).collect(),
            position_um: rows().map(|k| ticks[k].position_um).collect(),
        }
    }

    /// `both`: with the other axis' voltage.
    pub(super) fn record(&self, piece: &Piece, hold: Hold, both: bool) -> Record {
        let straight = |[now, before, _]: &[f64; 3]| match hold {
            Hold::Followed => *before,
            Hold::Smoothed => 0.5 * (now + before),
        };
        Record {
            file: format!("{}.csv", piece.name),
            role: piece.role,
            excitation: piece.words(),
            start_s: 0.0,
            period_s: piece.every as f64 / RATE_HZ,
            voltage_v: self.held_v.iter().map(straight).collect(),
            position_um: self.position_um.clone(),
            reference_um: None,
            temperature_c: None,
            voltage2_v: both.then(|| self.held2_v.iter().map(straight).collect()),
        }
    }
}
