//! Records and runs of a rehearsal on the firmware in the emulator.

use super::programme::{Piece, programme};
use super::rows::{Hold, Kept};
use crate::commands::control::chip::{Chip, Follow, RATE_HZ, RISE_TICKS, Reached, Running, straight_line};
use crate::error::CliError;
use crate::progress;
use hysteron_board::host::parameters;
use hysteron_board::{FALL_TICKS, Player, Request, Shape};
use hysteron_data::{Dataset, Known};
use hysteron_plant::Stage;
use hysteron_tracking::design::Controller;
use hysteron_tracking::rehearsal::Rehearsal;

/// The records: the board plays them with a straight line for a law; commands are what its frames say.
pub(super) fn records(chip: &Chip, rehearsal: &Rehearsal) -> Result<Dataset, CliError> {
    let stage = &rehearsal.stage;
    let mut running = chip.start("plain", straight_line(stage), stage)?;
    let pieces = programme(rehearsal.seed)?;
    let bar = progress::bar("recording on the board");
    let mut played = Vec::new();
    for (number, piece) in pieces.iter().enumerate() {
        bar.set_message(format!("recording {}", piece.name));
        let rested = Stage::new(stage, rehearsal.noise_seed(number as u64))?;
        let beside_hz = Rehearsal::cycles_beside(number) / piece.kept_s;
        let player = play(&mut running, piece, rested, beside_hz)?;
        played.push(Kept::of(piece, &player));
        progress::advance(&bar, (number + 1) as f64 / pieces.len() as f64);
    }
    bar.finish_and_clear();
    let multisine = played.iter().zip(&pieces).find(|(_, piece)| piece.name == "multisine");
    let hold = multisine.map_or(Hold::Smoothed, |(kept, _)| Hold::of(kept));
    Ok(Dataset {
        name: format!("rehearsal-{}-board", rehearsal.seed),
        description: format!(
            "{} in QEMU at a simulated stage with something hidden, seed {}; voltages as a straight-line hold would have them",
            chip.name(),
            rehearsal.seed
        ),
        known: Known {
            voltage_min_v: Some(stage.amplifier.min_v),
            voltage_max_v: Some(stage.amplifier.max_v),
            ..Known::default()
        },
        records: pieces
            .iter()
            .zip(&played)
            .map(|(piece, kept)| kept.record(piece, hold, stage.cross_coupling.is_some()))
            .collect(),
        ..Dataset::default()
    })
}

/// Along the references of the rehearsal, the loop closed where the controller has feedback.
pub(super) fn errors(
    chip: &Chip,
    rehearsal: &Rehearsal,
    controller: &Controller,
    name: &str,
) -> Result<Reached, CliError> {
    let mut running = chip.start_law(name, controller, &rehearsal.stage)?;
    let range_um = rehearsal.range_um();
    let [low_um, high_um] = range_um;
    let stroke_um = high_um - low_um;
    let settling_s = rehearsal.settling_s();
    let sine = |name, hz: f64| Follow {
        name,
        shape: Shape::Sine,
        frequency_hz: hz,
        range_um,
        stroke_um,
        settling_s: (settling_s * hz).ceil().max(2.0) / hz,
        judged_s: (0.1 * hz).ceil().max(2.0) / hz,
    };
    // Points that were never uploaded are all the lowest.
    let hold = Follow {
        name: "hold",
        shape: Shape::Table,
        frequency_hz: 1.0,
        range_um: [high_um, f64::from(running.hello().input_max_um)],
        stroke_um,
        settling_s,
        judged_s: 4.0 - settling_s,
    };
    let references = [sine("10", 10.0), sine("100", 100.0), sine("500", 500.0), hold];
    let seed = |number: usize| !rehearsal.noise_seed(number as u64);
    running.follow(&rehearsal.stage, &references, controller.feedback.is_some(), seed)
}

/// Plays a record's reference with the straight line, the other axis beside it at `beside_hz`.
fn play(running: &mut Running, piece: &Piece, stage: Stage, beside_hz: f64) -> Result<Player, CliError> {
    let ticks = (piece.kept_s * RATE_HZ).ceil() as u32;
    let [low, high] = piece.range;
    let moves = low < high;
    let top_um = f64::from(running.hello().input_max_um);
    let request = Request {
        shape: piece.shape,
        frequency_hz: piece.frequency_hz,
        range_um: Some([low, if moves { high } else { 1.0 }].map(|share| share * top_um)),
        seconds: 1.0,
        feedforward: true,
        feedback: false,
    };
    let ticks = ticks + RISE_TICKS;
    let player = Player::new(stage, piece.points.as_ref(), if moves { ticks } else { 0 });
    let mut player = player.beside(running.other_stage()?);
    let setup = running.setup(&request, player.ticks_before() + ticks + FALL_TICKS)?;
    let law = parameters(&running.table);
    running.run_ahead(&setup, law, &mut player, beside_hz)?;
    Ok(player)
}
