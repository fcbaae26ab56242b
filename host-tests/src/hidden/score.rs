//! Verdicts against truths: who was right, by effect, strength and family.

use super::{Example, generate};
use hysteron_diagnose::diagnosis::Diagnosis;
use hysteron_diagnose::evidence::Evidence;
use hysteron_diagnose::verdict::Decision;
use hysteron_diagnose::{examine, learn};
use hysteron_identify::{FitOptions, fit, present_step};
use hysteron_plant::challenge::{Asked, CATALOGUE, Effect, OUTSIDE, Spec, StageFamily, Strength, Truth};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What was said of a dataset.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Answer {
    /// The verdict.
    pub verdict: String,
    /// What these records cannot tell from it.
    pub also_possible: Vec<String>,
    /// Further effects that were found.
    pub further: Vec<String>,
    /// What most of the unexplained goes with, or empty.
    pub locked_to: String,
    /// The numbers that the verdict came from; those of no rounds where nobody asked for a single diagnosis.
    pub evidence: Evidence,
}

impl From<Diagnosis> for Answer {
    fn from(diagnosis: Diagnosis) -> Self {
        let mut locks = diagnosis.unexplained.locked_to.into_iter();
        let locked_to = locks.next().filter(|lock| lock.share > 0.1);
        Self {
            locked_to: locked_to.map_or(String::new(), |lock| lock.to.as_str().to_owned()),
            verdict: diagnosis.verdict.as_str().to_owned(),
            also_possible: diagnosis.also_possible.iter().map(ToString::to_string).collect(),
            further: diagnosis.further.iter().map(ToString::to_string).collect(),
            evidence: Evidence::default(),
        }
    }
}

impl From<Decision> for Answer {
    fn from(decision: Decision) -> Self {
        let names = |effects: Vec<_>| effects.iter().map(ToString::to_string).collect();
        Self {
            verdict: decision.verdict.as_str().to_owned(),
            also_possible: names(decision.set),
            further: names(decision.further),
            ..Self::default()
        }
    }
}

/// How good an answer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Grade {
    /// The verdict is what is hidden.
    Right,
    /// The verdict is another name, what is hidden stands beside it as not to be told apart.
    InSet,
    /// No name, or `none` where something is hidden.
    Missed,
    /// No name, and nothing for one to explain: the start model, fitted, leaves no more than it leaves of the same stage without
    /// the effect, but for a tenth of what the effect adds.
    TakenIn,
    /// A name of something that is not there.
    Wrong,
}

/// Verdicts that name no effect.
const NO_NAME: [&str; 3] = ["none", "unknown", "hysteresis-shape"];

/// Grades an answer to a truth with these accepted verdicts.
pub fn grade(accepted: &[impl AsRef<str>], answer: &Answer) -> Grade {
    let accepts = |name: &str| accepted.iter().any(|accepted| accepted.as_ref() == name);
    let verdict = answer.verdict.as_str();
    if accepts(verdict) {
        Grade::Right
    } else if answer.also_possible.iter().any(|name| accepts(name)) {
        Grade::InSet
    } else if NO_NAME.contains(&verdict) {
        Grade::Missed
    } else {
        Grade::Wrong
    }
}

/// A case, the answer to it, and its grade.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The seed.
    pub seed: u64,
    /// What is hidden.
    pub truth: Truth,
    /// The model that it started from.
    pub start: &'static str,
    /// What was said.
    pub answer: Answer,
    /// How good that is.
    pub grade: Grade,
}

/// The answer of the tool: a fit of the start model, then the diagnosis.
///
/// # Panics
/// Where the fit of the start model fails, which no case of the generator should bring about.
pub fn tool(example: &Example) -> Answer {
    match fit(&example.dataset, &FitOptions::new(example.start), &|_| {}) {
        Ok(report) => {
            let (diagnosis, evidence) = examine(&example.dataset, &report.model, &[], &|_, _| {});
            Answer {
                evidence,
                ..diagnosis.into()
            }
        }
        Err(error) => panic!("seed {}: {error}", example.truth.seed),
    }
}

/// The answer of `learn`: the effects of the model that it ends with, the first one kept as the verdict.
///
/// # Panics
/// As [`tool`].
pub fn learned(example: &Example) -> Answer {
    match learn(&example.dataset, &FitOptions::new(example.start), &|_, _| {}) {
        Ok(learned) => {
            let mut effects = learned.model.effects.into_iter().map(|effect| effect.name.to_string());
            Answer {
                verdict: effects.next().unwrap_or_else(|| learned.diagnosis.verdict.to_string()),
                further: effects.collect(),
                ..Answer::default()
            }
        }
        Err(error) => panic!("seed {}: {error}", example.truth.seed),
    }
}

