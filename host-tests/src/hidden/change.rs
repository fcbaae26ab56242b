//! Changes of a dataset that change nothing of the stage: whatever is said of one must be said of the other.

use hysteron_data::Dataset;

/// The records in reverse order. Where an effect depends on the order (ageing), this is no longer the same stage.
pub fn reversed(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    changed.records.reverse();
    changed
}

/// Files, descriptions and the dataset itself under names that say nothing.
pub fn renamed(dataset: &Dataset) -> Dataset {
    let mut changed = dataset.clone();
    changed.name = "a".to_owned();
    changed.description = String::new();
    for (n, record) in changed.records.iter_mut().enumerate() {
        // Not in alphabetical order either.
        record.file = format!("r{}.csv", (7 * n + 3) % 15);
        record.excitation = String::new();
    }
    changed
}

/// A constant added to every position: the sensor's zero is arbitrary.
pub fn offset(dataset: &Dataset, by_um: f64) -> Dataset {
    let mut changed = dataset.clone();
    changed
        .records
        .iter_mut()
        .flat_map(|record| &mut record.position_um)
        .for_each(|y| *y += by_um);
    changed
}

/// Positions and voltages in other units: both multiplied by constants.
pub fn scaled(dataset: &Dataset, position: f64, voltage: f64) -> Dataset {
    let mut changed = dataset.clone();
    for record in &mut changed.records {
        record.position_um.iter_mut().for_each(|y| *y *= position);
        record
            .voltage_v
            .iter_mut()
            .chain(record.voltage2_v.iter_mut().flatten())
            .for_each(|v| *v *= voltage);
    }
    changed.known.sensor_noise_um = changed.known.sensor_noise_um.map(|noise_um| noise_um * position);
    changed.known.voltage_min_v = changed.known.voltage_min_v.map(|v| v * voltage);
    changed.known.voltage_max_v = changed.known.voltage_max_v.map(|v| v * voltage);
    changed
}
