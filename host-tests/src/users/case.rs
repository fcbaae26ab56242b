//! A case: what a user has, what is held out, what is hidden, and the stage to ask again.

use super::hidden::{Effect, Form, Hidden, Outside, Scale};
use super::loops::{Family, Loops};
use super::programme::{OTHER_RANGE_V, Plan, Programme, Setting, plan};
use super::reference::left_percent;
use super::rig::{Command, Drive, Instrument, Played, Rig};
use super::stage::Stage;
use hysteron_data::{Dataset, Known, Record, Role};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What is to be hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Nothing.
    Nothing,
    /// One effect of the catalogue.
    One,
    /// Something outside of it.
    Outside,
    /// Two effects of it.
    Pair,
}

/// What is wanted of a case; what is open is drawn by its seed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spec {
    /// The programme.
    pub programme: Option<Programme>,
    /// The family.
    pub family: Option<Family>,
    /// How much is hidden.
    pub kind: Option<Kind>,
    /// The effect, of `Kind::One`.
    pub effect: Option<Effect>,
    /// What each hidden thing adds to what a start model leaves, percent of peak to peak.
    pub adds_percent: Option<f64>,
}

impl Spec {
    /// Of all cases only a programme, a family, an effect, or one of nothing, one, outside, pair; none for another word.
    pub fn only(word: &str) -> Option<Self> {
        let kinds = [
            ("nothing", Kind::Nothing),
            ("one", Kind::One),
            ("outside", Kind::Outside),
            ("pair", Kind::Pair),
        ];
        let spec = Self {
            programme: Programme::ALL.into_iter().find(|programme| programme.name() == word),
            family: Family::ALL.into_iter().find(|family| family.name() == word),
            effect: Effect::ALL.into_iter().find(|effect| effect.name() == word),
            kind: kinds.into_iter().find(|(name, _)| *name == word).map(|(_, kind)| kind),
            adds_percent: None,
        };
        let known = spec.programme.is_some() || spec.family.is_some() || spec.effect.is_some() || spec.kind.is_some();
        known.then_some(spec)
    }
}

/// A hidden thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// What it is.
    pub hidden: Hidden,
    /// In which form.
    pub form: &'static str,
    /// What it alone adds to what a start model leaves, percent of peak to peak, in quadrature.
    pub adds_percent: f64,
}

/// What is true of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// What is hidden.
    pub parts: Vec<Part>,
    /// How much was to be hidden.
    pub kind: Kind,
    /// What a start model leaves with nothing hidden, percent of peak to peak.
    pub bare_percent: f64,
    /// Opening of the loops, percent of the stroke.
    pub opening_percent: f64,
    /// Stroke, micrometres.
    pub stroke_um: f64,
    /// Noise of the sensor, micrometres rms.
    pub noise_um: f64,
    /// Position late against voltage, seconds.
    pub skew_s: f64,
}

impl Truth {
    /// Verdicts that are right.
    pub fn accepted(&self) -> Vec<&'static str> {
        let named: Vec<_> = self
            .parts
            .iter()
            .filter(|part| matches!(part.hidden, Hidden::Effect(_)))
            .map(|part| part.hidden.name())
            .collect();
        if named.is_empty() {
            vec!["none", "unknown", "hysteresis-shape"]
        } else {
            named
        }
    }
}

/// What the user's rig can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Voltages.
    pub range_v: [f64; 2],
    /// Shortest sample period, seconds.
    pub period_s: f64,
    /// Most samples of a record: four times the longest that was taken.
    pub samples: usize,
}

/// A case.
#[derive(Debug, Clone)]
pub struct Case {
    /// Its seed.
    pub seed: u64,
    /// How it was recorded.
    pub programme: Programme,
    /// The family of its loops.
    pub family: Family,
    /// What the user has.
    pub dataset: Dataset,
    /// Two records more, held out of everything.
    pub held_out: Dataset,
    /// What is true.
    pub truth: Truth,
    /// What the rig can do.
    pub limits: Limits,
    rig: Rig,
    other_axis: bool,
}

