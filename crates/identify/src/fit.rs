//! All parameters of a model in one call.

use crate::columns::{Design, Run};
use crate::covered::Covered;
use crate::error::IdentifyError;
use crate::family::{Direction, FADING_ELEMENTS, FREE_PLAYS, Family, MAX_PLAYS, peak_to_peak, range};
use crate::history::record_errors;
use crate::initial;
use crate::model::{FittedOn, FittedRecord, Method, Model};
use crate::objective::{self, Weighting, runs};
use crate::placement::{Placement, fading_lengths, free_thresholds, thresholds};
use crate::search::{Search, Shape, Thinned};
use crate::separable::{self, Solved};
use crate::start_state::InitialState;
use crate::{mpso, uncertainty};
use hysteron_data::{Dataset, Role};

/// What to fit and how.
#[derive(Debug, Clone, Copy)]
pub struct FitOptions {
    /// The model.
    pub family: Family,
    /// Which way it runs.
    pub direction: Direction,
    /// Number of play operators, 1 to [`MAX_PLAYS`].
    pub plays: usize,
    /// Where the thresholds stand.
    pub placement: Placement,
    /// How parameters are searched.
    pub method: Method,
    /// How records are weighed.
    pub weighting: Weighting,
    /// Seed of the swarm; the separable method has nothing random.
    pub seed: u64,
}

impl FitOptions {
    /// The defaults for a family: forward, 10 plays (18 of the free shape) placed on the data, separable, records weighed as they
    /// are reported.
    pub fn new(family: Family) -> Self {
        Self {
            family,
            direction: Direction::Forward,
            plays: default_plays(family),
            placement: Placement::Data,
            method: Method::Separable,
            weighting: Weighting::Record,
            seed: 1,
        }
    }

    /// The paper's own settings: direct inverse, N = 10 by eq. 16, weights by eq. 18.
    pub fn paper(family: Family) -> Self {
        Self {
            direction: Direction::Inverse,
            placement: Placement::Eq16,
            weighting: Weighting::LoopOpening,
            ..Self::new(family)
        }
    }
}

/// Plays of a family where none are asked for: the paper's ten, or those of the free shape.
pub fn default_plays(family: Family) -> usize {
    match family {
        Family::PlayPolynomial => FREE_PLAYS,
        Family::Duhem => FADING_ELEMENTS,
        Family::Pi | Family::Mpi | Family::Wrpi | Family::Mrpi => 10,
    }
}

/// A fitted model and the objective it reached.
#[derive(Debug, Clone)]
pub struct FitReport {
    /// The model.
    pub model: Model,
    /// Value of the objective (eq. 17 with the chosen weights).
    pub objective: f64,
}

