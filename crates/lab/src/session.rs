//! The session: data, models as a tree of steps, and the folder that holds them.
//!
//! The folder is written so that the command line opens it: `data/` is a dataset, `models/N.toml` are models, and every
//! step carries the command that does the same when typed in the folder.

use crate::error::{LabError, Refusal};
use crate::uploads::{Reading, Uploads};
use hysteron_data::Dataset;
use hysteron_diagnose::{Comparison, RecordComparison};
use hysteron_identify::Model;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Version of `session.json`.
const VERSION: u32 = 1;

/// Comparisons held in memory: the one looked at, the one before, and one to set beside them.
const COMPARISONS: usize = 3;

/// What is on disk in `session.json`.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct Book {
    version: u32,
    /// Grows with every change; a tab that saw an older one is told so.
    pub(crate) revision: u64,
    /// Folder or file of the dataset, as the commands name it.
    pub(crate) data: Option<String>,
    /// The command that made the dataset.
    pub(crate) data_command: Option<String>,
    /// The steps; a step's number is its place, from 0.
    pub(crate) steps: Vec<Step>,
    /// The step looked at.
    pub(crate) current: Option<usize>,
    /// The commands that made the tables for the firmware, by step.
    #[serde(default)]
    pub(crate) tables: BTreeMap<usize, String>,
    /// How the files that were brought are read.
    #[serde(default)]
    pub(crate) reading: Reading,
    /// Whether the files that were brought last are used, or the data came otherwise.
    #[serde(default)]
    pub(crate) files_taken: bool,
}

/// A model and how it came about.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Step {
    /// The step it was made from.
    pub(crate) parent: Option<usize>,
    /// The step that redo leads to.
    pub(crate) redo: Option<usize>,
    /// `mrpi` or `+ delay`.
    pub(crate) title: String,
    /// Its file, as the commands name it.
    pub(crate) model: String,
    /// The command that makes it.
    pub(crate) command: String,
    /// Pooled error on the records it was fitted to, percent of peak to peak.
    pub(crate) identify_percent: Option<f64>,
    /// The same on validation records.
    pub(crate) validate_percent: Option<f64>,
    /// Each record's error, percent of peak to peak, in the order of the dataset.
    pub(crate) records: Vec<(String, Option<f64>)>,
    /// What the noise alone would leave of each record, percent of peak to peak, in the same order.
    #[serde(default)]
    pub(crate) record_noise: Vec<Option<f64>>,
    /// The error that the noise alone would leave, percent of peak to peak, on the records that count.
    pub(crate) noise_percent: Option<f64>,
}

/// Everything the server knows, behind one lock.
pub(crate) struct Session {
    pub(crate) folder: PathBuf,
    pub(crate) book: Book,
    pub(crate) uploads: Uploads,
    pub(crate) dataset: Option<Arc<Dataset>>,
    /// What the page shows of its records.
    pub(crate) shown: Vec<serde_json::Value>,
    comparisons: VecDeque<(usize, Arc<Comparison>)>,
    /// Held as long as the server runs: two servers on one folder would overwrite each other.
    _lock: File,
}

impl Session {
    /// Opens a folder, new or used.
    pub(crate) fn open(folder: &Path) -> Result<Self, LabError> {
        let failed = |reason: String| LabError::Session {
            folder: folder.display().to_string(),
            reason,
        };
        for part in ["uploads", "models", "diagnoses", "reports", "tables"] {
            std::fs::create_dir_all(folder.join(part)).map_err(|error| failed(error.to_string()))?;
        }
        let lock = File::create(folder.join(".lock")).map_err(|error| failed(error.to_string()))?;
        lock.try_lock()
            .map_err(|_| failed("another `hysteron lab` has it open; use that one or give --session".to_owned()))?;
        let file = folder.join("session.json");
        let book = match std::fs::read_to_string(&file) {
            Ok(text) => serde_json::from_str::<Book>(&text)
                .map_err(|error| failed(format!("session.json: {error}; move the file away to begin anew")))?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Book {
                version: VERSION,
                ..Book::default()
            },
            Err(error) => return Err(failed(format!("session.json: {error}"))),
        };
        book.check().map_err(failed)?;
        let mut session = Self {
            folder: folder.to_owned(),
            uploads: Uploads::open(&folder.join("uploads"), &book.reading),
            book,
            dataset: None,
            shown: Vec::new(),
            comparisons: VecDeque::new(),
            _lock: lock,
        };
        if let Some(data) = session.book.data.clone() {
            let dataset = hysteron_data::read_dataset(&folder.join(data))?;
            session.shown = dataset.records.iter().map(crate::state::record).collect();
            session.dataset = Some(Arc::new(dataset));
        }
        Ok(session)
    }

