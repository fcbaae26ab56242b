//! The tool on a case: what it says, what it learns, and what the record that it asks for tells.

use super::case::{Case, Kind, Limits, Spec, Truth};
use super::tool::{self, Said, Wanted};
use hysteron_data::Dataset;
use hysteron_identify::{Family as Start, Model};
use rayon::prelude::*;
use std::time::Instant;

/// How good an answer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Grade {
    /// What is hidden is named, alone; of what has no name, none is said.
    Right,
    /// What is hidden is one of a set of that many.
    InSet(usize),
    /// No name.
    Silent(Silence),
    /// A name alone, of something that is not there.
    Wrong,
    /// A set of names without what is there.
    WrongSet,
    /// The tool gave an error.
    Failed,
}

/// How the tool is silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Silence {
    /// Structure remains.
    Unknown,
    /// Nothing is missing.
    Nothing,
    /// The shape of the loops.
    Shape,
    /// These records cannot answer.
    Refused,
}

/// Most records that are asked for, one after another.
pub const MOST_RECORDS: usize = 3;

/// The answer after a further record.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// What was played, in words.
    pub words: String,
    /// What of it the rig cannot do.
    pub beyond: Vec<&'static str>,
    /// How good the answer then is.
    pub grade: Grade,
    /// The verdict then.
    pub verdict: String,
}

/// What is asked of a case.
#[derive(Debug, Clone, Copy)]
pub struct Questions {
    /// Whether `learn` is run.
    pub learn: bool,
    /// Whether the next records are played.
    pub next: bool,
}

/// What became of a case.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Its seed.
    pub seed: u64,
    /// Its programme.
    pub programme: super::Programme,
    /// Its family.
    pub family: super::Family,
    /// What is true.
    pub truth: Truth,
    /// How good the first answer is.
    pub grade: Grade,
    /// The first answer, or the tool's error.
    pub said: Result<Said, String>,
    /// Error on the records held out, of the start model and after `learn`, percent of peak to peak.
    pub held_percent: Option<[f64; 2]>,
    /// The same error of the model that `learn` makes of the same recordings of the same stage with nothing hidden: what these records
    /// can tell of its hysteresis.
    pub bare_percent: Option<f64>,
    /// Effects in what was learned.
    pub learned: Vec<String>,
    /// Further records.
    pub asked: Vec<Asked>,
    /// Seconds: to make the case, to answer, to learn, to ask again.
    pub took_s: [f64; 4],
}

impl Outcome {
    /// Whether an effect of the catalogue is hidden, alone, and adds one percent or more.
    pub fn counts(&self) -> bool {
        self.truth.kind == Kind::One && self.truth.parts.first().is_some_and(|part| part.adds_percent >= 1.0)
    }
}

/// Grades an answer.
pub fn grade(accepted: &[&str], said: &Said) -> Grade {
    let set = said.set();
    let holds = set.iter().any(|name| accepted.contains(name));
    match set.len() {
        // What the shape of the loops may also be explained by is no name given to it.
        _ if !Said::is_name(&said.verdict) && accepted.contains(&said.verdict.as_str()) => Grade::Right,
        0 if !said.refused.is_empty() => Grade::Silent(Silence::Refused),
        0 => Grade::Silent(match said.verdict.as_str() {
            "none" => Silence::Nothing,
            "hysteresis-shape" => Silence::Shape,
            _ => Silence::Unknown,
        }),
        1 if holds && Said::is_name(&said.verdict) => Grade::Right,
        n if holds => Grade::InSet(n),
        // A name that stands beside `unknown` is no name alone, but no set with the truth either.
        1 if Said::is_name(&said.verdict) => Grade::Wrong,
        _ => Grade::WrongSet,
    }
}

