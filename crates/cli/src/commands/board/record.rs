//! `hysteron board record`.

use crate::commands::board::wanted::Wanted;
use crate::commands::board::{Axis, fault_line, known_delay_line, write};
use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_board::capture::Start;
use hysteron_report::adapted_line;
use hysteron_trials::recording::{Counted, Recorded, name, record, tables};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example, with OpenOCD at the board's ST-LINK:\n  \
    openocd -f board/st_nucleo_h743zi.cfg -c init -c 'rtt setup 0x20000000 0x20000 \"SEGGER RTT\"' \
    -c 'rtt start' -c 'rtt server start 9090 1'\n  \
    hysteron board record --from localhost:9090 --seconds 2 -o recorded\n  \
    hysteron board record --from udp://192.168.7.2:9090 --run --seconds 60 -o minute\n  \
    hysteron board record --from localhost:9090 --run --bank 1 --shape triangle --hz 50 --seconds 2 -o triangle\n  \
    hysteron compare recorded model.toml")]
pub(crate) struct RecordArgs {
    /// Where the board's telemetry comes from: udp://HOST:PORT of a board on a cable, HOST:PORT of the same by TCP alone or of a server of its RTT channel 1, or a device or captured file
    #[arg(long, value_name = "HOST:PORT|udp://HOST:PORT|PATH")]
    pub from: String,
    /// Length of the recording, seconds of the board's time
    #[arg(long, default_value_t = 10.0, allow_negative_numbers = true)]
    pub seconds: f64,
    /// Start the loop before, and stop it after; without it the board's button does
    #[arg(long)]
    pub run: bool,
    #[command(flatten)]
    pub wanted: Wanted,
    /// Which axis of a board with both; the other's command goes into the records as well. It stands still while a reference is played
    #[arg(long, default_value = "x")]
    pub axis: Axis,
    /// Folder of the new dataset
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
    /// Replace a dataset that is there already
    #[arg(long)]
    pub overwrite: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn run(args: &RecordArgs) -> Result<Done, CliError> {
    output::refuse_to_replace(&args.output, args.overwrite)?;
    let wish = match args.wanted.is_nothing() {
        true => None,
        false if args.run => Some(args.wanted.wish(args.seconds)?),
        false => {
            return Err(CliError::Option(
                "a reference, a bank or a part is asked for before the loop starts: give --run as well".to_owned(),
            ));
        }
    };
    let bar = progress::bar("recording");
    let axis = usize::from(args.axis == Axis::Y);
    let mut wishes = [None; 2];
    wishes[axis] = wish;
    let start = match &wish {
        Some(_) => Start::Playing(&wishes[..=axis]),
        None if args.run => Start::Host,
        None => Start::Nobody,
    };
    let recorded = record(&args.from, args.seconds, start, axis, &|share| {
        progress::advance(&bar, share)
    });
    bar.finish_and_clear();
    let Recorded {
        counted: answer,
        fault,
        dataset,
    } = recorded?;
    write(&dataset, &args.output, args.overwrite)?;
    if args.json {
        output::print_json(&answer)?;
    } else {
        output::print(&text(args, &answer, &fault_line(fault)))?;
    }
    Ok(Done::Answered)
}

fn text(args: &RecordArgs, answer: &Counted, fault: &str) -> String {
    let total = answer.samples + answer.lost;
    let mut text = format!(
        "{}: {} samples in {:.3} s, {} lost ({:.3} %), {} without a gap\n",
        name(&answer.board),
        answer.samples,
        answer.seconds,
        answer.lost,
        100.0 * answer.lost as f64 / total.max(1) as f64,
        match answer.pieces {
            1 => "1 record".to_owned(),
            pieces => format!("{pieces} records"),
        }
    );
    for (count, what) in [
        (answer.alone, "samples between two gaps left out"),
        (answer.unheard, "samples from before anybody listened left out"),
        (answer.foreign_bytes, "bytes that belong to no packet"),
        (answer.restarts, "restarts of the board"),
    ] {
        if count > 0 {
            text += &format!("{count} {what}\n");
        }
    }
    if answer.seconds < args.seconds {
        text += &format!("the stream ended before {} s\n", args.seconds);
    }
    text += fault;
    text += &answer
        .adapted
        .map_or_else(String::new, |learned| adapted_line(&learned) + "\n");
    text += &known_delay_line(answer.known_delay_s);
    text + &format!("{}\nwritten to {}\n", tables(answer), args.output.display())
}
