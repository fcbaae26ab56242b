//! Effect files: what stands in them, what is allowed, and the definition that comes out.

use super::expression::Expression;
use super::fault::{Fault, Spot};
use super::parser::{self, is_taken};
use super::user::UserEffect;
use crate::effect::{Description, Effect, Named, Place, Scene};
use crate::effect_file::{EffectFile, FileParameter};
use crate::error::{EffectError, InText};
use crate::family::Family;
use crate::id::EffectId;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// States of one effect: every one costs a column of the integrator's Jacobian.
pub(super) const MOST_STATES: usize = 4;

/// Parameters of one effect: no search over more is reliable.
const MOST_PARAMETERS: usize = 12;

/// Bytes of a file: the longest useful one has a few thousand.
const MOST_BYTES: u64 = 65_536;

/// Names of the variables that every expression knows, in the order of their values; states and parameters follow.
pub(super) const VARIABLES: [&str; 7] = ["u", "du", "t", "v", "temperature", "v2", "period"];
pub(super) const U: usize = 0;
pub(super) const DU: usize = 1;
pub(super) const T: usize = 2;
pub(super) const V: usize = 3;
pub(super) const TEMPERATURE: usize = 4;
pub(super) const V2: usize = 5;
pub(super) const PERIOD: usize = 6;

/// What moves a state.
#[derive(Debug)]
pub(super) enum Motion {
    Rate(Expression),
    Next(Expression),
}

/// The parsed expressions of a file.
#[derive(Debug)]
pub(super) struct Equations {
    pub output: Expression,
    /// Of each state.
    pub at_rest: Vec<Expression>,
    pub motions: Vec<Motion>,
}

impl Equations {
    /// Whether the output at a sample depends on the input at that sample alone.
    pub(super) fn is_pointwise(&self) -> bool {
        let motions = self.motions.iter().map(|motion| match motion {
            Motion::Rate(expression) | Motion::Next(expression) => expression,
        });
        let driven = self.at_rest.iter().chain(motions).any(|expression| expression.uses(U));
        !driven && !self.uses(DU)
    }

    /// Whether a variable stands in any of them.
    pub(super) fn uses(&self, variable: usize) -> bool {
        self.needs(variable, usize::MAX)
    }

    /// The equations with sample period and parameters put in.
    pub(super) fn with(&self, period_s: f64, parameters: &[f64]) -> Self {
        let first = VARIABLES.len() + self.motions.len();
        let known = |i: usize| match i {
            PERIOD => Some(period_s),
            i => i.checked_sub(first).and_then(|i| parameters.get(i)).copied(),
        };
        let motions = self.motions.iter().map(|motion| match motion {
            Motion::Rate(expression) => Motion::Rate(expression.with(known)),
            Motion::Next(expression) => Motion::Next(expression.with(known)),
        });
        Self {
            output: self.output.with(known),
            at_rest: self.at_rest.iter().map(|expression| expression.with(known)).collect(),
            motions: motions.collect(),
        }
    }

    /// The same as [`Self::uses`], the motion of one state left out: what only moves itself is of no use.
    fn needs(&self, variable: usize, but: usize) -> bool {
        let motions = self.motions.iter().enumerate().filter(|(i, _)| *i != but);
        let motions = motions.map(|(_, motion)| match motion {
            Motion::Rate(expression) | Motion::Next(expression) => expression,
        });
        let mut all = self.at_rest.iter().chain(motions).chain([&self.output]);
        all.any(|expression| expression.uses(variable))
    }
}

/// A checked effect file, ready to run.
#[derive(Debug)]
pub(super) struct Definition {
    pub file: EffectFile,
    pub description: Description,
    pub equations: Equations,
}

impl UserEffect {
    /// Reads an effect file.
    ///
    /// # Errors
    /// A file that cannot be opened, or as [`UserEffect::from_toml`].
    pub fn read(path: &Path) -> Result<Self, EffectError> {
        let file = path.display().to_string();
        let failed = |source| EffectError::Io {
            file: file.clone(),
            source,
        };
        let bytes = std::fs::metadata(path).map_err(failed)?.len();
        if bytes > MOST_BYTES {
            return Err(EffectError::File {
                reason: format!("{bytes} bytes; an effect file has at most {MOST_BYTES}"),
                file,
                at: None,
            });
        }
        let text = std::fs::read_to_string(path).map_err(failed)?;
        Self::from_toml(&text, &file)
    }

