//! All commands of a pass one after the other, at one rate.

use super::{Pass, Plan, Planned};

/// Frequency of the cycles before the first record, hertz: slow beside every mode.
const CYCLE_HZ: f64 = 2.0;
/// How many: after the first the stage is on its loop.
const CYCLES: f64 = 2.0;

/// Samples of the cycles before the first record.
pub(super) fn cycle_samples(rate_hz: f64) -> usize {
    (CYCLES / CYCLE_HZ * rate_hz).round() as usize
}

/// Samples of a record's command at the rate of a sequence.
pub(super) fn samples_of(record: &Planned, rate_hz: f64) -> usize {
    record.samples * step_of(record, rate_hz)
}

/// Samples of a sequence for one of a record: a hold is slower by a whole factor.
pub(super) fn step_of(record: &Planned, rate_hz: f64) -> usize {
    ((rate_hz / record.rate_hz).round() as usize).max(1)
}

/// The voltages of a pass, volts; a command that is slower than the sequence goes in straight lines.
pub(super) fn voltages(plan: &Plan, pass: &Pass) -> Vec<f64> {
    let mut voltage_v = vec![plan.rest_v; pass.samples];
    if plan.passes.first() == Some(pass) {
        let cycles = voltage_v.iter_mut().take(cycle_samples(plan.rate_hz));
        for (k, v) in cycles.enumerate() {
            let turn = std::f64::consts::TAU * CYCLE_HZ * k as f64 / plan.rate_hz;
            *v = plan.rest_v + 0.5 * (plan.cycle_to_v - plan.rest_v) * (1.0 - turn.cos());
        }
    }
    for record in &pass.records {
        let step = step_of(record, plan.rate_hz);
        let to = voltage_v.iter_mut().skip(record.begins_at);
        for (k, v) in to.take(record.voltage_v.len() * step).enumerate() {
            let (at, share) = (k / step, (k % step) as f64 / step as f64);
            let here = record.voltage_v[at];
            let next = record.voltage_v.get(at + 1).copied().unwrap_or(here);
            *v = here + (next - here) * share;
        }
    }
    voltage_v
}
