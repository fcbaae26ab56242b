//! Writes a dataset with a hidden effect, and the truth beside it.
//!
//! `cargo run --release -p host-tests --example generate -- --seed 7 --effect delay:medium -o DIR`
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::hidden::{self, score};
use hysteron_data::{Overwrite, write_dataset};
use hysteron_plant::challenge::{Asked, Effect, Spec, StageFamily, Strength};
use std::error::Error;
use std::path::PathBuf;

const HELP: &str = "\
generate --seed N [--effect NAME[:weak|:medium|:strong]]... [--family NAME] -o DIR
generate --seed N --calibration pair -o DIR

  several --effect make a pair; none makes a control with nothing hidden; a strength is medium unless given
  --calibration pair: the pair that `calibrate` makes of this seed with `learn`
";

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let (mut seed, mut hidden, mut family, mut folder, mut pair) = (0_u64, Vec::new(), None, None::<PathBuf>, false);
    while let Some(word) = words.next() {
        let value = words.next().ok_or(HELP)?;
        let unknown = || format!("{word} {value} is not known\n{HELP}");
        match word.as_str() {
            "--seed" => seed = value.parse()?,
            "--effect" => {
                let (effect, strength) = value.split_once(':').unwrap_or((&value, "medium"));
                hidden.push(Asked {
                    effect: Effect::from_name(effect).ok_or_else(unknown)?,
                    strength: Strength::from_name(strength).ok_or_else(unknown)?,
                });
            }
            "--calibration" if value == "pair" => pair = true,
            "--family" => family = Some(StageFamily::from_name(&value).ok_or_else(unknown)?),
            "-o" => folder = Some(value.into()),
            _ => return Err(unknown().into()),
        }
    }
    let folder = folder.ok_or(HELP)?;
    let spec = match score::pairs(seed, 1).pop() {
        Some((_, spec)) if pair => spec,
        _ => Spec {
            hidden,
            family,
            noise_seed: 0,
        },
    };
    let example = hidden::generate(seed, &spec)?;
    write_dataset(&example.dataset, &folder, Overwrite::Refuse)?;
    let mut truth = hidden::truth_json(&example.truth);
    truth["start"] = example.start.name().into();
    let text = serde_json::to_string_pretty(&truth)?;
    std::fs::write(folder.join("truth.json"), format!("{text}\n"))?;
    println!("{text}");
    Ok(())
}
