//! `model.toml`: readable, complete, and back bit for bit.

use crate::covered::Covered;
use crate::effects::{self, EffectId, UserEffect};
use crate::error::IdentifyError;
use crate::family::{Direction, Family};
use crate::model::{FittedEffect, FittedOn, Model, Parameter, Step};
use hysteron_core::envelope::Envelope;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    hysteron: String,
    direction: Direction,
    input_unit: String,
    output_unit: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    notices: Vec<String>,
    hysteresis: Hysteresis,
    #[serde(rename = "effect", default, skip_serializing_if = "Vec::is_empty")]
    effects: Vec<FittedEffect>,
    fitted_on: FittedOn,
    #[serde(default, skip_serializing_if = "nothing_covered")]
    covered: Covered,
    #[serde(rename = "step", default, skip_serializing_if = "Vec::is_empty")]
    history: Vec<Step>,
}

fn nothing_covered(covered: &Covered) -> bool {
    *covered == Covered::default()
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Hysteresis {
    family: Family,
    input_min: f64,
    input_max: f64,
    thresholds: Vec<f64>,
    #[serde(rename = "parameter")]
    parameters: Vec<FileParameter>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileParameter {
    name: String,
    value: f64,
    unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    standard_error: Option<f64>,
}

impl Model {
    /// The model as the text of a `model.toml`.
    pub fn to_toml(&self) -> String {
        let file = File {
            format: FORMAT,
            hysteron: env!("CARGO_PKG_VERSION").to_owned(),
            direction: self.direction,
            input_unit: self.direction.input_unit().to_owned(),
            output_unit: self.direction.output_unit().to_owned(),
            notices: self.notices.clone(),
            hysteresis: Hysteresis {
                family: self.family,
                input_min: self.input_min,
                input_max: self.input_max,
                thresholds: self.thresholds.clone(),
                parameters: self
                    .parameters()
                    .into_iter()
                    .map(|p| FileParameter {
                        name: p.name,
                        value: p.value,
                        unit: p.unit,
                        standard_error: p.standard_error,
                    })
                    .collect(),
            },
            effects: self.effects.clone(),
            fitted_on: self.fitted_on.clone(),
            covered: self.covered.clone(),
            history: self.history.clone(),
        };
        // Strings, numbers and lists of tables: nothing that TOML cannot hold.
        toml::to_string(&file).unwrap_or_default()
    }

    /// Reads the text of a `model.toml`; `name` is used in errors.
    ///
    /// # Errors
    /// - Not TOML, a field missing or unknown (with line and column).
    /// - Parameters that are not those of the family, thresholds that do not ascend, numbers that are not finite.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, IdentifyError> {
        let refuse = |reason: String| IdentifyError::ModelFile {
            file: name.to_owned(),
            reason,
        };
        let file: File = toml::from_str(text).map_err(|error| refuse(error.to_string().trim().to_owned()))?;
        if file.format != FORMAT {
            return Err(refuse(format!(
                "format = {}; this version reads format {FORMAT}",
                file.format
            )));
        }
        for (what, found, wanted) in [
            ("input_unit", &file.input_unit, file.direction.input_unit()),
            ("output_unit", &file.output_unit, file.direction.output_unit()),
        ] {
            if found != wanted {
                let direction = file.direction.name();
                return Err(refuse(format!(
                    "{what} = \"{found}\"; a model of direction {direction} has \"{wanted}\""
                )));
            }
        }
        let h = file.hysteresis;
        if h.family == Family::Duhem && file.direction == Direction::Inverse {
            return Err(refuse(IdentifyError::ForwardOnly { family: h.family }.to_string()));
        }
        check_thresholds(&h.thresholds).map_err(refuse)?;
        check_effects(&file.effects, file.direction).map_err(refuse)?;
        let mut model = Self {
            family: h.family,
            direction: file.direction,
            thresholds: h.thresholds,
            envelope: (h.family == Family::Mrpi).then_some(Envelope {
                alpha_s: 0.0,
                beta_s: 0.0,
            }),
            envelope_errors: None,
            coefficients: Vec::new(),
            standard_errors: Vec::new(),
            input_min: h.input_min,
            input_max: h.input_max,
            effects: file.effects,
            history: file.history,
            fitted_on: file.fitted_on,
            covered: file.covered,
            notices: file.notices,
        };
        model.take_parameters(&h.parameters).map_err(refuse)?;
        Ok(model)
    }

    /// Fills coefficients from the file's list, which must be the family's own.
    fn take_parameters(&mut self, found: &[FileParameter]) -> Result<(), String> {
        let plays = self.family.coefficients_a_play() * self.thresholds.len();
        let columns = 1 + self.family.input_powers().len() + plays;
        (self.coefficients, self.standard_errors) = (vec![0.0; columns], vec![None; columns]);
        let wanted = self.parameters();
        if found.len() != wanted.len() {
            let (family, plays) = (self.family, self.thresholds.len());
            let (n, wants) = (found.len(), wanted.len());
            return Err(format!("{n} parameters; {family} with {plays} thresholds has {wants}"));
        }
        for (found, wanted) in found.iter().zip(&wanted) {
            if found.name != wanted.name || found.unit != wanted.unit {
                let (name, unit, expected, in_unit) = (&found.name, &found.unit, &wanted.name, &wanted.unit);
                return Err(format!(
                    "parameter `{name}` in {unit} stands where `{expected}` in {in_unit} belongs"
                ));
            }
            if !found.value.is_finite() {
                return Err(format!(
                    "parameter `{}` = {}; it must be finite",
                    found.name, found.value
                ));
            }
        }
        for (i, parameter) in found.iter().take(columns).enumerate() {
            self.coefficients[i] = parameter.value;
            self.standard_errors[i] = parameter.standard_error;
        }
        if let [.., alpha, beta] = found
            && self.family == Family::Mrpi
        {
            if alpha.value < 0.0 || beta.value < 0.0 {
                return Err(format!(
                    "alpha = {} s, beta = {} s; both must be 0 or more",
                    alpha.value, beta.value
                ));
            }
            self.envelope = Some(Envelope {
                alpha_s: alpha.value,
                beta_s: beta.value,
            });
            self.envelope_errors = alpha.standard_error.zip(beta.standard_error).map(|(a, b)| [a, b]);
        }
        Ok(())
    }

    /// Reads a `model.toml`.
    ///
    /// # Errors
    /// As [`Model::from_toml`], and when the file cannot be opened.
    pub fn read(path: &Path) -> Result<Self, IdentifyError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| IdentifyError::Io {
            file: file.clone(),
            source,
        })?;
        Self::from_toml(&text, &file)
    }

    /// Writes a `model.toml`: first beside it, then in its place, so that no half file is ever left.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), IdentifyError> {
        let failed = |source| IdentifyError::Io {
            file: path.display().to_string(),
            source,
        };
        let beside = path.with_extension("toml.part");
        std::fs::write(&beside, self.to_toml()).map_err(failed)?;
        std::fs::rename(&beside, path).map_err(failed)
    }
}

