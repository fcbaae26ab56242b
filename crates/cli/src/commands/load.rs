//! Datasets and effect files from disk, with a progress bar and the reader's notices.

use crate::error::CliError;
use crate::progress;
use hysteron_data::{Dataset, read_dataset_with_progress};
use hysteron_identify::EffectId;
use hysteron_identify::effects::{Effect, UserEffect};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads a dataset; what the reader converted or ignored is said on standard error.
pub(crate) fn dataset(path: &Path) -> Result<Dataset, CliError> {
    let bar = progress::bar("reading");
    let dataset = read_dataset_with_progress(path, &mut |done, all| {
        progress::advance(&bar, done as f64 / all.max(1) as f64);
    })?;
    bar.finish_and_clear();
    for notice in &dataset.notices {
        // A closed standard error loses a remark, not the answer.
        let _ = writeln!(std::io::stderr(), "note: {}: {}", notice.file, notice.text);
    }
    Ok(dataset)
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

/// The effects of several files, each under a name of its own.
pub(crate) fn effect_files(paths: &[PathBuf]) -> Result<Vec<UserEffect>, CliError> {
    let mut effects: Vec<UserEffect> = Vec::new();
    for path in paths {
        let effect = UserEffect::read(path)?;
        if effects.iter().any(|other| other.name() == effect.name()) {
            return Err(CliError::Option(format!(
                "{}: another --effect is named `{}` as well; give each a name of its own",
                path.display(),
                effect.name()
            )));
        }
        effects.push(effect);
    }
    Ok(effects)
}