/// Fits a model to the records with role `identify`. `progress` is called with the share done, 0 to 1.
///
/// The initial state of each record is unknown; it is guessed, the model fitted, the state chosen again under the
/// model, and the model fitted again.
///
/// # Errors
/// - No record to identify, or none that moves.
/// - A number of plays out of range, or more parameters than samples.
/// - [`Method::Mpso`] for a family the paper does not fit that way.
///
/// # Cost
/// Separable: linear in the samples times the square of the columns; memory the square of the columns a record.
///
/// # Example
/// ```
/// use hysteron_data::{Dataset, Record, Role};
/// // A stage of one play, 5 V wide, at 0.1 um/V, and its answer to 60 V at 5 Hz.
/// let voltage_v: Vec<f64> = (0..2000).map(|k| 30.0 - 30.0 * (std::f64::consts::TAU * f64::from(k) / 400.0).cos()).collect();
/// let mut play = 0.0_f64;
/// let position_um = voltage_v.iter().map(|&v| { play = play.clamp(v - 5.0, v + 5.0); 0.08 * v + 0.02 * play }).collect();
/// let record = Record::new("sine.csv", Role::Identify, 5e-4, voltage_v, position_um);
/// let dataset = Dataset { records: vec![record], ..Dataset::default() };
///
/// use hysteron_identify::{Family, FitOptions, fit, record_errors};
/// let report = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ())?;
/// let errors = record_errors(&dataset, &report.model);
/// assert!(errors[0].percent.is_some_and(|percent| percent < 1.0)); // of peak to peak
/// # Ok::<(), hysteron_identify::IdentifyError>(())
/// ```
pub fn fit(
    dataset: &Dataset,
    options: &FitOptions,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<FitReport, IdentifyError> {
    let clipped = objective::clipped(dataset, options.direction);
    let mut runs = runs(dataset, options.direction, options.weighting, &clipped);
    check(&runs, options)?;
    let inputs: Vec<&[f64]> = runs.iter().map(|run| run.input).collect();
    let placed = match (options.family, options.placement) {
        (Family::PlayPolynomial, Placement::Data) => free_thresholds(options.plays, &inputs),
        (Family::Duhem, _) => fading_lengths(options.plays, &inputs),
        (_, placement) => thresholds(placement, options.plays, &inputs),
    };
    if options.family.is_free() && options.direction == Direction::Forward {
        return free_shape(dataset, options, &runs, placed, progress);
    }
    let rate_independent = Design::still(options.family, placed.clone());
    for run in &mut runs {
        initial::skip_unsettled(&rate_independent, run);
    }
    // A level taken for granted, where plays wider than the swing hold something, would bend all plays.
    let open: Vec<bool> = runs
        .iter()
        .map(|run| initial::holds_a_level(&rate_independent, run.input, run.initial))
        .collect();
    if !open.iter().all(|open| *open) {
        for (run, open) in runs.iter_mut().zip(open) {
            run.level_free = open;
        }
    }
    // The swarm starts from the same initial states as the separable fit, so that both minimise the same objective.
    let first = separable::solve(options.family, placed.clone(), &runs, &|share| progress(0.5 * share));
    let mut changed = false;
    for run in &mut runs {
        let chosen = initial::choose(&first.design, &first.coefficients, run);
        changed |= chosen != run.initial || run.level_free;
        (run.initial, run.level_free) = (chosen, false);
    }
    let solved = match options.method {
        Method::Separable if !changed => first,
        Method::Separable => separable::solve(options.family, placed, &runs, &|share| progress(0.5 + 0.4 * share)),
        Method::Mpso => {
            let swarmed = mpso::solve(options.family, placed, &runs, options.seed, progress);
            let normals = separable::normals(&swarmed.design, &runs, 1);
            Solved {
                design: swarmed.design,
                coefficients: swarmed.coefficients,
                ridge: separable::RIDGE,
                normals,
            }
        }
    };
    let objective = runs
        .iter()
        .map(|run| run.weight * solved.design.squared_error(&solved.coefficients, run))
        .sum();
    let mut model = assemble(dataset, options, &runs, &solved);
    model.cover(dataset);
    progress(1.0);
    Ok(FitReport { model, objective })
}

/// The free shape is fitted as every chain around it is: one search.
fn free_shape(
    dataset: &Dataset,
    options: &FitOptions,
    runs: &[Run<'_>],
    thresholds: Vec<f64>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<FitReport, IdentifyError> {
    let stroke_um = runs.iter().map(|run| peak_to_peak(run.output)).fold(0.0, f64::max);
    let skeleton = skeleton(dataset, options, thresholds);
    progress(0.1);
    let thinned = Thinned::of(dataset, QUIET * stroke_um);
    let search = Search::new(&thinned, &skeleton, &Shape::Own, QUIET * stroke_um)?;
    progress(0.9);
    let mut model = search.model();
    model.cover(dataset);
    let objective = runs
        .iter()
        .zip(
            record_errors(dataset, &model)
                .iter()
                .filter(|error| error.role == Role::Identify),
        )
        .map(|(run, error)| run.weight * run.output.len() as f64 * error.rms.powi(2))
        .sum();
    progress(1.0);
    Ok(FitReport { model, objective })
}

/// Noise that a fit of the hysteresis alone reckons with, as a share of the stroke: below it no record is worth more than another.
const QUIET: f64 = 1e-4;

/// A model of which nothing is fitted yet.
fn skeleton(dataset: &Dataset, options: &FitOptions, thresholds: Vec<f64>) -> Model {
    Model {
        family: options.family,
        direction: options.direction,
        thresholds,
        envelope: None,
        envelope_errors: None,
        coefficients: Vec::new(),
        standard_errors: Vec::new(),
        input_min: 0.0,
        input_max: 0.0,
        effects: Vec::new(),
        history: Vec::new(),
        fitted_on: FittedOn {
            dataset: dataset.name.clone(),
            method: options.method,
            weighting: options.weighting,
            placement: options.placement,
            seed: None,
            ridge: 0.0,
            noise: None,
            records: Vec::new(),
        },
        covered: Covered::default(),
        notices: Vec::new(),
    }
}

fn check(runs: &[Run<'_>], options: &FitOptions) -> Result<(), IdentifyError> {
    if runs.is_empty() {
        return Err(IdentifyError::NothingToFit);
    }
    if !(1..=MAX_PLAYS).contains(&options.plays) {
        return Err(IdentifyError::Plays {
            plays: options.plays,
            max: MAX_PLAYS,
        });
    }
    if options.family == Family::Duhem && options.direction == Direction::Inverse {
        return Err(IdentifyError::ForwardOnly { family: options.family });
    }
    if options.method == Method::Mpso && options.family.is_free() {
        return Err(IdentifyError::NoSwarm {
            family: options.family.name(),
        });
    }
    if runs.iter().all(|run| peak_to_peak(run.input) <= 0.0) {
        let input = match options.direction {
            Direction::Forward => "voltage",
            Direction::Inverse => "position",
        };
        return Err(IdentifyError::NoExcitation { input });
    }
    let parameters = 1 + options.family.input_powers().len() + options.plays * options.family.coefficients_a_play();
    let samples = runs.iter().map(|run| run.input.len()).sum();
    if samples <= parameters {
        return Err(IdentifyError::TooFewSamples { samples, parameters });
    }
    Ok(())
}

fn assemble(dataset: &Dataset, options: &FitOptions, runs: &[Run<'_>], solved: &Solved) -> Model {
    let errors = uncertainty::standard_errors(solved, runs);
    let Design {
        family,
        ref thresholds,
        envelope,
    } = solved.design;
    let (input_min, input_max) = range(runs.iter().flat_map(|run| run.input.iter().copied()));
    let records = dataset
        .with_role(Role::Identify)
        .zip(runs)
        .map(|(record, run)| FittedRecord {
            file: record.file.clone(),
            samples: record.len(),
            sample_rate_hz: record.rate_hz(),
            initial_state: run.initial.to_string(),
            fitted_from: run.fit_from,
            weight: run.weight,
        })
        .collect();
    let mut model = Model {
        family,
        direction: options.direction,
        thresholds: thresholds.clone(),
        envelope: (family == Family::Mrpi).then_some(envelope),
        envelope_errors: errors.envelope,
        coefficients: solved.coefficients.clone(),
        standard_errors: errors.coefficients,
        input_min,
        input_max,
        effects: Vec::new(),
        history: Vec::new(),
        fitted_on: FittedOn {
            dataset: dataset.name.clone(),
            method: options.method,
            weighting: options.weighting,
            placement: options.placement,
            seed: (options.method == Method::Mpso).then_some(options.seed),
            ridge: solved.ridge,
            noise: None,
            records,
        },
        covered: Covered::default(),
        notices: Vec::new(),
    };
    model.notices = notices(&model, runs, &errors.undetermined);
    model
}

/// What the user should know of the fit, in sentences.
fn notices(model: &Model, runs: &[Run<'_>], undetermined: &[Vec<usize>]) -> Vec<String> {
    let names: Vec<String> = model.parameters().into_iter().map(|parameter| parameter.name).collect();
    let mut notices: Vec<String> = undetermined
        .iter()
        .map(|group| {
            let members: Vec<&str> = group.iter().filter_map(|&i| names.get(i).map(String::as_str)).collect();
            format!(
                "the data determine only a combination of {}; each alone means nothing",
                members.join(", ")
            )
        })
        .collect();
    let rates = runs.iter().map(|run| run.period_s);
    let (fastest, slowest) = range(rates);
    if slowest > 1.001 * fastest && matches!(model.family, Family::Mrpi | Family::Wrpi) {
        notices.push(format!(
            "records of different rates ({:.6} to {:.6} Hz): the input's rate is the backward difference at each record's own rate",
            1.0 / slowest,
            1.0 / fastest
        ));
    }
    if let (Some(envelope), Some(errors)) = (model.envelope, model.envelope_errors) {
        for (name, value, error) in [
            ("alpha", envelope.alpha_s, errors[0]),
            ("beta", envelope.beta_s, errors[1]),
        ] {
            if value < 2.0 * error {
                notices.push(format!(
                    "{name} = {:.3} us is not significant (standard error {:.3} us): these records show no rate dependence on that branch",
                    1e6 * value,
                    1e6 * error
                ));
            }
        }
    }
    let estimated = runs
        .iter()
        .filter(|run| matches!(run.initial, InitialState::Remanent { fraction } if fraction > 0.0));
    let count = estimated.count();
    let skipped: usize = runs.iter().map(|run| run.fit_from).sum();
    if count > 0 {
        let left_out = match skipped {
            0 => String::new(),
            1 => "; 1 sample before the plays had settled is not fitted".to_owned(),
            _ => format!("; {skipped} samples before the plays had settled are not fitted"),
        };
        notices.push(format!(
            "{count} of {} records start in a state that the file does not give; the state is estimated (initial_state)\
             {left_out}",
            runs.len()
        ));
    }
    notices
}
