//! The noise floor on the practice cases, where they are present.

use hysteron_acquisition::noise_floor;
use hysteron_data::read_dataset;
use std::path::Path;

/// Truth of a practice case: the sensor's noise and the rounding of its converter, as the truth file has them.
fn truth(folder: &Path, name: &str) -> Option<f64> {
    let text = std::fs::read_to_string(folder.join(format!("{name}.truth.json"))).ok()?;
    let at = text.split("\"noise_rms_um\":").nth(1)?;
    at.split([',', '}']).next()?.trim().parse().ok()
}

#[test]
fn val_noise_of_the_practice_cases() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/practice-users");
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    }
    for number in 1..=28 {
        let name = format!("user-{number:02}");
        let (Some(truth), Ok(dataset)) = (truth(&folder, &name), read_dataset(&folder.join(&name))) else {
            continue;
        };
        let floor = noise_floor(&dataset);
        println!("{name}: {:.3} of the truth, {floor}", floor.rms_um / truth);
        println!("{}", hysteron_acquisition::inspect(&dataset));
    }
}