    /// Reads several effect files, each with an effect of a name of its own.
    ///
    /// # Errors
    /// As [`UserEffect::read`]; two effects of one name.
    pub fn read_all(paths: &[PathBuf]) -> Result<Vec<Self>, EffectError> {
        let mut effects: Vec<Self> = Vec::new();
        for path in paths {
            let effect = Self::read(path)?;
            if effects.iter().any(|other| other.name() == effect.name()) {
                return Err(EffectError::File {
                    file: path.display().to_string(),
                    reason: format!(
                        "another effect file names its effect `{}` as well; give each a name of its own",
                        effect.name()
                    ),
                    at: None,
                });
            }
            effects.push(effect);
        }
        Ok(effects)
    }

    /// Reads the text of an effect file; `name` is used in errors.
    ///
    /// # Errors
    /// - Not TOML, a field missing or unknown (with line and column).
    /// - A field whose value is not allowed, with what is allowed; an expression with the column in it.
    ///
    /// # Example
    /// ```
    /// use hysteron_effects::{Effect, UserEffect};
    /// let text = r#"
    /// name = "tilt"
    /// place = "sensor"
    /// summary = "The target is tilted against the sensor."
    /// output = "u * (1 + tilt)"
    /// [[parameter]]
    /// name = "tilt"
    /// unit = ""
    /// what = "relative error of the gain"
    /// min = -0.1
    /// max = 0.1
    /// "#;
    /// let tilt = UserEffect::from_toml(text, "tilt.toml")?;
    /// assert_eq!(tilt.effect().name().as_str(), "tilt");
    /// let wrong = UserEffect::from_toml(&text.replace("u * (", "x * ("), "tilt.toml").unwrap_err();
    /// assert!(wrong.to_string().starts_with("tilt.toml: output = \"x * (1 + tilt)\": column 1: unknown name `x`"));
    /// # Ok::<(), hysteron_effects::EffectError>(())
    /// ```
    pub fn from_toml(text: &str, name: &str) -> Result<Self, EffectError> {
        let file = Self::checked(text, name)?;
        Self::of(&file).map_err(|reason| EffectError::File {
            file: name.to_owned(),
            reason,
            at: None,
        })
    }

    /// Reads the text of an effect file and checks it, and keeps nothing of it: for a text that is still being written.
    ///
    /// # Errors
    /// As [`UserEffect::from_toml`].
    pub fn checked(text: &str, name: &str) -> Result<EffectFile, EffectError> {
        let refuse = |reason: String, at: Option<InText>| EffectError::File {
            file: name.to_owned(),
            reason,
            at,
        };
        if text.len() as u64 > MOST_BYTES {
            let reason = format!("{} bytes; an effect file has at most {MOST_BYTES}", text.len());
            return Err(refuse(reason, None));
        }
        let file: EffectFile = toml::from_str(text).map_err(|error| {
            let at = error
                .span()
                .map(|span| InText::at(text, span.start, error.message().to_owned()));
            refuse(error.to_string().trim().to_owned(), at)
        })?;
        match check(&file) {
            Ok(_) => Ok(file),
            Err(fault) => Err(refuse(fault.to_string(), fault.in_text(text))),
        }
    }

    /// The effect of a file's content; the same one for the same content, kept for the life of the program.
    ///
    /// # Errors
    /// In words, which field is wrong and what is allowed.
    pub fn of(file: &EffectFile) -> Result<Self, String> {
        static KNOWN: Mutex<Vec<&'static Definition>> = Mutex::new(Vec::new());
        let known = || KNOWN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(definition) = known().iter().find(|definition| definition.file == *file) {
            return Ok(Self(definition));
        }
        let definition: &'static Definition = Box::leak(Box::new(define(file).map_err(|fault| fault.to_string())?));
        known().push(definition);
        Ok(Self(definition))
    }
}

fn define(file: &EffectFile) -> Result<Definition, Fault> {
    let (place, equations) = check(file)?;
    Ok(Definition {
        description: describe(file, place, scene(&equations, place)),
        file: file.clone(),
        equations,
    })
}