    /// Writes the book as a whole, one revision on.
    pub(crate) fn save(&mut self) -> Result<(), Refusal> {
        self.book.revision += 1;
        let file = self.folder.join("session.json");
        let text = serde_json::to_string_pretty(&self.book).map_err(|error| Refusal::disk(&file, &error))?;
        write_whole(&file, text.as_bytes())
    }

    /// Takes a dataset; steps on other data end.
    pub(crate) fn take_data(&mut self, data: String, command: String, dataset: Dataset) -> Result<(), Refusal> {
        self.book.data = Some(data);
        self.book.files_taken = true;
        self.book.data_command = Some(command);
        self.book.steps.clear();
        self.book.tables.clear();
        self.book.current = None;
        self.comparisons.clear();
        self.shown = dataset.records.iter().map(crate::state::record).collect();
        self.dataset = Some(Arc::new(dataset));
        let results = ["diagnoses", "reports", "tables"].map(|part| std::fs::read_dir(self.folder.join(part)));
        for file in results.into_iter().flatten().flatten().flatten() {
            // A result of other data that cannot be removed is overwritten by the next one.
            let _ = std::fs::remove_file(file.path());
        }
        self.save()
    }

    /// Appends a model as a step and makes it the current one.
    pub(crate) fn take_step(
        &mut self,
        parent: Option<usize>,
        title: String,
        command: String,
        model: &Model,
        comparison: Comparison,
    ) -> Result<usize, Refusal> {
        let number = self.book.steps.len();
        let file = model_name(number);
        model.write(&self.folder.join(&file)).map_err(Refusal::unusable)?;
        let step = Step {
            parent,
            redo: None,
            title,
            model: file,
            command,
            identify_percent: comparison.identify.map(|pooled| pooled.nrmse_percent),
            validate_percent: comparison.validate.map(|pooled| pooled.nrmse_percent),
            records: comparison
                .records
                .iter()
                .map(|r| (r.file.clone(), r.nrmse_percent))
                .collect(),
            record_noise: comparison
                .records
                .iter()
                .map(|r| noise_of(r, comparison.noise_rms_um))
                .collect(),
            noise_percent: noise_percent(&comparison),
        };
        self.book.steps.push(step);
        if let Some(parent) = parent {
            self.book.steps[parent].redo = Some(number);
        }
        self.book.current = Some(number);
        self.remember(number, Arc::new(comparison));
        self.save()?;
        Ok(number)
    }

    /// The model of a step.
    pub(crate) fn model(&self, number: usize) -> Result<Model, Refusal> {
        Model::read(&self.folder.join(&self.step(number)?.model)).map_err(Refusal::unusable)
    }

    /// A step by its number.
    pub(crate) fn step(&self, number: usize) -> Result<&Step, Refusal> {
        self.book.steps.get(number).ok_or_else(|| {
            Refusal::absent(format!(
                "there is no step {number}; the session has {}",
                self.book.steps.len()
            ))
        })
    }

    /// The dataset.
    pub(crate) fn data(&self) -> Result<Arc<Dataset>, Refusal> {
        self.dataset
            .clone()
            .ok_or_else(|| Refusal::conflict("there are no recordings yet; bring some first"))
    }

    /// A comparison still in memory.
    pub(crate) fn remembered(&self, number: usize) -> Option<Arc<Comparison>> {
        self.comparisons
            .iter()
            .find(|c| c.0 == number)
            .map(|c| Arc::clone(&c.1))
    }

    /// Keeps a comparison, and lets the oldest go.
    pub(crate) fn remember(&mut self, number: usize, comparison: Arc<Comparison>) {
        self.comparisons.retain(|c| c.0 != number);
        self.comparisons.push_back((number, comparison));
        while self.comparisons.len() > COMPARISONS {
            self.comparisons.pop_front();
        }
    }

