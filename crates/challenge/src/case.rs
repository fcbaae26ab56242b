//! A case of the simulated laboratory as the dataset that a user has.

use hysteron_data::{Dataset, Known, Record, Role};
use hysteron_plant::challenge::{Case, CaseRecord, Use};

/// The dataset of a case. But for its name it does not differ from one hidden effect to the other.
pub fn dataset(case: Case, name: &str) -> Dataset {
    Dataset {
        name: name.to_owned(),
        description: format!(
            "piezo stage, open loop, 0 to {} V; records in the order taken",
            case.full_v
        ),
        known: Known::default(),
        records: case.records.into_iter().map(record).collect(),
        notices: Vec::new(),
    }
}

fn record(record: CaseRecord) -> Record {
    Record {
        file: format!("{}.csv", record.name),
        role: match record.role {
            Use::Identify => Role::Identify,
            Use::Validate => Role::Validate,
        },
        excitation: record.excitation,
        start_s: 0.0,
        period_s: record.period_s,
        voltage_v: record.voltage_v,
        position_um: record.position_um,
        reference_um: None,
        temperature_c: record.temperature_c,
        voltage2_v: record.voltage2_v,
    }
}
