//! Images for the emulator's boards, and the tables in them.

use crate::{CHIP, run, run_in, targets};
use std::path::{Path, PathBuf};

/// QEMU's boards, and the core that each image is compiled for. All run one source; memory map and timers are the same.
pub(crate) const BOARDS: [(&str, &str); 2] = [("mps2-an386", "cortex-m4"), ("mps2-an500", "cortex-m7")];

/// Where the images go.
pub(crate) const IMAGES: &str = "firmware/target/images";

/// The table in the images that `board run` takes by default.
pub(crate) const TABLE: &str = "firmware/tables/paper-rate-mrpi.toml";

/// The built-in stages that there are tables for.
const STAGES: [&str; 2] = ["paper-rate", "paper-delay"];

/// The stages that there are tables of complete laws for, with the tables' names.
const COMPLETE: [(&str, &str); 2] = [("8k", "tracking-8k"), ("739", "tracking-739")];

/// The tables of the axes of a stage with both: the complete laws, and what of the other's motion reaches each.
const AXES: [(&str, &str); 2] = [("tracking-x", "0.01"), ("tracking-y", "-0.006")];

/// The tables of the image with two.
const BANKS: [&str; 2] = ["tracking-8k", "tracking-739"];

/// Where the processor enters the emulator's images by itself while the loop runs; the second comes on top of the first.
const EMULATED_ENTRIES: [&str; 2] = ["mps2::sample_clock", "NonMaskableInt"];

/// Smallest code of an image: an image that was linked without its linker script has two bytes of it.
pub(crate) const SMALLEST_BYTES: u64 = 4096;

/// Stands before the tables of a second axis.
const OF_Y: &str = "--y";

/// Builds the images with tables, by default [`TABLE`]: bank 0 is the first. With tables behind [`OF_Y`], the images of both axes.
pub(crate) fn build(tables: &[String]) -> Result<(), String> {
    let mut axes = tables.split(|word| word == OF_Y);
    let mut next = || -> Vec<&Path> { axes.next().unwrap_or_default().iter().map(Path::new).collect() };
    let (of_x, of_y) = (next(), next());
    std::fs::create_dir_all(IMAGES).map_err(|error| format!("{IMAGES}: {error}"))?;
    if tables.iter().any(|word| word == OF_Y) {
        for board in BOARDS {
            build_both(&Path::new(IMAGES).join(format!("{}-xy", board.0)), board, &of_x, &of_y)?;
        }
        return Ok(());
    }
    let tables = if of_x.is_empty() { vec![Path::new(TABLE)] } else { of_x };
    for (board, core) in BOARDS {
        let built = build_with("mps2", core, &tables, &[])?;
        let image = Path::new(IMAGES).join(board);
        std::fs::copy(&built, &image).map_err(|error| format!("{}: {error}", image.display()))?;
        crate::firmware_image::check(board, &image, &EMULATED_ENTRIES, &limits(&tables))?;
    }
    Ok(())
}

/// What an image with tables may take.
fn limits(tables: &[&Path]) -> crate::firmware_image::Limits {
    let complete = |table: &Path| std::fs::read_to_string(table).is_ok_and(|text| text.contains("\n[controller]\n"));
    match tables.first() {
        Some(table) if complete(table) => crate::firmware_image::COMPLETE.with_banks(tables.len()),
        _ => crate::firmware_image::EMULATED.with_banks(tables.len()),
    }
}

