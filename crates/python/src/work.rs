//! Long work beside Python: the interpreter is free, the progress is shown, Ctrl-C stops it.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often Python is asked for signals and the bar is moved.
const TICK: Duration = Duration::from_millis(50);

/// Unwinds work that was stopped out of whatever loop it is in: the libraries call their progress often and hold nothing
/// that would be left half done.
struct Stopped;

/// How far the work is, seen from both sides.
#[derive(Default)]
struct Shown {
    share: f64,
    what: String,
    over: bool,
}

/// The work's hand on its progress.
#[derive(Default)]
pub(crate) struct Progress {
    shown: Mutex<Shown>,
    changed: Condvar,
    stop: AtomicBool,
}

impl Progress {
    /// Says how far the work is, 0 to 1, and what is done now. Does not return once the work was stopped.
    pub(crate) fn at(&self, share: f64, what: &str) {
        if self.stop.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
        let mut shown = self.lock();
        if shown.what != what {
            what.clone_into(&mut shown.what);
            shown.share = 0.0;
        }
        shown.share = shown.share.max(share);
    }

    fn lock(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) {
        self.lock().over = true;
        self.changed.notify_all();
    }

    /// Waits a tick, or until the work is over; says whether it is.
    fn wait(&self) -> bool {
        let waited = self
            .changed
            .wait_timeout_while(self.lock(), TICK, |shown| !shown.over)
            .unwrap_or_else(PoisonError::into_inner);
        waited.0.over
    }
}

/// Runs work on a thread of its own. `shows` is whether a bar is shown where `tqdm` is installed.
///
/// # Errors
/// What a signal raises (`KeyboardInterrupt`), and a fault of the program.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    label: &str,
    shows: bool,
    work: impl FnOnce(&Progress) -> T + Send,
) -> PyResult<T> {
    let progress = Progress::default();
    let bar = match shows {
        true => Some(py.import("hysteron._progress")?.call_method1("bar", (label,))?),
        false => None,
    };
    let (ended, stopped) = std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let ended = catch_unwind(AssertUnwindSafe(|| work(&progress)));
            progress.end();
            ended
        });
        let mut stopped = None;
        while !py.detach(|| progress.wait()) {
            if stopped.is_none()
                && let Err(reason) = py.check_signals().and_then(|()| show(bar.as_ref(), &progress))
            {
                progress.stop.store(true, Ordering::Relaxed);
                stopped = Some(reason);
            }
        }
        (worker.join(), stopped)
    });
    if let Some(bar) = bar {
        bar.call_method0("close")?;
    }
    match (ended, stopped) {
        (_, Some(reason)) => Err(reason),
        (Ok(Ok(answer)), None) => Ok(answer),
        _ => Err(PyRuntimeError::new_err(format!(
            "{label} failed by a fault of the program; nothing was changed"
        ))),
    }
}

fn show(bar: Option<&Bound<'_, PyAny>>, progress: &Progress) -> PyResult<()> {
    let Some(bar) = bar else { return Ok(()) };
    let (share, what) = {
        let shown = progress.lock();
        (shown.share, shown.what.clone())
    };
    bar.call_method1("at", (share, what))?;
    Ok(())
}
