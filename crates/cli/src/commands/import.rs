//! `hysteron import`.

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::{Args, ValueEnum};
use hysteron_data::import::{
    ColumnChoice, Decimal, Gaps, ImportOptions, Jitter, Missing, Separator, import, import_joined, name_apart,
};
use hysteron_data::{Dataset, Manifest, Overwrite, Role, append_records, write_dataset};
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "Examples:\n  hysteron import scope.csv -o stage\n  \
    hysteron import run1.mat run2.mat --validate run3.mat --rate 50000 --column voltage=u:V --column position=y:um -o stage\n  \
    hysteron import log.tdms -o stage --column voltage=AO0:V*20 --column position=AI1:um*5-50    # an amplifier, a sensor\n  \
    hysteron import --join F0001CH1.CSV F0001CH2.CSV -o stage \\\n    \
    --column voltage=F0001CH1:V*20 --column position=F0001CH2:um*10\n  \
    hysteron import next.csv --append -o stage    # one more record for a dataset that is there\n\n\
    QUANTITY is one of time, voltage, position, reference, temperature, voltage2; COLUMN a name or a number from 1.\n\
    A number x of the file is x*FACTOR+OFFSET in UNIT. --dry-run shows what was found, and writes nothing.\n\
    docs/recordings.md lists what oscilloscopes and programs write, and how each is read.")]
pub(crate) struct ImportArgs {
    /// Recordings that models are fitted to: text of any dialect, xlsx, JSON, TDMS, LVM, MATLAB, HDF5, NumPy, Parquet,
    /// Feather, PI GCS; also packed by gzip or zip
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
    /// Which column is which quantity, its unit, a gain and an offset: voltage=CH1:mV*20, position=CH2:um*5-50
    #[arg(long = "column", value_name = "QUANTITY=COLUMN:UNIT*FACTOR+OFFSET")]
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
    /// The files are channels of one recording, joined on their clocks; columns count through all, and a file's only
    /// channel has the file's name
    #[arg(long)]
    pub join: bool,
    /// Say what was found in the files, and write nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
    /// Add the records to a dataset that is there already
    #[arg(long, conflicts_with_all = ["overwrite", "name"])]
    pub append: bool,
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
    let mut text = String::new();
    let mut dataset = Dataset::default();
    let bar = progress::bar("importing");
    let tasks = tasks(args);
    for (i, (files, role)) in tasks.iter().enumerate() {
        let options = options(args, *role)?;
        let mut advance = |done: u64, all: u64| {
            progress::advance(&bar, (i as f64 + done as f64 / all.max(1) as f64) / tasks.len() as f64);
        };
        let imported = match files.as_slice() {
            [file] => import(file, &options, &mut advance)?,
            files => import_joined(files, &options, &mut advance)?,
        };
        // Writing to a String does not fail.
        let _ = writeln!(text, "{}", imported.preview);
        dataset.records.extend(imported.records);
    }
    bar.finish_and_clear();
    match args.output.as_deref().filter(|_| args.append) {
        Some(folder) => {
            let there = Manifest::read(folder)?;
            name_apart(
                &mut dataset.records,
                there.records.iter().map(|entry| entry.file.as_str()),
            );
        }
        None => name_apart(&mut dataset.records, []),
    }
    super::load::warn(&dataset);
    match &args.output {
        Some(folder) if !args.dry_run => {
            if args.append {
                append_records(folder, &dataset.records)?;
            } else {
                write_new(args, folder, &mut dataset)?;
            }
            let count = dataset.records.len();
            let _ = writeln!(
                text,
                "{count} record{} {} {}",
                if count == 1 { "" } else { "s" },
                if args.append { "added to" } else { "written to" },
                folder.display()
            );
            let _ = writeln!(text, "next: hysteron fit {} --model mrpi", folder.display());
        }
        _ => text.push_str("nothing written (--dry-run)\n"),
    }
    output::print(&text)?;
    Ok(Done::Answered)
}

/// Writes the records as a dataset of its own.
fn write_new(args: &ImportArgs, folder: &Path, dataset: &mut Dataset) -> Result<(), CliError> {
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
    write_dataset(dataset, folder, overwrite)?;
    Ok(())
}

/// What is read at once: each file, or all of a role where they are joined.
fn tasks(args: &ImportArgs) -> Vec<(Vec<PathBuf>, Role)> {
    let of = |files: &[PathBuf], role: Role| -> Vec<(Vec<PathBuf>, Role)> {
        let size = if args.join { files.len().max(1) } else { 1 };
        files.chunks(size).map(|files| (files.to_vec(), role)).collect()
    };
    [of(&args.files, Role::Identify), of(&args.validate, Role::Validate)].concat()
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