/// All cases of seeds, on all cores; each outcome is told as it comes.
pub fn run(seeds: &[u64], spec: &Spec, questions: Questions, tell: impl Fn(&Outcome) + Sync) -> Vec<Outcome> {
    let mut outcomes: Vec<Outcome> = seeds
        .par_iter()
        .with_max_len(1)
        .map(|seed| {
            let outcome = one(*seed, spec, questions);
            tell(&outcome);
            outcome
        })
        .collect();
    outcomes.sort_by_key(|outcome| outcome.seed);
    outcomes
}

/// One case.
pub fn one(seed: u64, spec: &Spec, questions: Questions) -> Outcome {
    let clock = Instant::now();
    let case = Case::generate(seed, spec);
    let mut took_s = [clock.elapsed().as_secs_f64(), 0.0, 0.0, 0.0];
    let accepted = case.truth.accepted();
    let clock = Instant::now();
    let start = tool::start(&case.dataset, Start::Mpi).map_err(|error| error.to_string());
    let said = start
        .as_ref()
        .map(|model| tool::ask(&case.dataset, model))
        .map_err(Clone::clone);
    took_s[1] = clock.elapsed().as_secs_f64();
    let grade = said.as_ref().map_or(Grade::Failed, |said| grade(&accepted, said));
    let mut outcome = Outcome {
        seed,
        programme: case.programme,
        family: case.family,
        truth: case.truth.clone(),
        grade,
        said,
        held_percent: None,
        bare_percent: None,
        learned: Vec::new(),
        asked: Vec::new(),
        took_s,
    };
    let Ok(model) = start else { return outcome };
    if questions.learn {
        let clock = Instant::now();
        learn(&case, model, &mut outcome);
        outcome.took_s[2] = clock.elapsed().as_secs_f64();
        outcome.bare_percent = outcome.counts().then(|| with_nothing_hidden(seed, spec)).flatten();
    }
    let open = matches!(grade, Grade::InSet(_) | Grade::Silent(_) | Grade::WrongSet);
    if questions.next && open && outcome.truth.kind == Kind::One {
        let clock = Instant::now();
        outcome.asked = ask_again(&case, outcome.said.as_ref().ok().and_then(|said| said.next.clone()));
        outcome.took_s[3] = clock.elapsed().as_secs_f64();
    }
    outcome
}

fn learn(case: &Case, start: Model, outcome: &mut Outcome) {
    let before = tool::error_percent(&case.held_out, &start);
    match tool::learned(&case.dataset, start) {
        Ok((model, effects)) => {
            let after = tool::error_percent(&case.held_out, &model);
            outcome.held_percent = before.zip(after).map(|(b, a)| [b, a]);
            outcome.learned = effects;
        }
        // The user has the start model then, no better and no worse.
        Err(error) => {
            outcome.held_percent = before.map(|before| [before, before]);
            outcome.learned = vec![format!("error: {error}")];
        }
    }
}

/// Held-out error of what `learn` makes of the stage of a case with nothing hidden in it, percent of peak to peak.
fn with_nothing_hidden(seed: u64, spec: &Spec) -> Option<f64> {
    let kind = Some(Kind::Nothing);
    let case = Case::generate(seed, &Spec { kind, ..*spec });
    let start = tool::start(&case.dataset, Start::Mpi).ok()?;
    let (model, _) = tool::learned(&case.dataset, start).ok()?;
    tool::error_percent(&case.held_out, &model)
}

/// Plays what is asked for, adds it to the records, asks again.
fn ask_again(case: &Case, first: Option<Wanted>) -> Vec<Asked> {
    let accepted = case.truth.accepted();
    let (mut dataset, mut next, mut asked) = (case.dataset.clone(), first, Vec::new());
    while let Some(wanted) = next.take() {
        let beyond = beyond(&wanted, &case.limits);
        add_record(case, &mut dataset, &wanted, asked.len());
        let Ok(model) = tool::start(&dataset, Start::Mpi) else {
            break;
        };
        let said = tool::ask(&dataset, &model);
        let grade = grade(&accepted, &said);
        asked.push(Asked {
            words: wanted.words,
            beyond,
            grade,
            verdict: said.verdict.clone(),
        });
        if asked.len() < MOST_RECORDS && !matches!(grade, Grade::Right | Grade::Wrong) {
            next = said.next;
        }
    }
    asked
}

