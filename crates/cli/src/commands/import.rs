//! `hysteron import`.

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_data::import::{ColumnChoice, Decimal, Gaps, ImportOptions, Jitter, Missing, Separator, import};
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron import scope.csv -o stage\n  \
    hysteron import run1.mat run2.mat --validate run3.mat --rate 50000 --column voltage=u:V --column position=y:um -o stage\n\n\
    QUANTITY is one of time, voltage, position, reference, temperature, voltage2; COLUMN a name or a number from 1.\n\
    MATLAB files of version 7.3 are not read; in MATLAB save them with: save('file.mat', '-v7')")]
pub(crate) struct ImportArgs {
    /// Recordings that models are fitted to: CSV, TSV, TXT, .mat (v5), PI GCS arrays
    #[arg(required_unless_present = "validate")]
    pub files: Vec<PathBuf>,
    /// A recording that models are judged on; may be given several times
    #[arg(long, value_name = "FILE")]
    pub validate: Vec<PathBuf>,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER", required_unless_present = "dry_run")]
    pub output: Option<PathBuf>,
    /// Name of the dataset; the folder's name if not given
    #[arg(long)]
    pub name: Option<String>,
    /// Which column is which quantity, its unit and a factor: voltage=CH1:mV*20
    #[arg(long = "column", value_name = "QUANTITY=COLUMN:UNIT*FACTOR")]
    pub columns: Vec<ColumnChoice>,
    /// Sample rate in hertz, for files without time and instead of the time in the file
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Where columns end; found out if not given
    #[arg(long, value_enum)]
    pub separator: Option<SeparatorName>,
    /// The decimal sign; found out if not given
    #[arg(long, value_enum)]
    pub decimal: Option<DecimalName>,
    /// Line of the column names, from 1; 0: there is none
    #[arg(long, value_name = "LINE")]
    pub header_line: Option<u64>,
    /// What to do with empty cells and NaN
    #[arg(long, value_enum, default_value_t = MissingName::Refuse)]
    pub missing: MissingName,
    /// What to do where time jumps
    #[arg(long, value_enum, default_value_t = GapsName::Refuse)]
    pub gaps: GapsName,
    /// What to do with time stamps that jitter by more than a tenth of a sample
    #[arg(long, value_enum, default_value_t = JitterName::Refuse)]
    pub jitter: JitterName,
    /// Say what was found in the files, and write nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SeparatorName {
    Comma,
    Semicolon,
    Tab,
    Blank,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DecimalName {
    Point,
    Comma,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MissingName {
    /// An error that names the first
    Refuse,
    /// Leave out lines at the beginning and the end
    Trim,
    /// As trim, and close single gaps by the mean of the neighbours
    Interpolate,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum GapsName {
    /// An error that names the first
    Refuse,
    /// A new record begins
    Split,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum JitterName {
    /// An error that says how large it is
    Refuse,
    /// The samples were uniform, the stamps are late
    Clock,
    /// The stamps are right: interpolate to a uniform clock
    Interpolate,
}

pub(crate) fn run(args: &ImportArgs) -> Result<Done, CliError> {
    let files = args.files.iter().map(|file| (file, Role::Identify));
    let files: Vec<_> = files
        .chain(args.validate.iter().map(|file| (file, Role::Validate)))
        .collect();
    let mut text = String::new();
    let mut dataset = Dataset::default();
    let bar = progress::bar("importing");
    for (i, (file, role)) in files.iter().enumerate() {
        let imported = import(file, &options(args, *role)?, &mut |done, all| {
            progress::advance(&bar, (i as f64 + done as f64 / all.max(1) as f64) / files.len() as f64);
        })?;
        // Writing to a String does not fail.
        let _ = writeln!(text, "{}", imported.preview);
        dataset.records.extend(imported.records);
    }
    bar.finish_and_clear();
    name_apart(&mut dataset.records);
    match &args.output {
        Some(folder) if !args.dry_run => {
            let folder_name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
            dataset.name = args
                .name
                .clone()
                .or(folder_name)
                .unwrap_or_else(|| "imported".to_owned());
            dataset.description = "imported".to_owned();
            let overwrite = if args.overwrite {
                Overwrite::Allow
            } else {
                Overwrite::Refuse
            };
            write_dataset(&dataset, folder, overwrite)?;
            let count = dataset.records.len();
            let _ = writeln!(
                text,
                "{count} record{} written to {}",
                if count == 1 { "" } else { "s" },
                folder.display()
            );
            let _ = writeln!(text, "next: hysteron fit {} --model mrpi", folder.display());
        }
        _ => text.push_str("nothing written (--dry-run)\n"),
    }
    output::print(&text)?;
    Ok(Done::Answered)
}

fn options(args: &ImportArgs, role: Role) -> Result<ImportOptions, CliError> {
    if let Some(rate) = args.rate
        && !(rate.is_finite() && rate > 0.0)
    {
        return Err(CliError::Option(format!(
            "--rate {rate}: a sample rate is a finite number of hertz above 0"
        )));
    }
    Ok(ImportOptions {
        role,
        columns: args.columns.clone(),
        rate_hz: args.rate,
        separator: args.separator.map(|separator| match separator {
            SeparatorName::Comma => Separator::Comma,
            SeparatorName::Semicolon => Separator::Semicolon,
            SeparatorName::Tab => Separator::Tab,
            SeparatorName::Blank => Separator::Blank,
        }),
        decimal: args.decimal.map(|decimal| match decimal {
            DecimalName::Point => Decimal::Point,
            DecimalName::Comma => Decimal::Comma,
        }),
        header_line: args.header_line,
        missing: match args.missing {
            MissingName::Refuse => Missing::Refuse,
            MissingName::Trim => Missing::Trim,
            MissingName::Interpolate => Missing::Interpolate,
        },
        gaps: match args.gaps {
            GapsName::Refuse => Gaps::Refuse,
            GapsName::Split => Gaps::Split,
        },
        jitter: match args.jitter {
            JitterName::Refuse => Jitter::Refuse,
            JitterName::Clock => Jitter::Clock,
            JitterName::Interpolate => Jitter::Interpolate,
        },
    })
}

/// Files of one name from different folders get numbers: `run.csv`, `run-2.csv`.
fn name_apart(records: &mut [Record]) {
    let mut taken = std::collections::HashSet::new();
    for record in records {
        let stem = record.file.trim_end_matches(".csv").to_owned();
        let mut number = 1;
        while !taken.insert(record.file.clone()) {
            number += 1;
            record.file = format!("{stem}-{number}.csv");
        }
    }
}