/// A start model that takes in this share of a hidden effect lacks nothing that a diagnosis could name.
const TAKEN_IN: f64 = 0.9;

/// Whether the fitted start model has taken the one hidden effect in: its error on validation records is, but for a tenth of what the
/// effect adds to the readings, that on the same stage without the effect. All three in percent of peak to peak.
fn absorbed(example: &Example, spec: &Spec) -> bool {
    let [hidden] = example.truth.hidden.as_slice() else {
        return false;
    };
    let bare = Spec {
        hidden: Vec::new(),
        ..spec.clone()
    };
    let error_percent = |of: &Example| {
        let model = fit(&of.dataset, &FitOptions::new(example.start), &|_| {}).ok()?.model;
        present_step(&of.dataset, &model).validate_percent
    };
    let without = generate(example.truth.seed, &bare).ok();
    match (error_percent(example), without.as_ref().and_then(error_percent)) {
        (Some(with), Some(without)) => {
            let adds = (with * with - without * without).max(0.0).sqrt();
            adds < (1.0 - TAKEN_IN) * hidden.contribution_percent
        }
        _ => false,
    }
}

/// Makes the cases, asks for answers on all cores, and grades them. A case that no stage of its seed can show is left out.
pub fn score(
    cases: &[(u64, Spec)],
    answer: impl Fn(&Example) -> Answer + Sync,
    done: impl Fn(&Outcome) + Sync,
) -> Vec<Outcome> {
    cases
        .par_iter()
        .with_max_len(1)
        .filter_map(|(seed, spec)| {
            let example = generate(*seed, spec).ok()?;
            let answer = answer(&example);
            let grade = match grade(&example.truth.accepted_verdicts(), &answer) {
                Grade::Missed if absorbed(&example, spec) => Grade::TakenIn,
                grade => grade,
            };
            let outcome = Outcome {
                seed: *seed,
                start: example.start.name(),
                truth: example.truth,
                answer,
                grade,
            };
            done(&outcome);
            Some(outcome)
        })
        .collect()
}

/// The cases of a calibration: `each` seeds for every effect and strength, three times as many controls as an effect has, half of them
/// as often outside of the catalogue, and as many pairs as an effect has cases.
pub fn calibration(first_seed: u64, each: u64) -> Vec<(u64, Spec)> {
    let mut specs = Vec::new();
    for round in 0..each {
        for strength in Strength::ALL {
            specs.extend(CATALOGUE.map(|effect| Spec::one(effect, strength)));
            if round % 2 == 0 {
                specs.extend(OUTSIDE.map(|effect| Spec::one(effect, strength)));
            }
            specs.extend(std::iter::repeat_n(Spec::default(), 3));
            specs.push(Spec {
                hidden: pair(first_seed.wrapping_add(specs.len() as u64)),
                ..Spec::default()
            });
        }
    }
    specs
        .into_iter()
        .enumerate()
        .map(|(n, spec)| (first_seed + n as u64, spec))
        .collect()
}

/// Cases with two hidden effects, as [`score`] takes them.
pub fn pairs(first_seed: u64, count: u64) -> Vec<(u64, Spec)> {
    (first_seed..first_seed + count)
        .map(|seed| {
            let hidden = pair(seed);
            (
                seed,
                Spec {
                    hidden,
                    ..Spec::default()
                },
            )
        })
        .collect()
}

/// Two effects that change more than the static loops and are not delay and lag, which stand for each other; medium or strong.
fn pair(seed: u64) -> Vec<Asked> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    let physical: Vec<Effect> = CATALOGUE.into_iter().filter(|effect| !effect.is_shape()).collect();
    let rival = |effect| matches!(effect, Effect::Delay | Effect::FirstOrderLag);
    loop {
        let mut draw = || Asked {
            effect: physical[rng.random_range(0..physical.len())],
            strength: [Strength::Medium, Strength::Strong][rng.random_range(0..2_usize)],
        };
        let (a, b) = (draw(), draw());
        if a.effect != b.effect && !(rival(a.effect) && rival(b.effect)) {
            return vec![a, b];
        }
    }
}

/// Right, in the set, missed, wrong, and absorbed by the start model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Verdict right.
    pub right: usize,
    /// Right name beside the verdict.
    pub in_set: usize,
    /// No name.
    pub missed: usize,
    /// A wrong name.
    pub wrong: usize,
    /// No name, and nothing for one to explain.
    pub absorbed: usize,
}

