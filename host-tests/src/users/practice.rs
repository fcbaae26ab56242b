//! The practice cases beside the project, scored against their truth files.

use super::score::{Grade, grade};
use super::tool::{self, Said};
use hysteron_data::import::{ColumnChoice, ImportOptions, import};
use hysteron_data::{Dataset, Role, read_dataset};
use hysteron_identify::Family as Start;
use serde_json::Value;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A practice case in its files.
#[derive(Debug, Clone)]
pub struct Files {
    /// Its folder's name.
    pub name: String,
    /// The records of the user.
    pub dataset: Dataset,
    /// The records held out, where there are any.
    pub held_out: Option<Dataset>,
    /// The model to start from.
    pub start: Start,
    /// Verdicts that are right.
    pub accepted: Vec<String>,
    /// What is hidden.
    pub effects: Vec<String>,
    /// How it was recorded.
    pub recorded_as: String,
}

/// What became of it.
#[derive(Debug, Clone)]
pub struct Scored {
    /// How good the answer is.
    pub grade: Grade,
    /// The answer.
    pub said: Said,
    /// Error on the records held out, before and after `learn`, percent of peak to peak.
    pub held_percent: Option<[f64; 2]>,
    /// Effects in what was learned.
    pub learned: Vec<String>,
    /// Seconds to answer and to learn.
    pub took_s: [f64; 2],
}

/// The folder of the practice data; none where it is absent.
pub fn folder(which: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(which);
    folder.is_dir().then_some(folder)
}

/// Reads a case: the truth file beside its folder, scope captures through their import.
///
/// # Errors
/// Files that are absent or not as the README says.
pub fn read(truth: &Path) -> Result<Files, Box<dyn Error>> {
    let json: Value = serde_json::from_str(&std::fs::read_to_string(truth)?)?;
    let file = truth
        .file_name()
        .and_then(|name| name.to_str())
        .ok_or("a truth file without a name")?;
    let name = file.trim_end_matches(".truth.json").to_owned();
    let folder = truth.with_file_name(&name);
    let words = |key: &str| -> Vec<String> {
        let all = json[key].as_array().into_iter().flatten();
        all.filter_map(|word| word.as_str().map(str::to_owned)).collect()
    };
    let dataset = match &json["scope"] {
        Value::Null => read_dataset(&folder)?,
        scope => captures(&folder, scope)?,
    };
    let held_out = truth.with_file_name(format!("{name}-held-out"));
    let start = std::fs::read_to_string(folder.join("case.toml")).unwrap_or_default();
    Ok(Files {
        dataset,
        held_out: held_out.is_dir().then(|| read_dataset(&held_out)).transpose()?,
        start: if start.contains("mrpi") {
            Start::Mrpi
        } else if start.contains("\"pi\"") {
            Start::Pi
        } else {
            Start::Mpi
        },
        accepted: words("accepted_verdicts"),
        effects: words("effects"),
        recorded_as: json["recorded_as"].as_str().unwrap_or("fifteen records").to_owned(),
        name,
    })
}

fn captures(folder: &Path, scope: &Value) -> Result<Dataset, Box<dyn Error>> {
    let number = |key: &str| scope[key].as_f64().ok_or_else(|| format!("{key} is absent"));
    let columns: [ColumnChoice; 2] = [
        format!("voltage=CH1:V*{}", number("voltage_factor")?).parse()?,
        format!("position=CH2:um*{}", number("position_um_per_volt")?).parse()?,
    ];
    let mut dataset = Dataset {
        name: "scope".to_owned(),
        ..Dataset::default()
    };
    let roles = scope["roles"].as_object().ok_or("roles are absent")?;
    let mut files: Vec<_> = roles.iter().collect();
    files.sort_by_key(|(file, _)| file.as_str());
    for (file, role) in files {
        let role = if role == "validate" {
            Role::Validate
        } else {
            Role::Identify
        };
        let options = ImportOptions {
            role,
            columns: columns.to_vec(),
            ..ImportOptions::default()
        };
        dataset
            .records
            .extend(import(&folder.join(file), &options, &mut |_, _| {})?.records);
    }
    Ok(dataset)
}

/// Asks the tool.
///
/// # Errors
/// Where no start model can be fitted.
pub fn score(files: &Files) -> Result<Scored, Box<dyn Error>> {
    let clock = Instant::now();
    let model = tool::start(&files.dataset, files.start)?;
    let said = tool::ask(&files.dataset, &model);
    let answered_s = clock.elapsed().as_secs_f64();
    let error = |model| {
        files
            .held_out
            .as_ref()
            .and_then(|held_out| tool::error_percent(held_out, model))
    };
    let before = error(&model);
    let (better, learned) = tool::learned(&files.dataset, model.clone())?;
    let accepted: Vec<&str> = files.accepted.iter().map(String::as_str).collect();
    Ok(Scored {
        grade: grade(&accepted, &said),
        said,
        held_percent: before.zip(error(&better)).map(|(b, a)| [b, a]),
        learned,
        took_s: [answered_s, clock.elapsed().as_secs_f64() - answered_s],
    })
}
