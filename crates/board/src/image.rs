//! An image of a table, built from the firmware's sources.

use crate::{BoardError, Machine};
use std::fs::{self, File, TryLockError};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// What the images are compiled for.
const CHIP: &str = "thumbv7em-none-eabihf";

/// How often whoever waits for a build is told of it where the compiler says nothing.
const LOOK: Duration = Duration::from_millis(100);

/// What an image can be built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Board {
    /// A board of the emulator.
    Emulated(Machine),
    /// STM32H743ZI, Cortex-M7.
    NucleoH743zi,
    /// STM32G474RE, Cortex-M4F.
    NucleoG474re,
}

impl Board {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::NucleoH743zi,
        Self::NucleoG474re,
        Self::Emulated(Machine::Mps2An386),
        Self::Emulated(Machine::Mps2An500),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Emulated(machine) => machine.name(),
            Self::NucleoH743zi => "nucleo-h743zi",
            Self::NucleoG474re => "nucleo-g474re",
        }
    }

    /// The board of a name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|board| board.name() == name)
    }

    /// The chip of a real one, as probe-rs calls it.
    pub fn chip(self) -> Option<&'static str> {
        match self {
            Self::Emulated(_) => None,
            Self::NucleoH743zi => Some("STM32H743ZITx"),
            Self::NucleoG474re => Some("STM32G474RETx"),
        }
    }

    /// Its core, and the features that its image is built with.
    fn built_with(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Emulated(Machine::Mps2An386) => ("cortex-m4", None),
            Self::Emulated(Machine::Mps2An500) => ("cortex-m7", Some("max-instruction")),
            Self::NucleoH743zi => ("cortex-m7", Some("h743zi")),
            Self::NucleoG474re => ("cortex-m4", Some("g474re")),
        }
    }

    /// Folder of its package in the firmware's, name of its program, and the folder of what is built.
    fn place(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Emulated(_) => (".", "mps2", "target"),
            Self::NucleoH743zi | Self::NucleoG474re => ("nucleo", "nucleo", "target/nucleo"),
        }
    }
}

/// Builds the application with a table in it, one for each axis, and puts the image where `image` says.
///
/// Builds in one folder of sources wait for each other. What the image says of its table ([`crate::Session::hello`]) tells whether it
/// is this one.
///
/// `told` gets each line of the compiler's as it comes, and an empty one ten times a second: what unwinds out of it ends the build.
///
/// # Errors
/// A folder without the firmware's sources, a table that its build refuses, no toolchain for the chip.
///
/// # Cost
/// 5 s where the core is compiled already, 30 s where it is not; a real board's drivers take a minute more.
pub fn build(
    firmware: &Path,
    board: Board,
    tables: (&Path, Option<&Path>),
    image: &Path,
    told: &mut dyn FnMut(&str),
) -> Result<(), BoardError> {
    let (folder, program, built_in) = board.place();
    if !firmware.join(folder).is_dir() || !firmware.join("mps2").is_dir() {
        return Err(BoardError::NoFirmware(firmware.to_owned()));
    }
    let firmware = firmware.canonicalize()?;
    let table = tables.0.canonicalize()?;
    let beside = tables.1.map(Path::canonicalize).transpose()?;
    let target = firmware.join(built_in);
    fs::create_dir_all(&target)?;
    let lock = File::create(target.join("image-of-a-table.lock"))?;
    loop {
        match lock.try_lock() {
            Ok(()) => break,
            Err(TryLockError::WouldBlock) => told("waits for another build"),
            Err(TryLockError::Error(error)) => return Err(error.into()),
        }
        std::thread::sleep(LOOK);
    }
    let (core, of_core) = board.built_with();
    let features: Vec<&str> = of_core.into_iter().chain(beside.as_ref().map(|_| "two-axes")).collect();
    let mut cargo = Command::new("cargo");
    cargo
        .args(["build", "--release", "--locked", "--package", program, "--bin", program])
        .args(["--target", CHIP, "--config"])
        .arg(format!("target.{CHIP}.rustflags=[\"-Ctarget-cpu={core}\"]"))
        .arg("--target-dir")
        .arg(&target)
        .args(["--features", &features.join(",")])
        .env("HYSTERON_TABLE", &table)
        .env("HYSTERON_CORE", core)
        .env_remove("HYSTERON_TABLE_Y")
        // Either would replace the linker's arguments or the place of the image.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_TARGET_DIR")
        .envs(beside.map(|beside| ("HYSTERON_TABLE_Y", beside)))
        .current_dir(firmware.join(folder));
    followed(cargo, told)?;
    fs::copy(target.join(CHIP).join("release").join(program), image)?;
    Ok(())
}

/// A build that ends with whoever waits for it.
struct Building(Child);

impl Drop for Building {
    fn drop(&mut self) {
        // One that has ended cannot be ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs the compiler to its end, and says what it says.
fn followed(mut cargo: Command, told: &mut dyn FnMut(&str)) -> Result<(), BoardError> {
    let started = cargo.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut building = Building(started.map_err(|source| BoardError::Start {
        program: "cargo",
        package: "rustup",
        source,
    })?);
    let (sender, said) = channel();
    if let Some(errors) = building.0.stderr.take() {
        std::thread::spawn(move || {
            let lines = BufReader::new(errors).lines().map_while(Result::ok);
            lines.map(|line| sender.send(line)).all(|sent| sent.is_ok())
        });
    }
    let mut lines = Vec::new();
    loop {
        match said.recv_timeout(LOOK) {
            Ok(line) => {
                told(line.trim());
                lines.push(line);
            }
            Err(RecvTimeoutError::Timeout) => told(""),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    if building.0.wait()?.success() {
        return Ok(());
    }
    lines.retain(|line| !line.trim_start().starts_with("Compiling"));
    Err(BoardError::Build(lines.join("\n")))
}