/// What of a record the rig cannot do.
fn beyond(wanted: &Wanted, limits: &Limits) -> Vec<&'static str> {
    let [low, high] = limits.range_v;
    let slack = 0.01 * (high - low);
    let mut beyond = Vec::new();
    if wanted.voltage_v.iter().any(|v| *v < low - slack || *v > high + slack) {
        beyond.push("voltage");
    }
    if wanted.period_s < 0.99 * limits.period_s {
        beyond.push("rate");
    }
    if wanted.voltage_v.len() > limits.samples.max(20_000) {
        beyond.push("length");
    }
    beyond
}

/// The record on the true stage. A rig that is slower plays it at its own rate; what is outside its range it clips.
fn add_record(case: &Case, dataset: &mut Dataset, wanted: &Wanted, n: usize) {
    let period_s = wanted.period_s.max(case.limits.period_s);
    let last = wanted.voltage_v.len() - 1;
    let samples = (last as f64 * wanted.period_s / period_s) as usize + 1;
    let at_rate = |values: &[f64]| -> Vec<f64> {
        let at = |k: usize| {
            let x = k as f64 * period_s / wanted.period_s;
            let i = (x as usize).min(last);
            values[i] + x.fract() * (values[(i + 1).min(last)] - values[i])
        };
        (0..samples.max(2)).map(at).collect()
    };
    let [low, high] = case.limits.range_v;
    let volts = at_rate(&wanted.voltage_v)
        .into_iter()
        .map(|v| v.clamp(low, high))
        .collect();
    let other = wanted.other_v.as_deref().map(at_rate);
    dataset
        .records
        .push(case.play(&format!("next-{n}.csv"), period_s, volts, other));
}

/// One line about an outcome.
pub fn line(outcome: &Outcome) -> String {
    let parts: Vec<String> = outcome
        .truth
        .parts
        .iter()
        .map(|part| format!("{} {:.2} %", part.hidden.name(), part.adds_percent))
        .collect();
    let said = match &outcome.said {
        Ok(said) => format!(
            "{} also [{}] further [{}] starred [{}]",
            said.verdict,
            said.also_possible.join(", "),
            said.further.join(", "),
            said.starred.join(", ")
        ),
        Err(error) => error.clone(),
    };
    let held = outcome
        .held_percent
        .map_or(String::new(), |[before, after]| format!("{before:.2} -> {after:.2} %"));
    let asked: Vec<String> = outcome
        .asked
        .iter()
        .map(|asked| format!("{:?} {}", asked.grade, asked.verdict))
        .collect();
    format!(
        "{:?}\tseed {}\t{}\t{}\t{:?} [{}]\t-> {said}\theld out {held} by [{}]\tnext [{}]\t{:.1} s",
        outcome.grade,
        outcome.seed,
        outcome.programme.name(),
        outcome.family.name(),
        outcome.truth.kind,
        parts.join(" + "),
        outcome.learned.join(", "),
        asked.join("; "),
        outcome.took_s.iter().sum::<f64>()
    )
}

