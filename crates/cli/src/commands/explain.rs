//! `hysteron explain`.

mod page;

use crate::commands::load::{self, NamedEffect};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::Dataset;
use hysteron_diagnose::{add, add_own};
use hysteron_identify::effects::{self, Description, Place};
use hysteron_identify::illustration::{Illustration, illustrate};
use hysteron_identify::{Added, Model};
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

/// The places of the chain in their order.
const CHAIN: [Place; 7] = [
    Place::Delay,
    Place::Amplifier,
    Place::Hysteresis,
    Place::Creep,
    Place::Structure,
    Place::Coupling,
    Place::Sensor,
];

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

/// The chain in words, the effect's own place in brackets.
fn chain(place: Place) -> String {
    let mut text = "voltage".to_owned();
    for here in CHAIN {
        let name = here.name();
        let _ = if here == place {
            write!(text, " → [{name}]")
        } else {
            write!(text, " → {name}")
        };
    }
    text + " → reading"
}

/// What the pictures show, in a sentence.
fn caption(shown: &Illustration) -> String {
    format!(
        "{}, on a stage of 10 µm at 100 V: with and without the effect differ by {} % of the stroke.",
        capital(&shown.excitation),
        hysteron_report::significant(shown.differs_percent)
    )
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

/// The titled paragraphs of an explanation.
fn paragraphs(d: &Description) -> [(&'static str, String); 7] {
    [
        ("Equation", hysteron_report::equation(d.equation)),
        ("Source, usual size", d.source.to_owned()),
        ("Place in the chain", chain(d.place)),
        ("How it shows", d.shows.to_owned()),
        ("Mistaken for", d.mistaken_for.to_owned()),
        ("Told apart by", d.separated_by.to_owned()),
        ("Compensated by", d.compensated_by.to_owned()),
    ]
}

fn text(explained: &Explained) -> String {
    let d = explained.description;
    let mut text = format!("{}: {}\n", d.name, d.summary);
    for (title, paragraph) in paragraphs(d) {
        let _ = write!(text, "\n{title}\n{}", wrapped(&paragraph));
    }
    text.push_str("\nParameters\n");
    for p in d.parameters {
        let unit = if p.unit.is_empty() { "-" } else { p.unit };
        let _ = writeln!(text, "  {:<14} {unit:<8} {}", p.name, p.what);
    }
    if d.parameters.is_empty() {
        text.push_str("  none of its own: it changes the hysteresis' plays\n");
    }
    match &explained.shown {
        Ok(shown) => {
            let _ = write!(
                text,
                "\nAn example (pictures: -o page.html)\n{}",
                wrapped(&caption(shown))
            );
            for (p, value) in d.parameters.iter().zip(&shown.values) {
                let _ = writeln!(text, "  {:<14} {value:.4e} {}", p.name, p.unit);
            }
        }
        Err(reason) => {
            let _ = write!(text, "\nNo example\n{}", wrapped(reason));
        }
    }
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
    for p in fitted(own, d) {
        let _ = writeln!(text, "  {:<14} {:.4e} {}", p.name, p.value, p.unit);
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

/// A paragraph indented by two and wrapped at 100 columns.
fn wrapped(paragraph: &str) -> String {
    const COLUMNS: usize = 98;
    let mut text = String::new();
    let mut line = String::new();
    for word in paragraph.split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            let _ = writeln!(text, "  {line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(text, "  {line}");
    text
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
