//! Which recording is of which planned record: by its voltage, whatever its name.

use super::likeness::{self, Likeness};
use super::told::{Remark, Wrong};
use super::{Plan, Planned, Purpose, cutting};
use hysteron_data::Record;
use rayon::prelude::*;

/// Largest difference between the voltage that was recorded and the command, rms, as a share of the command's range: a monitor output of an
/// amplifier is good to a percent.
pub(super) const SAME_VOLTAGE: f64 = 0.02;
/// Least correlation of a small signal with its command: behind an amplifier's lag of 150 us the multisine has 0.37 at no shift, another
/// seed's less than 0.05 at any.
const SAME_SIGNAL: f64 = 0.3;
/// Commands whose coarse likeness is highest, and which are looked at sample by sample.
const LOOKED_AT: usize = 4;
/// Period of a recording up to this share beside the command's.
pub(super) const SAME_PERIOD: f64 = 1e-3;

/// A record that came back.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// The pass of its planned record, and its number there.
    pub at: (usize, usize),
    /// What counts of it, under the planned name.
    pub record: Record,
    /// The position over the rest before it, micrometres.
    pub rest_um: Vec<f64>,
    /// The file that it was in.
    pub from: String,
}

/// What came back of a plan.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Returned {
    /// The records, in the plan's order.
    pub taken: Vec<Taken>,
    /// What should be known of them.
    pub remarks: Vec<Remark>,
    /// Why they cannot be used.
    pub wrong: Vec<Wrong>,
    /// Passes of which something came back, the first always among them.
    pub passes: usize,
}

impl Returned {
    /// The record of a planned one.
    pub fn of(&self, at: (usize, usize)) -> Option<&Taken> {
        self.taken.iter().find(|taken| taken.at == at)
    }

    /// Counts all positions from that of rest, as models do: with the sensor's own zero, a start looks like a step, and creep is found that
    /// is none.
    pub fn count_from(&mut self, zero_um: f64) {
        for taken in &mut self.taken {
            let positions = taken.record.position_um.iter_mut().chain(&mut taken.rest_um);
            positions.for_each(|y| *y -= zero_um);
        }
    }

    /// The records of a pass.
    pub fn of_pass(&self, pass: usize) -> impl Iterator<Item = &Taken> {
        self.taken.iter().filter(move |taken| taken.at.0 == pass)
    }
}

/// Planned records of one command.
struct Class<'a> {
    slots: Vec<((usize, usize), &'a Planned)>,
}

impl Class<'_> {
    fn planned(&self) -> &Planned {
        self.slots[0].1
    }
}

/// A recording that may be of a command.
#[derive(Clone, Copy)]
struct Candidate {
    recording: usize,
    class: usize,
    like: Likeness,
    /// The voltage agrees as it is, not only in its shape.
    same: bool,
    /// Difference over the part that counts, as a share of its range.
    distance: f64,
}

/// Finds the recordings of a plan's records, and cuts them to what counts.
///
/// # Cost
/// A pass over the samples for each recording and command; three Fourier transforms of 16 384 points for each pair where files begin
/// before their command.
pub fn matched(plan: &Plan, recorded: &[Record]) -> Returned {
    let mut returned = Returned::default();
    let mut left: Vec<usize> = Vec::new();
    for (index, record) in recorded.iter().enumerate() {
        if !cutting::sequence(plan, record, &mut returned) {
            left.push(index);
        }
    }
    let mut classes: Vec<Class<'_>> = Vec::new();
    for (pass, number, planned) in each(plan) {
        if returned.of((pass, number)).is_some() {
            continue;
        }
        let slot = ((pass, number), planned);
        let same = |class: &&mut Class<'_>| {
            class.planned().check == planned.check && class.planned().rate_hz == planned.rate_hz
        };
        match classes.iter_mut().find(same) {
            Some(class) => class.slots.push(slot),
            None => classes.push(Class { slots: vec![slot] }),
        }
    }
    let assigned = assign(&classes, recorded, &left, &mut returned);
    for (class, recordings) in classes.iter().zip(assigned) {
        place(class, recorded, recordings, &mut returned);
    }
    returned.taken.sort_by_key(|taken| taken.at);
    missing(plan, &mut returned);
    returned
}

/// All planned records with their places.
pub(super) fn each(plan: &Plan) -> impl Iterator<Item = (usize, usize, &Planned)> {
    let passes = plan.passes.iter().enumerate();
    passes.flat_map(|(pass, of)| {
        of.records
            .iter()
            .enumerate()
            .map(move |(number, planned)| (pass, number, planned))
    })
}