impl Tally {
    /// Counts outcomes.
    pub fn of<'a>(outcomes: impl IntoIterator<Item = &'a Outcome>) -> Self {
        outcomes.into_iter().fold(Self::default(), |mut tally, outcome| {
            match outcome.grade {
                Grade::Right => tally.right += 1,
                Grade::InSet => tally.in_set += 1,
                Grade::Missed => tally.missed += 1,
                Grade::Wrong => tally.wrong += 1,
                Grade::TakenIn => tally.absorbed += 1,
            }
            tally
        })
    }

    /// How many the start model lacks.
    pub fn lacking(&self) -> usize {
        self.right + self.in_set + self.missed + self.wrong
    }

    fn cell(&self) -> String {
        if self.lacking() + self.absorbed == 0 {
            return "-".to_owned();
        }
        let mut text = format!("{}/{}", self.right, self.lacking());
        if self.in_set > 0 {
            let _ = write!(text, " +{}", self.in_set);
        }
        if self.wrong > 0 {
            let _ = write!(text, ", {} wrong", self.wrong);
        }
        if self.absorbed > 0 {
            let _ = write!(text, ", {} absorbed", self.absorbed);
        }
        text
    }

    fn percent(count: usize, of: usize) -> String {
        if of == 0 {
            "-".to_owned()
        } else {
            format!("{:.0} % of {of}", 100.0 * count as f64 / of as f64)
        }
    }
}

/// What is hidden, as one word.
fn label(truth: &Truth) -> String {
    let names: Vec<&str> = truth.hidden.iter().map(|hidden| hidden.effect.name()).collect();
    if names.is_empty() {
        "nothing".to_owned()
    } else {
        names.join(" and ")
    }
}

fn single(outcome: &Outcome) -> Option<(Effect, Strength)> {
    match outcome.truth.hidden.as_slice() {
        [hidden] => Some((hidden.effect, hidden.strength)),
        _ => None,
    }
}

/// Whether every hidden effect is named, as verdict or further.
pub fn all_found(outcome: &Outcome) -> bool {
    let said = |name: &str| outcome.answer.verdict == name || outcome.answer.further.iter().any(|f| f == name);
    outcome.truth.hidden.iter().all(|hidden| said(hidden.effect.name()))
}

/// The outcomes as Markdown: the summary, the confusion matrix by effect and strength, the same by family, and what `unknown`
/// is locked to.
pub fn markdown(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    summary(&mut text, outcomes);
    matrix(&mut text, outcomes);
    by_family(&mut text, outcomes);
    locks(&mut text, outcomes);
    text
}

fn summary(text: &mut String, outcomes: &[Outcome]) {
    let play_class = |o: &&Outcome| o.truth.family.is_play_class();
    let _ = writeln!(
        text,
        "| | right | right or in the set | wrong name | absorbed |\n|---|---|---|---|---|"
    );
    let mut row = |name: &str, tally: Tally| {
        let of = |count| Tally::percent(count, tally.lacking());
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} |",
            of(tally.right),
            of(tally.right + tally.in_set),
            of(tally.wrong),
            tally.absorbed
        );
    };
    type Kind = (&'static str, fn(Effect) -> bool);
    let kinds: [Kind; 3] = [
        ("physical", |effect| !effect.is_outside() && !effect.is_shape()),
        ("told by the loops alone", Effect::is_shape),
        ("all of the catalogue", |effect| !effect.is_outside()),
    ];
    for (kind, belongs) in kinds {
        for strength in Strength::ALL.into_iter().rev() {
            let chosen = outcomes
                .iter()
                .filter(play_class)
                .filter(|o| matches!(single(o), Some((effect, found)) if found == strength && belongs(effect)));
            row(&format!("{kind}, {}, play class", strength.name()), Tally::of(chosen));
        }
    }
    let outside = |o: &&Outcome| matches!(single(o), Some((effect, _)) if effect.is_outside());
    row(
        "outside of the catalogue, play class",
        Tally::of(outcomes.iter().filter(play_class).filter(outside)),
    );
    let nothing = |o: &&Outcome| o.truth.hidden.is_empty();
    row(
        "nothing hidden, play class",
        Tally::of(outcomes.iter().filter(play_class).filter(nothing)),
    );
    row("Bouc-Wen, all", Tally::of(outcomes.iter().filter(|o| !play_class(o))));
    let pairs: Vec<&Outcome> = outcomes
        .iter()
        .filter(play_class)
        .filter(|o| o.truth.hidden.len() > 1)
        .collect();
    row(
        "two hidden: one of the two, play class",
        Tally::of(pairs.iter().copied()),
    );
    let both = pairs.iter().filter(|o| all_found(o)).count();
    let _ = writeln!(
        text,
        "\nTwo hidden: both found in {}.",
        Tally::percent(both, pairs.len())
    );
    sets(text, outcomes);
}

