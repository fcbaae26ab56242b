//! `hysteron explain`.

mod page;

use crate::commands::load::{self, NamedEffect};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::Dataset;
use hysteron_diagnose::{add, add_own};
use hysteron_identify::effects::{self, Description};
use hysteron_identify::illustration::{Illustration, illustrate};
use hysteron_identify::{Added, Model};
use hysteron_report::amounts::{Amount, plain};
use hysteron_report::explanation::{CHAIN, explanation_text, wrapped};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Examples:\n  hysteron explain\n  hysteron explain delay -o delay.html\n  \
    hysteron explain delay stage model.toml -o delay.html\n  hysteron explain ./my-effect.toml -o my-effect.html"
)]
pub(crate) struct ExplainArgs {
    /// The effect, or an effect file (ends with .toml); without one, all are listed
    pub effect: Option<String>,
    /// Dataset folder, or one CSV: what the effect does on these records
    #[arg(requires = "model")]
    pub data: Option<PathBuf>,
    /// The model of these records to put it into; the file stays as it is
    pub model: Option<PathBuf>,
    /// Write a page with pictures
    #[arg(short, long, value_name = "PAGE.html", requires = "effect")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// All that is said of one effect.
struct Explained {
    description: &'static Description,
    /// On the imagined stage, or why it cannot be shown there.
    shown: Result<Illustration, String>,
    own: Option<OnOwnData>,
}

/// The effect put into the user's model.
struct OnOwnData {
    dataset: Dataset,
    before: Model,
    added: Added,
}

pub(crate) fn run(args: &ExplainArgs) -> Result<Done, CliError> {
    let Some(name) = &args.effect else {
        return list(args.json);
    };
    let named = NamedEffect::read(name)?;
    let effect = named.effect();
    let explained = Explained {
        description: effect.description(),
        shown: illustrate(&effect),
        own: own(args, named)?,
    };
    if let Some(path) = &args.output {
        output::write_file(path, &page::page(&explained))?;
    }
    if args.json {
        output::print_json(&json(&explained))?;
        return Ok(Done::Answered);
    }
    let mut text = text(&explained);
    if let Some(path) = &args.output {
        // Writing to a String does not fail.
        let _ = writeln!(text, "\npage with pictures: {}", path.display());
    }
    output::print(&text)?;
    Ok(Done::Answered)
}

fn list(as_json: bool) -> Result<Done, CliError> {
    let all: Vec<&Description> = effects::catalogue().iter().map(|effect| effect.description()).collect();
    if as_json {
        let all: Vec<_> = all
            .iter()
            .map(|d| serde_json::json!({"effect": d.name, "place": d.place.name(), "summary": d.summary}))
            .collect();
        output::print_json(&all)?;
        return Ok(Done::Answered);
    }
    let mut text = "The effects, from the command to the reading:\n".to_owned();
    for place in CHAIN {
        let _ = writeln!(text, "\n{}", place.name());
        for d in all.iter().filter(|d| d.place == place) {
            let _ = writeln!(text, "  {:<20} {}", d.name, d.summary);
        }
    }
    text.push_str("\nnext: hysteron explain delay -o delay.html\n");
    output::print(&text)?;
    Ok(Done::Answered)
}

fn own(args: &ExplainArgs, named: NamedEffect) -> Result<Option<OnOwnData>, CliError> {
    let (Some(data), Some(model)) = (&args.data, &args.model) else {
        return Ok(None);
    };
    let before = load::model(model)?;
    let dataset = load::dataset(data)?;
    let name = named.effect().name();
    let bar = progress::bar(&format!("trying {name}"));
    let advance = |share| progress::advance(&bar, share);
    let added = match named {
        NamedEffect::Own(own) => add_own(&dataset, &before, own, &advance)?,
        NamedEffect::Catalogue(id) => add(&dataset, &before, id, &advance)?,
    };
    bar.finish_and_clear();
    Ok(Some(OnOwnData { dataset, before, added }))
}

fn text(explained: &Explained) -> String {
    let d = explained.description;
    let mut text = explanation_text(d, &explained.shown);
    if let Some(own) = &explained.own {
        own_text(&mut text, own, d);
    }
    text
}

fn own_text(text: &mut String, own: &OnOwnData, d: &Description) {
    let percent = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3} %"));
    let (before, after) = (&own.added.before, &own.added.after);
    let _ = writeln!(
        text,
        "\nOn your records ({}), error in % of peak to peak\n  {:<24} {:>10} {:>10}",
        own.dataset.name, "", "without", "with it"
    );
    for (name, before, after) in [
        ("fitted to", before.identify_percent, after.identify_percent),
        ("not fitted to", before.validate_percent, after.validate_percent),
    ] {
        let _ = writeln!(text, "  {name:<24} {:>10} {:>10}", percent(before), percent(after));
    }
    let parameters = fitted(own, d);
    let names: Vec<String> = parameters.iter().map(|p| format!("{:<14}", p.name)).collect();
    let amounts = parameters.iter().zip(&names).map(|(p, name)| Amount {
        name,
        value: p.value,
        standard_error: None,
        unit: &p.unit,
    });
    for line in plain(&amounts.collect::<Vec<_>>()) {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str(&wrapped(&verdict(own)));
}

/// The parameters that the user's records ask for.
fn fitted<'a>(own: &'a OnOwnData, d: &Description) -> &'a [hysteron_identify::Parameter] {
    let found = own
        .added
        .model
        .effects
        .iter()
        .find(|effect| effect.name.as_str() == d.name);
    found.map_or(&[], |effect| &effect.parameters)
}

/// Whether it helps, and who says so properly.
fn verdict(own: &OnOwnData) -> String {
    let said = match (own.added.before.validate_percent, own.added.after.validate_percent) {
        (Some(before), Some(after)) if after < before => format!(
            "On records it was not fitted to, the model with it is off by {} times as much as without.",
            hysteron_report::significant(after / before)
        ),
        (Some(_), Some(_)) => "On records it was not fitted to, the model is no better with it.".to_owned(),
        _ => "There is no validation record: that the error falls where it was fitted proves nothing.".to_owned(),
    };
    said + " A smaller error does not say that this effect is the cause: `hysteron diagnose` holds all of them against each other."
}

fn json(explained: &Explained) -> serde_json::Value {
    let d = explained.description;
    let parameters: Vec<_> = d
        .parameters
        .iter()
        .map(|p| serde_json::json!({"name": p.name, "unit": p.unit, "what": p.what}))
        .collect();
    let example = explained.shown.as_ref().ok().map(|shown| {
        serde_json::json!({
            "excitation": shown.excitation,
            "differs_percent": shown.differs_percent,
            "values": shown.values,
        })
    });
    let own = explained.own.as_ref().map(|own| {
        serde_json::json!({
            "dataset": own.dataset.name,
            "before": own.added.before,
            "after": own.added.after,
            "parameters": fitted(own, d),
        })
    });
    serde_json::json!({
        "effect": d.name,
        "place": d.place.name(),
        "summary": d.summary,
        "equation": d.equation,
        "source": d.source,
        "parameters": parameters,
        "shows": d.shows,
        "mistaken_for": d.mistaken_for,
        "separated_by": d.separated_by,
        "compensated_by": d.compensated_by,
        "example": example,
        "own_data": own,
    })
}