/// Voltage ranges of amplifiers in use.
const RANGES_V: [[f64; 2]; 9] = [
    [0.0, 26.0],
    [-2.6, 26.0],
    [0.0, 100.0],
    [-10.0, 100.0],
    [0.0, 120.0],
    [-20.0, 130.0],
    [-15.0, 150.0],
    [0.0, 200.0],
    [-200.0, 1000.0],
];

impl Case {
    /// The case of a seed: the same for ever.
    pub fn generate(seed: u64, spec: &Spec) -> Self {
        Draft::new(seed, spec).finish(spec)
    }

    /// Plays a record on the stage as it now is, with the case's own instruments; nothing of the stage's state is kept.
    /// `other_v` moves the other axis, where the rig has one.
    pub fn play(&self, file: &str, period_s: f64, voltage_v: Vec<f64>, other_v: Option<Vec<f64>>) -> Record {
        let still = self.other_axis.then(|| vec![0.0; voltage_v.len()]);
        let drive = Drive {
            file: file.to_owned(),
            excitation: "asked for".to_owned(),
            role: Role::Identify,
            period_s,
            command: Command::Voltage(voltage_v),
            other_v: other_v.filter(|_| self.other_axis).or(still),
            lead_in: 0,
            pause_s: 1.0,
            jumps: false,
        };
        self.rig.clone().play(&drive).record
    }
}

/// A case on its way.
struct Draft {
    seed: u64,
    rng: Pcg64,
    programme: Programme,
    family: Family,
    kind: Kind,
    other_axis: bool,
    bare: Rig,
    plan: Plan,
    scale: Scale,
    opening_percent: f64,
    bare_percent: f64,
}

/// Stages that are drawn at most until one is plausible.
const MOST_DRAWS: usize = 12;

