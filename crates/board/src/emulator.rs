//! QEMU as a child process with two FIFOs; ended when dropped, and when it takes too long.

use crate::{BoardError, Machine};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A running emulator.
pub(crate) struct Emulator {
    pub(crate) to_board: File,
    pub(crate) from_board: File,
    folder: tempfile::TempDir,
    guard: Guard,
}

/// Watches the child: ends it after `patience`, and closes the other ends of both FIFOs with it.
struct Guard {
    child: Arc<Mutex<Child>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// How often the child is looked at.
const LOOK: Duration = Duration::from_millis(20);

impl Emulator {
    /// An instruction takes 2^`shift` ns of virtual time.
    pub(crate) fn start(machine: Machine, image: &Path, shift: u8, patience: Duration) -> Result<Self, BoardError> {
        let image = image.canonicalize()?;
        let folder = tempfile::tempdir()?;
        let (to, from) = (folder.path().join("to-board"), folder.path().join("from-board"));
        let start = |program, package, command: &mut Command| {
            command.spawn().map_err(|source| BoardError::Start {
                program,
                package,
                source,
            })
        };
        let made = start("mkfifo", "coreutils", Command::new("mkfifo").args([&to, &from]))?.wait()?;
        if !made.success() {
            return Err(BoardError::Files(std::io::Error::other("mkfifo failed")));
        }
        // Opened for both, a FIFO waits for nobody. While these are held, no open below or in the image waits either; they are
        // closed when the image has ended, so that whoever reads or writes then finds the end.
        let both = |fifo: &Path| OpenOptions::new().read(true).write(true).open(fifo);
        let held = [both(&to)?, both(&from)?];
        let from_board = File::open(&from)?;
        let to_board = OpenOptions::new().write(true).open(&to)?;
        let said = File::create(folder.path().join("said"))?;
        let mut command = Command::new("qemu-system-arm");
        command
            .args([
                "-machine",
                machine.name(),
                "-display",
                "none",
                "-monitor",
                "none",
                "-serial",
                "none",
            ])
            .args(["-semihosting-config", "enable=on,target=native"])
            // Virtual time does not follow the wall clock: the same run every time.
            .args(["-icount", &format!("shift={shift},sleep=off"), "-kernel"])
            .arg(&image)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(said);
        let child = start("qemu-system-arm", "qemu-system-arm", &mut command)?;
        let guard = Guard::watch(child, patience, held);
        Ok(Self {
            to_board,
            from_board,
            folder,
            guard,
        })
    }

    /// Sends bytes and takes as many as answer them, neither waiting for the other.
    pub(crate) fn swap(&mut self, bytes: &[u8], answers: usize) -> std::io::Result<Vec<u8>> {
        let mut to_board = self.to_board.try_clone()?;
        let mut answers = vec![0; answers];
        let from_board = &mut self.from_board;
        std::thread::scope(|scope| {
            let writer = scope.spawn(move || to_board.write_all(bytes));
            let read = from_board.read_exact(&mut answers);
            // A writer that failed has left the reader without an answer.
            writer.join().unwrap_or(Ok(())).and(read)
        })?;
        Ok(answers)
    }

    /// What QEMU wrote to its standard error, and how it ended.
    pub(crate) fn said(&self) -> String {
        let said = std::fs::read_to_string(self.folder.path().join("said")).unwrap_or_default();
        let ended = self
            .guard
            .child
            .lock()
            .ok()
            .and_then(|mut child| child.try_wait().ok().flatten());
        match ended {
            Some(status) => format!("{} ({status})", said.trim()),
            None => said.trim().to_owned(),
        }
    }
}

impl Guard {
    fn watch(child: Child, patience: Duration, held: [File; 2]) -> Self {
        let child = Arc::new(Mutex::new(child));
        let over = Arc::new(AtomicBool::new(false));
        let (watched, stop) = (Arc::clone(&child), Arc::clone(&over));
        let thread = std::thread::spawn(move || {
            let deadline = Instant::now() + patience;
            loop {
                std::thread::park_timeout(LOOK);
                let asked = stop.load(Ordering::Acquire);
                let Ok(mut child) = watched.lock() else { return };
                if asked || Instant::now() > deadline {
                    // A child that has ended already is what is wanted.
                    let _ = child.kill();
                }
                if !matches!(child.try_wait(), Ok(None)) {
                    break;
                }
            }
            drop(held);
        });
        Self {
            child,
            over,
            thread: Some(thread),
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A watcher that panicked has nothing left to end.
            let _ = thread.join();
        }
    }
}