    /// Where a step's diagnosis is kept.
    pub(crate) fn diagnosis_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}.json"))
    }

    /// Where is kept what the candidates of a step's diagnosis do to the data.
    pub(crate) fn signatures_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}-signatures.json"))
    }

    /// Where a step's report is kept.
    pub(crate) fn report_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("reports/{}.html", number + 1))
    }

    /// Where the table of a step is kept, as the commands name it.
    pub(crate) fn table_name(number: usize) -> String {
        format!("tables/{}.toml", number + 1)
    }

    /// The folder of the data, if there are data.
    pub(crate) fn data_folder(&self) -> Option<PathBuf> {
        self.book.data.as_ref().map(|data| self.folder.join(data))
    }

    /// Where the voltage of the record to take next is kept.
    pub(crate) fn next_record_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}-next.csv"))
    }
}

impl Book {
    /// Whether every number in it names a step that is there.
    fn check(&self) -> Result<(), String> {
        if self.version != VERSION {
            return Err(format!(
                "session.json is of version {}, this program reads {VERSION}",
                self.version
            ));
        }
        let count = self.steps.len();
        let there = |number: Option<usize>| number.is_none_or(|number| number < count);
        let sound = there(self.current)
            && self.steps.iter().enumerate().all(|(number, step)| {
                step.parent.is_none_or(|parent| parent < number) && there(step.redo) && step.model == model_name(number)
            })
            && self.tables.keys().all(|&number| number < count);
        sound
            .then_some(())
            .ok_or_else(|| "session.json names steps that are not there; move the file away to begin anew".to_owned())
    }
}

/// The file of a step's model.
pub(crate) fn model_name(number: usize) -> String {
    format!("models/{}.toml", number + 1)
}

/// The noise in percent of each record's peak to peak, pooled like the errors that count.
fn noise_percent(comparison: &Comparison) -> Option<f64> {
    let pool = |role| {
        let squares: Vec<f64> = comparison
            .records
            .iter()
            .filter(|record| record.role == role)
            .filter_map(|record| Some(noise_of(record, comparison.noise_rms_um)?.powi(2)))
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    pool(hysteron_data::Role::Validate).or_else(|| pool(hysteron_data::Role::Identify))
}

/// The noise in percent of a record's peak to peak; nothing where it does not move.
fn noise_of(record: &RecordComparison, noise_rms: f64) -> Option<f64> {
    let percent = record.nrmse_percent?;
    (record.rms_um > 0.0).then(|| percent * noise_rms / record.rms_um)
}

/// A folder in which new data are made before they replace those that are there; what an earlier try left is gone.
pub(crate) fn fresh(folder: &Path) -> Result<PathBuf, Refusal> {
    let fresh = folder.join("fresh");
    if fresh.exists() {
        std::fs::remove_dir_all(&fresh).map_err(|error| Refusal::disk(&fresh, &error))?;
    }
    std::fs::create_dir_all(&fresh).map_err(|error| Refusal::disk(&fresh, &error))?;
    Ok(fresh)
}

/// Puts `fresh/data` and its key, if it has one, into the places of those that were there.
pub(crate) fn replace_data(folder: &Path) -> Result<(), Refusal> {
    let (fresh, data) = (folder.join("fresh"), folder.join("data"));
    let key = folder.join("data.key");
    let moved = || -> std::io::Result<()> {
        if data.exists() {
            std::fs::remove_dir_all(&data)?;
        }
        if key.exists() {
            std::fs::remove_file(&key)?;
        }
        std::fs::rename(fresh.join("data"), &data)?;
        if fresh.join("data.key").exists() {
            std::fs::rename(fresh.join("data.key"), &key)?;
        }
        std::fs::remove_dir_all(&fresh)
    };
    moved().map_err(|error| Refusal::disk(&data, &error))
}

/// Writes a file beside its place, then into it.
pub(crate) fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), Refusal> {
    let beside = file.with_extension("part");
    std::fs::write(&beside, bytes)
        .and_then(|()| std::fs::rename(&beside, file))
        .map_err(|error| Refusal::disk(file, &error))
}