impl Draft {
    fn new(seed: u64, spec: &Spec) -> Self {
        let mut rng = Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9).wrapping_add(17));
        // Programmes in turn, families in turn: as many of each in any row of seeds.
        let (turn, round) = ((seed % 10) as usize, (seed / 10) as usize);
        let programme = spec.programme.unwrap_or(Programme::ALL[turn]);
        let family = spec.family.unwrap_or(Family::ALL[(turn + round) % Family::ALL.len()]);
        let drawn = match rng.random_range(0..20) {
            0..12 => Kind::One,
            12..15 => Kind::Nothing,
            15..18 => Kind::Outside,
            _ => Kind::Pair,
        };
        let kind = spec
            .kind
            .unwrap_or(if spec.effect.is_some() { Kind::One } else { drawn });
        let other_axis =
            spec.effect == Some(Effect::Coupling) || programme == Programme::Raster || rng.random_range(0.0..1.0) < 0.2;
        let mut draft = Self::drawn(seed, programme, family, kind, other_axis, &mut rng);
        for _ in 0..MOST_DRAWS {
            if draft.bare_percent < draft.plausible_percent() {
                break;
            }
            draft = Self::drawn(seed, programme, family, kind, other_axis, &mut rng);
        }
        Self { rng, ..draft }
    }

    /// Stages of which a start model leaves more than this with nothing hidden are none that anyone sells: the paper's model leaves 0.2
    /// to 2.5 % on measured ones. A skew adds its own.
    fn plausible_percent(&self) -> f64 {
        if self.programme == Programme::Skewed { 5.0 } else { 2.5 }
    }

    fn drawn(seed: u64, programme: Programme, family: Family, kind: Kind, other_axis: bool, rng: &mut Pcg64) -> Self {
        let opening = rng.random_range(0.08..0.2);
        let setting = Setting {
            range_v: RANGES_V[rng.random_range(0..RANGES_V.len())],
            stroke_um: 3.0 * 40f64.powf(rng.random_range(0.0..1.0)),
            other_axis,
        };
        let loops = Loops::draw(family, opening, rng);
        let opening_percent = 100.0 * loops.opening();
        let mut plan = plan(programme, &setting, rng);
        let bare = rig(programme, &setting, loops, &plan, seed, rng);
        for drive in &mut plan.drives {
            if let Command::ClosedLoop(reference, _) = &mut drive.command {
                reference.iter_mut().for_each(|y| *y += bare.stage.zero_um);
            }
        }
        let scale = scale(&plan, &setting, programme);
        let mut settled = bare.clone();
        settled.settle();
        let bare_percent = left_percent(&take(&mut settled, &plan.drives), setting.range_v);
        Self {
            seed,
            rng: rng.clone(),
            programme,
            family,
            kind,
            other_axis,
            bare,
            plan,
            scale,
            opening_percent,
            bare_percent,
        }
    }

    fn finish(mut self, spec: &Spec) -> Case {
        let (mut rig, mut parts) = (self.bare.clone(), Vec::new());
        let wanted = if self.kind == Kind::Pair {
            2
        } else {
            usize::from(self.kind != Kind::Nothing)
        };
        for hidden in self.candidates(spec) {
            if parts.len() == wanted {
                break;
            }
            let target = spec
                .adds_percent
                .unwrap_or_else(|| 1.2 * 4f64.powf(self.rng.random_range(0.0..1.0)));
            let form = Form::draw(hidden, self.scale, &mut self.rng);
            if let Some((strength, adds_percent)) = self.strength(&form, target) {
                form.install(strength, &mut rig);
                parts.push(Part {
                    hidden,
                    form: form.words,
                    adds_percent,
                });
            }
        }
        rig.settle();
        let taken = take(&mut rig, &self.plan.drives);
        let held = take(&mut rig, &self.plan.held_out);
        let dataset = |name: &str, played: Vec<Played>| Dataset {
            name: name.to_owned(),
            description: String::new(),
            known: Known::default(),
            records: played.into_iter().map(|played| played.record).collect(),
            notices: Vec::new(),
        };
        let truth = Truth {
            parts,
            kind: self.kind,
            bare_percent: self.bare_percent,
            opening_percent: self.opening_percent,
            stroke_um: rig.stage.stroke_um,
            noise_um: rig.instrument.noise_um,
            skew_s: rig.instrument.skew_s,
        };
        let dataset_of_user = dataset(&format!("user-{}", self.seed), taken);
        let longest = dataset_of_user.records.iter().map(Record::len).max().unwrap_or(0);
        Case {
            seed: self.seed,
            programme: self.programme,
            family: self.family,
            held_out: dataset("held-out", held),
            limits: Limits {
                range_v: rig.stage.range_v,
                period_s: self.scale.sample_s,
                samples: 4 * longest,
            },
            dataset: dataset_of_user,
            truth,
            other_axis: self.other_axis,
            rig,
        }
    }

    /// What may be hidden, in the order in which it is tried: what these records cannot contain at the strength is passed over.
    fn candidates(&mut self, spec: &Spec) -> Vec<Hidden> {
        if let Some(effect) = spec.effect {
            // Some forms of it may be beyond these records.
            return vec![Hidden::Effect(effect); 6];
        }
        let mut all: Vec<Hidden> = match self.kind {
            Kind::Nothing => Vec::new(),
            Kind::Outside => self.programme.outside().iter().copied().map(Hidden::Outside).collect(),
            _ => self.programme.effects().iter().copied().map(Hidden::Effect).collect(),
        };
        all.retain(|hidden| self.other_axis || *hidden != Hidden::Effect(Effect::Coupling));
        for k in (1..all.len()).rev() {
            let other = self.rng.random_range(0..=k);
            all.swap(k, other);
        }
        all
    }

    /// The strength at which a form alone adds so much, and how much it then adds; none where these records cannot contain it.
    fn strength(&self, form: &Form, target_percent: f64) -> Option<(f64, f64)> {
        let adds = |strength: f64| {
            let mut rig = self.bare.clone();
            form.install(strength, &mut rig);
            rig.settle();
            let left = left_percent(&take(&mut rig, &self.plan.drives), rig.stage.range_v);
            (left.powi(2) - self.bare_percent.powi(2)).max(0.0).sqrt()
        };
        let mut best = (1.0, adds(1.0));
        if best.1 < target_percent {
            return None;
        }
        let (mut low, mut high) = (1e-3_f64, 1.0_f64);
        for _ in 0..9 {
            let middle = (low * high).sqrt();
            let found = adds(middle);
            if (found / target_percent).ln().abs() < (best.1 / target_percent).ln().abs() {
                best = (middle, found);
            }
            if (found / target_percent - 1.0).abs() < 0.03 {
                break;
            }
            if found < target_percent {
                low = middle;
            } else {
                high = middle;
            }
        }
        // A bit of a converter is there or not: coarse steps are as they are.
        let near = if form.hidden == Hidden::Outside(Outside::StuckBit) {
            0.5..2.5
        } else {
            0.8..1.25
        };
        near.contains(&(best.1 / target_percent)).then_some(best)
    }
}

