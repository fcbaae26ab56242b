//! `backlash`

use crate::compensator::Compensation;
use crate::effect::{Acts, Bounds, Description, Effect, Facts, Mark, Named, Place, Scene, Signals};
use crate::id::{EffectId, EffectName};
use hysteron_core::effects::Block;
use hysteron_core::effects::backlash;

pub(crate) struct Backlash;

static DESCRIPTION: Description = Description {
    name: EffectId::Backlash.name(),
    place: Place::Sensor,
    summary: "Motion is lost at every reversal, in a contact or a worn joint.",
    equation: "y' = max(y - b, min(y + b, y'))",
    source: "a two-sided play of the position; flexures none, ball tips and screws 5 to 200 nm",
    parameters: &[Named {
        name: "width",
        unit: "um",
        what: "2 b, 0 to a tenth of the stroke",
    }],
    shows: "A dead band of the same width after every reversal at all amplitudes; small signals vanish; the opening over \
            the amplitude does not go to zero.",
    mistaken_for: "the hysteresis' own plays: it is one, with one large weight",
    separated_by: "An amplitude ladder down to 1 %: the loop of the ceramics closes, that of lost motion becomes the whole signal.",
    compensated_by: "A jump of the width at each reversal in the inverse, or repair.",
    scene: Scene::Ladder,
};

impl Effect for Backlash {
    fn name(&self) -> EffectName {
        EffectId::Backlash.into()
    }

    fn bends_the_loops(&self) -> bool {
        true
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn mark(&self) -> Option<Mark> {
        Some(Mark::Position)
    }

    fn bounds(&self, facts: &Facts) -> Result<Vec<Bounds>, String> {
        let stroke = facts.moving_stroke_um()?;
        Ok(vec![Bounds::new(0.0, 0.1 * stroke, 1e-3 * stroke, 0.0)])
    }

    fn starts(&self, facts: &Facts, _: &[Bounds]) -> Vec<Vec<f64>> {
        [0.001, 0.003, 0.006, 0.01, 0.02, 0.04, 0.08]
            .iter()
            .map(|&w| vec![w * facts.stroke_um()])
            .collect()
    }

    fn acts(&self) -> Acts {
        Acts::Nonlinearly
    }

    fn on_position(&self, values: &[f64], signals: &Signals<'_>, position_um: &mut [f64]) {
        let (Ok(backlash), Some(&first)) = (backlash::Backlash::new(values[0]), position_um.first()) else {
            return;
        };
        let mut state = backlash.rest_at(before(values, signals, first));
        for &y in &position_um[..signals.run_in] {
            backlash.step(&mut state, y);
        }
        for y in position_um {
            *y = backlash.step(&mut state, *y);
        }
    }

    /// The output's change is that of the position at the time when it last moved the output.
    fn on_change(&self, values: &[f64], signals: &Signals<'_>, position_um: &[f64], change: &mut [f64]) {
        let (Ok(backlash), Some(&first)) = (backlash::Backlash::new(values[0]), position_um.first()) else {
            return;
        };
        let start = before(values, signals, first);
        let mut state = backlash.rest_at(start);
        let (mut last, mut held) = (start, change.first().copied().unwrap_or(0.0));
        for k in 0..signals.run_in {
            let now = backlash.step(&mut state, position_um[k]);
            if now != last {
                (last, held) = (now, change[k]);
            }
        }
        for (change, &y) in change.iter_mut().zip(position_um) {
            let now = backlash.step(&mut state, y);
            if now != last {
                (last, held) = (now, *change);
            }
            *change = held;
        }
    }

    fn compensation(&self, _: &[f64]) -> Compensation {
        Compensation::none("a jump at every turn shakes the stage; the feedback takes it up")
    }
}

/// The output before the first sample: where the last motion has left the contact in its play.
fn before(values: &[f64], signals: &Signals<'_>, first_um: f64) -> f64 {
    first_um + (0.5 - signals.fraction) * values[0]
}
