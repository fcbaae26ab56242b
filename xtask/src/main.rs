//! `cargo xtask`: what CI does, as one command at home.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a tool of the command line")]

mod docs;
mod evidence;
mod firmware;
mod firmware_bench;
mod firmware_boards;
mod firmware_bound;
mod firmware_image;
mod firmware_listing;
mod firmware_path;
mod firmware_starts;
mod mutants;
mod prose;
mod python;
mod rehearsals;
mod release;
mod tests;

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use tests::Work;

const HELP: &str = "\
usage: cargo xtask <command>

  test    install what the tests need, then format check, lints, chip build, all tests and the docs; ends on a count
  docs    check every link and run every command block of README and book against its printed output, then build the book with
          mdbook in target/book; --write brings the output in the pages up to date, --fast leaves slow blocks out, --no-html
          builds no book, --program FILE takes this program instead of building it
  evidence  list the measured tables of the book's evidence, each with its command; with words, measure those whose commands
          contain them anew, and write the output into the page with date, code, machine and time
  prose   print how README, ARCHITECTURE and book read: what, it, that in 1000 words, sentences above 30 and 40 words; takes files
  python  build the Python package into target/python and run its tests; --fleet runs those on a local Ray and Dask cluster,
          --wheel builds the wheel for release, installs it into an empty environment and runs the README's session there
  msrv    check the workspace with the oldest Rust that it promises, which rustup installs
  package pack the crates that others can build on as a registry takes them
  dist    build the program without debugging information and pack it with licences and README in target/dist
  bench   print the figures of the book: cargo bench over the workspace
  calibrate   verdicts on hundreds of simulated stages with hidden effects, as the book quotes them; takes cases an
          effect and strength (default 4) and the first seed (default 1000)
  calibrate thresholds   verdicts that change where a threshold is moved by 30 %, on the evidence of the last calibration
  calibrate odds   the weights of the probabilities, fitted to the evidence of the last two calibrations, and what they are worth on
          cases left out; --write puts them where they stand
  calibrate users   the same on recordings as users make them: ten programmes, stages of other families; takes the number of
          cases (default 60), the first seed, a programme, family, effect or kind; --quick, --harmless, --json FILE
  rehearsals  every effect hidden in three stages, found, learned and undone, as a table; with mps2-an386 or mps2-an500 on one
          stage in the emulator's firmware
  benchmark   oscillators with hysteresis, a hardening spring and friction inside, made from their published equations: errors
          beside a linear model and a NARX; takes one of bouc-wen, duffing, friction; --quick
  firmware run      build the images, run each in the emulator against the simulated stage
  firmware build    build the images for the emulator's boards; takes tables, by default firmware/tables/paper-rate-mrpi.toml:
                    several become banks that the host changes between; x.toml --y y.toml makes images of both axes
  firmware bench    instructions of one control tick in the emulator, beside the same algorithm in C by gcc -O3
  firmware compare  every controller on every reference, in the emulator and on the host, bit by bit, as one table
  firmware boards   build the images of nucleo-h743zi and nucleo-g474re, and check what can be checked without a board
  firmware release  the ready images of both boards, checked, as ELF and HEX with their SHA-256, into firmware/target/released
  firmware bound    build them; what the interrupt of each takes at most, by the longest path through its code
  firmware starts   build them, run each with a complete law in a processor model: codes beside the host's, then starts and faults,
                    as one table
  firmware tables   write the tables in firmware/tables anew with the tool's own commands
  mutants run cargo-mutants on the control law and the firmware's monitor and controller: which changes no test notices; takes
          its words, as --shard 0/8
  fuzz    run every fuzz target for SECONDS (default 60) with cargo-fuzz; needs the nightly toolchain

Example:
  cargo xtask test
";

/// The chip that the core is built for: Cortex-M4F and M7 with single-precision floating point.
const CHIP: &str = "thumbv7em-none-eabihf";

