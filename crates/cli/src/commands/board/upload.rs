//! `hysteron board upload`.

use crate::error::CliError;
use crate::exit::Done;
use crate::{output, progress};
use clap::Args;
use hysteron_board::BoardError;
use hysteron_board::slots::{Verdict, packed, upload};
use hysteron_board::telemetry::hex;
use hysteron_table::{Table, hash};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "Example, with OpenOCD at the board's ST-LINK:\n  \
    hysteron export controller.toml --dac 0,200 --adc=-25,25 -o table.toml\n  \
    hysteron board upload table.toml --to localhost:9090 --restart\n  \
    hysteron board record --from localhost:9090 --run --hz 50 --seconds 2 -o recorded\n\n\
    The table must be of the same family, number of plays, kind of law, rate, limits and converters as the one that the board's image \
    was built with. The board checks all of the table before it writes, and writes the slot that is not in use: whatever fails, it keeps \
    the table that it has.")]
pub(crate) struct UploadArgs {
    /// The table, as `export` writes it
    #[arg(value_name = "CONTROLLER_TABLE")]
    pub table: PathBuf,
    /// The board, at its safe level: HOST:PORT of its own on a cable, or of a server of its RTT channel 1
    #[arg(long, value_name = "HOST:PORT")]
    pub to: String,
    /// Start the board anew once it has the table, which is in force from its next start on
    #[arg(long)]
    pub restart: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// The answer for machines.
#[derive(Serialize)]
struct Answer {
    table_sha256: String,
    bytes: usize,
    /// What the board's last start found in each slot.
    slots: [String; 2],
    taken: bool,
    slot: Option<u8>,
    sequence: Option<u32>,
    refused: Option<Refused>,
    runs: Option<bool>,
}

#[derive(Serialize)]
struct Refused {
    field: String,
    value: String,
    reason: String,
}

pub(crate) fn run(args: &UploadArgs) -> Result<Done, CliError> {
    let path = &args.table;
    let text = std::fs::read_to_string(path).map_err(|source| CliError::Read {
        path: path.clone(),
        source,
    })?;
    let refused = |source| CliError::Table {
        path: path.clone(),
        source,
    };
    let table = Table::parse(&text).map_err(refused)?;
    let bytes = packed(&table, &text).map_err(refused)?;
    let bar = progress::bar("sending");
    let verdict = upload(&args.to, &bytes, args.restart, &mut |share| {
        progress::advance(&bar, share)
    });
    bar.finish_and_clear();
    let verdict = verdict?;
    let refused = verdict.taken.as_ref().err().cloned();
    let answer = answer(hex(&hash(&text)), bytes.len(), verdict);
    if args.json {
        output::print_json(&answer)?;
    } else if refused.is_none() {
        output::print(&words(&answer))?;
    }
    match refused {
        None => Ok(Done::Answered),
        Some(refused) => Err(BoardError::TableRefused {
            to: args.to.clone(),
            refused,
        }
        .into()),
    }
}

fn answer(table_sha256: String, bytes: usize, verdict: Verdict) -> Answer {
    let (taken, refused) = match verdict.taken {
        Ok(taken) => (Some(taken), None),
        Err(refused) => (None, Some(refused)),
    };
    Answer {
        table_sha256,
        bytes,
        slots: verdict.slots,
        taken: taken.is_some(),
        slot: taken.map(|(slot, _)| slot),
        sequence: taken.map(|(_, sequence)| sequence),
        refused: refused.map(|refused| Refused {
            field: refused.field,
            value: refused.value,
            reason: refused.reason,
        }),
        runs: verdict.runs,
    }
}

fn words(answer: &Answer) -> String {
    let mut text = format!(
        "taken: {} bytes in slot {}, as table {}\n",
        answer.bytes,
        answer.slot.unwrap_or_default(),
        answer.sequence.unwrap_or_default()
    );
    text += match answer.runs {
        None => "in force from the board's next start on; --restart starts it\n",
        Some(true) => "started anew: the board runs with it\n",
        Some(false) => "the board did not say within 10 s of its new start that it runs with it; look at its log\n",
    };
    text += &format!("table {}\nbefore:\n", answer.table_sha256);
    for line in &answer.slots {
        text += &format!("  {line}\n");
    }
    text
}
