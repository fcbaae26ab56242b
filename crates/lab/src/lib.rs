//! The workbench: a page on loopback in which a person goes the whole way, from recordings to a model that explains
//! them, without typing a command.
//!
//! [`Lab::open`] takes a session folder and a port, [`Lab::run`] answers until the program ends. Every answer is computed
//! by the same functions as on the command line.
#![forbid(unsafe_code)]

mod address;
mod api;
mod archive;
mod assets;
mod bench;
mod board;
mod book;
mod bring;
mod came_back;
mod campaign;
mod controller;
mod draft;
mod error;
mod explain;
mod export;
mod folder;
mod grow;
mod guard;
mod hand;
mod image;
mod jobs;
mod learn;
mod own;
mod place;
mod projects;
mod reading;
mod riddle;
mod rungs;
mod series;
mod session;
mod state;
mod undo;
mod uploads;
mod views;
mod wish;
mod work;

pub use error::LabError;

use address::Address;
use guard::Guard;
use hysteron_control::design::Controller;
use hysteron_control::expected::Row;
use jobs::Job;
use projects::Projects;
use session::Session;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;

/// A dataset that one can begin with when there are no recordings at hand.
pub struct StartingPoint {
    /// Its name in the address and in commands.
    pub name: &'static str,
    /// What the button says.
    pub title: String,
    /// What it is, one sentence.
    pub about: String,
    /// The command that makes the same dataset as `data`.
    pub command: String,
    /// Makes it in a folder that is not there yet; a key to it goes beside the folder, `.key` behind its name.
    #[expect(clippy::type_complexity, reason = "a maker with its progress")]
    pub make: Box<dyn Fn(&Path, &(dyn Fn(f64) + Sync)) -> Result<(), String> + Send + Sync>,
}

/// A simulated stage that controllers can be tried on.
pub struct SimulatedStage {
    /// Its name in commands.
    pub name: &'static str,
    /// Lowest and highest reference where nobody names others, micrometres.
    pub usual_um: [f64; 2],
    /// Runs a controller along the references between two positions, micrometres.
    #[expect(clippy::type_complexity, reason = "a run with what it is given")]
    pub run: Box<dyn Fn(&Controller, [f64; 2]) -> Result<StageRun, String> + Send + Sync>,
    /// Serves a table's law at it as a board would: its address, and what holds it.
    #[expect(clippy::type_complexity, reason = "a maker with what it makes")]
    pub serve: Box<dyn Fn(&str) -> Result<(String, Box<dyn Send + Sync>), String> + Send + Sync>,
}

/// What became of a controller on a simulated stage.
pub struct StageRun {
    /// What the command line says of it.
    pub said: String,
    /// What was expected and found, reference by reference.
    pub rows: Vec<Row>,
}

/// How the workbench is opened.
pub struct Options {
    /// Dataset folder, or one file in the native format, to begin with.
    pub data: Option<PathBuf>,
    /// Folder of the session, new or used.
    pub session: PathBuf,
    /// Port; 0 for a free one.
    pub port: u16,
    /// Datasets that one can begin with.
    pub starts: Vec<StartingPoint>,
    /// Simulated stages that controllers can be tried on.
    pub stages: Vec<SimulatedStage>,
    /// The firmware's sources; where there are none, no image is built.
    pub firmware: PathBuf,
    /// Version of the program.
    pub version: &'static str,
}

/// The workbench, listening.
pub struct Lab {
    listener: TcpListener,
    guard: Guard,
    app: Arc<App>,
}

/// What requests share.
pub(crate) struct App {
    session: Mutex<Session>,
    pub(crate) projects: Projects,
    job: Mutex<Job>,
    /// Percent of a file that is read at this moment.
    reading: Mutex<Option<u8>>,
    bench: Mutex<Option<board::OnBench>>,
    tick: watch::Sender<u64>,
    pub(crate) starts: Vec<StartingPoint>,
    pub(crate) stages: Vec<SimulatedStage>,
    pub(crate) firmware: PathBuf,
    pub(crate) version: &'static str,
    /// Tells one run of the server from the next, for a page that was open all the while.
    pub(crate) run: String,
}

impl App {
    /// The session. A request that failed while it held the lock has changed nothing half: the book is saved as a whole.
    pub(crate) fn session(&self) -> MutexGuard<'_, Session> {
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn job(&self) -> MutexGuard<'_, Job> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says how much of a file is read, 0 to 1; nothing once it is.
    pub(crate) fn reads(&self, share: Option<f64>) {
        let percent = share.map(|share| (100.0 * share) as u8);
        let before = {
            let mut reading = self.reading.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::replace(&mut *reading, percent)
        };
        if before != percent {
            self.changed();
        }
    }

    /// Percent of a file that is read at this moment.
    pub(crate) fn reading(&self) -> Option<u8> {
        *self.reading.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells every page that there is something new to see.
    pub(crate) fn changed(&self) {
        self.tick.send_modify(|tick| *tick += 1);
    }

    pub(crate) fn ticks(&self) -> watch::Receiver<u64> {
        self.tick.subscribe()
    }
}

impl Lab {
    /// Opens the session and takes the port, on loopback only.
    ///
    /// # Errors
    /// - A session folder, or the project in it that was open last, that cannot be written, that another server holds, or whose `session.json` cannot be read.
    /// - Data that cannot be read; a port that is taken.
    pub fn open(options: Options) -> Result<Self, LabError> {
        let (projects, mut session) = Projects::found(&options.session)?;
        if let Some(data) = &options.data {
            own::begin_with(&mut session, data)?;
        }
        let (listener, address) = Address::take(&options.session, options.port)?;
        let guard = Guard::new(&address);
        let app = App {
            session: Mutex::new(session),
            projects,
            job: Mutex::default(),
            reading: Mutex::default(),
            bench: Mutex::default(),
            tick: watch::Sender::new(1),
            starts: options.starts,
            stages: options.stages,
            firmware: options.firmware,
            version: options.version,
            run: address::random()?,
        };
        Ok(Self {
            listener,
            guard,
            app: Arc::new(app),
        })
    }

    /// The address with the token, for the browser.
    pub fn address(&self) -> String {
        self.guard.address()
    }

    /// Answers requests until the program ends.
    ///
    /// # Errors
    /// The system takes the port or the threads away.
    pub fn run(self) -> Result<(), LabError> {
        self.listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()?;
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            tokio::spawn(board::watch(Arc::clone(&self.app)));
            axum::serve(listener, api::router(self.app, self.guard)).await
        })?;
        Ok(())
    }
}
