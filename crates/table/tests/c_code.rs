//! The C of a table, compiled by `cc`, beside the core's law in `f32`: every command of 10^6 ticks, bit by bit.

#![expect(clippy::unwrap_used, reason = "a test that cannot run fails")]

use hysteron_core::bank::PlayBank;
use hysteron_core::codes::{AdcCode, Converter};
use hysteron_core::control_law::ControlLaw;
use hysteron_core::corner_mrpi::CornerMrpi;
use hysteron_core::envelope::Envelope;
use hysteron_core::limiter::Limiter;
use hysteron_core::model::AtRest;
use hysteron_core::mpi::MpiCoefficients;
use hysteron_core::pi_controller::PiController;
use hysteron_core::surroundings::LoopInput;
use hysteron_core::thresholds::Thresholds;
use hysteron_table::{Adaptation, Family, Hum, Table};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

const TICKS: usize = 1_000_000;
/// From here on there is no feedback, up to three quarters.
const OPEN_FROM: usize = TICKS / 2;
const CLOSED_FROM: usize = TICKS / 4 * 3;

/// Reference, reading, the other axis' volts and motion, degrees.
type Inputs = [f32; 5];

/// What a law gives in a tick: the command's bits, those of the reference that is due, whether it was limited.
type Outputs = [u32; 3];

/// Sines, triangles, random walks and steps within and beyond the range; now and then a number that is none.
fn inputs(table: &Table) -> Vec<Inputs> {
    let (low, high) = (table.input_min_um, table.input_max_um);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut next = move || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut walk, mut level, mut lag) = (0.0, 0.0, middle);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e30, -1e30, 3e38, -0.0, 0.0];
    (0..TICKS)
        .map(|k| {
            let t = k as f64 / table.sample_rate_hz;
            walk = (walk + 0.02 * (next() - 0.5)).clamp(-1.0, 1.0);
            if k % 3_000 == 0 {
                level = 2.4 * next() - 1.2;
            }
            let frequency_hz = [3.0, 47.0, 500.0, 1_930.0][k / 50_000 % 4];
            let sine = (std::f64::consts::TAU * frequency_hz * t).sin();
            let shape = match k / 25_000 % 5 {
                0 => 0.9 * sine,
                1 => 0.4 * sine + 0.5 * walk,
                2 => level,
                3 => 1.9 * (2.0 * (t * 40.0).fract() - 1.0).abs() - 0.95,
                _ => 0.7 * sine + 0.3 * (std::f64::consts::TAU * 1.7 * frequency_hz * t).sin(),
            };
            let reference = middle + half * shape;
            lag += 0.05 * (reference - lag);
            let mut now = [
                reference,
                lag + 0.002 * (next() - 0.5),
                60.0 + 50.0 * sine,
                3.0 * walk,
                22.0 + 5.0 * walk,
            ];
            if k % 997 == 996 {
                let place = (next() * 5.0) as usize % 5;
                now[place] = bad[(next() * 8.0) as usize % 8];
            }
            now.map(|x| x as f32)
        })
        .collect()
}

/// Compiles a law with a loop around it, runs it, and returns what it gave, with the codes of every 10th command.
fn run_c(folder: &Path, table: &Table, text: &str, inputs: &[Inputs]) -> Vec<Outputs> {
    let code = table.c_code(text, "law").unwrap();
    let mut fields = String::new();
    for (place, field) in [
        "reference_um",
        "measured_um",
        "voltage2_v",
        "motion2_um",
        "temperature_c",
    ]
    .iter()
    .enumerate()
    {
        if code.header.contains(&format!("float {field};")) {
            writeln!(fields, "now.{field} = in[{place}];").unwrap();
        }
    }
    let main = format!(
        "#include \"law.h\"\n#include <stdio.h>\n\
         int main(int n, char **names) {{\n\
         FILE *from = fopen(names[1], \"rb\"), *to = fopen(names[n - 1], \"wb\");\n\
         static law_state state; law_input now; float in[5], out[2]; int k = 0, limited;\n\
         if (!from || !to) {{ return 1; }}\n\
         while (fread(in, sizeof in, 1, from) == 1) {{\n{fields}\
         if (k == 0) {{ law_reset(&state, &now); }}\n\
         if (k == {OPEN_FROM}) {{ law_set_feedback(&state, 0.0f); }}\n\
         if (k == {CLOSED_FROM}) {{ law_set_feedback(&state, 1.0f); }}\n\
         out[0] = law_step(&state, &now); out[1] = law_due_um(&state); limited = law_limited(&state);\n\
         fwrite(out, sizeof out, 1, to); fwrite(&limited, sizeof limited, 1, to); k++;\n}}\n\
         return fclose(to);\n}}\n"
    );
    std::fs::write(folder.join("law.h"), &code.header).unwrap();
    std::fs::write(folder.join("law.c"), &code.source).unwrap();
    std::fs::write(folder.join("main.c"), main).unwrap();
    std::fs::write(folder.join("in"), bytes(inputs)).unwrap();
    compile(folder, &["law.c", "main.c"]);
    let status = Command::new(folder.join("run"))
        .args(["in", "out"])
        .current_dir(folder)
        .status();
    assert!(status.unwrap().success());
    let out = std::fs::read(folder.join("out")).unwrap();
    out.chunks_exact(12)
        .map(|chunk| core::array::from_fn(|i| u32::from_le_bytes(chunk[4 * i..4 * i + 4].try_into().unwrap())))
        .collect()
}

