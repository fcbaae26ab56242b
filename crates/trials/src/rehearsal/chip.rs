//! Records and runs of a rehearsal on the firmware in the emulator.

use super::rows::{Hold, Kept};
use crate::chip::{Chip, Follow, RATE_HZ, RISE_TICKS, Reached, Running, straight_line};
use crate::error::TrialError;
use crate::programme::{Piece, programme, training_programme};
use hysteron_board::host::{complete, parameters};
use hysteron_board::{Law, Parameters, Player, Request, Shape};
use hysteron_control::design::Controller;
use hysteron_data::{Dataset, Known, Record};
use hysteron_plant::Stage;
use hysteron_table::TableError;
use hysteron_tracking::rehearsal::{BESIDE_HZ, Rehearsal};

/// The records: the board plays them with a straight line for a law; commands are what its frames say.
pub(super) fn records(chip: &Chip, rehearsal: &Rehearsal, progress: &dyn Fn(&str, f64)) -> Result<Dataset, TrialError> {
    let stage = &rehearsal.stage;
    let mut running = chip.start("plain", straight_line(stage), stage)?;
    let pieces = programme(rehearsal.seed)?;
    let mut played = Vec::new();
    for (number, piece) in pieces.iter().enumerate() {
        progress(piece.name, number as f64 / pieces.len() as f64);
        let rested = Stage::new(stage, rehearsal.noise_seed(number as u64))?;
        let beside_hz = Rehearsal::cycles_beside(number) / piece.kept_s;
        let top_um = f64::from(running.hello().input_max_um);
        let law = parameters(&running.table);
        let player = play(&mut running, law, (piece, top_um), rested, beside_hz)?;
        played.push(Kept::of(piece, &player));
    }
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
) -> Result<Reached, TrialError> {
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

/// Records of a controller, open loop, along slow references: what the host's rehearsal runs along, with references of 256 points.
pub(super) fn training(chip: &Chip, rehearsal: &Rehearsal, controller: &Controller) -> Result<Vec<Record>, TrialError> {
    let stage = &rehearsal.stage;
    let mut running = chip.start_law("training", controller, stage)?;
    let both = stage.cross_coupling.is_some();
    let mut records = Vec::new();
    for (number, piece) in training_programme(rehearsal.seed).iter().enumerate() {
        let rested = Stage::new(stage, rehearsal.noise_seed(300 + number as u64))?;
        let law = complete(&running.table);
        let player = play(
            &mut running,
            law,
            (piece, stage.hysteresis.stroke_um),
            rested,
            BESIDE_HZ,
        )?;
        records.push(Kept::of(piece, &player).record(piece, Hold::Followed, both));
    }
    Ok(records)
}

/// Plays the reference of a piece, its range in shares of `top_um`, the other axis beside it at `beside_hz`.
fn play<L: Law>(
    running: &mut Running,
    law: Result<Parameters<L>, TableError>,
    (piece, top_um): (&Piece, f64),
    stage: Stage,
    beside_hz: f64,
) -> Result<Player, TrialError> {
    let ticks = (piece.kept_s * RATE_HZ).ceil() as u32;
    let [low, high] = piece.range;
    let moves = piece.moves();
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
    running.play(&request, law, (player, ticks), beside_hz)
}
