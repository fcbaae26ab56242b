//! The noise floor and the warnings on the practice cases, where they are present.

use hysteron_acquisition::{Kind, mistakes, noise_floor};
use hysteron_data::read_dataset;
use std::path::Path;

/// A practice case's truth file, and the noise of the sensor with the rounding of its converter as that file has it.
fn truth(folder: &Path, name: &str) -> Option<(String, f64)> {
    let text = std::fs::read_to_string(folder.join(format!("{name}.truth.json"))).ok()?;
    let at = text.split("\"noise_rms_um\":").nth(1)?;
    let noise_um = at.split([',', '}']).next()?.trim().parse().ok()?;
    Some((text, noise_um))
}

/// The noise is told to a tenth, and what is warned of is there: a ripple that folds, a stuck bit, and nothing else.
#[test]
fn val_noise_and_warnings_of_the_practice_cases() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/practice-users");
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    }
    for number in 1..=28 {
        let name = format!("user-{number:02}");
        let (Some((truth, noise_um)), Ok(dataset)) = (truth(&folder, &name), read_dataset(&folder.join(&name))) else {
            continue;
        };
        let expected = if truth.contains("\"pwm\"") {
            vec![Kind::Tone]
        } else if truth.contains("\"stuck\"") {
            vec![Kind::MissingCodes]
        } else {
            Vec::new()
        };
        let found: Vec<Kind> = mistakes(&dataset).iter().map(|finding| finding.kind).collect();
        assert_eq!(found, expected, "{name}");
        // A stuck bit adds its own steps to the noise.
        let floor = noise_floor(&dataset);
        let ratio = floor.rms_um / noise_um;
        assert!(
            (0.9..1.1).contains(&ratio) || expected == [Kind::MissingCodes],
            "{name}: {ratio:.3} of the truth, {floor}"
        );
    }
}