fn bytes(inputs: &[Inputs]) -> Vec<u8> {
    inputs.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
}

fn compile(folder: &Path, files: &[&str]) {
    let output = Command::new("cc")
        .args([
            "-std=c99",
            "-pedantic",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-O2",
            "-ffp-contract=off",
        ])
        .args(["-fsanitize=undefined", "-fno-sanitize-recover=undefined", "-o", "run"])
        .args(files)
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn outputs(command: f32, due: f32, limited: bool) -> Outputs {
    [command.to_bits(), due.to_bits(), u32::from(limited)]
}

/// The complete law as the core runs it.
fn complete(table: &Table, inputs: &[Inputs]) -> Vec<Outputs> {
    let mut law = table.law_numbers().unwrap().unwrap().law::<f32>().unwrap();
    let feedback = law.tracking.feedback;
    let mut state = law.rest(inputs[0][4]);
    let ticks = inputs.iter().enumerate();
    ticks
        .map(|(k, now)| {
            law.tracking.feedback = feedback.filter(|_| !(OPEN_FROM..CLOSED_FROM).contains(&k));
            let input = LoopInput {
                reference_ahead: now[0],
                measured: now[1],
                voltage2_ahead: now[2],
                motion2_ahead: now[3],
                temperature_c: now[4],
            };
            let command = law.step(&mut state, input);
            outputs(command, state.due(), state.limited())
        })
        .collect()
}

/// The paper's law as the core runs it, around an inverse.
fn paper<I: AtRest<f32>>(table: &Table, inverse: I, inputs: &[Inputs]) -> Vec<Outputs> {
    let rate_hz = table.sample_rate_hz as f32;
    let gains = PiController::new(
        table.proportional_v_per_um as f32,
        table.integral_v_per_um_s as f32,
        rate_hz,
    )
    .unwrap();
    let (min, max) = (table.output_min_v as f32, table.output_max_v as f32);
    let mut law = ControlLaw {
        feedforward: inverse,
        feedback: gains,
        limiter: Limiter::new(min, max, table.slew_v_per_s as f32, rate_hz).unwrap(),
    };
    let plays = law.feedforward.at_rest(inputs[0][1], inputs[0][0]);
    let mut state = law.start(plays, table.safe_v as f32);
    let ticks = inputs.iter().enumerate();
    ticks
        .map(|(k, now)| {
            let open = (OPEN_FROM..CLOSED_FROM).contains(&k);
            law.feedback = gains.weighted(if open { 0.0 } else { 1.0 });
            let command = law.step(&mut state, now[0], now[1]);
            outputs(command, now[0], state.limiter.limited())
        })
        .collect()
}

#[track_caller]
fn same(name: &str, table: &Table, text: &str, rust: impl Fn(&[Inputs]) -> Vec<Outputs>) {
    let folder = tempfile::tempdir().unwrap();
    let inputs = inputs(table);
    let (in_c, in_rust) = (run_c(folder.path(), table, text, &inputs), rust(&inputs));
    assert_eq!((in_c.len(), in_rust.len()), (TICKS, TICKS));
    if let Some(k) = (0..TICKS).find(|&k| in_c[k] != in_rust[k]) {
        panic!(
            "{name}: tick {k}, {:?}: C {:x?}, Rust {:x?}",
            inputs[k], in_c[k], in_rust[k]
        );
    }
    // Both ways through the limiter are taken, by 100 ticks at least and by a tenth of them.
    let limited = in_rust.iter().filter(|out| out[2] == 1).count();
    assert!(
        limited > 100 && TICKS - limited > TICKS / 10,
        "{name}: {limited} limited"
    );
}

fn tables() -> Vec<(String, String)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/tables");
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    names.sort();
    assert!(names.len() >= 14, "{names:?}");
    let file = |path: std::path::PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path.file_stem().unwrap().to_str().unwrap().to_owned(), text)
    };
    names.into_iter().map(file).collect()
}

