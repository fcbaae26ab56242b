//! Several projects under one address: the session's folder is the first, each other one a folder in its `projects/`.
//!
//! Each is a session's folder of its own, which the command line opens like any other. One is open at a time.

use crate::App;
use crate::book::Book;
use crate::error::{LabError, Refusal};
use crate::folder::write_whole;
use crate::session::Session;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, UNIX_EPOCH};

/// Folder of the others in that of the first.
const OTHERS: &str = "projects";

/// File in the first one's folder with the name of the one that is open.
const OPEN: &str = ".project";

/// Longest name of a project, characters.
const NAME: usize = 40;

/// Where the projects are, and which is open.
pub(crate) struct Projects {
    home: PathBuf,
    open: Mutex<String>,
}

impl Projects {
    /// The projects of a session's folder, and the one that was open last.
    ///
    /// # Errors
    /// Neither that one nor the first can be opened.
    pub(crate) fn found(home: &Path) -> Result<(Self, Session), LabError> {
        let last = std::fs::read_to_string(home.join(OPEN)).unwrap_or_default();
        let last = last.trim();
        // One that is gone, or whose name is none, gives way to the first.
        let there = checked(last).is_ok() && folder(home, last).join("session.json").exists();
        let name = if there { last } else { "" };
        let session = Session::open(&folder(home, name))?;
        let projects = Self {
            home: home.to_owned(),
            open: Mutex::new(name.to_owned()),
        };
        Ok((projects, session))
    }

    /// What the open one is called.
    pub(crate) fn open_name(&self) -> String {
        self.title(&self.open.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What a project is called: the first has the name of the session's folder.
    fn title(&self, name: &str) -> String {
        match (name, self.home.file_name()) {
            ("", Some(home)) => home.to_string_lossy().into_owned(),
            ("", None) => "session".to_owned(),
            (name, _) => name.to_owned(),
        }
    }

    /// The names of all, the first before the others.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.home.join(OTHERS))
            .into_iter()
            .flatten()
            .flatten();
        let mut names: Vec<String> = entries
            .filter(|entry| entry.path().join("session.json").exists())
            .filter_map(|entry| entry.file_name().into_string().ok())
            .filter(|name| checked(name).is_ok())
            .collect();
        names.sort();
        names.insert(0, String::new());
        names
    }
}

/// Folder of a project; that of the first has no name.
fn folder(home: &Path, name: &str) -> PathBuf {
    if name.is_empty() {
        home.to_owned()
    } else {
        home.join(OTHERS).join(name)
    }
}

/// A name that is a folder on every system, and no way to another place.
fn checked(name: &str) -> Result<&str, Refusal> {
    let fits = |c: char| c.is_alphanumeric() || " -_".contains(c);
    let count = name.chars().count();
    if (1..=NAME).contains(&count) && name.chars().all(fits) && name.trim() == name {
        return Ok(name);
    }
    Err(Refusal::unusable(format!(
        "`{}` is no name of a project: 1 to {NAME} letters, digits, spaces, - and _, with no space at an end",
        name.chars().take(NAME).collect::<String>()
    )))
}

/// Begins an empty project, and opens it.
pub(crate) fn make(app: &App, name: &str) -> Result<(), Refusal> {
    let name = checked(name.trim())?;
    let place = folder(&app.projects.home, name);
    if place.exists() {
        return Err(Refusal::conflict(format!(
            "there is a project `{name}`; open it, or choose another name"
        )));
    }
    change_to(app, name)
}

/// Opens another project.
pub(crate) fn open(app: &App, name: &str) -> Result<(), Refusal> {
    if !app.projects.names().iter().any(|known| known == name) {
        return Err(Refusal::absent(format!(
            "there is no project `{}`",
            name.chars().take(NAME).collect::<String>()
        )));
    }
    change_to(app, name)
}

fn change_to(app: &App, name: &str) -> Result<(), Refusal> {
    let failed = |error: LabError| Refusal::unusable(error.to_string());
    if app.has_board() {
        return Err(Refusal::conflict(
            "a board is connected; disconnect it before another project is opened",
        ));
    }
    let mut session = app.session();
    // Held until the other one stands: no job can begin meanwhile.
    let job = app.job();
    if job.running {
        return Err(Refusal::conflict(format!("still {}; wait for it or stop it", job.kind)));
    }
    let home = &app.projects.home;
    let mut open = app.projects.open.lock().unwrap_or_else(PoisonError::into_inner);
    if *open == name {
        return Ok(());
    }
    let mut other = Session::open(&folder(home, name)).map_err(failed)?;
    // A tab that shows the one before shall not act on this one.
    other.book.revision = other.book.revision.max(session.book.revision);
    other.save()?;
    write_whole(&home.join(OPEN), name.as_bytes())?;
    *session = other;
    name.clone_into(&mut open);
    drop((open, job, session));
    app.changed();
    Ok(())
}

/// All projects, as their page shows them.
pub(crate) fn list(app: &App) -> Value {
    let projects = &app.projects;
    let open = projects.open.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let each = projects.names().into_iter().map(|name| {
        let file = folder(&projects.home, &name).join("session.json");
        let book = Book::read(&file);
        let changed = std::fs::metadata(&file).and_then(|of| of.modified()).ok();
        let changed = changed.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let (book, unreadable) = match book {
            Ok(book) => (book.unwrap_or_default(), None),
            Err(reason) => (Book::default(), Some(reason)),
        };
        let steps = book.steps.iter().filter(|step| !step.removed);
        let current = book.current.and_then(|current| book.steps.get(current));
        json!({
            "name": name,
            "title": projects.title(&name),
            "open": name == open,
            "changed_s": changed.as_ref().map(Duration::as_secs),
            "has_data": !book.generations.is_empty(),
            "models": steps.count(),
            "model": current.map(|step| step.name()),
            "error_percent": current.and_then(|step| step.validate_percent.or(step.identify_percent)),
            "unreadable": unreadable,
        })
    });
    json!({"projects": each.collect::<Vec<_>>()})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuse_names_that_lead_elsewhere() {
        for name in [
            "",
            "..",
            ".",
            "a/b",
            "a\\b",
            " a",
            "a ",
            "a\nb",
            ".hidden",
            "C:",
            &"x".repeat(41),
        ] {
            assert!(checked(name).is_err(), "{name:?}");
        }
        for name in ["a", "Stage 2", "prüfstand_3-b"] {
            assert_eq!(checked(name), Ok(name));
        }
    }

    #[test]
    fn val_the_one_that_was_open_is_found_again_where_it_is_there() {
        let place = tempfile::tempdir().unwrap();
        let home = place.path().join("lab");
        let (projects, session) = Projects::found(&home).unwrap();
        assert_eq!(
            (projects.open_name(), projects.names()),
            ("lab".to_owned(), vec![String::new()])
        );
        drop(session);
        drop(Session::open(&home.join("projects/other")).unwrap());
        std::fs::write(home.join(".project"), "other").unwrap();
        let (projects, session) = Projects::found(&home).unwrap();
        assert_eq!(projects.open_name(), "other");
        assert_eq!(session.folder, home.join("projects/other"));
        drop(session);
        for gone in ["gone", "../other", ""] {
            std::fs::write(home.join(".project"), gone).unwrap();
            let (projects, _) = Projects::found(&home).unwrap();
            assert_eq!((projects.open_name(), projects.names().len()), ("lab".to_owned(), 2));
        }
    }
}
