//! Whether what came back of a campaign's commands can be used, and cut to what is.

use crate::campaign::{Command, PERIODS_KEPT};
use crate::message::{Message, Setting};
use crate::plan::Purpose;
use hysteron_data::{Record, Role};
use hysteron_identify::family::{peak_to_peak, range};

/// Share of samples at an end of the range, while the command moves, from which on a sensor or converter is at its end.
const AT_ITS_END: f64 = 0.01;

/// The small multisine must stand out of what does not repeat by this ratio of powers, 20 dB: 2 % of error a line over 2000 lines places a
/// lag to a microsecond.
const STANDS_OUT: f64 = 100.0;

/// The record of a command, cut to what it is for, from one that begins with the command's first sample; its voltages are the command's.
///
/// # Errors
/// What is wrong with the position, in a sentence, and what to do.
pub fn usable(command: &Command, record: &Record) -> Result<Record, Message> {
    let n = command.voltage_v.len();
    let part = |series: &[f64]| -> Vec<f64> { series.iter().take(n).skip(command.skip).copied().collect() };
    let cut = Record {
        file: command.file.clone(),
        role: match command.purpose {
            // It is beside the first one, and no model is fitted to both.
            Purpose::Drift => Role::Validate,
            _ => Role::Identify,
        },
        excitation: command.words.clone(),
        start_s: 0.0,
        period_s: command.period_s,
        voltage_v: command.voltage_v[command.skip..].to_vec(),
        position_um: part(&record.position_um),
        reference_um: command.reference_um.clone(),
        temperature_c: record.temperature_c.as_deref().map(part),
        voltage2_v: None,
    };
    at_its_end(&cut)?;
    if command.purpose.is_small() {
        stands_out(&cut.position_um, PERIODS_KEPT)?;
    }
    Ok(cut)
}

/// How far the position has to go at least, peak to peak, as a multiple of what it does at rest, rms: noise alone reaches ten times.
const MOVES: f64 = 30.0;

/// Whether a position that was recorded while the stage was driven can be used, beside one at rest.
///
/// # Errors
/// What is wrong with it, in a sentence, and what to do.
pub fn moved(record: &Record, at_rest: &Record) -> Result<(), Message> {
    at_its_end(record)?;
    let n = at_rest.len() as f64;
    let mean = at_rest.position_um.iter().sum::<f64>() / n;
    let noise_um = (at_rest.position_um.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n).sqrt();
    let went_um = peak_to_peak(&record.position_um);
    if went_um >= MOVES * noise_um {
        return Ok(());
    }
    Err(Message::from(format!(
        "the position goes {went_um:.4} um and is {noise_um:.4} um rms at rest; is the amplifier on, and the sensor that of this axis?"
    )))
}

fn at_its_end(record: &Record) -> Result<(), Message> {
    let (low, high) = range(record.position_um.iter().copied());
    if high <= low {
        return Err("the position stands still".into());
    }
    for end in [low, high] {
        let stuck = record.stuck_at(end);
        if stuck as f64 > AT_ITS_END * record.len() as f64 {
            let stands = format!(
                "the position stands at {end} um for {stuck} samples while the command moves; the sensor or its converter is at its \
                 end: shift its range, or take a lower "
            );
            return Err(Message::from(stands).naming(Setting::TopV));
        }
    }
    Ok(())
}