/// The recordings of each class.
fn assign(
    classes: &[Class<'_>],
    recorded: &[Record],
    left: &[usize],
    returned: &mut Returned,
) -> Vec<Vec<(usize, Candidate)>> {
    let found: Vec<(usize, Vec<Candidate>)> = left
        .par_iter()
        .map(|&recording| (recording, candidates(classes, recording, &recorded[recording])))
        .collect();
    let mut all: Vec<Candidate> = found.iter().flat_map(|(_, of)| of.iter().copied()).collect();
    all.sort_by(|a, b| b.same.cmp(&a.same).then(a.distance.total_cmp(&b.distance)));
    let mut assigned: Vec<Vec<(usize, Candidate)>> = classes.iter().map(|_| Vec::new()).collect();
    let mut taken = vec![false; recorded.len()];
    for candidate in all {
        let room = assigned[candidate.class].len() < classes[candidate.class].slots.len();
        if room && !std::mem::replace(&mut taken[candidate.recording], true) {
            assigned[candidate.class].push((candidate.recording, candidate));
        }
    }
    for (recording, of) in found.iter().filter(|(recording, _)| !taken[*recording]) {
        let from = recorded[*recording].file.clone();
        match of.first() {
            Some(candidate) => returned.remarks.push(Remark::Twice {
                from,
                name: classes[candidate.class].planned().name.clone(),
            }),
            None => returned.wrong.push(stranger(classes, &recorded[*recording])),
        }
    }
    assigned
        .iter_mut()
        .for_each(|class| class.sort_by_key(|(recording, _)| *recording));
    assigned
}

/// The commands that a recording may be of, the nearest first.
fn candidates(classes: &[Class<'_>], recording: usize, record: &Record) -> Vec<Candidate> {
    let alike = |(class, of): (usize, &Class<'_>), like: Likeness| -> Option<Candidate> {
        let planned = of.planned();
        let counts = likeness::at(&planned.voltage_v, &record.voltage_v, like.shift, planned.counts_from);
        let other = || {
            // By its first period: another clock shifts the last one by samples.
            let first = cutting::period(planned, &record.voltage_v, like.shift, 0);
            planned.role.is_small() && first.correlation.abs() < SAME_SIGNAL
        };
        if 2 * like.overlap < planned.samples {
            return None;
        }
        let same = like.off <= SAME_VOLTAGE;
        ((same || like.shape_off <= SAME_VOLTAGE) && !other()).then_some(Candidate {
            recording,
            class,
            like,
            same,
            distance: if same { counts.off } else { like.shape_off },
        })
    };
    let of_its_rate = || {
        let each = classes.iter().enumerate();
        each.filter(|(_, class)| same_period(class.planned().period_s(), record.period_s))
    };
    // As it is asked for, from the command's first sample on, before anything is shifted.
    let at_once = of_its_rate().filter_map(|of| {
        let like = likeness::at(&of.1.planned().voltage_v, &record.voltage_v, 0, 0);
        alike(of, like).filter(|candidate| candidate.same)
    });
    let mut found: Vec<Candidate> = at_once.collect();
    if found.is_empty() {
        let coarse = of_its_rate().filter_map(|of| {
            let (like, _) = likeness::coarse(&of.1.planned().voltage_v, &record.voltage_v)?;
            Some((
                of,
                like.correlation.abs() * like.overlap as f64 / of.1.planned().samples as f64,
            ))
        });
        let mut coarse: Vec<_> = coarse.collect();
        coarse.sort_by(|a, b| b.1.total_cmp(&a.1));
        let best = coarse
            .into_iter()
            .take(LOOKED_AT)
            .filter_map(|(of, _)| alike(of, likeness::best(&of.1.planned().voltage_v, &record.voltage_v)));
        found = best.collect();
    }
    if found.is_empty() {
        found = at_another_rate(classes, recording, record);
    }
    found.sort_by(|a, b| b.same.cmp(&a.same).then(a.distance.total_cmp(&b.distance)));
    // What is clearly another one's is not taken for want of a better one.
    let nearest = found.first().map_or(0.0, |candidate| candidate.distance);
    found.retain(|candidate| candidate.distance <= 1.5 * nearest + 1e-4);
    found
}

/// The command that a recording has at another sample rate.
fn at_another_rate(classes: &[Class<'_>], recording: usize, record: &Record) -> Vec<Candidate> {
    let each = classes.iter().enumerate();
    let other = each.filter(|(_, class)| !same_period(class.planned().period_s(), record.period_s));
    let found = other.filter_map(|(class, of)| {
        let planned = of.planned();
        let command = likeness::resampled(&planned.voltage_v, planned.period_s(), record.period_s);
        let like = likeness::best(&command, &record.voltage_v);
        (like.off <= SAME_VOLTAGE).then_some(Candidate {
            recording,
            class,
            like,
            same: true,
            distance: like.off,
        })
    });
    found.collect()
}

pub(super) fn same_period(planned_s: f64, recorded_s: f64) -> bool {
    (recorded_s / planned_s - 1.0).abs() <= SAME_PERIOD
}

/// A recording that is of no command, with the nearest one.
fn stranger(classes: &[Class<'_>], record: &Record) -> Wrong {
    let of = |class: &Class<'_>| {
        let planned = class.planned();
        let command = if same_period(planned.period_s(), record.period_s) {
            planned.voltage_v.clone()
        } else {
            likeness::resampled(&planned.voltage_v, planned.period_s(), record.period_s)
        };
        let counts = (planned.counts_from as f64 * command.len() as f64 / planned.samples as f64) as usize;
        let shift = likeness::best(&command, &record.voltage_v).shift;
        (
            planned.name.clone(),
            likeness::at(&command, &record.voltage_v, shift, counts).off,
        )
    };
    let nearest: Vec<(String, f64)> = classes.par_iter().map(of).collect();
    Wrong::Stranger {
        from: record.file.clone(),
        nearest: nearest
            .into_iter()
            .filter(|(_, off)| off.is_finite())
            .min_by(|a, b| a.1.total_cmp(&b.1)),
    }
}

/// Gives the recordings of one command to its planned records: by name where one has it, else in their order.
fn place(class: &Class<'_>, recorded: &[Record], mut of: Vec<(usize, Candidate)>, returned: &mut Returned) {
    let mut slots = class.slots.clone();
    let mut pairs = Vec::new();
    slots.retain(|(at, planned)| {
        let named = |(recording, _): &(usize, Candidate)| stem(&recorded[*recording].file) == planned.name;
        let found = of.iter().position(named).map(|index| of.remove(index));
        pairs.extend(found.map(|(recording, candidate)| (*at, *planned, recording, candidate)));
        found.is_none()
    });
    let by_order = of.into_iter().zip(&slots);
    let by_order: Vec<_> = by_order
        .map(|((recording, candidate), (at, planned))| (*at, *planned, recording, candidate))
        .collect();
    if class.slots.len() > 1 && !by_order.is_empty() {
        returned.remarks.push(Remark::InOrder {
            pairs: by_order
                .iter()
                .map(|(_, planned, recording, _)| (recorded[*recording].file.clone(), planned.name.clone()))
                .collect(),
        });
    }
    for (at, planned, recording, candidate) in pairs.into_iter().chain(by_order) {
        cutting::one(planned, at, &recorded[recording], candidate.like, returned);
    }
}

/// A file's name without folder and ending.
fn stem(file: &str) -> &str {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Planned records that did not come back, in passes of which others did.
fn missing(plan: &Plan, returned: &mut Returned) {
    let came = |at: (usize, usize), returned: &Returned, planned: &Planned| {
        returned.of(at).is_some() || returned.wrong.iter().any(|wrong| wrong.is_of(at.0, &planned.name))
    };
    returned.passes = 1;
    for (pass, of) in plan.passes.iter().enumerate() {
        let any = of
            .records
            .iter()
            .enumerate()
            .any(|(number, planned)| planned.role != Purpose::Drift && came((pass, number), returned, planned));
        if pass > 0 && !any {
            break;
        }
        returned.passes = pass + 1;
        for (number, planned) in of.records.iter().enumerate() {
            if came((pass, number), returned, planned) {
                continue;
            }
            let (name, file) = (planned.name.clone(), planned.file.clone());
            match planned.role {
                Purpose::Drift => returned.remarks.push(Remark::NoDrift { name, file }),
                _ => returned.wrong.push(Wrong::Missing { name, file }),
            }
        }
    }
    // Where nothing is missing, what is too much does no harm.
    let only_strangers = returned
        .wrong
        .iter()
        .all(|wrong| matches!(wrong, Wrong::Stranger { .. }));
    if only_strangers {
        let strangers = std::mem::take(&mut returned.wrong);
        returned.remarks.extend(strangers.into_iter().map(Remark::LeftOut));
    }
}
