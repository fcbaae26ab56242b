//! What is hidden: asked for, or drawn.

use crate::folder::Riddle;
use crate::truth::SealedTruth;
use crate::{ChallengeError, dataset, seal};
use hysteron_plant::challenge::{Asked, CATALOGUE, Effect, OUTSIDE, Spec, StageFamily, Strength, generate};
use rand::RngExt;

/// What a challenge is made of. The default draws everything, at medium strength.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Effects to hide instead of a drawn one; `none` hides nothing.
    pub effects: Vec<String>,
    /// `weak`, `medium` or `strong`.
    pub strength: String,
    /// Whether two effects of the catalogue are hidden.
    pub pair: bool,
    /// The stage's hysteresis; drawn if not given.
    pub family: Option<String>,
    /// Makes this stage and draws this effect again; whoever knows the seed knows the truth.
    pub seed: Option<u64>,
}

impl Default for Setting {
    fn default() -> Self {
        Self {
            effects: Vec::new(),
            strength: Strength::Medium.name().to_owned(),
            pair: false,
            family: None,
            seed: None,
        }
    }
}

/// Seeds tried: a stage may be unable to show the effect at its strength.
const DRAWS: usize = 5;

impl Setting {
    /// Draws the stage, plays the programme on it, seals the truth.
    ///
    /// # Errors
    /// A name that is not known, with those that are; a stage that cannot show the effect at its strength.
    ///
    /// # Cost
    /// Some seconds: each play of the programme takes 0.1 to 0.4 s, and there are 2 to 5 of them.
    pub fn make(&self) -> Result<Riddle, ChallengeError> {
        let strength = one_of("--strength", &self.strength, &Strength::ALL, Strength::name)?;
        let family = match &self.family {
            Some(name) => Some(one_of("--family", name, &StageFamily::ALL, StageFamily::name)?),
            None => None,
        };
        let mut refusal = None;
        for _ in 0..if self.seed.is_some() { 1 } else { DRAWS } {
            let seed = self.seed.unwrap_or_else(|| rand::rng().random());
            let hidden = self.hidden(seed)?.into_iter();
            let spec = Spec {
                hidden: hidden.map(|effect| Asked { effect, strength }).collect(),
                family,
                noise_seed: 0,
            };
            match generate(seed, &spec) {
                Err(error) => refusal = Some(error),
                Ok((case, truth)) => {
                    let (key, sealed) = seal::seal(&serde_json::to_string(&SealedTruth::new(&truth, seed))?);
                    return Ok(Riddle {
                        dataset: dataset(case, "challenge"),
                        sealed,
                        key,
                    });
                }
            }
        }
        Err(refusal.map_or_else(|| ChallengeError::Refused("no stage drawn".to_owned()), Into::into))
    }

    /// The effects to hide: those asked for; else drawn from the seed: nothing or one of outside of the catalogue once in
    /// eight each.
    fn hidden(&self, seed: u64) -> Result<Vec<Effect>, ChallengeError> {
        if !self.effects.is_empty() {
            return asked(&self.effects);
        }
        // A stream of its own (splitmix64): the stage is drawn from the same seed.
        let mut state = seed ^ 0x6A09_E667_F3BC_C908;
        let mut draw = |n: usize| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) % n as u64) as usize
        };
        let first = CATALOGUE[draw(CATALOGUE.len())];
        if self.pair {
            let others: Vec<Effect> = CATALOGUE.into_iter().filter(|&other| other != first).collect();
            return Ok(vec![first, others[draw(others.len())]]);
        }
        Ok(match draw(8) {
            0 => Vec::new(),
            1 => vec![OUTSIDE[draw(OUTSIDE.len())]],
            _ => vec![first],
        })
    }
}

fn asked(names: &[String]) -> Result<Vec<Effect>, ChallengeError> {
    if let [only] = names
        && only == "none"
    {
        return Ok(Vec::new());
    }
    let all: Vec<Effect> = CATALOGUE.into_iter().chain(OUTSIDE).collect();
    let effects: Vec<Effect> = names
        .iter()
        .map(|name| one_of("--effect", name, &all, Effect::name))
        .collect::<Result<_, _>>()?;
    match effects[..] {
        [_] => Ok(effects),
        [a, b] if a != b => Ok(effects),
        _ => Err(ChallengeError::Refused(format!(
            "--effect {}: one effect, two different ones, or `none` alone",
            names.join(" ")
        ))),
    }
}

fn one_of<T: Copy>(option: &str, name: &str, all: &[T], of: impl Fn(T) -> &'static str) -> Result<T, ChallengeError> {
    all.iter().copied().find(|&one| of(one) == name).ok_or_else(|| {
        let allowed: Vec<&str> = all.iter().map(|&one| of(one)).collect();
        ChallengeError::Refused(format!("{option} {name}: allowed are {}", allowed.join(", ")))
    })
}