/// Where the effect of a file stands, and its equations, where all of it is allowed.
fn check(file: &EffectFile) -> Result<(Place, Equations), Fault> {
    let place = place(&file.place)?;
    check_effect_name(&file.name)?;
    let texts = [
        ("summary", Some(&file.summary)),
        ("source", file.source.as_ref()),
        ("shows", file.shows.as_ref()),
        ("mistaken_for", file.mistaken_for.as_ref()),
        ("separated_by", file.separated_by.as_ref()),
        ("compensated_by", file.compensated_by.as_ref()),
    ];
    for (field, text) in texts {
        if text.is_some_and(|text| text.trim().is_empty()) {
            let or = if field == "summary" {
                ""
            } else {
                ", or leave the line out"
            };
            return Err(Spot::Effect(field).fault(format!("{field} is empty; say it in a sentence{or}")));
        }
    }
    if file.states.len() > MOST_STATES {
        let why = format!("{} states; allowed are up to {MOST_STATES}", file.states.len());
        return Err(Spot::Effect("state").fault(why));
    }
    if file.parameters.is_empty() || file.parameters.len() > MOST_PARAMETERS {
        return Err(Spot::Effect("parameter").fault(format!(
            "{} parameters; allowed are 1 to {MOST_PARAMETERS}: without one there is nothing to fit",
            file.parameters.len()
        )));
    }
    let own: Vec<&str> = file
        .states
        .iter()
        .map(|state| state.name.as_str())
        .chain(file.parameters.iter().map(|parameter| parameter.name.as_str()))
        .collect();
    let named = |i: usize| match i.checked_sub(file.states.len()) {
        Some(parameter) => Spot::Parameter(parameter, "name"),
        None => Spot::State(i, "name"),
    };
    for (i, name) in own.iter().enumerate() {
        check_name(name, &own[..i]).map_err(|why| named(i).fault(why))?;
    }
    for (i, parameter) in file.parameters.iter().enumerate() {
        check_parameter(parameter).map_err(|(field, why)| Spot::Parameter(i, field).fault(why))?;
    }
    let equations = parse(file, place < Place::Hysteresis, &own)?;
    for (i, name) in own.iter().enumerate() {
        if !equations.needs(VARIABLES.len() + i, i) {
            let why = format!("`{name}` moves nothing; let it stand in an expression or take it out");
            return Err(named(i).fault(why));
        }
    }
    Ok((place, equations))
}

fn place(name: &str) -> Result<Place, Fault> {
    const PLACES: [(&str, Place); 6] = [
        ("delay", Place::Delay),
        ("amplifier", Place::Amplifier),
        ("creep", Place::Creep),
        ("structure", Place::Structure),
        ("coupling", Place::Coupling),
        ("sensor", Place::Sensor),
    ];
    let allowed =
        "allowed are delay, amplifier (they act on the voltage), creep, structure, coupling, sensor (on the position)";
    match PLACES.iter().find(|(known, _)| *known == name) {
        Some((_, place)) => Ok(*place),
        None if name == "hysteresis" => Err(Spot::Effect("place").fault(format!(
            "place = \"hysteresis\": the plays have a memory that no expression of one input can reach into; write what acts \
             before or behind them, or choose another family with `hysteron fit --model`; {allowed}"
        ))),
        None => Err(Spot::Effect("place").fault(format!("place = \"{name}\"; {allowed}"))),
    }
}

fn check_effect_name(name: &str) -> Result<(), Fault> {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(allowed) || name.len() > 40 {
        return Err(Spot::Effect("name").fault(format!(
            "name = \"{name}\"; allowed are lower-case letters, digits and hyphens, a letter first, at most 40"
        )));
    }
    let verdicts = ["none", "unknown", "nothing"];
    let families = Family::ALL.map(Family::name);
    if EffectId::names().contains(&name) || verdicts.contains(&name) || families.contains(&name) {
        return Err(Spot::Effect("name").fault(format!(
            "name = \"{name}\" is taken by the catalogue, by a verdict or by a family; choose another, such as \"my-{name}\""
        )));
    }
    Ok(())
}

/// Names of states and parameters.
fn check_name(name: &str, before: &[&str]) -> Result<(), String> {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(allowed) || name.len() > 40 {
        return Err(format!(
            "`{name}` cannot be a parameter's or a state's name; allowed are lower-case letters, digits and _, a letter first, \
             at most 40"
        ));
    }
    if VARIABLES.contains(&name) || is_taken(name) {
        return Err(format!(
            "`{name}` means something else in every expression; choose another name"
        ));
    }
    if before.contains(&name) {
        return Err(format!(
            "`{name}` stands twice; states and parameters have names of their own"
        ));
    }
    Ok(())
}

/// Largest bound: micrometres, volts, hertz and seconds of a stage all stay far below.
const LARGEST: f64 = 1e12;

