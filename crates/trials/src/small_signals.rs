//! Bandwidths and noise on a real board, by signals so small that hysteresis hardly shows.

use crate::error::TrialError;
use crate::on_board::{Looped, no_fault};
use crate::programme::{HARMONICS, TICKS_A_POINT, small_multisine};
use hysteron_board::upload::Upload;
use hysteron_board::{Hello, Mode, TABLE_POINTS};
use hysteron_control::response::{Response, line_response};

/// Small signals about the middle of what is followed.
pub(crate) struct Small<'a> {
    looped: &'a Looped<'a>,
    middle_um: f64,
    swing_um: f64,
    rate_hz: f64,
}

/// Swing of the small multisine either way, as a share of the range: what the board takes for an oscillation is several times as much.
const SMALL: f64 = 0.01;
/// Time before it and the rest are judged, seconds: ramp and ringing are over and fast creep stands.
const STANDS_S: f64 = 0.5;
/// Periods of the multisine that are judged.
const PERIODS: usize = 16;
/// Seed of its phases.
const PHASES: u64 = 1;
/// Length of the rest that is judged, seconds.
const REST_S: f64 = 0.5;

impl<'a> Small<'a> {
    pub(crate) fn about(looped: &'a Looped<'a>, table: &Hello, [low_um, high_um]: [f64; 2]) -> Self {
        Self {
            looped,
            middle_um: 0.5 * (low_um + high_um),
            swing_um: SMALL * (high_um - low_um),
            rate_hz: f64::from(table.sample_rate_hz),
        }
    }

    /// From reference to measured position, at the multisine's own lines; empty where a gap leaves no whole periods. Adds the ticks that
    /// did not come to `lost`.
    pub(crate) fn response(&self, lost: &mut u64, progress: &dyn Fn(f64)) -> Result<Response, TrialError> {
        let period = TICKS_A_POINT as usize * TABLE_POINTS;
        let judged = PERIODS * period;
        let points = small_multisine(PHASES);
        let ticks = self.run(points, judged, lost, progress)?;
        let [reference_um, measured_um]: [Vec<f64>; 2] =
            [0, 1].map(|column| ticks.iter().map(|tick| tick[column]).collect());
        let all = line_response(&reference_um, &measured_um, 1.0 / self.rate_hz, PERIODS);
        Ok(all.up_to(HARMONICS as f64 * self.rate_hz / period as f64))
    }

    /// Standard deviation of the measured position about a straight line in time, nanometres: the sensor's own noise with it.
    pub(crate) fn noise_nm(&self, lost: &mut u64, progress: &dyn Fn(f64)) -> Result<Option<f64>, TrialError> {
        let judged = (REST_S * self.rate_hz) as usize;
        let ticks = self.run([1 << 15; TABLE_POINTS], judged, lost, progress)?;
        let n = ticks.len() as f64;
        let time = |k: usize| (k as f64 + 0.5) / n - 0.5;
        let mean = ticks.iter().map(|tick| tick[1]).sum::<f64>() / n;
        let slope: f64 = (0..).zip(&ticks).map(|(k, tick)| time(k) * tick[1]).sum::<f64>() * 12.0 / n;
        let squares: f64 = (0..)
            .zip(&ticks)
            .map(|(k, tick)| (tick[1] - mean - slope * time(k)).powi(2))
            .sum();
        Ok((!ticks.is_empty()).then(|| 1e3 * (squares / n).sqrt()))
    }

    /// Plays points; reference and measured position of the last `judged` ticks, none where one of them is lost.
    fn run(
        &self,
        points: [u16; TABLE_POINTS],
        judged: usize,
        lost: &mut u64,
        progress: &dyn Fn(f64),
    ) -> Result<Vec<[f64; 2]>, TrialError> {
        let range_um = [self.middle_um - self.swing_um, self.middle_um + self.swing_um];
        let frequency_hz = self.rate_hz / f64::from(TICKS_A_POINT * TABLE_POINTS as u32);
        let seconds = STANDS_S + judged as f64 / self.rate_hz;
        let points = Upload::new(range_um, points);
        let captured = self.looped.along(points, frequency_hz, seconds, progress)?;
        no_fault(&captured, "small signals")?;
        *lost += captured.counts.lost;
        let Some(recording) = captured.pieces.last().map(|piece| &piece.recording) else {
            return Ok(Vec::new());
        };
        let rows = recording.frames.iter().zip(&recording.position_um);
        let running = rows.filter(|(frame, _)| frame.mode() == Mode::Running);
        let ticks: Vec<[f64; 2]> = running.map(|(frame, &y)| [f64::from(frame.reference_um), y]).collect();
        let first = ticks.len().checked_sub(judged);
        Ok(first.map_or_else(Vec::new, |first| ticks[first..].to_vec()))
    }
}
