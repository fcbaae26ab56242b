//! One case: what a user has, and what is true.

use std::borrow::Cow;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::contribution;
use super::effect::{Asked, Effect, Strength};
use super::forms::Form;
use super::laboratory::{Laboratory, StageFamily, log_uniform};
use super::programme::{self, Planned};
use super::readout::{self, Motion, Setup};
use crate::error::StageError;

/// What a case should be.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Spec {
    /// The effects to hide; none for a control.
    pub hidden: Vec<Asked>,
    /// The stage's hysteresis; drawn from the seed if not given.
    pub family: Option<StageFamily>,
    /// Changes the sensor's noise and nothing else.
    pub noise_seed: u64,
}

impl Spec {
    /// A case with one effect.
    pub fn one(effect: Effect, strength: Strength) -> Self {
        Self {
            hidden: vec![Asked { effect, strength }],
            ..Self::default()
        }
    }
}

/// What a record is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// To fit models to.
    Identify,
    /// To judge models on.
    Validate,
}

/// The family of the model that the user has at the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Prandtl-Ishlinskii.
    Pi,
    /// Modified Prandtl-Ishlinskii.
    Mpi,
    /// Modified rate-dependent Prandtl-Ishlinskii.
    Mrpi,
}

impl Start {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::Mpi => "mpi",
            Self::Mrpi => "mrpi",
        }
    }
}

/// One record as it was taken, uniformly sampled from time zero.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseRecord {
    /// Name without extension.
    pub name: String,
    /// What it is for.
    pub role: Use,
    /// The excitation, for people.
    pub excitation: String,
    /// Sample period, seconds.
    pub period_s: f64,
    /// Command, volts at the actuator.
    pub voltage_v: Vec<f64>,
    /// Reading, micrometres.
    pub position_um: Vec<f64>,
    /// Temperature beside the stage, degrees Celsius, where it is recorded.
    pub temperature_c: Option<Vec<f64>>,
    /// Command of the other axis, where there is one, volts.
    pub voltage2_v: Option<Vec<f64>>,
}

/// A named number.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit, in words where it has none.
    pub unit: &'static str,
}

impl Parameter {
    pub(super) fn new(name: &str, value: f64, unit: &'static str) -> Self {
        Self {
            name: name.to_owned(),
            value,
            unit,
        }
    }
}

/// An effect that is there.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// Which.
    pub effect: Effect,
    /// How strong.
    pub strength: Strength,
    /// What it alone adds to the error: the distance between the readings with and without it, after the best common gain and offset, rms in percent of each
    /// record's peak to peak, root mean square over the records that move.
    pub contribution_percent: f64,
    /// What it is in numbers.
    pub parameters: Vec<Parameter>,
}

/// What is true of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// What is hidden.
    pub hidden: Vec<Hidden>,
    /// Family of the stage's hysteresis.
    pub family: StageFamily,
    /// Stroke, micrometres.
    pub stroke_um: f64,
    /// Full voltage, volts.
    pub full_v: f64,
    /// Noise of the sensor, micrometres rms.
    pub noise_rms_um: f64,
    /// The seed that it was made from.
    pub seed: u64,
}

impl Truth {
    /// The verdicts that are right: any effect of the catalogue that is hidden, `unknown` where others are, `none` or `hysteresis-shape` where none is.
    pub fn accepted_verdicts(&self) -> Vec<&'static str> {
        if self.hidden.is_empty() {
            return vec!["none", "hysteresis-shape"];
        }
        let mut names = Vec::new();
        for hidden in &self.hidden {
            let here: &[&'static str] = match hidden.effect {
                // Plays that forget widen the loops with the rate and relax at rest: both names say what happens.
                Effect::MemoryLeak => &["unknown", "rate-dependence", "creep"],
                effect if effect.is_outside() => &["unknown"],
                effect => &[effect.name()],
            };
            names.extend(here.iter().filter(|name| !names.contains(*name)).collect::<Vec<_>>());
        }
        names
    }
}

/// A case: records, and the model to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// In the order taken.
    pub records: Vec<CaseRecord>,
    /// Full voltage, volts.
    pub full_v: f64,
    /// The model to start from. It does not contain the hidden effect: no bent superposition where the asymmetry is hidden, no rate where the rate is.
    pub start: Start,
}