/// Builds an image a table, one of two tables, one of both axes, and those that measure themselves.
pub(crate) fn images() -> Result<(), String> {
    let folder = Path::new(IMAGES).join("tables");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let paper = STAGES.iter().flat_map(|stage| {
        ["linear", "mpi", "wrpi", "mrpi", "play-polynomial"].map(|family| format!("{stage}-{family}"))
    });
    for name in paper {
        build_named(&folder, BOARDS[0], &name, &name)?;
    }
    build_banks(&folder)?;
    for ((_, core), name) in BOARDS.into_iter().zip(["in-guest", "in-guest-m7"]) {
        let built = build_image("guest", core, Path::new(TABLE))?;
        let image = folder.join(name);
        std::fs::copy(&built, &image).map_err(|error| format!("{}: {error}", image.display()))?;
    }
    let limits = &crate::firmware_image::COMPLETE;
    for (_, name) in COMPLETE {
        let image = build_named(&folder, BOARDS[0], name, name)?;
        crate::firmware_image::check(name, &image, &EMULATED_ENTRIES, limits)?;
    }
    // For the tests, which hold the other core to the same bits.
    let image = build_named(&folder, BOARDS[1], COMPLETE[0].1, "tracking-8k-m7")?;
    crate::firmware_image::check("tracking-8k-m7", &image, &EMULATED_ENTRIES, limits)?;
    let [x, y] = AXES.map(|(axis, _)| PathBuf::from(format!("firmware/tables/{axis}.toml")));
    for (name, board) in [("tracking-xy", BOARDS[0]), ("tracking-xy-m7", BOARDS[1])] {
        build_both(&folder.join(name), board, &[&x], &[&y])?;
    }
    Ok(())
}

/// Holds the images in the emulator beside the host over controllers and references.
pub(crate) fn emulator_and_host() -> Result<(), String> {
    // Of the whole workspace: with the features of one package alone its dependencies would be compiled twice.
    run(
        "cargo",
        &["build", "--locked", "--workspace", "--example", "emulator_and_host"],
    )?;
    let example = crate::targets().join("debug/examples/emulator_and_host");
    run(&example.display().to_string(), &[])
}

/// Builds the application with a table of `firmware/tables`, and puts the image in a folder.
fn build_named(folder: &Path, (_, core): (&str, &str), table: &str, name: &str) -> Result<PathBuf, String> {
    let built = build_image("mps2", core, Path::new(&format!("firmware/tables/{table}.toml")))?;
    let image = folder.join(name);
    std::fs::copy(&built, &image).map_err(|error| format!("{}: {error}", image.display()))?;
    Ok(image)
}

/// Builds the image with two tables, for the tests that change from one to the other.
fn build_banks(folder: &Path) -> Result<(), String> {
    let paths = BANKS.map(|name| PathBuf::from(format!("firmware/tables/{name}.toml")));
    let tables = [paths[0].as_path(), paths[1].as_path()];
    for ((board, core), name) in BOARDS.into_iter().zip(["banks", "banks-m7"]) {
        let built = build_with("mps2", core, &tables, &[])?;
        let image = folder.join(name);
        std::fs::copy(&built, &image).map_err(|error| format!("{}: {error}", image.display()))?;
        crate::firmware_image::check(
            &format!("{board}, two tables"),
            &image,
            &EMULATED_ENTRIES,
            &limits(&tables),
        )?;
    }
    Ok(())
}

/// Builds the image of both axes.
fn build_both(image: &Path, (board, core): (&str, &str), of_x: &[&Path], of_y: &[&Path]) -> Result<(), String> {
    if of_x.is_empty() || of_x.len() != of_y.len() {
        return Err(format!(
            "{} tables of the first axis and {} of the second; give as many of each, such as x.toml {OF_Y} y.toml",
            of_x.len(),
            of_y.len()
        ));
    }
    let built = build_with("mps2", core, of_x, of_y)?;
    let copied = std::fs::copy(&built, image);
    copied.map_err(|error| format!("{}: {error}", image.display()))?;
    let name = format!("{board}, two axes");
    let limits = crate::firmware_image::BOTH.with_banks(of_x.len());
    crate::firmware_image::check(&name, image, &EMULATED_ENTRIES, &limits)
}

