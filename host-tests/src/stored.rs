//! Evidence of calibrations, a case a line, for what is set by it: thresholds and weights.

use hysteron_diagnose::evidence::Evidence;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Where the evidence of the last `calibrate` lies.
pub const EVIDENCE: &str = "target/calibration/evidence.jsonl";

/// The same of the last `calibrate users`.
pub const USERS: &str = "target/calibration/users.jsonl";

/// The evidence of one case, and the verdicts that are right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stored {
    /// The seed of the case.
    pub seed: u64,
    /// Verdicts that are right.
    pub accepted: Vec<String>,
    /// The numbers that a verdict comes from.
    pub evidence: Evidence,
}

/// Writes evidence, a case a line.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn store(path: &Path, cases: &[Stored]) -> std::io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut text = String::new();
    for case in cases {
        text.push_str(&serde_json::to_string(case)?);
        text.push('\n');
    }
    std::fs::write(path, text)
}

/// Reads what [`store`] has written.
///
/// # Errors
/// A file that is absent, or no evidence.
pub fn stored(path: &Path) -> std::io::Result<Vec<Stored>> {
    let text = std::fs::read_to_string(path)?;
    text.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
}
