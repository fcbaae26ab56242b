//! A table sent to the application in pieces, the power cut while it is written, and the start after it: codes of the host's law.
#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_board::{host, slots};
use hysteron_firmware::controller::Controller;
use hysteron_firmware::law::Law;
use hysteron_firmware::parameters::Parameters;
use hysteron_firmware::small_stage::SmallStage;
use hysteron_firmware::stored::{Next, Pause, Stored, TABLE_BYTES};
use hysteron_firmware::table;
use hysteron_firmware::telemetry::{Found, find};
use hysteron_firmware::trajectory::Shape;
use hysteron_firmware::upload::{ANSWER_BYTES, Answer, Message, Messages, PIECE_BYTES, Said};
use hysteron_firmware::wire::{Hello, Setup};
use hysteron_slot::model::{Flash, Tear};
use hysteron_slot::{Refusal, Rule, Slots, sum};
use hysteron_table::{Table, hash};

const COMPILED: &str = include_str!("../../../firmware/tables/paper-rate-mrpi.toml");
const OTHER: &str = include_str!("../../../firmware/tables/paper-delay-mrpi.toml");
const TICKS: u32 = 5000;

type Chip = Flash<8, 2048, 8192>;

fn stored(chip: Chip) -> Stored<Chip> {
    Stored::new(Slots::new(chip, [0, 4096], 4096))
}

/// What an upload asks of a board, and what it was asked.
#[derive(Default)]
struct Board {
    runs: bool,
    said: Vec<&'static str>,
}

impl Pause for Board {
    fn at_rest(&self) -> bool {
        !self.runs
    }

    fn stop(&mut self) {
        self.said.push("stop");
    }

    fn go_on(&mut self) {
        self.said.push("go on");
    }
}

fn start(stored: &mut Stored<Chip>) -> Option<(Parameters<table::Law>, Hello)> {
    let mut parameters = table::parameters().unwrap();
    let hello = stored.choose(&mut parameters, None, &mut |_| {})?;
    Some((parameters, hello))
}

fn say(stored: &mut Stored<Chip>, board: &mut Board, message: Message) -> Answer<'static> {
    // Through the bytes of a connection, with something of no meaning before.
    let mut messages = Messages::default();
    let mut bytes = vec![0xa5, b'U', 7];
    bytes.extend(message.to_packet());
    let mut heard = bytes.into_iter().filter_map(|byte| messages.push(byte));
    let heard = heard.next().unwrap();
    assert_eq!(heard, message);
    match stored.take(heard, board) {
        Next::Say(answer) | Next::Restart(answer) => answer,
        Next::SaySlots => panic!("nobody asked"),
    }
}

fn send(stored: &mut Stored<Chip>, board: &mut Board, bytes: &[u8]) -> Answer<'static> {
    let (length, sum) = (bytes.len() as u32, sum(bytes));
    let begun = say(stored, board, Message::Begin { length, sum });
    if begun.refused.is_some() {
        return begun;
    }
    for (place, piece) in (0..).step_by(PIECE_BYTES).zip(bytes.chunks(PIECE_BYTES)) {
        let mut bytes = [0; PIECE_BYTES];
        bytes[..piece.len()].copy_from_slice(piece);
        // Each comes twice; the second changes nothing.
        for _ in 0..2 {
            let said = say(stored, board, Message::Piece { place, bytes });
            assert_eq!((said.to, said.number), (Said::Due, place + piece.len() as u32));
        }
    }
    say(stored, board, Message::Commit)
}

fn packed(text: &str) -> Vec<u8> {
    slots::packed(&Table::parse(text).unwrap(), text).unwrap()
}

/// Codes of a run at the small stage.
fn codes<L: Law>(parameters: Parameters<L>) -> Vec<u16> {
    let [low_um, high_um] = parameters.range_um;
    let setup = Setup {
        ticks: TICKS,
        shape: Shape::Sine,
        phase_step: 1 << 24,
        low_um: low_um + 0.1 * (high_um - low_um),
        high_um: high_um - 0.1 * (high_um - low_um),
        feedforward: true,
        feedback: true,
        clocked: true,
    };
    let mut stage = SmallStage::new(&parameters, 3);
    let mut controller = Controller::new(parameters, &setup);
    let ticks = 0..TICKS;
    ticks
        .map(|number| {
            let frame = controller.step(stage.input(number, TICKS), false);
            stage.output(frame.dac);
            frame.dac
        })
        .collect()
}

fn of_host(text: &str) -> Vec<u16> {
    codes(host::parameters(&Table::parse(text).unwrap()).unwrap())
}

