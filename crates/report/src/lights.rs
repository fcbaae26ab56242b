//! What a design says of itself at a glance: whether all is well, where to look, what nobody can tell, each with its reason.

use crate::text::controller::{self as words, LIVE, NO_MODEL_ERROR};
use hysteron_control::design::OpenLoop;
use hysteron_control::design::source::Designed;
use hysteron_identify::covered::ToldBy;
use serde::{Deserialize, Serialize};

/// What a light says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shine {
    /// All is well.
    Pass,
    /// A person should look here.
    Look,
    /// The records do not say.
    CannotTell,
}

/// One light.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// What it says.
    pub shine: Shine,
    /// Of what.
    pub about: String,
    /// Why: the words that the command line prints.
    pub why: String,
}

/// The lights of a design; `margin` is the largest peak of the sensitivity that was asked for.
pub fn design_lights(designed: &Designed, margin: f64) -> Vec<Light> {
    let mut lights = Vec::new();
    let mut light = |shine: Shine, about: &str, why: &str| {
        lights.push(Light {
            shine,
            about: about.to_owned(),
            why: why.split_whitespace().collect::<Vec<_>>().join(" "),
        });
    };
    let controller = &designed.controller;
    let covered = &controller.model.covered;
    for undone in &designed.undone {
        let shine = if undone.by.is_some() { Shine::Pass } else { Shine::Look };
        let (by, note) = words::compensator(undone);
        light(shine, &undone.part.to_string(), &format!("{by}: {note}"));
    }
    let feedback = words::feedback(controller, margin);
    match (&controller.feedback, controller.open_loop) {
        (Some(design), _) => {
            let told = match covered.told_by() {
                Some(ToldBy::Record(_)) => Shine::Pass,
                Some(ToldBy::User) | None => Shine::CannotTell,
            };
            let above = words::told(design.told_to_hz, covered);
            light(told, "a mode may be anywhere", &above);
            light(Shine::Pass, "feedback", &feedback);
        }
        (None, Some(OpenLoop::NotTold)) => light(Shine::CannotTell, "feedback", &feedback),
        (None, _) => light(Shine::Look, "feedback", &feedback),
    }
    if controller.samples_ahead == 0 {
        light(Shine::Look, "a live reference", LIVE);
    }
    if designed.model_percent.is_none() {
        light(Shine::CannotTell, "the model's own error", NO_MODEL_ERROR);
    }
    for beyond in &covered.beyond {
        light(Shine::Look, "beyond the records", &beyond.to_string());
    }
    if covered.beyond.is_empty() {
        light(Shine::Pass, "within the records", &words::covered_line(covered));
    }
    lights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_text;
    use hysteron_control::design::ReferenceKind;
    use hysteron_control::design::feedback::Effort;
    use hysteron_control::design::source::{Source, Wishes, design};
    use hysteron_data::{Dataset, Record, Role};
    use hysteron_identify::{Family, FitOptions, fit};

    /// With a quick loop, on the word that there is no mode below 150 Hz.
    fn closed() -> Designed {
        let mut designed = designed(&Wishes {
            rigid_hz: Some(150.0),
            open: true,
            ..Wishes::default()
        });
        let open = designed.controller.clone();
        designed.controller = open.with_feedback_within(2.0, Effort::Quick).unwrap();
        designed
    }

    /// Of a stage of one play, 5 V wide, recorded with a slow sine.
    fn designed(wishes: &Wishes) -> Designed {
        let angle = |k: i32| std::f64::consts::TAU * f64::from(k) / 400.0;
        let voltage_v: Vec<f64> = (0..2000).map(|k| 30.0 - 30.0 * angle(k).cos()).collect();
        let mut play = 0.0_f64;
        let position_um = voltage_v
            .iter()
            .map(|&v| {
                play = play.clamp(v - 5.0, v + 5.0);
                0.08 * v + 0.02 * play
            })
            .collect();
        let dataset = Dataset {
            records: vec![Record::new("sine.csv", Role::Identify, 5e-4, voltage_v, position_um)],
            ..Dataset::default()
        };
        let model = fit(&dataset, &FitOptions::new(Family::Mpi), &|_| ()).unwrap().model;
        let source = Source::Model {
            model: &model,
            along: &[],
        };
        design(&source, wishes).unwrap()
    }

    fn shine(lights: &[Light], about: &str) -> Option<Shine> {
        lights
            .iter()
            .find(|light| light.about == about)
            .map(|light| light.shine)
    }

    #[test]
    fn val_each_light_says_what_the_command_line_says() {
        let live = Wishes {
            reference: ReferenceKind::Live,
            open: true,
            volts: Some([0.0, 70.0]),
            beyond_records: true,
            ..Wishes::default()
        };
        for designed in [designed(&Wishes::default()), closed(), designed(&live)] {
            let printed = design_text(&designed, 2.0).unwrap();
            let printed = printed.split_whitespace().collect::<Vec<_>>().join(" ");
            let lights = design_lights(&designed, 2.0);
            assert!(lights.len() >= 2, "{lights:?}");
            for light in lights {
                assert!(printed.contains(&light.why), "{light:?}\n{printed}");
            }
        }
    }

    #[test]
    fn val_a_light_passes_only_where_all_is_well() {
        let lights = design_lights(&designed(&Wishes::default()), 2.0);
        assert_eq!(shine(&lights, "feedback"), Some(Shine::CannotTell), "{lights:?}");
        assert_eq!(shine(&lights, "within the records"), Some(Shine::Pass));
        let lights = design_lights(&closed(), 2.0);
        assert_eq!(shine(&lights, "feedback"), Some(Shine::Pass), "{lights:?}");
        assert_eq!(shine(&lights, "a mode may be anywhere"), Some(Shine::CannotTell));
        let beyond = Wishes {
            reference: ReferenceKind::Live,
            open: true,
            volts: Some([0.0, 70.0]),
            beyond_records: true,
            ..Wishes::default()
        };
        let lights = design_lights(&designed(&beyond), 2.0);
        assert_eq!(shine(&lights, "feedback"), Some(Shine::Look), "{lights:?}");
        assert_eq!(shine(&lights, "a live reference"), Some(Shine::Look));
        assert_eq!(shine(&lights, "beyond the records"), Some(Shine::Look));
        assert_eq!(shine(&lights, "within the records"), None);
    }
}