#[test]
fn val_the_paper_law_of_every_preset_is_the_same_in_c() {
    let of_paper = tables().into_iter().filter(|(name, _)| name.starts_with("paper"));
    for (name, text) in of_paper {
        let mut table = Table::parse(&text).unwrap();
        // Both gains act.
        table.proportional_v_per_um = 0.3;
        let inverse = table.inverse::<10>(false).unwrap().1;
        same(&name, &table, &text, |inputs| paper(&table, inverse, inputs));
    }
}

#[test]
fn val_the_complete_law_of_every_preset_is_the_same_in_c() {
    for (name, text) in tables().into_iter().filter(|(name, _)| name.starts_with("tracking")) {
        let table = Table::parse(&text).unwrap();
        same(&name, &table, &text, |inputs| complete(&table, inputs));
    }
}

/// Everything that a complete law can have; and as little as it can have.
#[test]
fn val_every_part_of_a_complete_law_is_the_same_in_c() {
    let text = include_str!("../../../firmware/tables/tracking-739.toml");
    let mut table = Table::parse(text).unwrap();
    let part = table.controller.as_mut().unwrap();
    part.coupling = Some([0.002, 1e-6, 0.001, 8.0]);
    part.cross_um_per_um = Some(-0.006);
    part.sensor = Some([8.0, 0.004, -0.0005]);
    part.sensor_lag_s = 4e-5;
    part.heat = Some([21.0, 0.7, 0.03, 0.002]);
    part.hum = Some(Hum {
        frequency_hz: 49.97,
        learning_s: 0.2,
        largest_um: 0.05,
        sensitivity: [[0.1, 0.2], [0.3, 0.4], [0.0, 0.0], [0.5, 0.6], [0.7, 0.6]],
    });
    part.adaptation = Some(Adaptation {
        gain_bound: 0.05,
        zero_bound_um: 0.1,
        lag_bound_s: 5e-6,
        lag_from_hz: 20.0,
        lag_up_to_um_per_s: 20e3,
        time_s: 0.5,
        dead_um: 0.002,
        um_per_v: 0.1,
    });
    same("all parts", &table, text, |inputs| complete(&table, inputs));
    let part = table.controller.as_mut().unwrap();
    (part.coupling, part.cross_um_per_um, part.sensor, part.heat) = (None, None, None, None);
    part.adaptation = None;
    part.feedback.as_mut().unwrap().trust = None;
    same("no trust", &table, text, |inputs| complete(&table, inputs));
    let part = table.controller.as_mut().unwrap();
    (part.sensor_lag_s, part.hum, part.feedback, part.samples_ahead) = (0.0, None, None, 0);
    same("no part", &table, text, |inputs| complete(&table, inputs));
}

