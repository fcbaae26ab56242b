//! One long job at a time, its progress seen live, stopped when asked.

use crate::App;
use crate::error::Refusal;
use serde::Serialize;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the page shows of the job.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Job {
    /// Tells one job from the next: a short one may begin and end between two looks of a page.
    pub(crate) number: u64,
    /// `fitting`, `diagnosing`; empty before the first.
    pub(crate) kind: String,
    /// What is tried now.
    pub(crate) message: String,
    /// Done, 0 to 1.
    pub(crate) share: f64,
    pub(crate) running: bool,
    /// How it ended, where not well.
    pub(crate) failed: Option<String>,
    pub(crate) stopped: bool,
    #[serde(skip)]
    stop: Arc<AtomicBool>,
}

/// Unwinds a job that was stopped out of whatever loop it is in: the libraries call their progress often and hold
/// nothing that would be left half done.
struct Stopped;

/// The job's hand on its progress.
pub(crate) struct Progress {
    app: Arc<App>,
    stop: Arc<AtomicBool>,
}

impl Progress {
    /// Says how far the job is. Does not return once the job was stopped.
    pub(crate) fn at(&self, share: f64, message: &str) {
        if self.stop.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
        {
            let mut job = self.app.job();
            job.share = job.share.max(share);
            if !message.is_empty() {
                message.clone_into(&mut job.message);
            }
        }
        self.app.changed();
    }
}

/// Starts a job; refused while another runs.
pub(crate) fn start(
    app: &Arc<App>,
    kind: &str,
    work: impl FnOnce(&Progress) -> Result<(), Refusal> + Send + 'static,
) -> Result<(), Refusal> {
    let stop = Arc::new(AtomicBool::new(false));
    {
        let mut job = app.job();
        if job.running {
            return Err(Refusal::conflict(format!("still {}; wait for it or stop it", job.kind)));
        }
        *job = Job {
            number: job.number + 1,
            kind: kind.to_owned(),
            running: true,
            stop: Arc::clone(&stop),
            ..Job::default()
        };
    }
    app.changed();
    let app = Arc::clone(app);
    tokio::task::spawn_blocking(move || {
        let progress = Progress {
            app: Arc::clone(&app),
            stop,
        };
        let ended = catch_unwind(AssertUnwindSafe(|| work(&progress)));
        {
            let mut job = app.job();
            job.running = false;
            match ended {
                Ok(Ok(())) => job.share = 1.0,
                Ok(Err(refusal)) => job.failed = Some(refusal.message),
                Err(reason) if reason.is::<Stopped>() => job.stopped = true,
                Err(_) => {
                    job.failed = Some(format!(
                        "{} failed by a fault of the program; nothing was changed",
                        job.kind
                    ))
                }
            }
        }
        app.changed();
    });
    Ok(())
}

/// Asks the running job to stop.
pub(crate) fn stop(app: &App) -> Result<(), Refusal> {
    let job = app.job();
    if !job.running {
        return Err(Refusal::conflict("nothing is running"));
    }
    job.stop.store(true, Ordering::Relaxed);
    Ok(())
}