/// How often a name, or a set of them, contains what is hidden, and how large it is.
fn sets(text: &mut String, outcomes: &[Outcome]) {
    let size = |o: &&Outcome| {
        let verdict = usize::from(!NO_NAME.contains(&o.answer.verdict.as_str()));
        verdict + o.answer.also_possible.len()
    };
    let named: Vec<&Outcome> = outcomes.iter().filter(|o| size(o) > 0).collect();
    let tally = Tally::of(named.iter().copied());
    let _ = writeln!(
        text,
        "\nNames and sets of names: they contain what is hidden in {}; mean size {:.2}.",
        Tally::percent(tally.right + tally.in_set, named.len()),
        named.iter().map(size).sum::<usize>() as f64 / named.len().max(1) as f64
    );
}

fn matrix(text: &mut String, outcomes: &[Outcome]) {
    let _ = writeln!(
        text,
        "\n| hidden | weak | medium | strong | verdicts |\n|---|---|---|---|---|"
    );
    let mut rows: BTreeMap<(usize, String), Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes {
        let group = match outcome.truth.hidden.as_slice() {
            [] => 0,
            [hidden] if hidden.effect.is_outside() => 2,
            [_] => 1,
            _ => 3,
        };
        let name = if group == 3 {
            "two".to_owned()
        } else {
            label(&outcome.truth)
        };
        rows.entry((group, name)).or_default().push(outcome);
    }
    for ((group, name), members) in rows {
        let mut cells = Vec::new();
        if group == 0 || group == 3 {
            cells.push(Tally::of(members.iter().copied()).cell());
            cells.extend(["".to_owned(), "".to_owned()]);
        } else {
            for strength in Strength::ALL {
                let chosen = members
                    .iter()
                    .copied()
                    .filter(|o| matches!(single(o), Some((_, s)) if s == strength));
                cells.push(Tally::of(chosen).cell());
            }
        }
        let verdicts = counted(members.iter().map(|o| o.answer.verdict.as_str()));
        let _ = writeln!(text, "| {name} | {} | {verdicts} |", cells.join(" | "));
    }
}

/// Words and how often each was said, the most frequent first.
fn counted<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let mut said: BTreeMap<&str, usize> = BTreeMap::new();
    words.for_each(|word| *said.entry(word).or_default() += 1);
    let mut said: Vec<_> = said.into_iter().collect();
    said.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let said: Vec<String> = said.iter().map(|(word, count)| format!("{word} {count}")).collect();
    said.join(", ")
}

fn by_family(text: &mut String, outcomes: &[Outcome]) {
    let _ = writeln!(
        text,
        "\n| family | one of the catalogue | outside | nothing | two |\n|---|---|---|---|---|"
    );
    for family in StageFamily::ALL {
        let of = |wanted: fn(&Outcome) -> bool| {
            Tally::of(outcomes.iter().filter(|o| o.truth.family == family && wanted(o))).cell()
        };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            family.name(),
            of(|o| matches!(single(o), Some((effect, _)) if !effect.is_outside())),
            of(|o| matches!(single(o), Some((effect, _)) if effect.is_outside())),
            of(|o| o.truth.hidden.is_empty()),
            of(|o| o.truth.hidden.len() > 1),
        );
    }
}

fn locks(text: &mut String, outcomes: &[Outcome]) {
    let mut rows: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let unknown = |o: &&Outcome| o.truth.family.is_play_class() && o.answer.verdict == "unknown";
    for outcome in outcomes.iter().filter(unknown) {
        if let Some((effect, _)) = single(outcome).filter(|(effect, _)| effect.is_outside()) {
            let to = outcome.answer.locked_to.as_str();
            let words = rows.entry(effect.name()).or_default();
            words.push(if to.is_empty() { "nothing" } else { to });
        }
    }
    if rows.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n| hidden, play class | unknown, locked to |\n|---|---|");
    for (effect, words) in rows {
        let _ = writeln!(text, "| {effect} | {} |", counted(words.into_iter()));
    }
}

/// One line about an outcome: seed, truth, answer.
pub fn line(outcome: &Outcome) -> String {
    let truth = &outcome.truth;
    let contributions: Vec<String> = truth
        .hidden
        .iter()
        .map(|hidden| format!("{:.2} %", hidden.contribution_percent))
        .collect();
    format!(
        "{:?}\tseed {}\t{} ({})\t{}\tfrom {}\t-> {} also [{}] further [{}] locked to [{}]",
        outcome.grade,
        outcome.seed,
        label(truth),
        contributions.join(", "),
        truth.family.name(),
        outcome.start,
        outcome.answer.verdict,
        outcome.answer.also_possible.join(", "),
        outcome.answer.further.join(", "),
        outcome.answer.locked_to,
    )
}
