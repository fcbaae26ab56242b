//! An answer, and whether it is right.

use crate::truth::SealedTruth;
use hysteron_plant::challenge::{CATALOGUE, Effect};
use serde::{Deserialize, Serialize};

/// Answers that are no effect.
const OTHERS: [&str; 3] = ["none", "unknown", "hysteresis-shape"];

/// Effects that short records may fail to tell apart, the phase of both being `-w tau`: a set of them is a whole answer.
const ALIKE: [&str; 2] = ["delay", "first-order-lag"];

/// Every name that an answer may have.
pub fn names() -> Vec<&'static str> {
    CATALOGUE.into_iter().map(Effect::name).chain(OTHERS).collect()
}

/// What was answered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Effects that are hidden, or one word: `none`, `unknown`, `hysteresis-shape`.
    pub effects: Vec<String>,
}

/// How an answer stands to the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// All that is hidden is named, and nothing else.
    Right,
    /// Some of it, or more than it.
    PartlyRight,
    /// Nothing of it.
    Wrong,
}

impl Outcome {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::PartlyRight => "partly right",
            Self::Wrong => "wrong",
        }
    }
}

/// An outcome with its reason.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judgement {
    /// The outcome.
    pub outcome: Outcome,
    /// Its reason, one sentence.
    pub because: String,
}

impl Answer {
    /// Takes an answer.
    ///
    /// # Errors
    /// In words, which name is not allowed, and what is.
    pub fn new(names: &[String]) -> Result<Self, String> {
        if names.is_empty() {
            return Err("an answer has at least one name".to_owned());
        }
        for (i, name) in names.iter().enumerate() {
            if !self::names().contains(&name.as_str()) {
                return Err(format!(
                    "answer `{name}` is not known; allowed are {}",
                    self::names().join(", ")
                ));
            }
            if OTHERS.contains(&name.as_str()) && names.len() > 1 {
                return Err(format!("`{name}` stands alone; several names are several effects"));
            }
            if names[..i].contains(name) {
                return Err(format!("`{name}` stands twice"));
            }
        }
        Ok(Self {
            effects: names.to_vec(),
        })
    }
}

/// Judges an answer: right when it names all that is hidden and nothing else, but for a neighbour that cannot be told from it.
pub fn judge(answer: &Answer, truth: &SealedTruth) -> Judgement {
    let verdict = |outcome, because: String| Judgement { outcome, because };
    let hidden: Vec<&str> = truth
        .hidden
        .iter()
        .map(|h| {
            if h.outside_of_the_catalogue {
                "unknown"
            } else {
                h.effect.as_str()
            }
        })
        .collect();
    let named: Vec<&str> = answer.effects.iter().map(String::as_str).collect();
    if let [only] = named[..]
        && hidden.len() < 2
        && truth.accepted.iter().any(|accepted| accepted == only)
    {
        return verdict(Outcome::Right, format!("`{only}` is what there is to say"));
    }
    let (found, missed): (Vec<&str>, Vec<&str>) = hidden.iter().partition(|h| named.contains(h));
    let beside: Vec<&str> = named.iter().copied().filter(|n| !hidden.contains(n)).collect();
    let excused = |name: &&str| ALIKE.contains(name) && found.iter().any(|f| ALIKE.contains(f));
    let wrong: Vec<&str> = beside.iter().copied().filter(|name| !excused(name)).collect();
    if found.is_empty() {
        let there = if hidden.is_empty() {
            "nothing is hidden".to_owned()
        } else {
            format!("{} is hidden", hidden.join(" and "))
        };
        return verdict(Outcome::Wrong, there);
    }
    if missed.is_empty() && wrong.is_empty() {
        let because = if beside.is_empty() {
            format!("{} named, nothing else", found.join(" and "))
        } else {
            format!(
                "{} is among the named, and records may fail to tell these apart",
                found.join(" and ")
            )
        };
        return verdict(Outcome::Right, because);
    }
    let mut because = format!("{} found", found.join(" and "));
    for (list, what) in [(missed, "missed"), (wrong, "not there")] {
        if !list.is_empty() {
            because.push_str(&format!("; {} {what}", list.join(" and ")));
        }
    }
    verdict(Outcome::PartlyRight, because)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::SealedEffect;

    fn truth(hidden: &[(&str, bool)], accepted: &[&str]) -> SealedTruth {
        let effect = |&(name, outside): &(&str, bool)| SealedEffect {
            effect: name.to_owned(),
            outside_of_the_catalogue: outside,
            strength: "medium".to_owned(),
            contribution_percent: 1.5,
            parameters: Vec::new(),
        };
        SealedTruth {
            hidden: hidden.iter().map(effect).collect(),
            accepted: accepted.iter().map(|&name| name.to_owned()).collect(),
            family: "preisach".to_owned(),
            stroke_um: 20.0,
            full_v: 150.0,
            noise_rms_um: 1e-3,
            seed: 1,
        }
    }

    #[test]
    fn val_judgements() {
        let delay = truth(&[("delay", false)], &["delay"]);
        let creep = truth(&[("creep", false)], &["creep"]);
        let nothing = truth(&[], &["none", "hysteresis-shape"]);
        let outside = truth(&[("telegraph", true)], &["unknown"]);
        let pair = truth(&[("creep", false), ("delay", false)], &["creep", "delay"]);
        use Outcome::{PartlyRight, Right, Wrong};
        for (truth, names, wanted) in [
            (&delay, &["delay"][..], Right),
            (&delay, &["delay", "first-order-lag"], Right),
            (&delay, &["first-order-lag"], Wrong),
            (&delay, &["delay", "creep"], PartlyRight),
            (&delay, &["none"], Wrong),
            (&creep, &["creep", "thermal-drift"], PartlyRight),
            (&nothing, &["none"], Right),
            (&nothing, &["hysteresis-shape"], Right),
            (&nothing, &["creep"], Wrong),
            (&outside, &["unknown"], Right),
            (&outside, &["none"], Wrong),
            (&pair, &["creep"], PartlyRight),
            (&pair, &["delay", "creep"], Right),
            (&pair, &["delay", "creep", "first-order-lag"], Right),
            (&pair, &["resonance", "slew-limit"], Wrong),
        ] {
            let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
            let judged = judge(&Answer::new(&names).unwrap(), truth);
            assert_eq!(judged.outcome, wanted, "{names:?}: {judged:?}");
        }
    }

    #[test]
    fn refuse_answers_that_are_none() {
        let refused = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
            Answer::new(&names).unwrap_err()
        };
        assert!(refused(&["gremlins"]).contains("allowed are asymmetry"));
        assert!(refused(&["none", "delay"]).contains("stands alone"));
        assert!(refused(&["delay", "delay"]).contains("twice"));
    }
}
