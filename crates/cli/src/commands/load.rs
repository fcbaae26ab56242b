//! Datasets, models and effect files from disk, with a progress bar and the reader's notices; what is of another kind
//! than a command wants is said as such, once.

use crate::error::CliError;
use crate::{output, progress};
use hysteron_data::{Dataset, Notice, read_dataset_with_progress};
use hysteron_identify::effects::{Effect, UserEffect};
use hysteron_identify::{EffectId, Model};
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// What a path is, told by its name and first lines before it is read as what a command wants.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    Dataset,
    Folder,
    Manifest,
    Model,
    Other,
}

impl What {
    fn of(path: &Path) -> Self {
        if path.is_dir() {
            return if path.join("dataset.toml").is_file() {
                Self::Dataset
            } else {
                Self::Folder
            };
        }
        let mut head = Vec::new();
        if let Ok(file) = std::fs::File::open(path) {
            // what cannot be read is said by whoever reads the whole
            let _ = file.take(4096).read_to_end(&mut head);
        }
        let head = String::from_utf8_lossy(&head);
        let begins = |key: &str| {
            let mut lines = head.lines().map(str::trim_start);
            lines.any(|line| {
                line.strip_prefix(key)
                    .is_some_and(|rest| rest.trim_start().starts_with('='))
            })
        };
        if begins("family") && begins("direction") {
            Self::Model
        } else if head.lines().any(|line| line.trim() == "[[record]]") {
            Self::Manifest
        } else {
            Self::Other
        }
    }
}

/// The order of commands that take both.
const ORDER: &str = "datasets come before models, as in `hysteron compare stage model.toml`";

/// Reads a model.
pub(crate) fn model(path: &Path) -> Result<Model, CliError> {
    let found = match What::of(path) {
        What::Dataset => "a dataset",
        What::Folder => "a folder",
        What::Manifest => "the list of a dataset's records",
        What::Model | What::Other if is_recording(path) => "a recording",
        What::Model | What::Other => return Ok(Model::read(path)?),
    };
    Err(CliError::Option(format!(
        "{}: this is {found}, and a model is wanted here: a model.toml of `hysteron fit` or `hysteron learn`; {ORDER}",
        path.display()
    )))
}

/// Whether a file's name is that of samples.
fn is_recording(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    path.is_file() && ending.is_some_and(|ending| ["csv", "mat", "txt", "tdms", "h5", "npz"].contains(&ending.as_str()))
}

/// Reads a dataset; what the reader converted or ignored is said on standard error, and where a lab has erred.
pub(crate) fn dataset(path: &Path) -> Result<Dataset, CliError> {
    let dataset = unchecked(path)?;
    warn(&dataset);
    Ok(dataset)
}

/// Reads a dataset of which it is not known yet what its records are; what the reader converted or ignored is said on standard error.
pub(crate) fn unchecked(path: &Path) -> Result<Dataset, CliError> {
    let shown = path.display();
    match What::of(path) {
        What::Model => {
            return Err(CliError::Option(format!(
                "{shown}: this is a model, and a dataset is wanted here: a folder with dataset.toml, or one CSV; {ORDER}"
            )));
        }
        What::Manifest => {
            return Err(CliError::Option(format!(
                "{shown}: this is the list of a dataset's records; give its folder"
            )));
        }
        What::Dataset | What::Folder | What::Other => {}
    }
    let bar = progress::bar("reading");
    let dataset = read_dataset_with_progress(path, &mut |done, all| {
        progress::advance(&bar, done as f64 / all.max(1) as f64);
    })?;
    bar.finish_and_clear();
    say(&dataset.notices);
    Ok(dataset)
}

/// Says on standard error where a lab has erred.
pub(crate) fn warn(dataset: &Dataset) {
    for finding in hysteron_acquisition::mistakes(dataset) {
        output::warn(finding);
    }
}

/// Says on standard error what a reader did.
pub(crate) fn say(notices: &[Notice]) {
    for notice in notices {
        output::note(format_args!("{}: {}", notice.file, notice.text));
    }
}

/// An effect that an argument names.
#[derive(Clone, Copy)]
pub(crate) enum NamedEffect {
    /// Of the catalogue.
    Catalogue(EffectId),
    /// From an effect file.
    Own(UserEffect),
}

impl NamedEffect {
    /// Reads the effect file where the argument names one.
    pub(crate) fn read(argument: &str) -> Result<Self, CliError> {
        if argument.ends_with(".toml") {
            return Ok(Self::Own(UserEffect::read(Path::new(argument))?));
        }
        Ok(Self::Catalogue(argument.parse()?))
    }

    /// The effect itself.
    pub(crate) fn effect(self) -> Arc<dyn Effect> {
        match self {
            Self::Catalogue(id) => id.effect(),
            Self::Own(own) => own.effect(),
        }
    }
}