/// Whole periods, of which what they share is compared with what they do not.
fn stands_out(position_um: &[f64], periods: usize) -> Result<(), Message> {
    let n = position_um.len() / periods;
    let means: Vec<f64> = position_um
        .chunks(n)
        .map(|p| p.iter().sum::<f64>() / n as f64)
        .collect();
    let at = |period: usize, k: usize| position_um[period * n + k] - means[period];
    let (mut shared, mut scatter) = (0.0, 0.0);
    for k in 0..n {
        let mean = (0..periods).map(|p| at(p, k)).sum::<f64>() / periods as f64;
        shared += mean * mean;
        scatter += (0..periods).map(|p| (at(p, k) - mean).powi(2)).sum::<f64>() / (periods - 1) as f64;
    }
    // The mean has its share of the scatter.
    let ratio = shared / (scatter / periods as f64).max(f64::MIN_POSITIVE);
    if ratio >= STANDS_OUT {
        return Ok(());
    }
    Err(Message::from(format!(
        "the response stands out of what does not repeat by {:.0} dB, {:.0} are needed; look \
         for what disturbs the stage at rest, or choose a finer range of the sensor",
        10.0 * ratio.log10(),
        10.0 * STANDS_OUT.log10()
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_plant::preset;
    use hysteron_plant::{Stage, StageConfig};

    /// A command of a tenth of a second, and what the stage answers to it.
    fn pair() -> (Command, Record) {
        let period_s = 20e-6;
        let voltage_v: Vec<f64> = (0..5000)
            .map(|k| 60.0 * (1.0 - (std::f64::consts::TAU * 40.0 * f64::from(k) * period_s).cos()))
            .collect();
        let stage: StageConfig = preset::tracking_8k();
        let run = Stage::new(&stage, 3).unwrap().run(&voltage_v, period_s).unwrap();
        let command = Command {
            file: "large.csv".to_owned(),
            words: "sine".to_owned(),
            purpose: Purpose::LargeSignals,
            period_s,
            voltage_v: voltage_v.clone(),
            skip: 0,
            reference_um: None,
            seed: 0,
        };
        let record = Record::new("large.csv", Role::Identify, period_s, voltage_v, run.position_um);
        (command, record)
    }

    #[test]
    fn val_a_record_of_its_command_is_taken_and_what_is_around_it_left_out() {
        let (mut command, mut record) = pair();
        record.voltage_v.iter_mut().for_each(|v| *v *= 1.005);
        record.voltage_v.extend([0.0; 300]);
        record.position_um.extend([0.0; 300]);
        command.skip = 100;
        let taken = usable(&command, &record).unwrap();
        assert_eq!(taken.voltage_v, command.voltage_v[100..]);
        assert_eq!(taken.position_um, record.position_um[100..5000]);
        assert_eq!(taken.role, Role::Identify);
    }

    #[test]
    fn refuse_positions_that_are_of_no_use() {
        for (said, change) in [
            ("the position stands still", (|y| *y = 1.0) as fn(&mut f64)),
            ("stands at 8 um for", |y| *y = y.min(8.0)),
        ] {
            let (command, mut record) = pair();
            record.position_um.iter_mut().for_each(change);
            let reason = usable(&command, &record).unwrap_err();
            assert!(reason.to_string().contains(said), "{said}: {reason}");
        }
    }

    /// Beside 0.3 um peak to peak of noise at rest: one that moves twenty micrometres, one that does not move, one that is clipped.
    #[test]
    fn refuse_a_position_that_does_not_move_or_is_clipped() {
        let (_, driven) = pair();
        let noise = |k: usize| 0.3 * (((k * 7919 + k * k % 104_729) % 1000) as f64 / 1000.0 - 0.5);
        let at_rest = Record {
            position_um: (0..5000).map(noise).collect(),
            ..driven.clone()
        };
        assert_eq!(moved(&driven, &at_rest), Ok(()));
        let still = moved(&at_rest, &at_rest).unwrap_err();
        assert!(still.to_string().contains("is the amplifier on"), "{still}");
        let clipped = Record {
            position_um: driven.position_um.iter().map(|y| y.min(8.0)).collect(),
            ..driven
        };
        let clipped = moved(&clipped, &at_rest).unwrap_err();
        assert!(clipped.to_string().contains("stands at 8 um for"), "{clipped}");
    }

    #[test]
    fn refuse_a_small_multisine_in_noise() {
        let (mut command, mut record) = pair();
        // Eight periods of 500 samples behind 1000 that are left out.
        command.skip = 1000;
        command.purpose = Purpose::SmallSignals;
        let noise = |k: usize| ((k * 7919 + k * k % 104_729) % 1000) as f64 / 1000.0 - 0.5;
        let periodic = |k: usize| 0.02 * (std::f64::consts::TAU * k as f64 / 500.0).sin();
        record.position_um = (0..5000).map(|k| periodic(k) + 0.001 * noise(k)).collect();
        assert!(usable(&command, &record).is_ok());
        record.position_um = (0..5000).map(|k| periodic(k) + 0.2 * noise(k)).collect();
        let reasons = usable(&command, &record).unwrap_err();
        assert!(reasons.to_string().contains("20 are needed"), "{reasons}");
    }
}