/// Whether an image with a reachable panic is refused by the linker, for that reason: it must be.
pub(crate) fn refuses_panics() -> Result<(), String> {
    println!("> the image with a panic in its interrupt, which must not link");
    let table = Path::new(TABLE)
        .canonicalize()
        .map_err(|error| format!("{TABLE}: {error}"))?;
    let tried = std::process::Command::new("cargo")
        .args(words("mps2", BOARDS[0].1, &["panic-on-purpose"]))
        .env("HYSTERON_TABLE", table)
        .env("HYSTERON_CORE", BOARDS[0].1)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_TARGET_DIR")
        .current_dir("firmware")
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    let said = String::from_utf8_lossy(&tried.stderr);
    match (
        tried.status.success(),
        said.contains("undefined symbol: a_panic_can_be_reached"),
    ) {
        (false, true) => Ok(()),
        (false, false) => Err(format!("the image with a panic failed for another reason:\n{said}")),
        (true, _) => Err("an image with a reachable panic has linked".to_owned()),
    }
}

/// The arguments of cargo that build a program of the firmware's workspace for a core, with its features beside the core's.
fn words(program: &str, core: &str, features: &[&str]) -> Vec<String> {
    let package = match program {
        "blocks" => "bench",
        "guest" => "mps2",
        other => other,
    };
    let flags = format!("target.{CHIP}.rustflags=[\"-Ctarget-cpu={core}\"]");
    let mut words = vec!["build", "--release", "--locked", "--package", package, "--bin", program];
    words.extend(["--target", CHIP]);
    words.extend(["--config", &flags]);
    if core == "cortex-m7" {
        words.extend(["--features", "max-instruction"]);
    }
    for feature in features {
        words.extend(["--features", feature]);
    }
    words.into_iter().map(str::to_owned).collect()
}

/// Builds a program of the firmware's workspace for a core, with a table in it; returns its image.
pub(crate) fn build_image(program: &str, core: &str, table: &Path) -> Result<PathBuf, String> {
    build_with(program, core, &[table], &[])
}

/// A table's full path, as the build script of the application takes it.
pub(crate) fn full_path(table: &Path) -> Result<String, String> {
    let path = table.canonicalize().map_err(|error| {
        format!(
            "{}: {error}; give a table that `hysteron export` wrote",
            table.display()
        )
    })?;
    Ok(path.display().to_string())
}

/// Several full paths, as `PATH` has them.
fn full_paths(tables: &[&Path]) -> Result<String, String> {
    let paths = tables.iter().map(|table| full_path(table));
    let paths: Vec<String> = paths.collect::<Result<_, _>>()?;
    let joined = std::env::join_paths(&paths).map_err(|error| format!("{}: {error}", paths.join(", ")))?;
    joined
        .into_string()
        .map_err(|_| "the tables' folder's name is not UTF-8".to_owned())
}

/// As [`build_image`], with a table a bank, and of a second axis as many or none.
fn build_with(program: &str, core: &str, tables: &[&Path], of_y: &[&Path]) -> Result<PathBuf, String> {
    let table = full_paths(tables)?;
    let of_y = full_paths(of_y)?;
    let of_y = Some(of_y.as_str()).filter(|paths| !paths.is_empty());
    let words = words(program, core, if of_y.is_some() { &["two-axes"] } else { &[] });
    let arguments: Vec<&str> = words.iter().map(String::as_str).collect();
    // RUSTFLAGS would replace the flags above.
    run_in(
        "firmware",
        "cargo",
        &arguments,
        &[
            ("HYSTERON_TABLE", Some(&table)),
            ("HYSTERON_TABLE_Y", of_y),
            ("HYSTERON_CORE", Some(core)),
            ("RUSTFLAGS", None),
            ("CARGO_TARGET_DIR", None),
        ],
    )?;
    let built = PathBuf::from("firmware/target")
        .join(CHIP)
        .join("release")
        .join(program);
    let size = std::fs::metadata(&built).map_or(0, |found| found.len());
    if size < SMALLEST_BYTES {
        return Err(format!(
            "{} has {size} bytes: it was linked without its script",
            built.display()
        ));
    }
    Ok(built)
}