/// An outcome as JSON.
pub fn json(outcome: &Outcome) -> serde_json::Value {
    let parts: Vec<_> = outcome
        .truth
        .parts
        .iter()
        .map(|part| serde_json::json!({"effect": part.hidden.name(), "form": part.form, "adds_percent": part.adds_percent}))
        .collect();
    let said = match &outcome.said {
        Ok(said) => serde_json::json!({
            "verdict": said.verdict,
            "also_possible": said.also_possible,
            "further": said.further,
            "refused": said.refused,
            "starred": said.starred,
        }),
        Err(error) => serde_json::json!({ "error": error }),
    };
    let asked: Vec<_> = outcome
        .asked
        .iter()
        .map(|asked| {
            serde_json::json!({
                "excitation": asked.words,
                "beyond_rig": asked.beyond,
                "grade": format!("{:?}", asked.grade),
                "verdict": asked.verdict,
            })
        })
        .collect();
    serde_json::json!({
        "seed": outcome.seed,
        "programme": outcome.programme.name(),
        "family": outcome.family.name(),
        "kind": format!("{:?}", outcome.truth.kind),
        "hidden": parts,
        "bare_percent": outcome.truth.bare_percent,
        "opening_percent": outcome.truth.opening_percent,
        "grade": format!("{:?}", outcome.grade),
        "said": said,
        "held_out_percent": outcome.held_percent,
        "held_out_with_nothing_hidden_percent": outcome.bare_percent,
        "learned": outcome.learned,
        "asked": asked,
        "seconds": {
            "make": outcome.took_s[0],
            "answer": outcome.took_s[1],
            "learn": outcome.took_s[2],
            "ask_again": outcome.took_s[3],
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(verdict: &str, also: &[&str], refused: bool) -> Said {
        Said {
            verdict: verdict.to_owned(),
            also_possible: also.iter().map(|name| (*name).to_owned()).collect(),
            further: Vec::new(),
            refused: if refused {
                vec!["one period".to_owned()]
            } else {
                Vec::new()
            },
            starred: Vec::new(),
            next: None,
            evidence: Default::default(),
        }
    }

    /// Every way to answer, where an effect is hidden and where none of the catalogue is.
    #[test]
    fn val_answers_are_graded() {
        let none = ["none", "unknown", "hysteresis-shape"];
        let rows = [
            (&["delay"][..], said("delay", &[], false), Grade::Right),
            (&["delay"], said("first-order-lag", &["delay"], false), Grade::InSet(2)),
            (&["delay"], said("unknown", &["delay"], false), Grade::InSet(1)),
            (&["delay"], said("creep", &["mains-hum"], false), Grade::WrongSet),
            (&["delay"], said("creep", &[], false), Grade::Wrong),
            (&["delay"], said("unknown", &[], false), Grade::Silent(Silence::Unknown)),
            (&["delay"], said("none", &[], false), Grade::Silent(Silence::Nothing)),
            (
                &["delay"],
                said("hysteresis-shape", &[], false),
                Grade::Silent(Silence::Shape),
            ),
            (&["delay"], said("unknown", &[], true), Grade::Silent(Silence::Refused)),
            (&none, said("hysteresis-shape", &[], false), Grade::Right),
            (
                &none,
                said("hysteresis-shape", &["sensor-nonlinearity"], false),
                Grade::Right,
            ),
            (&none, said("none", &[], false), Grade::Right),
            (&none, said("unknown", &[], true), Grade::Right),
            (&["unknown", "thermal-drift"], said("unknown", &[], false), Grade::Right),
            (&none, said("delay", &[], false), Grade::Wrong),
            (&none, said("delay", &["creep"], false), Grade::WrongSet),
        ];
        for (accepted, said, expected) in rows {
            assert_eq!(grade(accepted, &said), expected, "{accepted:?} {said:?}");
        }
    }

    /// What a rig cannot do is seen: too fast, too far, too long.
    #[test]
    fn val_the_rig_has_limits() {
        let limits = Limits {
            range_v: [0.0, 100.0],
            period_s: 1e-3,
            samples: 10_000,
        };
        let wanted = |period_s: f64, volts: f64, n: usize| Wanted {
            words: String::new(),
            period_s,
            voltage_v: vec![volts; n],
            other_v: None,
        };
        assert!(beyond(&wanted(1e-3, 100.0, 20_000), &limits).is_empty());
        assert_eq!(beyond(&wanted(2e-5, 50.0, 10), &limits), ["rate"]);
        assert_eq!(beyond(&wanted(1e-3, 102.0, 10), &limits), ["voltage"]);
        assert_eq!(beyond(&wanted(1e-3, 50.0, 20_001), &limits), ["length"]);
    }
}
