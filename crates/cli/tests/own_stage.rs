//! A campaign by files on a bench of one's own, played here by a simulated stage: the files are commands, what came back is known by its
//! voltage and checked, and at the end stands a controller.
#![expect(clippy::unwrap_used, reason = "a test that cannot set up its files fails")]

mod own_bench;

use assert_cmd::Command;
use hysteron_data::read_dataset;
use own_bench::{ZERO_UM, commands, played, short_rest};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

fn hysteron(args: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_hysteron"));
    program.args(args).output().unwrap()
}

/// What the binary prints and says.
fn answered(args: &[&str]) -> [String; 2] {
    let output = hysteron(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {said}");
    [String::from_utf8(output.stdout).unwrap(), said]
}

/// It must end with 2 and say all of the words; the box that errors are drawn in breaks lines.
fn refused(args: &[&str], words: &[&str]) {
    let output = hysteron(args);
    let plain = |text: &str| -> String { text.chars().filter(|c| !c.is_whitespace() && *c != '│').collect() };
    let said = plain(&String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    for word in words {
        assert!(said.contains(&plain(word)), "{args:?} does not say `{word}`: {said}");
    }
}

/// The number behind these words.
fn number(said: &str, behind: &str) -> f64 {
    let (_, number) = said.split_once(behind).unwrap();
    number.split_once(' ').unwrap().0.parse().unwrap()
}

/// The bench: a stage that was cycled and rests at 0 V, and what was recorded so far.
struct Bench {
    back: PathBuf,
    toml: String,
    records: u64,
}

impl Bench {
    /// Plays a command and records it under a name.
    fn play(&mut self, file: &Path, name: &str, before: usize) {
        self.play_after(&[], file, name, before);
        writeln!(self.toml, "[[record]]\nfile = \"{name}\"\nrole = \"identify\"").unwrap();
        std::fs::write(self.back.join("dataset.toml"), &self.toml).unwrap();
    }

    /// The same again, on a stage that has been through other volts just before.
    fn play_after(&mut self, volts: &[f64], file: &Path, name: &str, before: usize) {
        self.records += 1;
        let text = played(self.records, volts, file, before);
        std::fs::write(self.back.join(name), text).unwrap();
    }
}

/// First everything in one file that begins early, from a sensor with a zero of its own; then one by one, under an instrument's names and
/// backwards; then as planned.
#[test]
fn val_a_campaign_by_files_ends_in_a_controller() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = |name: &str| path(name).display().to_string();
    let (plan, records, back) = (text("plan"), text("records"), text("back"));
    let fixed = ["campaign", "--top-v", "200", "--rate-hz", "50000"];
    let [said, _] = answered(&[&fixed[..], &["-o", &plan]].concat());
    assert!(
        said.contains("cycle the stage to 150 V") && said.contains("--latency-us US -o records"),
        "{said}"
    );
    refused(
        &[&fixed[..], &["-o", &plan]].concat(),
        &["campaign.toml: there is a plan already", "--overwrite"],
    );
    answered(&[&fixed[..], &["--latency-us", "20", "--overwrite", "-o", &plan]].concat());

    std::fs::create_dir(path("back")).unwrap();
    let mut bench = Bench {
        back: path("back"),
        toml: "format = 1\nname = \"bench\"\n[known]\nadc_um = [-25.0, 25.0]\n".to_owned(),
        records: 0,
    };
    bench.play(&path("plan").join("all.csv"), "scope.csv", 777);
    let come_back = ["campaign", "--plan", &plan, "--recorded", &back, "-o", &records];
    let with = |options: &[&'static str]| -> Vec<&str> { [&come_back[..], options].concat() };
    refused(
        &with(&["--top-v", "150", "--rate-hz", "50000"]),
        &["--top-v 150, and", "campaign.toml has 200 V"],
    );
    refused(
        &with(&["--latency-us", "30"]),
        &["--latency-us 30, and", "campaign.toml has 20 us"],
    );
    let [said, noted] = answered(&with(&[]));
    assert!(
        noted.contains("scope.csv: 8 records cut from it; the sequence begins 777 samples"),
        "{noted}"
    );
    // Of a bench without a mistake one thing cannot be known.
    assert_eq!(noted.matches("warning").count(), 1, "{noted}");
    assert!(
        noted.contains("which the controller undoes as the amplifier's; a skew between the channels")
            && noted.contains("20.0 us, is an error of 2.2 % of peak to peak at 500 Hz"),
        "{noted}"
    );
    assert!(said.contains("drift to frf-small-again: gain "), "{said}");
    // Rests of seconds leave a stage that creeps by 1.5 % of 15 um a decade a third of a percent above its zero.
    let zero_um = number(&said, "the sensor reads ");
    assert!((zero_um - ZERO_UM).abs() < 0.05, "{zero_um}");
    let after_pass_1 = read_dataset(&path("records")).unwrap();
    // 20 us and half a sample; the range of the converter counts from the same zero as the positions.
    assert!((after_pass_1.known.delay_s.unwrap() - 30e-6).abs() < 1e-12);
    assert!((after_pass_1.known.adc_um.unwrap()[0] - (-25.0 - zero_um)).abs() < 1e-4);

    let pass = commands(&path("plan/pass1"));
    for (number, file) in pass.iter().rev().enumerate() {
        bench.play(file, &format!("CH2_{number}.csv"), 0);
    }
    // One of them again, 20 ms after 2 s at 140 V.
    let (first, again) = (&pass[1], format!("CH2_{}.csv", pass.len() - 2));
    bench.play_after(&short_rest(), first, &again, 0);
    let name = first.file_stem().unwrap().to_str().unwrap();
    refused(
        &with(&["--overwrite"]),
        &[
            &format!("{name} does not begin at rest"),
            "at the rest voltage before it, as the plan has it",
            "--short-rests takes it all the same",
        ],
    );
    answered(&with(&["--overwrite", "--short-rests"]));
    let description = read_dataset(&path("records")).unwrap().description;
    assert!(
        description.ends_with("1 began before the stage was at rest, as was granted"),
        "{description}"
    );
    bench.play_after(&[], first, &again, 0);
    answered(&with(&["--overwrite"]));
    let second = commands(&path("plan/pass2"));
    for file in &second[1..] {
        bench.play(file, file.file_name().unwrap().to_str().unwrap(), 0);
    }
    let name = second[0].file_name().unwrap().to_str().unwrap();
    assert!(name.starts_with("frf-small-after"), "{name}");
    let [said, noted] = answered(&with(&["--overwrite"]));
    assert!(
        noted.contains("drift cannot be told: frf-small-after-pass2 is not there"),
        "{noted}"
    );
    assert!(said.contains("next: hysteron design"), "{said}");
    // As the built-in campaign's: 0.05 % of a command's range is a tenth of a volt.
    let missed = number(&said, "misses the commands by ");
    assert!(missed < 0.1, "{missed}");
    let [said, _] = answered(&["design", &records, "--open", "-o", &text("controller.toml")]);
    assert!(
        said.contains("WHILE IT WAS RECORDED  drift to frf-small-again: gain "),
        "{said}"
    );
    assert!(!said.contains("WARNING"), "{said}");
    // Files keep no references: what the last pass missed of them is not known.
    assert!(said.contains("open at least "), "{said}");
}

/// What contradicts, lacks or is of no plan ends with both values and what to do.
#[test]
fn refuse_recordings_without_their_plan() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (plan, records) = (path("plan"), path("records"));
    let one = path("one.csv");
    std::fs::write(
        &one,
        "time_s,voltage_v,position_um\n0,0,0\n0.00002,1,0.3\n0.00004,2,0.5\n",
    )
    .unwrap();
    let come_back = ["campaign", "--recorded", &one, "-o", &records, "--plan", &plan];
    refused(&come_back, &["campaign.toml: No such file", "--plan names the folder"]);
    answered(&[
        "campaign",
        "--top-v",
        "20",
        "--rate-hz",
        "10000",
        "--latency-us",
        "20",
        "-o",
        &plan,
    ]);
    refused(
        &come_back,
        &[
            "the recordings cannot be used yet",
            "one.csv: its voltage is that of no planned record; it is shorter than half of any command",
            "hold: not there; play hold.csv of the plan",
        ],
    );
    refused(
        &["campaign", "--stage", "8k", "--recorded", &one, "-o", &records],
        &["cannot be used with"],
    );
    refused(&["campaign", "--plan", &plan, "-o", &records], &["--recorded"]);
    refused(
        &[&come_back[..], &["--latency-us", "20000"]].concat(),
        &["--latency-us 20000: give 0 to 10000 us"],
    );
    assert!(!folder.path().join("records").exists());
}