/// Effects must be those of the catalogue, each with its own parameters and physical values.
fn check_effects(found: &[FittedEffect], direction: Direction) -> Result<(), String> {
    if direction == Direction::Inverse && !found.is_empty() {
        return Err("a model of direction inverse has no effects; they belong to forward models".to_owned());
    }
    for (i, fitted) in found.iter().enumerate() {
        let name = &fitted.name;
        let effect = match &fitted.definition {
            Some(file) if file.name != name.as_str() => {
                return Err(format!("effect `{name}` has the definition of `{}`", file.name));
            }
            Some(file) => UserEffect::of(file)
                .map_err(|reason| format!("definition of the effect `{name}`: {reason}"))?
                .effect(),
            None => name.id().map(EffectId::effect).ok_or_else(|| {
                format!(
                    "effect `{name}` has no definition here and is not in the catalogue: {}",
                    EffectId::names().join(", ")
                )
            })?,
        };
        if found[..i].iter().any(|other| other.name == *name) {
            return Err(format!("effect `{name}` stands twice; a chain has each effect once"));
        }
        let wanted = effect.description().parameters;
        let named = |p: &Parameter, w: &effects::Named| {
            p.name == w.name && (p.unit == w.unit || p.unit == effect.unit_without_temperature(w))
        };
        if fitted.parameters.len() != wanted.len() || !fitted.parameters.iter().zip(wanted).all(|(p, w)| named(p, w)) {
            let list: Vec<String> = wanted.iter().map(|w| format!("{} ({})", w.name, w.unit)).collect();
            return Err(format!(
                "effect `{name}` needs the parameters {} in this order",
                list.join(", ")
            ));
        }
        if let Some(bad) = fitted.parameters.iter().find(|p| !p.value.is_finite()) {
            return Err(format!(
                "effect `{name}`: {} = {}; it must be finite",
                bad.name, bad.value
            ));
        }
    }
    Ok(())
}

fn check_thresholds(thresholds: &[f64]) -> Result<(), String> {
    if thresholds.is_empty() || thresholds.len() > crate::family::MAX_PLAYS {
        return Err(format!(
            "{} thresholds; allowed are 1 to {}",
            thresholds.len(),
            crate::family::MAX_PLAYS
        ));
    }
    let mut before = None;
    for (i, &r) in thresholds.iter().enumerate() {
        let i = i + 1;
        if !(r.is_finite() && r >= 0.0) {
            return Err(format!("threshold r[{i}] = {r}; it must be finite and 0 or more"));
        }
        if let Some(last) = before
            && r <= last
        {
            return Err(format!(
                "threshold r[{i}] = {r} must exceed r[{}] = {last}; sort the thresholds",
                i - 1
            ));
        }
        before = Some(r);
    }
    Ok(())
}
