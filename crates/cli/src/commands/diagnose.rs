//! `hysteron diagnose`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_diagnose::diagnosis::{Diagnosis, Level, NextRecord, RankedEffect};
use hysteron_identify::{Direction, Model};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron diagnose stage model.toml -o next.csv\n  \
    hysteron diagnose stage model.toml --effect my-effect.toml")]
pub(crate) struct DiagnoseArgs {
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The model to start from
    pub model: PathBuf,
    /// Write the voltage of the record to take next
    #[arg(short, long, value_name = "NEXT.csv")]
    pub output: Option<PathBuf>,
    /// An effect file of your own, among the candidates; may be repeated
    #[arg(long, value_name = "FILE.toml")]
    pub effect: Vec<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &DiagnoseArgs) -> Result<Done, CliError> {
    let model = Model::read(&args.model)?;
    if model.direction == Direction::Inverse {
        return Err(CliError::Option(format!(
            "{}: an inverse model has no place for physical effects; give a forward model (hysteron fit --direction forward)",
            args.model.display()
        )));
    }
    let own = load::effect_files(&args.effect)?;
    let dataset = load::dataset(&args.data)?;
    let bar = progress::bar("diagnosing");
    let mut diagnosis = hysteron_diagnose::diagnose_with(&dataset, &model, &own, &|share, effect| {
        bar.set_message(effect.to_owned());
        progress::advance(&bar, share);
    })?;
    bar.finish_and_clear();
    if let (Some(path), Some(next)) = (&args.output, &mut diagnosis.next_record) {
        output::write_file(path, &csv(next))?;
        next.file = Some(path.display().to_string());
    }
    if args.json {
        output::print_json(&diagnosis)?;
    } else {
        output::print(&text(&diagnosis))?;
    }
    Ok(Done::Answered)
}

/// The record to play, as a native CSV without a position.
fn csv(next: &NextRecord) -> String {
    let mut text = "time_s,voltage_v\n".to_owned();
    for (k, v) in next.voltage_v.iter().enumerate() {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{:.6},{v:.5}", k as f64 * next.sample_period_s);
    }
    text
}

fn text(d: &Diagnosis) -> String {
    let mut text = String::new();
    is_anything_missing(&mut text, d);
    let _ = writeln!(text, "\n{}", verdict(d));
    for reason in &d.cannot_answer {
        let _ = writeln!(text, "  - {}", reason_in_words(reason));
    }
    if !d.also_possible.is_empty() {
        let _ = writeln!(
            text,
            "these records cannot tell it from: {}",
            d.also_possible.join(", ")
        );
    }
    if !d.further.is_empty() {
        let _ = writeln!(text, "with it in the model, there is still: {}", d.further.join(", "));
    }
    if d.shape_too_poor {
        text.push_str("the model's family of plays is too poor for this stage's loops: try --model play-polynomial\n");
    }
    ranking(&mut text, &d.ranking);
    remains(&mut text, d);
    if let Some(next) = &d.next_record {
        next_record(&mut text, next);
    }
    text
}

fn is_anything_missing(text: &mut String, d: &Diagnosis) {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3} %"));
    let _ = writeln!(text, "noise floor {:.3e} um rms", d.noise_rms_um);
    let _ = writeln!(
        text,
        "{:<38} {:>10} {:>10}",
        "error, % of peak to peak", "identify", "validate"
    );
    for (name, error) in [
        ("the model", d.before),
        ("a hysteresis of free shape instead", d.free_shape),
    ] {
        let (identify, validate) = (percent(error.identify_percent), percent(error.validate_percent));
        let _ = writeln!(text, "{name:<38} {identify:>10} {validate:>10}");
    }
}

fn verdict(d: &Diagnosis) -> String {
    if !d.cannot_answer.is_empty() {
        return "verdict: unknown; these records cannot answer:".to_owned();
    }
    match d.verdict.as_str() {
        "none" => "verdict: none; what is left is sensor noise and the known coarseness of the model".to_owned(),
        "unknown" => "verdict: unknown; structure remains that no effect of the catalogue explains".to_owned(),
        "hysteresis-shape" => {
            "verdict: hysteresis-shape; nothing physical is missing, the family of plays is too poor".to_owned()
        }
        name => format!("verdict: {name} is missing"),
    }
}

/// Why records cannot answer.
pub(super) fn reason_in_words(reason: &str) -> &str {
    match reason {
        "nothing-moves" => "the voltage stands still in every record",
        "no-validation" => {
            "no record that moves has role `validate`: an effect could be judged only where it was fitted"
        }
        "no-identification" => "no record that moves has role `identify`",
        "all-noise" => "the stroke is less than 30 times the noise: a medium effect drowns in it",
        "clipped" => {
            "the position stands on its largest or smallest value in over 5 % of the samples while the voltage moves"
        }
        "one-excitation" => "only one sine was played: at one frequency and amplitude all effects look alike",
        "too-short" => "the records that move last too short a time",
        other => other,
    }
}

fn ranking(text: &mut String, ranking: &[RankedEffect]) {
    let _ = writeln!(
        text,
        "\n  {:<20} {:<9} {:>10} {:>10} {:>10} {:>9} {:>7}",
        "candidate", "level", "identify %", "validate %", "statistic", "threshold", "share"
    );
    for effect in ranking {
        let level = match effect.level {
            Level::Physical => "physical",
            Level::Shape => "shape",
        };
        let _ = writeln!(
            text,
            "{} {:<20} {level:<9} {:>10.3} {:>10.3} {:>10.2} {:>9.2} {:>6.0}%",
            if effect.significant { '*' } else { ' ' },
            effect.effect,
            effect.identify_percent,
            effect.validate_percent,
            effect.statistic,
            effect.threshold,
            100.0 * effect.share
        );
        if effect.significant && !effect.parameters.is_empty() {
            let parameters: Vec<String> = effect
                .parameters
                .iter()
                .map(|p| format!("{} {:.4e} {}", p.name, p.value, p.unit))
                .collect();
            let _ = writeln!(text, "      {}", parameters.join(", "));
        }
    }
    text.push_str("  (* significant and large enough to matter; share: what it takes of the squared error)\n");
}

fn remains(text: &mut String, d: &Diagnosis) {
    let left = &d.unexplained;
    let _ = writeln!(
        text,
        "\nleft unexplained: {:.3} % of peak to peak, of which noise {:.3} %",
        left.percent, left.noise_percent
    );
    let locked: Vec<String> = left
        .locked_to
        .iter()
        .filter(|l| l.share > 0.1)
        .map(|l| format!("{} {:.0} %", l.to, 100.0 * l.share))
        .collect();
    if !locked.is_empty() {
        let _ = writeln!(text, "it goes with: {}", locked.join(", "));
    }
}

fn next_record(text: &mut String, next: &NextRecord) {
    let _ = write!(text, "\nrecord to take next: {}", next.excitation);
    if !next.separates.is_empty() {
        let _ = write!(
            text,
            "\n  it separates {} by {:.1} times what is left unexplained",
            next.separates.join(" from "),
            next.expected_sigma
        );
    }
    match &next.file {
        Some(file) => {
            let _ = writeln!(text, "\n  written to {file}");
        }
        None => text.push_str("\n  `-o next.csv` writes it\n"),
    }
}
