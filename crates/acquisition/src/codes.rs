//! Steps of the converters: how coarse, and which are never read.

use crate::plain::{figure, line, names};
use crate::report::{Channel, Finding, Kind, Quantity, Resolution, Unit};
use crate::resolution::code_width;
use crate::span;
use hysteron_data::Record;

/// Steps over the range below which they are coarse: their rounding is 0.05 % of the stroke there.
const COARSE: f64 = 580.0;

/// The steps of a column over all records: the finest that shows, and the largest range over it.
pub(crate) fn resolution<'a>(columns: impl Iterator<Item = &'a [f64]>) -> Resolution {
    let (mut step, mut bits) = (0.0, None);
    let (mut moving, mut stepped) = (0, 0);
    for values in columns {
        moving += usize::from(span(values) > 0.0);
        let own = code_width(values);
        if own > 0.0 {
            stepped += 1;
            let own_bits = (span(values) / own).log2();
            if bits.is_none_or(|bits| own_bits > bits) {
                (step, bits) = (own, Some(own_bits));
            }
        }
    }
    // A converter's steps are in most columns; in one they are a command's own.
    if 2 * stepped <= moving {
        return Resolution { step: 0.0, bits: None };
    }
    Resolution { step, bits }
}

/// Bits below which the values are those of a command that jumps between a few levels.
const FEW_LEVELS: f64 = 4.0;

/// Coarse steps of either column.
pub(crate) fn coarse(resolution: Resolution, channel: Channel) -> Option<Finding> {
    let bits = resolution
        .bits
        .filter(|bits| *bits < COARSE.log2() && *bits > FEW_LEVELS)?;
    Some(Finding {
        kind: Kind::CoarseCodes,
        channel: Some(channel),
        records: Vec::new(),
        figure: figure(bits, Unit::Bit, Quantity::EffectiveBits),
    })
}

/// Readings that are expected in a gap before it counts: by chance it stays empty once in 10^10.
const EXPECTED: f64 = 25.0;
/// Times that a gap is passed, slowly.
const PASSED: usize = 4;

/// Gaps between the codes of a record that it passes slowly and never reads.
fn gaps(record: &Record) -> usize {
    let (v, y) = (&record.voltage_v, &record.position_um);
    let step = code_width(y);
    let Some(line) = line(record).filter(|_| step > 0.0) else {
        return 0;
    };
    let mut sorted = y.clone();
    sorted.sort_by(f64::total_cmp);
    let mut missing = 0;
    for (at, pair) in sorted.windows(2).enumerate() {
        let gap = pair[1] - pair[0];
        if gap < 1.5 * step {
            continue;
        }
        // As many readings as lie within the gap's width on its emptier side.
        let below = at + 1 - sorted.partition_point(|&y| y < pair[0] - gap);
        let above = sorted.partition_point(|&y| y <= pair[1] + gap) - at - 1;
        let expected = below.min(above) as f64 * (gap - step) / (gap + step);
        if expected < EXPECTED {
            continue;
        }
        let passes = (6..y.len() - 1).filter(|&k| {
            let over = (y[k - 1] <= pair[0]) != (y[k] <= pair[0]);
            // A position that is fast there jumps over whole codes.
            let slow = (y[k - 1] - y[k - 2]).abs().max((y[k + 1] - y[k]).abs()) < 0.5 * gap;
            // The voltage must not have jumped as well, now or as long before as an amplifier takes; nor rest, for what jumps
            // meanwhile is the stage.
            let moved_v = (k - 5..=k).map(|j| (v[j] - v[j - 1]).abs()).fold(0.0, f64::max);
            over && slow && moved_v > 0.0 && 6.0 * moved_v * line.slope.abs() < gap
        });
        if passes.count() >= PASSED {
            missing += (gap / step).round() as usize - 1;
        }
    }
    missing
}

/// Codes that are passed and never read.
pub(crate) fn missing(records: &[Record]) -> Option<Finding> {
    let seen: Vec<(&Record, usize)> = records
        .iter()
        .map(|record| (record, gaps(record)))
        .filter(|(_, codes)| *codes > 0)
        .collect();
    let most = seen.iter().map(|(_, codes)| *codes).max()?;
    Some(Finding {
        kind: Kind::MissingCodes,
        channel: Some(Channel::Position),
        records: names(seen.iter().map(|(record, _)| *record)),
        figure: figure(most as f64, Unit::Code, Quantity::Codes),
    })
}
