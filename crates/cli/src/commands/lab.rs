//! `hysteron lab`.

use crate::commands::control::offered::stages;
use crate::error::CliError;
use crate::exit::Done;
use crate::output;
use clap::Args;
use hysteron_challenge::Setting;
use hysteron_challenge::examples::{Example, Made, paper_stage};
use hysteron_data::{Overwrite, write_dataset};
use hysteron_lab::{Lab, Options, StartingPoint};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[derive(Args)]
#[command(after_help = "Example:\n  hysteron lab stage\n\n\
    Listens on 127.0.0.1 only. The session folder holds data, models and diagnoses as the other commands read them;\n\
    opened again, it goes on where it was left, at the same address while its port is free. Records can be added at any\n\
    time: data/ stays, data-2/ has them as well, and models stay until they are fitted anew. Its page Projects begins others, each in projects/ under its name, a\n\
    session folder of its own. Ctrl-C ends it.")]
pub(crate) struct LabArgs {
    /// Dataset folder, or one CSV, to begin with; copied into the session
    pub data: Option<PathBuf>,
    /// Do not open the browser
    #[arg(long)]
    pub no_open: bool,
    /// Port; 0 for the session's last one, or a free one
    #[arg(long, default_value_t = 0)]
    pub port: u16,
    /// The firmware's sources, for images with a controller's table
    #[arg(long, value_name = "FOLDER", default_value = "firmware")]
    pub firmware: PathBuf,
    /// Folder of the session, new or used
    #[arg(long, value_name = "DIR", default_value = "hysteron-lab")]
    pub session: PathBuf,
}

pub(crate) fn run(args: &LabArgs) -> Result<Done, CliError> {
    let lab = Lab::open(Options {
        data: args.data.clone(),
        session: args.session.clone(),
        port: args.port,
        starts: starts(),
        stages: stages(),
        firmware: args.firmware.clone(),
        version: env!("CARGO_PKG_VERSION"),
    })?;
    output::print(&format!(
        "workbench: {}\nsession:   {}\nCtrl-C ends it\n",
        lab.address(),
        args.session.display()
    ))?;
    if !args.no_open {
        open(&lab.address());
    }
    lab.run()?;
    Ok(Done::Answered)
}

/// The datasets that one can begin with.
fn starts() -> Vec<StartingPoint> {
    let demo = StartingPoint {
        name: "demo",
        title: "The demo stage".to_owned(),
        about: "A simulated piezo stage with rate-dependent hysteresis: nine records, three of them to judge by."
            .to_owned(),
        command: "hysteron example paper-stage -o data".to_owned(),
        make: Box::new(|folder, progress| {
            let dataset = paper_stage(&|share| progress(share)).map_err(|error| error.to_string())?;
            write_dataset(&dataset, folder, Overwrite::Refuse).map_err(|error| error.to_string())
        }),
    };
    let challenge = StartingPoint {
        name: "challenge",
        title: "A stage with something hidden".to_owned(),
        about:
            "A simulated stage drawn anew each time, fifteen records. One effect is hidden in it, or none, or one that \
                the catalogue does not have. Find it, answer, then see the truth."
                .to_owned(),
        command: "hysteron challenge new data".to_owned(),
        make: Box::new(|folder, _| {
            let mut key = folder.as_os_str().to_owned();
            key.push(".key");
            let riddle = Setting::default().make().map_err(|error| error.to_string())?;
            riddle.write(folder, Path::new(&key)).map_err(|error| error.to_string())
        }),
    };
    let of_stages = Example::ALL
        .into_iter()
        .filter(|example| *example != Example::PaperStage);
    let of_stages = of_stages.filter(|example| *example != Example::Scope);
    [demo, challenge].into_iter().chain(of_stages.map(of_example)).collect()
}

/// An example that is a dataset.
fn of_example(example: Example) -> StartingPoint {
    let sentence = |text: &str| {
        let mut text = text.replace(" um", " µm").replace('`', "");
        if let Some(first) = text.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        text
    };
    let title = match example {
        Example::Stage739hz => "A slow stage".to_owned(),
        other => sentence(&other.name().replace('-', " ")),
    };
    StartingPoint {
        name: example.name(),
        title,
        about: format!("{}.", sentence(example.about())),
        command: format!("hysteron example {} -o data", example.name()),
        make: Box::new(move |folder, progress| {
            let made = example
                .make(&|share| progress(share))
                .map_err(|error| error.to_string())?;
            let Made::Dataset { dataset, .. } = made else {
                return Err("the files of an instrument are no dataset".to_owned());
            };
            write_dataset(&dataset, folder, Overwrite::Refuse).map_err(|error| error.to_string())
        }),
    }
}

/// Opens the address in the browser; where there is none, the address stands in the terminal.
fn open(address: &str) {
    let (program, before): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let started = Command::new(program)
        .args(before)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    // A terminal without a browser is no fault: the address is printed.
    drop(started);
}
