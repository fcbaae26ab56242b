//! A unit compiled and packed.

use crate::{FmuError, Variable};
use hysteron_table::CCode;
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::Path;
use std::process::Command;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// A co-simulation unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fmu {
    pub(crate) name: String,
    pub(crate) words: String,
    pub(crate) period_s: f64,
    /// In the order of their references, from 1 on; 0 is the time.
    pub(crate) variables: Vec<Variable>,
    /// What connects `fmi3.c` with the code.
    pub(crate) unit: String,
    pub(crate) code: CCode,
}

/// The functions of the interface, the same for every unit.
const INTERFACE: &str = include_str!("../c/fmi3.c");

impl Fmu {
    /// The unit as a file: description, library of this machine, sources.
    ///
    /// # Errors
    /// No C compiler `cc`; a folder for temporary files that cannot be written.
    pub fn pack(&self) -> Result<Vec<u8>, FmuError> {
        let sources = self.sources();
        let folder = tempfile::tempdir()?;
        for (file, text) in &sources {
            std::fs::write(folder.path().join(file), text)?;
        }
        let library = self.compile(folder.path())?;
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let mut add = |file: &str, bytes: &[u8]| -> Result<(), FmuError> {
            archive.start_file(file, SimpleFileOptions::default())?;
            Ok(archive.write_all(bytes)?)
        };
        add("modelDescription.xml", self.description(&self.token()).as_bytes())?;
        let (platform, ending) = platform();
        add(&format!("binaries/{platform}/{}.{ending}", self.name), &library)?;
        for (file, text) in &sources {
            add(&format!("sources/{file}"), text.as_bytes())?;
        }
        add("sources/buildDescription.xml", self.build_description().as_bytes())?;
        Ok(archive.finish()?.into_inner())
    }

    fn sources(&self) -> Vec<(String, String)> {
        vec![
            ("fmi3.c".to_owned(), INTERFACE.to_owned()),
            ("unit.h".to_owned(), self.unit_header()),
            (format!("{}.h", self.name), self.code.header.clone()),
            (format!("{}.c", self.name), self.code.source.clone()),
        ]
    }

    /// Another code, another token: a library does not serve a description that is not its own.
    fn token(&self) -> String {
        let all = format!("{}{}{}{INTERFACE}", self.code.header, self.code.source, self.unit);
        let mut token = String::new();
        for byte in hysteron_table::hash(&all).iter().take(16) {
            // Writing to a String does not fail.
            let _ = write!(token, "{byte:02x}");
        }
        token
    }

    fn unit_header(&self) -> String {
        let inputs: Vec<&str> = self
            .variables
            .iter()
            .map(|variable| if variable.input { "1" } else { "0" })
            .collect();
        format!(
            "/* {name}: what the interface of fmi3.c stands before. */\n#ifndef UNIT_H\n#define UNIT_H\n\n#include \"{name}.h\"\n\n\
             #define UNIT_TOKEN \"{}\"\n#define UNIT_PERIOD_S {:?}\n#define UNIT_VARIABLES {}\n\n\
             /* The time, then the variables. */\nstatic const unsigned char UNIT_INPUT[UNIT_VARIABLES] = {{0, {}}};\n\n{}\n#endif\n",
            self.token(),
            self.period_s,
            self.variables.len() + 1,
            inputs.join(", "),
            self.unit,
            name = self.name,
        )
    }

    fn compile(&self, folder: &Path) -> Result<Vec<u8>, FmuError> {
        let source = format!("{}.c", self.name);
        let output = Command::new("cc")
            .args([
                "-std=c99",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-O2",
                "-ffp-contract=off",
                "-fPIC",
                "-shared",
            ])
            .args(["-o", "unit", "fmi3.c", &source, "-lm"])
            .current_dir(folder)
            .output()
            .map_err(FmuError::Compiler)?;
        if !output.status.success() {
            return Err(FmuError::Compile(String::from_utf8_lossy(&output.stderr).into_owned()));
        }
        Ok(std::fs::read(folder.join("unit"))?)
    }
}

/// The standard's name of this machine, and how its libraries end.
fn platform() -> (String, &'static str) {
    let (system, ending) = match std::env::consts::OS {
        "macos" => ("darwin", "dylib"),
        "windows" => ("windows", "dll"),
        other => (other, "so"),
    };
    (format!("{}-{system}", std::env::consts::ARCH), ending)
}
