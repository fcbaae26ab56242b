//! `cargo xtask rehearsals`: hidden effects found, learned and undone, as the book's tables.

use crate::{cargo, output, targets};
use serde_json::Value;

/// Effects that a rehearsal can hide.
const EFFECTS: [&str; 6] = [
    "delay",
    "first-order-lag",
    "resonance",
    "cross-coupling",
    "mains-hum",
    "creep",
];
/// Stages a table counts on the host.
const SEEDS: [&str; 3] = ["1", "2", "3"];
/// References that are judged, as the program names them.
const REFERENCES: [&str; 4] = ["10", "100", "500", "hold"];

/// Rehearses every effect on three stages on the host, or on one stage in the firmware of an emulator's `core`.
pub(crate) fn rehearsals(words: &[String]) -> Result<(), String> {
    cargo(&["build", "--package", "hysteron-cli", "--locked"])?;
    let core = words.first().map(String::as_str);
    let seeds = if core.is_some() { &SEEDS[..1] } else { &SEEDS[..] };
    println!("| hidden | seed | named | model before / after | 10 Hz before / after | 100 Hz | 500 Hz | 4 s hold |");
    println!("|---|---|---|---|---|---|---|---|");
    let mut falls = Falls::default();
    for effect in EFFECTS {
        for seed in seeds {
            let rehearsed = rehearse(effect, seed, core)?;
            println!("{}", row(seed, &rehearsed)?);
            falls.count(&rehearsed)?;
        }
    }
    println!(
        "\nAn effect shows on {} of {} references: there the error without its compensator is more than six times that \
         of the same stage without the effect. It falls more than five times on {} of them; least: {:.1} times.",
        falls.shown, falls.all, falls.five_times, falls.least
    );
    Ok(())
}

/// What the program says of one rehearsal.
fn rehearse(effect: &str, seed: &str, core: Option<&str>) -> Result<Value, String> {
    let program = targets().join("debug/hysteron").display().to_string();
    let mut words = vec!["rehearse", effect, "--seed", seed, "--json"];
    if let Some(core) = core {
        words.extend(["--emulator", core]);
    }
    let said = output(&program, &words)?;
    serde_json::from_str(&said).map_err(|error| format!("rehearse {effect} --seed {seed}: {error}"))
}

fn row(seed: &str, rehearsed: &Value) -> Result<String, String> {
    let models = [first_rung(rehearsed)?, last_open(rehearsed)?];
    let models = models
        .iter()
        .map(|rung| Ok(short(number(&rung["model_percent"])?)))
        .collect::<Result<Vec<String>, String>>()?;
    let mut cells = vec![
        rehearsed["truth"].as_str().unwrap_or_default().to_owned(),
        seed.to_owned(),
        if rehearsed["named"] == true { "yes" } else { "no" }.to_owned(),
        models.join(" / "),
    ];
    for reference in REFERENCES {
        let [before, after, _] = errors(rehearsed, reference)?;
        cells.push(format!("{} / {}", short(before), short(after)));
    }
    Ok(format!("| {} |", cells.join(" | ")))
}

/// How far the errors fall where the effect is what makes them.
struct Falls {
    all: usize,
    shown: usize,
    five_times: usize,
    least: f64,
}

impl Default for Falls {
    fn default() -> Self {
        Self {
            all: 0,
            shown: 0,
            five_times: 0,
            least: f64::INFINITY,
        }
    }
}

impl Falls {
    fn count(&mut self, rehearsed: &Value) -> Result<(), String> {
        for reference in REFERENCES {
            let [before, after, without_effect] = errors(rehearsed, reference)?;
            self.all += 1;
            if before > 6.0 * without_effect {
                self.shown += 1;
                self.five_times += usize::from(before > 5.0 * after);
                self.least = self.least.min(before / after);
            }
        }
        Ok(())
    }
}

/// Percent of the range in open loop: without the compensator, with it, and of the stage without the effect.
fn errors(rehearsed: &Value, reference: &str) -> Result<[f64; 3], String> {
    Ok([
        number(&rehearsed["without_compensator_percent"][reference])?,
        number(&last_open(rehearsed)?["tracking_percent"][reference])?,
        number(&rehearsed["without_effect_percent"][reference])?,
    ])
}

fn first_rung(rehearsed: &Value) -> Result<&Value, String> {
    rungs(rehearsed)?
        .first()
        .ok_or_else(|| "a rehearsal without steps".to_owned())
}

/// The last controller that runs in open loop.
fn last_open(rehearsed: &Value) -> Result<&Value, String> {
    let open = rungs(rehearsed)?.iter().rfind(|rung| rung["loop"] == "open");
    open.ok_or_else(|| "a rehearsal without an open loop".to_owned())
}

fn rungs(rehearsed: &Value) -> Result<&Vec<Value>, String> {
    rehearsed["rungs"]
        .as_array()
        .ok_or_else(|| "a rehearsal without steps".to_owned())
}

fn number(value: &Value) -> Result<f64, String> {
    value.as_f64().ok_or_else(|| format!("a rehearsal's figure is {value}"))
}

/// Three digits; three decimals below 1 %.
fn short(percent: f64) -> String {
    match percent {
        large if large >= 10.0 => format!("{large:.1}"),
        medium if medium >= 1.0 => format!("{medium:.2}"),
        small => format!("{small:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn rehearsed(after: f64) -> Value {
        let figures = |percent: f64| json!({"10": 0.02, "100": 0.02, "500": percent, "hold": 0.01});
        json!({
            "truth": "a delay of 168 us", "named": true,
            "rungs": [
                {"loop": "open", "model_percent": 4.26, "tracking_percent": figures(17.6)},
                {"loop": "open", "model_percent": 0.056, "tracking_percent": figures(after)},
                {"loop": "closed", "model_percent": 0.056, "tracking_percent": figures(0.011)},
            ],
            "without_compensator_percent": figures(17.6),
            "without_effect_percent": figures(0.03),
        })
    }

    #[test]
    fn val_a_row_compares_open_loops() {
        assert_eq!(
            row("1", &rehearsed(0.025)),
            Ok("| a delay of 168 us | 1 | yes | 4.26 / 0.056 | 0.020 / 0.020 | 0.020 / 0.020 | 17.6 / 0.025 | 0.010 / 0.010 |".into())
        );
    }

    #[test]
    fn val_falls_count_where_the_effect_shows() {
        let mut falls = Falls::default();
        assert_eq!(
            falls.count(&rehearsed(0.1)).and_then(|()| falls.count(&rehearsed(8.8))),
            Ok(())
        );
        assert_eq!((falls.all, falls.shown, falls.five_times), (8, 2, 1));
        assert!((falls.least - 2.0).abs() < 1e-12);
    }

    #[test]
    fn refuse_a_figure_that_is_absent() {
        let mut without = rehearsed(0.1);
        without["without_effect_percent"] = Value::Null;
        assert_eq!(
            Falls::default().count(&without),
            Err("a rehearsal's figure is null".into())
        );
    }
}
