//! What records can tell, before any model is fitted to them.

use crate::diagnosis::Reason;
use crate::reasons;
use crate::rules::Thresholds;
use hysteron_acquisition::{Kind, inspect};
use hysteron_data::Dataset;
use hysteron_identify::{EffectId, Family, facts};

/// What records can tell and what they cannot.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Why they cannot answer, or not for every effect.
    pub reasons: Vec<Reason>,
    /// Each effect of the catalogue, with the reason where no record could show it.
    pub effects: Vec<(EffectId, Option<String>)>,
}

/// What the records of a dataset can tell and what they cannot.
///
/// # Cost
/// A few passes over the records.
pub fn told(dataset: &Dataset) -> Told {
    let rig = inspect(dataset);
    let leads = rig.finds(Kind::PositionLeads);
    let reasons = reasons::of(dataset, rig.noise.rms_um, leads, &Thresholds::DEFAULT);
    // Of the plainest family, which has none of the effects itself.
    let facts = facts(dataset, Family::Pi);
    let refused = |id: EffectId| id.effect().bounds(&facts).err();
    Told {
        reasons,
        effects: EffectId::ALL.map(|id| (id, refused(id))).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hysteron_data::{Record, Role};

    /// Four periods of a sine; `voltage2_v` where the other axis moves.
    fn recorded(other_axis: bool) -> Dataset {
        let wave = |k: i32| 50.0 - 50.0 * (f64::from(k) * std::f64::consts::TAU / 500.0).cos();
        let voltage_v: Vec<f64> = (0..2000).map(wave).collect();
        let position_um = voltage_v.iter().map(|v| 0.1 * v).collect();
        let mut record = Record::new("a.csv", Role::Identify, 1e-3, voltage_v, position_um);
        record.voltage2_v = other_axis.then(|| (0..2000).map(|k| f64::from(k % 100)).collect());
        Dataset {
            records: vec![record],
            ..Dataset::default()
        }
    }

    #[test]
    fn val_what_needs_a_column_or_a_motion_is_refused_with_the_reason() {
        let reason = |dataset: &Dataset, id: EffectId| {
            let told = told(dataset);
            told.effects.into_iter().find(|(of, _)| *of == id).unwrap().1
        };
        let alone = recorded(false);
        assert!(
            reason(&alone, EffectId::CrossCoupling)
                .unwrap()
                .contains("record the other axis' command")
        );
        assert_eq!(reason(&recorded(true), EffectId::CrossCoupling), None);
        assert_eq!(reason(&alone, EffectId::Delay), None);
        assert_eq!(told(&alone).reasons, [Reason::OneSine]);
        let mut still = alone;
        still.records[0].voltage_v.fill(10.0);
        assert_eq!(told(&still).reasons, [Reason::NothingMoves]);
        assert!(reason(&still, EffectId::SlewLimit).is_some());
    }
}