/// Many plays, which the paper's law remembers by corners, in an odd number; and a single one.
#[test]
fn val_other_numbers_of_plays_are_the_same_in_c() {
    const MANY: usize = 33;
    let text = include_str!("../../../firmware/tables/paper-rate-mrpi.toml");
    let mut table = Table::parse(text).unwrap();
    let width = table.input_max_um - table.input_min_um;
    table.thresholds_um = (0..MANY).map(|i| width * (i as f64 + 0.5) / 40.0).collect();
    table.weights_v_per_um = (0..MANY)
        .map(|i| 0.05 * ((i * 7 % 11) as f64 - 3.0) / 11.0 + 0.08)
        .collect();
    let single = |values: &[f64]| -> [f32; MANY] { core::array::from_fn(|i| values[i] as f32) };
    let bank = PlayBank::new(
        Thresholds::new(single(&table.thresholds_um)).unwrap(),
        table.input_min_um as f32,
        table.input_max_um as f32,
        table.sample_rate_hz as f32,
    );
    let coefficients = MpiCoefficients {
        offset: table.offset_v as f32,
        cubic: table.cubic_v_per_um3 as f32,
        linear: table.linear_v_per_um as f32,
        weights: single(&table.weights_v_per_um),
    };
    let envelope = Envelope {
        alpha_s: table.alpha_s as f32,
        beta_s: table.beta_s as f32,
    };
    let inverse = CornerMrpi::new(bank.unwrap(), coefficients, envelope).unwrap();
    same("33 plays", &table, text, |inputs| paper(&table, inverse, inputs));
    for family in [Family::Mrpi, Family::Mpi] {
        table.family = family;
        table.thresholds_um.truncate(1);
        table.weights_v_per_um.truncate(1);
        if family == Family::Mpi {
            (table.alpha_s, table.beta_s) = (0.0, 0.0);
        }
        let inverse = table.inverse::<1>(false).unwrap().1;
        same("1 play", &table, text, |inputs| paper(&table, inverse, inputs));
    }
}

/// Both converters, over every code and around each edge between two.
#[test]
fn val_codes_are_the_same_in_c() {
    let text = include_str!("../../../firmware/tables/tracking-8k.toml");
    let table = Table::parse(text).unwrap();
    let code = table.c_code(text, "law").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let volts = |table: &Table| -> Vec<f32> {
        let step = (table.dac_top_v - table.dac_min_v) / 65_535.0;
        let edges = (-5..262_160).map(|k| (table.dac_min_v + step * 0.25 * f64::from(k)) as f32);
        edges
            .chain([f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e38])
            .collect()
    };
    let main = "#include \"law.h\"\n#include <stdio.h>\n\
        int main(void) {\nFILE *from = fopen(\"in\", \"rb\"), *to = fopen(\"out\", \"wb\"); float v; uint32_t k;\n\
        if (!from || !to) { return 1; }\n\
        while (fread(&v, sizeof v, 1, from) == 1) { k = law_dac_code(v); fwrite(&k, sizeof k, 1, to); }\n\
        for (k = 0; k < 65536; k++) { v = law_adc_um((uint16_t)k); fwrite(&v, sizeof v, 1, to); }\n\
        return fclose(to);\n}\n";
    std::fs::write(folder.path().join("law.h"), code.header).unwrap();
    std::fs::write(folder.path().join("law.c"), code.source).unwrap();
    std::fs::write(folder.path().join("main.c"), main).unwrap();
    let all = volts(&table);
    let bytes: Vec<u8> = all.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("in"), bytes).unwrap();
    compile(folder.path(), &["law.c", "main.c"]);
    assert!(
        Command::new(folder.path().join("run"))
            .current_dir(folder.path())
            .status()
            .unwrap()
            .success()
    );
    let out = std::fs::read(folder.path().join("out")).unwrap();
    let found: Vec<u32> = out
        .chunks_exact(4)
        .map(|c| u32::from_le_bytes(c.try_into().unwrap()))
        .collect();
    let dac = Converter::new(table.dac_min_v as f32, table.dac_top_v as f32).unwrap();
    let adc = Converter::new(table.adc_min_um as f32, table.adc_top_um as f32).unwrap();
    let codes = all.iter().map(|&v| u32::from(dac.code(v).0));
    let positions = (0..=u16::MAX).map(|code| adc.volts(AdcCode(code)).to_bits());
    assert!(found.into_iter().eq(codes.chain(positions)));
}

#[test]
fn refuse_names_that_are_none_in_c() {
    let text = include_str!("../../../firmware/tables/paper-rate-mrpi.toml");
    let table = Table::parse(text).unwrap();
    for name in ["", "7up", "my-law", "a_name_of_nineteen_", "größe"] {
        assert_eq!(
            table.c_code(text, name).unwrap_err().to_string(),
            format!(
                "name = {name}: must be a letter and up to 17 letters, digits or underscores: names in C begin with it"
            )
        );
    }
    assert!(table.c_code(text, "a_name_of_eighteen").is_ok());
}