fn take(rig: &mut Rig, drives: &[Drive]) -> Vec<Played> {
    drives.iter().map(|drive| rig.play(drive)).collect()
}

fn scale(plan: &Plan, setting: &Setting, programme: Programme) -> Scale {
    let per_um = (setting.range_v[1] - setting.range_v[0]) / setting.stroke_um;
    let rate = |drive: &Drive| {
        let (values, factor) = match &drive.command {
            Command::Voltage(values) => (values, 1.0),
            Command::ClosedLoop(values, _) => (values, per_um),
        };
        values
            .windows(2)
            .map(|w| factor * (w[1] - w[0]).abs())
            .fold(0.0, f64::max)
            / drive.period_s
    };
    let length_s = plan
        .drives
        .iter()
        .map(|drive| match &drive.command {
            Command::Voltage(values) | Command::ClosedLoop(values, _) => {
                values.len() as f64 * drive.period_s + drive.pause_s
            }
        })
        .sum();
    Scale {
        rate_v_per_s: plan
            .drives
            .iter()
            .filter(|drive| !drive.jumps)
            .map(rate)
            .fold(0.0, f64::max),
        fastest_s: plan.fastest_s,
        length_s,
        sample_s: plan
            .drives
            .iter()
            .map(|drive| drive.period_s)
            .fold(f64::INFINITY, f64::min),
        warming_k: plan.room.warmer_k(length_s),
        other_v: OTHER_RANGE_V,
        monitor: programme == Programme::Monitor,
    }
}

fn rig(programme: Programme, setting: &Setting, loops: Loops, plan: &Plan, seed: u64, rng: &mut Pcg64) -> Rig {
    let stroke = setting.stroke_um;
    let bits = match programme {
        Programme::Scope => [8, 10, 12][rng.random_range(0..3)],
        _ => 16,
    };
    let codes = 2f64.powi(bits);
    let span = setting.range_v[1] - setting.range_v[0];
    let skew_s = rng.random_range(1e-5..4e-5) * if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
    let monitor = [
        1.0 + rng.random_range(-0.01..0.01),
        span * rng.random_range(-2e-3..2e-3),
        span * 2e-4,
    ];
    let instrument = Instrument {
        noise_um: stroke * 5e-5 * 8f64.powf(rng.random_range(0.0..1.0)),
        position_step_um: 1.3 * stroke / codes,
        voltage_step_v: 1.1 * span / codes,
        monitor: (programme == Programme::Monitor).then_some(monitor),
        skew_s: if programme == Programme::Skewed { skew_s } else { 0.0 },
        jitter_s: 0.0,
        stuck_bit: None,
        temperature_column: plan.temperature_column,
        reversed: programme != Programme::ClosedLoop && rng.random_range(0.0..1.0) < 0.08,
    };
    let stage = Stage {
        range_v: setting.range_v,
        stroke_um: stroke,
        loops,
        zero_um: stroke * rng.random_range(-0.05..0.05),
        before: Vec::new(),
        relaxing: None,
        after: Vec::new(),
        sensor: Vec::new(),
    };
    Rig::new(stage, instrument, plan.room, seed)
}