fn main() -> ExitCode {
    let mut words = std::env::args().skip(1);
    let done = match words.next().as_deref() {
        Some("test") => test(),
        Some("bench") => cargo(&["bench", "--workspace"]),
        Some("calibrate") => calibrate(&words.collect::<Vec<_>>()),
        Some("docs") => docs::docs(&words.collect::<Vec<_>>()),
        Some("evidence") => evidence::evidence(&words.collect::<Vec<_>>()),
        Some("prose") => prose::prose(&words.collect::<Vec<_>>()),
        Some("python") => python::python(&words.collect::<Vec<_>>()),
        Some("msrv") => release::msrv(),
        Some("package") => release::package(),
        Some("dist") => release::dist(),
        Some("rehearsals") => rehearsals::rehearsals(&words.collect::<Vec<_>>()),
        Some("benchmark") => example("benchmark", &words.collect::<Vec<_>>()),
        Some("firmware") => firmware(words.next().as_deref(), &words.collect::<Vec<_>>()),
        Some("mutants") => mutants::mutants(&words.collect::<Vec<_>>()),
        Some("fuzz") => fuzz(words.next().as_deref().unwrap_or("60")),
        Some("help" | "--help" | "-h") => {
            print!("{HELP}");
            Ok(())
        }
        _ => {
            eprint!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("cargo xtask: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// Runs an example of the tests across crates, built for speed.
fn example(name: &str, words: &[String]) -> Result<(), String> {
    let mut all = vec!["run", "--release", "--package", "host-tests", "--example", name, "--"];
    all.extend(words.iter().map(String::as_str));
    cargo(&all)
}

fn calibrate(words: &[String]) -> Result<(), String> {
    match words {
        [users, rest @ ..] if users == "users" => example("calibrate_users", rest),
        _ => example("calibrate", words),
    }
}

fn firmware(what: Option<&str>, tables: &[String]) -> Result<(), String> {
    install_target()?;
    match what {
        Some("build") => firmware::build(tables),
        Some("tables") => firmware::tables(),
        Some("bench") => install_emulator()
            .and_then(|()| install_compiler())
            .and_then(|()| firmware_bench::bench()),
        Some("compare") => install_emulator()
            .and_then(|()| firmware::images())
            .and_then(|()| firmware::emulator_and_host()),
        Some("boards") => install_compiler().and_then(|()| firmware_boards::boards()),
        Some("release") => install_compiler().and_then(|()| firmware_boards::release()),
        Some("bound") => install_compiler().and_then(|()| firmware_bound::bound()),
        Some("starts") => install_compiler()
            .and_then(|()| firmware_starts::install())
            .and_then(|()| firmware_boards::images())
            .and_then(|_| firmware_starts::starts()),
        Some("run") => install_emulator().and_then(|()| firmware::show()),
        other => Err(format!(
            "firmware: {other:?} is none of run, build, bench, compare, boards, release, bound, starts, tables"
        )),
    }
}

fn test() -> Result<(), String> {
    install_target()?;
    // What else is installed comes over the network, while the cores check the sources.
    std::thread::scope(|scope| {
        let installed = scope.spawn(install_programs);
        check_sources()?;
        installed
            .join()
            .unwrap_or_else(|_| Err("the installation broke off".to_owned()))
    })?;
    release::package()?;
    // The images, one crate after another, leave a core to the tests.
    let programs = std::thread::scope(|scope| {
        let images = scope.spawn(images);
        let programs = tests::programs().and_then(|programs| Ok((programs, python::beside_tests()?)));
        images
            .join()
            .unwrap_or_else(|_| Err("the images broke off".to_owned()))?;
        programs
    });
    let (programs, of_python) = programs?;
    let checks = [
        Work::Check("firmware compare", firmware::emulator_and_host),
        Work::Check("firmware starts", firmware_starts::starts),
        Work::Check("docs", docs::check),
        of_python,
        // No member of the workspace: its tests run on the host all the same.
        Work::of_cargo(&["test", "--package", "hysteron-firmware", "--locked"]),
        Work::of_cargo(&["test", "--workspace", "--locked", "--no-fail-fast", "--doc"]),
    ];
    tests::run(checks.into_iter().chain(programs))
}

/// Builds everything for the chips, and checks what needs no program of the host's.
fn images() -> Result<(), String> {
    cargo(&[
        "build",
        "--package",
        "hysteron-core",
        "--target",
        CHIP,
        "--release",
        "--locked",
    ])?;
    firmware::refuses_panics()?;
    firmware::images()?;
    firmware::build(&[])?;
    firmware_bench::bench()?;
    firmware_boards::boards()
}

/// Layout, and what clippy finds.
fn check_sources() -> Result<(), String> {
    cargo(&["fmt", "--all", "--check"])?;
    cargo(&[
        "clippy",
        "--workspace",
        "--all-targets",
        "--locked",
        "--",
        "--deny",
        "warnings",
    ])
}

/// Installs the programs that the tests run in.
fn install_programs() -> Result<(), String> {
    install_browser()?;
    install_emulator()?;
    install_compiler()?;
    install_fmpy()?;
    python::environment(false)?;
    firmware_starts::install()
}

/// Where cargo puts what it builds.
fn targets() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from)
}

/// Adds the chip's target, and says what to do where rustup cannot.
fn install_target() -> Result<(), String> {
    let installed = output("rustup", &["target", "list", "--installed"])
        .map_err(|reason| format!("{reason}; install rustup, or the target {CHIP} by your distribution's packages"))?;
    if installed.lines().any(|line| line.trim() == CHIP) {
        return Ok(());
    }
    run("rustup", &["target", "add", CHIP])
}

/// Installs the browser and its driver that the workbench is tested in.
fn install_browser() -> Result<(), String> {
    install("chromedriver", &["chromium", "chromium-driver"])
}

/// Installs the emulator that the firmware is tested in.
fn install_emulator() -> Result<(), String> {
    install("qemu-system-arm", &["qemu-system-arm"])
}

/// Installs the C compiler that the core is measured against.
fn install_compiler() -> Result<(), String> {
    install("arm-none-eabi-gcc", &["gcc-arm-none-eabi"])
}

/// Installs FMPy, which validates co-simulation units.
fn install_fmpy() -> Result<(), String> {
    python::install_python()?;
    let interpreter = fmpy_interpreter()?;
    if output(&interpreter, &["-c", "import fmpy"]).is_ok() {
        return Ok(());
    }
    let folder = targets().join("fmpy").display().to_string();
    run("python3", &["-m", "venv", &folder])?;
    run(&interpreter, &["-m", "pip", "install", "--quiet", FMPY])
}

/// What pip installs to validate units.
const FMPY: &str = "fmpy==0.3.32";

/// The interpreter that has FMPy.
fn fmpy_interpreter() -> Result<String, String> {
    let path = targets().join("fmpy/bin/python");
    let absolute = std::path::absolute(path).map_err(|error| error.to_string())?;
    Ok(absolute.display().to_string())
}

/// Installs Debian's packages where a program is absent.
fn install(wanted: &str, packages: &[&str]) -> Result<(), String> {
    if output(wanted, &["--version"]).is_ok() {
        return Ok(());
    }
    install_packages(packages)
}

fn install_packages(packages: &[&str]) -> Result<(), String> {
    let by_root = output("id", &["-u"]).is_ok_and(|id| id.trim() == "0");
    let (program, before) = if by_root { ("apt-get", 1) } else { ("sudo", 0) };
    let update = ["apt-get", "update"];
    let mut install = vec!["apt-get", "install", "--yes", "--no-install-recommends"];
    install.extend(packages);
    run(program, &update[before..])
        .and_then(|()| run(program, &install[before..]))
        .map_err(|reason| {
            format!(
                "{reason}; install {} by your distribution's packages",
                packages.join(" and ")
            )
        })
}

fn fuzz(seconds: &str) -> Result<(), String> {
    seconds
        .parse::<u32>()
        .map_err(|_| format!("fuzz: `{seconds}` is no number of seconds"))?;
    if output("cargo", &["+nightly", "fuzz", "--version"]).is_err() {
        run("cargo", &["install", "--locked", "cargo-fuzz"])?;
    }
    let targets = output("cargo", &["+nightly", "fuzz", "list", "--fuzz-dir", "fuzz"])?;
    for target in targets.lines() {
        let limit = format!("-max_total_time={seconds}");
        run(
            "cargo",
            &[
                "+nightly",
                "fuzz",
                "run",
                "--fuzz-dir",
                "fuzz",
                target,
                "--",
                &limit,
                "-rss_limit_mb=1024",
            ],
        )?;
    }
    Ok(())
}

fn cargo(arguments: &[&str]) -> Result<(), String> {
    run("cargo", arguments)
}

fn run(program: &str, arguments: &[&str]) -> Result<(), String> {
    run_in(".", program, arguments, &[])
}

/// Runs a program in a folder, with variables set or, where there is no value, taken out.
fn run_in(folder: &str, program: &str, arguments: &[&str], variables: &[(&str, Option<&str>)]) -> Result<(), String> {
    println!("> {program} {}", arguments.join(" "));
    let mut command = Command::new(program);
    for (name, value) in variables {
        match value {
            Some(value) => command.env(name, value),
            None => command.env_remove(name),
        };
    }
    let status = command
        .args(arguments)
        .current_dir(folder)
        .status()
        .map_err(|error| format!("cannot start {program}: {error}"))?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("{program} {}: {status}", arguments.join(" ")))
    }
}

fn output(program: &str, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|error| format!("cannot start {program}: {error}"))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        let said = String::from_utf8_lossy(&output.stdout);
        let last = said.lines().last().unwrap_or_default();
        Err(format!("{program} {}: {} {last}", arguments.join(" "), output.status))
    }
}