/// Writes the tables in `firmware/tables` anew, by the tool's own commands: the paper's stages' inverses of every family, and of stages
/// to be tracked with the complete law, from a campaign on them.
pub(crate) fn tables() -> Result<(), String> {
    // As the tests build it: optimised well enough, and built already.
    run("cargo", &["build", "--locked", "--package", "hysteron-cli"])?;
    let hysteron = targets().join("debug/hysteron");
    let hysteron = hysteron.to_str().ok_or("the target folder's name is not UTF-8")?;
    let work = Path::new("firmware/target/tables");
    for stage in STAGES {
        for (records, excitations, families) in TABLES {
            let data = work.join(format!("{stage}-{records}")).display().to_string();
            let mut arguments = vec!["simulate", "--stage", stage, "--overwrite", "-o", &data];
            arguments.extend(excitations.iter().flat_map(|excitation| ["--excitation", excitation]));
            run(hysteron, &arguments)?;
            for family in families {
                let model = work.join(format!("{stage}-{family}.toml")).display().to_string();
                // With eq. 16's thresholds the search sets alpha and beta to 0; with the data's it finds a rate dependence.
                let thresholds = if family == "mrpi" { "data" } else { "eq16" };
                let fit = [
                    "fit",
                    &data,
                    "--model",
                    family,
                    "--direction",
                    "inverse",
                    "--thresholds",
                    thresholds,
                    "-o",
                    &model,
                ];
                run(hysteron, &fit)?;
                let table = format!("firmware/tables/{stage}-{family}.toml");
                // Inside of what every record reaches, and where no inverse asks for less than 0 V.
                let range = ["--input-min", "0.1", "--input-max", "2.3"];
                run(
                    hysteron,
                    &[&["export", &model, "--stage", stage, "-o", &table], &range[..]].concat(),
                )?;
            }
        }
    }
    for (stage, name) in COMPLETE {
        let data = work.join(name).display().to_string();
        let controller = work.join(format!("{name}.toml")).display().to_string();
        run(hysteron, &["campaign", "--stage", stage, "--overwrite", "-o", &data])?;
        run(hysteron, &["design", &data, "-o", &controller])?;
        let table = format!("firmware/tables/{name}.toml");
        run(hysteron, &["export", &controller, "--stage", stage, "-o", &table])?;
    }
    for ((stage, name), (axis, cross)) in COMPLETE.into_iter().zip(AXES) {
        let controller = work.join(format!("{name}.toml")).display().to_string();
        let table = format!("firmware/tables/{axis}.toml");
        run(
            hysteron,
            &["export", &controller, "--stage", stage, "--cross", cross, "-o", &table],
        )?;
    }
    Ok(())
}

/// Records, their excitations, and the families that are fitted to them: the paper's three sines, half a second each; slow ones for
/// families without a rate, which three rates at once would bend until they cannot be inverted.
const TABLES: [(&str, &[&str], [&str; 2]); 2] = [
    (
        "sines",
        &[
            "sine:hz=10,periods=5",
            "sine:hz=100,periods=50",
            "sine:hz=500,periods=250",
        ],
        ["wrpi", "mrpi"],
    ),
    (
        "slow",
        &["sine:hz=10,periods=5", "decaying-triangle:high_v=26,centre_v=13"],
        ["mpi", "play-polynomial"],
    ),
];

/// Builds the images and shows a run of each.
pub(crate) fn show() -> Result<(), String> {
    build(&[])?;
    for (board, _) in BOARDS {
        let out = format!("firmware/target/run-{board}");
        run(
            "cargo",
            &[
                "run",
                "--locked",
                "--package",
                "hysteron-cli",
                "--",
                "board",
                "run",
                "--emulator",
                board,
                "--stage",
                "paper-rate",
                "--hz",
                "100",
                "--overwrite",
                "-o",
                &out,
            ],
        )?;
    }
    Ok(())
}