/// Makes the case of a seed.
///
/// The same seed always has the same stage, sensor, laboratory and programme, whatever is hidden in it, but for
/// two columns: the other axis is there wherever it couples, and the temperature wherever the stage ages, because nothing else tells that from a
/// gain that follows the temperature.
/// Effects of a pair are sized alone.
///
/// # Errors
/// A strength that the effect cannot reach on this stage in six draws of its form ([`StageError::Conflict`]): take another seed.
///
/// # Cost
/// Each play of the programme takes 0.1 to 0.4 s on a current PC; there are 2 to 5 of them.
///
/// # Example
/// ```
/// use hysteron_plant::challenge::{Effect, Spec, Strength, generate};
/// let (case, truth) = generate(7, &Spec::one(Effect::Vibration, Strength::Medium))?;
/// assert_eq!(case.records.len(), 15);
/// assert_eq!(truth.accepted_verdicts(), ["unknown"]);
/// assert!((1.0..=2.0).contains(&truth.hidden[0].contribution_percent));
/// # Ok::<(), hysteron_plant::StageError>(())
/// ```
pub fn generate(seed: u64, spec: &Spec) -> Result<(Case, Truth), StageError> {
    let rng = |n: u64| Pcg64::seed_from_u64(seed.wrapping_add(n.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
    let mut laboratory = Laboratory::draw(spec.family, &mut rng(1))?;
    let hides = |effect| spec.hidden.iter().any(|asked| asked.effect == effect);
    laboratory.has_other_axis |= hides(Effect::CrossCoupling);
    laboratory.records_temperature |= hides(Effect::Ageing);
    let programme = programme::plan(&laboratory, &mut rng(2))?;
    let stage_seed: u64 = rng(3).random();
    let stage = Setup {
        config: laboratory.config.clone(),
        curve: None,
        outside: Vec::new(),
    };
    let motion = readout::play(&stage.config, &programme, stage_seed)?;
    let reading_um = stage.read(&motion, &programme);
    let bare = Bare {
        laboratory,
        programme,
        stage_seed,
        stage,
        motion,
        reading_um,
    };
    let mut setup = bare.stage.clone();
    let mut hidden = Vec::with_capacity(spec.hidden.len());
    for (place, asked) in spec.hidden.iter().enumerate() {
        let (form, size, contribution_percent) = bare.fit(*asked, &mut rng(10 + place as u64))?;
        form.apply(size, &bare.laboratory, &mut setup);
        let parameters = form.parameters(size, &bare.laboratory);
        hidden.push(Hidden {
            effect: asked.effect,
            strength: asked.strength,
            contribution_percent,
            parameters,
        });
    }
    let motion = bare.moved(&setup)?;
    let mut positions_um = setup.read(&motion, &bare.programme);
    let noise_seed = rng(4).random::<u64>().wrapping_add(spec.noise_seed);
    let Laboratory {
        noise_rms_um,
        step_um,
        full_v,
        stroke_um,
        family,
        ..
    } = bare.laboratory;
    readout::record(&mut positions_um, noise_rms_um, step_um, noise_seed);
    let start = start(spec, &mut rng(5));
    let case = Case {
        records: bare.records(motion.into_owned(), positions_um),
        full_v,
        start,
    };
    Ok((
        case,
        Truth {
            hidden,
            family,
            stroke_um,
            full_v,
            noise_rms_um,
            seed,
        },
    ))
}

/// The model to start from: one in four PI, one in four MPI, else MRPI, as far as it lacks what is hidden. With nothing hidden but what
/// the loops alone tell it is not PI, which has no asymmetry while stages do: it would lack something else as well.
fn start(spec: &Spec, rng: &mut Pcg64) -> Start {
    let drawn = [Start::Pi, Start::Mpi, Start::Mrpi, Start::Mrpi][rng.random_range(0..4_usize)];
    let hides = |effect| spec.hidden.iter().any(|asked| asked.effect == effect);
    match drawn {
        _ if hides(Effect::Asymmetry) => Start::Pi,
        Start::Mrpi if hides(Effect::RateDependence) => Start::Mpi,
        Start::Pi if spec.hidden.iter().all(|asked| asked.effect.is_shape()) => Start::Mpi,
        drawn => drawn,
    }
}

/// The stage with nothing hidden in it, and how it reads.
struct Bare {
    laboratory: Laboratory,
    programme: Vec<Planned>,
    stage_seed: u64,
    stage: Setup,
    motion: Vec<Motion>,
    reading_um: Vec<Vec<f64>>,
}

impl Bare {
    /// The motion of a stage; that of this one where nothing differs before the reading.
    fn moved(&self, setup: &Setup) -> Result<Cow<'_, [Motion]>, StageError> {
        if setup.config == self.stage.config {
            return Ok(Cow::Borrowed(&self.motion));
        }
        readout::play(&setup.config, &self.programme, self.stage_seed).map(Cow::Owned)
    }

    /// Draws a form of the effect and finds its size.
    fn fit(&self, asked: Asked, rng: &mut Pcg64) -> Result<(Form, f64, f64), StageError> {
        const DRAWS: usize = 6;
        let (low_percent, high_percent) = asked.strength.band_percent();
        for _ in 0..DRAWS {
            let form = Form::draw(asked.effect, &self.laboratory, &self.programme, rng);
            let target_percent = rng.random_range(low_percent.ln()..high_percent.ln()).exp();
            let contribution = |size: f64| {
                let mut setup = self.stage.clone();
                form.apply(size, &self.laboratory, &mut setup);
                let reading_um = setup.read(&self.moved(&setup)?, &self.programme);
                Ok(contribution::percent(&self.reading_um, &reading_um))
            };
            // The search ends wherever it first meets the band: started from one place, it would always find the same size.
            let range = (form.start * log_uniform(rng, 0.4, 2.5), form.most);
            if let Some((size, percent)) = contribution::size_for(asked.strength, target_percent, range, contribution)?
            {
                return Ok((form, size, percent));
            }
        }
        Err(StageError::Conflict {
            what: format!(
                "{} cannot add {low_percent} to {high_percent} % on this stage ({} hysteresis)",
                asked.effect.name(),
                self.laboratory.family.name()
            ),
            advice: "take another seed or a weaker effect",
        })
    }

    fn records(&self, motion: Vec<Motion>, positions_um: Vec<Vec<f64>>) -> Vec<CaseRecord> {
        let take = |(planned, (motion, position_um)): (&Planned, (Motion, Vec<f64>))| CaseRecord {
            name: planned.name.clone(),
            role: planned.role,
            excitation: planned.excitation.clone(),
            period_s: planned.period_s,
            voltage_v: planned.voltage_v.clone(),
            position_um,
            temperature_c: self.laboratory.records_temperature.then_some(motion.temperature_c),
            voltage2_v: planned.voltage2_v.clone(),
        };
        self.programme
            .iter()
            .zip(motion.into_iter().zip(positions_um))
            .map(take)
            .collect()
    }
}