/// Uploaded, started anew: the codes are those of the host's law with that table, and the board names its file.
#[test]
fn val_the_next_start_runs_the_uploaded_table() {
    let (mut stored, mut board) = (stored(Chip::default()), Board::default());
    assert!(start(&mut stored).is_none(), "both slots are erased");
    assert_eq!(codes(table::parameters().unwrap()), of_host(COMPILED));
    let said = send(&mut stored, &mut board, &packed(OTHER));
    assert_eq!((said.to, said.number, said.refused), (Said::Taken(0), 0, None));
    assert_eq!(board.said, ["stop", "go on"]);
    // A host that has not heard it asks again, and nothing is written again.
    assert_eq!(say(&mut stored, &mut board, Message::Commit), said);
    assert_eq!(board.said.len(), 2);
    let (parameters, hello) = start(&mut stored).unwrap();
    assert_eq!(hello.hash, hash(OTHER));
    let ran = codes(parameters);
    assert_eq!(ran, of_host(OTHER));
    assert_ne!(ran, of_host(COMPILED));
    // A second goes to the other slot, and the first stays.
    let changed = OTHER.replacen("integral_v_per_um_s", "# of a test\nintegral_v_per_um_s", 1);
    let said = send(&mut stored, &mut board, &packed(&changed));
    assert_eq!((said.to, said.number), (Said::Taken(1), 1));
    assert_eq!(start(&mut stored).unwrap().1.hash, hash(&changed));
    let lines = stored.answers().map(|answer| answer.to_string());
    assert_eq!(
        lines,
        [
            "slot 0: sequence = 0: the other slot has 1, which is newer",
            "slot 1: table 1 runs"
        ]
    );
}

/// Flash is left alone while the loop runs, and by whatever fails a check; the field, its value and what is allowed come back.
#[test]
fn refuse_uploads_that_would_harm() {
    let (mut stored, mut board) = (stored(Chip::default()), Board::default());
    let mut refused = |board: &mut Board, bytes: &[u8]| send(&mut stored, board, bytes).refused.unwrap().to_string();
    board.runs = true;
    assert_eq!(
        refused(&mut board, &packed(OTHER)),
        "mode = 1: the loop runs; stop it, and upload at the safe level"
    );
    board.runs = false;
    let other_dac = OTHER.replacen("dac_top_v = ", "dac_top_v = 9", 1);
    let said = refused(&mut board, &packed(&other_dac));
    assert!(
        said.starts_with("dac_top_v = 9") && said.contains(": must be "),
        "{said}"
    );
    let mut torn = packed(OTHER);
    torn[200] ^= 1;
    assert!(refused(&mut board, &torn).starts_with("crc32 = 0x"));
    assert_eq!(
        refused(&mut board, &[0; TABLE_BYTES + 1]),
        format!(
            "length = {}: must be {TABLE_BYTES} bytes by the table's own parts, and fit a slot of {TABLE_BYTES} bytes",
            TABLE_BYTES + 1
        )
    );
    assert!(board.said.is_empty(), "no sample clock was stopped: {:?}", board.said);
    assert!(start(&mut stored).is_none());
}

/// The power fails in each operation of the upload of a second table, as the application writes it.
#[test]
fn val_power_cut_during_an_upload() {
    let mut cuts = 0;
    loop {
        // The first upload is of two pages and the table's words.
        let mut chip = Chip::default();
        let words = packed(COMPILED).len().next_multiple_of(8) as u32 / 8;
        chip.cut(2 + words + cuts, Tear::Mixed(cuts));
        let mut stored = stored(chip);
        send(&mut stored, &mut Board::default(), &packed(COMPILED));
        assert_eq!(start(&mut stored).unwrap().1.hash, hash(COMPILED));
        let said = send(&mut stored, &mut Board::default(), &packed(OTHER));
        if said.refused.is_none() {
            break;
        }
        assert_eq!(said.refused.unwrap().rule, Rule::Flash);
        stored.flash().power_on();
        let found = start(&mut stored).unwrap().1.hash;
        assert!(found == hash(COMPILED) || found == hash(OTHER), "cut {cuts}");
        cuts += 1;
    }
    assert_eq!(cuts, 2 + packed(OTHER).len().next_multiple_of(8) as u32 / 8);
}

/// Answers come back as they were sent, whatever a board says.
#[test]
fn val_answers_come_back() {
    let refused = Refusal::new(Rule::BeyondInverse, "input_max_um", 15.5)
        .against("something")
        .at(7)
        .allowed([1.0, f64::INFINITY, -0.25]);
    for to in [Said::Due, Said::Taken(1), Said::Slot(1), Said::Restarting] {
        for refused in [None, Some(refused)] {
            let answer = Answer {
                to,
                number: 0xfedc_ba98,
                refused,
            };
            let packet = answer.to_packet();
            assert_eq!(find(&packet), Found::Answer);
            assert_eq!(Answer::from_packet(&packet), Some(answer));
            assert_eq!(find(&packet[..ANSWER_BYTES - 1]), Found::Incomplete);
            let mut torn = packet;
            torn[20] ^= 4;
            assert_eq!(find(&torn), Found::Nothing);
        }
    }
    for (number, rule) in (0..).zip(Rule::ALL) {
        assert_eq!(rule as u8, number);
    }
}
