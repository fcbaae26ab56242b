//! `hysteron predict`.

use crate::commands::load;
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_data::export::{Column, TableFormat, Values, write_table};
use hysteron_data::{Dataset, Record};
use hysteron_identify::Model;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron predict model.toml stage -o out.csv\n  \
    hysteron predict model.toml stage -o out.parquet    # or .npz, for Python\n\n\
    A row a sample: record, time_s, the input, measured, model and residual (measured minus model), in um or, of an inverse\n\
    model, in V. The model runs freely: the measured output is used for nothing but its state before the first sample.")]
pub(crate) struct PredictArgs {
    /// The model
    pub model: PathBuf,
    /// Dataset folder, or one CSV
    pub data: PathBuf,
    /// The table to write; its ending says the format: .csv, .npz or .parquet
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
}

/// What was written of a record.
#[derive(Serialize)]
struct Predicted {
    record: String,
    samples: usize,
    sample_rate_hz: f64,
    residual_rms: f64,
    unit: &'static str,
}

pub(crate) fn run(args: &PredictArgs) -> Result<Done, CliError> {
    let format = TableFormat::of(&args.output)?;
    let model = load::model(&args.model)?;
    let dataset = load::dataset(&args.data)?;
    let (columns, predicted) = predict(&model, &dataset);
    write_table(&args.output, format, &columns)?;
    if args.json {
        output::print_json(&predicted)?;
        return Ok(Done::Answered);
    }
    let mut text = String::new();
    for record in &predicted {
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{}: {} samples at {} Hz, residual {:.4} {} rms",
            record.record, record.samples, record.sample_rate_hz, record.residual_rms, record.unit
        );
    }
    let _ = writeln!(text, "written to {}", args.output.display());
    output::print(&text)?;
    Ok(Done::Answered)
}

/// The table and what is said of it.
fn predict(model: &Model, dataset: &Dataset) -> (Vec<Column>, Vec<Predicted>) {
    let bar = progress::bar("predicting");
    let unit = model.direction.output_unit();
    let suffix = |unit: &str| if unit == "V" { "v" } else { "um" };
    let mut predicted = Vec::with_capacity(dataset.records.len());
    let mut rows = Vec::new();
    let [mut time, mut input, mut measured, mut modelled, mut residual] = [const { Vec::new() }; 5];
    for (number, record) in (0u32..).zip(&dataset.records) {
        let output = modelled_output(model, record);
        let of_record = model.direction.output(record);
        let start = residual.len();
        rows.extend(std::iter::repeat_n(number, record.len()));
        time.extend((0..record.len()).map(|k| record.start_s + k as f64 * record.period_s));
        input.extend_from_slice(model.direction.input(record));
        measured.extend_from_slice(of_record);
        residual.extend(of_record.iter().zip(&output).map(|(measured, model)| measured - model));
        modelled.extend(output);
        let squares: f64 = residual[start..].iter().map(|off: &f64| off * off).sum();
        predicted.push(Predicted {
            record: record.file.clone(),
            samples: record.len(),
            sample_rate_hz: record.rate_hz(),
            residual_rms: (squares / record.len().max(1) as f64).sqrt(),
            unit,
        });
        progress::advance(&bar, f64::from(number + 1) / dataset.records.len() as f64);
    }
    bar.finish_and_clear();
    let input_name = match model.direction.input_unit() {
        "V" => "voltage_v",
        _ => "position_um",
    };
    let numbers = |name: String, values| Column {
        name,
        values: Values::Numbers(values),
    };
    let list = dataset.records.iter().map(|record| record.file.clone()).collect();
    let columns = vec![
        Column {
            name: "record".to_owned(),
            values: Values::Words { list, rows },
        },
        numbers("time_s".to_owned(), time),
        numbers(input_name.to_owned(), input),
        numbers(format!("measured_{}", suffix(unit)), measured),
        numbers(format!("model_{}", suffix(unit)), modelled),
        numbers(format!("residual_{}", suffix(unit)), residual),
    ];
    (columns, predicted)
}

/// The model's output over a record.
fn modelled_output(model: &Model, record: &Record) -> Vec<f64> {
    model.simulate(record).output
}