/// What is wrong with a parameter: the field, and why.
fn check_parameter(parameter: &FileParameter) -> Result<(), (&'static str, String)> {
    let FileParameter { name, min, max, .. } = parameter;
    let in_words = |field: &str, value: f64| format!("parameter `{name}`: {field} = {value}");
    for (field, value) in [("min", *min), ("max", *max)] {
        if !(-LARGEST..=LARGEST).contains(&value) {
            let why = format!("{}; allowed is -{LARGEST:e} to {LARGEST:e}", in_words(field, value));
            return Err((field, why));
        }
    }
    if min >= max {
        return Err(("min", format!("{} must be below max = {max}", in_words("min", *min))));
    }
    if parameter.what.trim().is_empty() {
        return Err(("what", format!("parameter `{name}`: what is empty; say what it is")));
    }
    let starts = parameter.starts.as_deref();
    if starts.is_some_and(|starts| starts.is_empty() || starts.len() > STARTS) {
        let why = format!(
            "parameter `{name}`: starts has {} values; allowed are 1 to {STARTS}, or leave it out",
            starts.map_or(0, <[f64]>::len)
        );
        return Err(("starts", why));
    }
    let fields = [("neutral", parameter.neutral)].into_iter();
    let starts = starts.unwrap_or_default().iter().map(|&start| ("starts", Some(start)));
    for (field, value) in fields.chain(starts) {
        if let Some(value) = value
            && !(*min..=*max).contains(&value)
        {
            let why = format!("{}; allowed is min to max, {min} to {max}", in_words(field, value));
            return Err((field, why));
        }
    }
    Ok(())
}

/// Points at which a search looks first.
pub(super) const STARTS: usize = 128;

fn parse(file: &EffectFile, before: bool, own: &[&str]) -> Result<Equations, Fault> {
    let mut names: Vec<&str> = VARIABLES.to_vec();
    if before {
        // The voltage at the stack is what such effects make.
        names[V] = "";
    }
    names.extend(own);
    let expression = |spot: Spot, field: &str, text: &str, names: &[&str]| {
        parser::parse(text, names).map_err(|mut misread| {
            if before && misread.why.contains("unknown name `v`") {
                misread.why += "; the voltage at the stack comes out of this effect: its input is u";
            }
            spot.in_expression(format!("{field} = \"{text}\""), misread)
        })
    };
    let (mut at_rest, mut motions) = (Vec::new(), Vec::new());
    let mut resting = names.clone();
    for name in &mut resting[VARIABLES.len()..VARIABLES.len() + file.states.len()] {
        // Where a state begins cannot depend on states.
        *name = "";
    }
    for (number, state) in file.states.iter().enumerate() {
        let of = |field: &'static str, text: &str, names: &[&str]| {
            let words = format!("state `{}`: {field}", state.name);
            expression(Spot::State(number, field), &words, text, names)
        };
        at_rest.push(of("at_rest", &state.at_rest, &resting)?);
        motions.push(match (&state.rate, &state.next) {
            (Some(rate), None) => Motion::Rate(of("rate", rate, &names)?),
            (None, Some(next)) => Motion::Next(of("next", next, &names)?),
            _ => {
                return Err(Spot::State(number, "name").fault(format!(
                    "state `{}` needs one of the two: rate (its change per second) or next (its new value at each sample)",
                    state.name
                )));
            }
        });
    }
    Ok(Equations {
        output: expression(Spot::Effect("output"), "output", &file.output, &names)?,
        at_rest,
        motions,
    })
}

/// The imagined record that shows it.
fn scene(equations: &Equations, place: Place) -> Scene {
    if equations.uses(V2) {
        Scene::OtherAxis
    } else if equations.uses(TEMPERATURE) || place == Place::Creep {
        Scene::Hold
    } else if place < Place::Hysteresis || equations.uses(DU) || !equations.motions.is_empty() {
        Scene::FastSine
    } else {
        Scene::SlowSine
    }
}

/// The words of a file as a description; they live as long as the program.
fn describe(file: &EffectFile, place: Place, scene: Scene) -> Description {
    let text = |text: &str| -> &'static str { Box::leak(text.trim().to_owned().into_boxed_str()) };
    let or = |given: &Option<String>| given.as_deref().map_or("the effect file does not say", text);
    let mut equation = String::new();
    for state in &file.states {
        let name = &state.name;
        equation += &match (&state.rate, &state.next) {
            (Some(rate), _) => format!("d{name}/dt = {rate}, at rest {}; ", state.at_rest),
            (_, next) => format!(
                "{name} = {} at each sample, at rest {}; ",
                next.as_deref().unwrap_or(""),
                state.at_rest
            ),
        };
    }
    let letter = if place < Place::Hysteresis { "v" } else { "y" };
    equation += &format!("{letter}' = {}", file.output);
    let named = |parameter: &FileParameter| Named {
        name: text(&parameter.name),
        unit: text(&parameter.unit),
        what: text(&format!(
            "{}; {} to {}",
            parameter.what.trim(),
            parameter.min,
            parameter.max
        )),
    };
    Description {
        name: text(&file.name),
        place,
        summary: text(&file.summary),
        equation: text(&equation),
        source: or(&file.source),
        parameters: Box::leak(file.parameters.iter().map(named).collect()),
        shows: or(&file.shows),
        mistaken_for: or(&file.mistaken_for),
        separated_by: or(&file.separated_by),
        compensated_by: or(&file.compensated_by),
        scene,
    }
}
