//! `hysteron add`.

use crate::commands::load::{self, NamedEffect};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_identify::{Added, EffectName, FittedEffect, Step};
use hysteron_report::amounts::{Amount, written};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron add delay stage model.toml -o model2.toml\n  \
    hysteron add resonance stage model2.toml -o model3.toml\n  hysteron ladder model3.toml\n\n\
    Effects: delay, first-order-lag, slew-limit, saturation, rate-dependence, asymmetry, amplitude-gain,\n\
    hysteresis-shape, creep, resonance, cross-coupling, thermal-drift, mains-hum, backlash, sensor-nonlinearity,\n\
    nonlinear-stiffness, friction, mode-hysteresis.\n\
    A resonance may be added a second time: a second mode. The last three take its place.\n\n\
    An effect of your own is given by its file (docs/effect-files.md):\n  \
    hysteron add ./my-effect.toml stage model.toml -o model2.toml")]
pub(crate) struct AddArgs {
    /// The effect to add: its name, or an effect file (ends with .toml)
    pub effect: String,
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model to add it to; it stays as it is
    pub model: PathBuf,
    /// Where to write the new model
    #[arg(short, long, value_name = "MODEL2")]
    pub output: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &AddArgs) -> Result<Done, CliError> {
    let model = load::model(&args.model)?;
    let dataset = load::dataset(&args.data)?;
    let effect = NamedEffect::read(&args.effect)?;
    let name = effect.effect().name();
    let bar = progress::bar(&format!("adding {name}"));
    let advance = |share| progress::advance(&bar, share);
    let added = match effect {
        NamedEffect::Own(own) => hysteron_diagnose::add_own(&dataset, &model, own, &advance)?,
        NamedEffect::Catalogue(id) => hysteron_diagnose::add(&dataset, &model, id, &advance)?,
    };
    bar.finish_and_clear();
    added.model.write(&args.output)?;
    if args.json {
        output::print_json(&json(args, &name, &added))?;
    } else {
        output::print(&text(args, &name, &added))?;
    }
    Ok(Done::Answered)
}

fn text(args: &AddArgs, name: &EffectName, added: &Added) -> String {
    let mut text = format!("{name} added, everything fitted anew\n\n");
    match added.model.effects.iter().find(|effect| effect.name == *name) {
        Some(effect) => parameters(&mut text, effect),
        None => {
            // Writing to a String does not fail.
            let _ = writeln!(
                text,
                "  the hysteresis is now {} with {} {}",
                added.model.family,
                added.model.thresholds.len(),
                added.model.family.elements()
            );
        }
    }
    errors(&mut text, &added.before, &added.after);
    for notice in &added.model.notices {
        let _ = write!(text, "\nnote: {notice}");
    }
    if !added.model.notices.is_empty() {
        text.push('\n');
    }
    let _ = write!(
        text,
        "\nwritten to {}\nnext: hysteron ladder {}\n",
        args.output.display(),
        args.output.display()
    );
    text
}

fn parameters(text: &mut String, effect: &FittedEffect) {
    let amounts: Vec<Amount<'_>> = effect.parameters.iter().map(Amount::from).collect();
    let _ = writeln!(text, "  {:<16} {:>12} {:>11}  unit", "parameter", "value", "std. error");
    for row in written(&amounts) {
        let line = format!(
            "  {:<16} {:>12} {:>11}  {}",
            row.name, row.value, row.standard_error, row.unit
        );
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

/// The errors of every record, before and after.
pub(super) fn errors(text: &mut String, before: &Step, after: &Step) {
    let widest = before
        .records
        .iter()
        .map(|r| r.file.chars().count())
        .max()
        .unwrap_or(0)
        .max(18);
    let _ = writeln!(text, "\n{:<9} {:<widest$} {:>17}", "", "error:", "% of peak to peak");
    let _ = writeln!(
        text,
        "{:<9} {:<widest$} {:>8} {:>8}",
        "role", "record", "before", "after"
    );
    for (b, a) in before.records.iter().zip(&after.records) {
        // A record that stands still has no such figure.
        if let (Some(pb), Some(pa)) = (b.percent, a.percent) {
            let _ = writeln!(text, "{:<9} {:<widest$} {pb:>8.2} {pa:>8.2}", b.role.name(), b.file);
        }
    }
    text.push('\n');
    for (name, b, a) in [
        ("records fitted to", before.identify_percent, after.identify_percent),
        ("records not fitted to", before.validate_percent, after.validate_percent),
    ] {
        if let (Some(b), Some(a)) = (b, a) {
            let _ = writeln!(text, "pooled over the {name}: {b:.3} -> {a:.3} % of peak to peak");
        }
    }
    if after.validate_percent.is_none() {
        text.push_str("no record was kept to judge by: give some the role validate, or a fall here proves nothing\n");
    } else if after.validate_percent >= before.validate_percent {
        text.push_str("the records not fitted to do not support it: their error did not fall\n");
    }
}

fn json(args: &AddArgs, name: &EffectName, added: &Added) -> serde_json::Value {
    let records: Vec<_> = added
        .before
        .records
        .iter()
        .zip(&added.after.records)
        .map(|(b, a)| {
            serde_json::json!({
                "file": b.file,
                "role": b.role,
                "before": {"percent": b.percent, "relative_percent": b.relative_percent, "rms_um": b.rms},
                "after": {"percent": a.percent, "relative_percent": a.relative_percent, "rms_um": a.rms},
            })
        })
        .collect();
    let pooled = |step: &Step| {
        serde_json::json!({
            "identify_percent": step.identify_percent,
            "validate_percent": step.validate_percent,
        })
    };
    serde_json::json!({
        "effect": name,
        "file": args.output,
        "model": added.model.family.name(),
        "effects": added.model.effects,
        "noise_rms_um": added.model.fitted_on.noise.map(|noise| noise.rms_um),
        "before": pooled(&added.before),
        "after": pooled(&added.after),
        "records": records,
        "notices": added.model.notices,
    })
}
