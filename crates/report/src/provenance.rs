//! What went into a report, so that it can be made anew.

use std::path::{Path, PathBuf};

use hysteron_data::Dataset;
use hysteron_identify::Model;
use sha2::{Digest, Sha256};

use crate::comparison_page::Context;
use crate::report_page::{Findings, report_page};

/// What a page is about: data, model, and what that was fitted on. `data` and `model_file` as a command names them.
pub fn facts(data: &str, model_file: &str, dataset: &Dataset, model: &Model) -> [(&'static str, String); 3] {
    [
        ("data", format!("{} ({data})", dataset.name)),
        (
            "model",
            format!(
                "{}, {} {}, {} ({model_file})",
                model.family,
                model.thresholds.len(),
                model.family.elements(),
                model.direction.name()
            ),
        ),
        ("fitted on", model.fitted_on.dataset.clone()),
    ]
}

/// The report with its facts and the commands that make it anew. `files` are data, model and page as a command names them.
pub fn frozen(files: &[String; 3], dataset: &Dataset, findings: &Findings<'_>, version: &str) -> String {
    let [data, model_file, output] = files;
    let model = findings.model;
    let facts = facts(data, model_file, dataset, model);
    let mut command = format!("hysteron compare {data} {model_file}\n");
    if findings.diagnosis.is_some() {
        command.push_str(&format!("hysteron diagnose {data} {model_file}\n"));
    }
    command.push_str(&format!("hysteron report {data} {model_file} -o {output}"));
    let context = Context {
        facts: &facts,
        command: &command,
        version,
    };
    report_page(&format!("{} on {}", model.family, dataset.name), findings, &context)
}

/// SHA-256 of the model and of every file of the dataset, by file name.
///
/// # Errors
/// The file that cannot be read, and why.
pub fn hashes(
    data: &Path,
    model: &Path,
    dataset: &Dataset,
) -> Result<Vec<(String, String)>, (PathBuf, std::io::Error)> {
    let mut files = vec![model.to_owned()];
    if data.is_dir() {
        files.push(data.join("dataset.toml"));
        files.extend(dataset.records.iter().map(|record| data.join(&record.file)));
    } else {
        files.push(data.to_owned());
    }
    files
        .into_iter()
        .map(|path| {
            let bytes = std::fs::read(&path).map_err(|source| (path.clone(), source))?;
            let name = path
                .file_name()
                .unwrap_or(path.as_os_str())
                .to_string_lossy()
                .into_owned();
            let hash = Sha256::digest(&bytes)
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect();
            Ok((name, hash))
        })
        .collect()
}
