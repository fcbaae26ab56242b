//! Undo and redo: along the tree of steps, and of what the data became since a step was fitted on them.
//!
//! A step stays on the generation of the data that it was fitted on, so that only the last one, on which none was, can be taken back.
//! It stands for all changes since; each of them left its own state of the data here, with its folder.

use crate::App;
use crate::book::{Book, Generation, Stands, Step};
use crate::error::Refusal;
use crate::jobs;
use crate::reading::MANIFEST;
use crate::session::Session;
use crate::uploads;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A generation that no step was fitted on; nothing where the data are as the last step knows them.
type Tail = Option<Generation>;

/// States of the data before and after the present one.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct Changes {
    /// What undo leads to, the last change last.
    past: Vec<Tail>,
    /// What redo leads to, the next change last, each with the step at which it was undone.
    future: Vec<(Option<usize>, Tail)>,
}

/// Which way one goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    Undo,
    Redo,
}

/// What is undone or made again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Next {
    /// A change of the data.
    Data,
    /// The way to this step.
    Step(usize),
}

impl Changes {
    pub(crate) fn is_empty(&self) -> bool {
        self.past.is_empty() && self.future.is_empty()
    }

    /// The folders that it holds.
    pub(crate) fn folders(&self) -> impl Iterator<Item = &String> {
        let future = self.future.iter().map(|(_, tail)| tail);
        let tails = self.past.iter().chain(future).flatten();
        tails.map(|generation| &generation.data)
    }
}

impl Book {
    /// Takes the last generation off, where no step was fitted on it.
    pub(crate) fn take_tail(&mut self) -> Tail {
        let now = self.now().filter(|&now| now > 0)?;
        let mut fitted = self.steps.iter().map(|step| step.generation);
        if fitted.any(|generation| generation == now) {
            return None;
        }
        self.generations.pop()
    }

    /// The data change: what they were can be had again, what was undone before cannot.
    pub(crate) fn changes_from(&mut self, tail: Tail) {
        self.changes.past.push(tail);
        self.changes.future.clear();
    }

    /// A step is fitted on the data: they can no longer be taken back.
    pub(crate) fn settle(&mut self) {
        self.changes = Changes::default();
    }

    fn next(&self, way: Way) -> Option<Next> {
        let step = self.current.and_then(|current| self.steps.get(current));
        let along = |next: fn(&Step) -> Option<usize>| step.and_then(next).map(Next::Step);
        match way {
            Way::Undo if !self.changes.past.is_empty() => Some(Next::Data),
            Way::Undo => along(|step| step.parent),
            Way::Redo => {
                let data = self.changes.future.last();
                let here = data.filter(|(at, _)| *at == self.current).map(|_| Next::Data);
                here.or_else(|| along(|step| step.redo))
                    .or_else(|| data.map(|_| Next::Data))
            }
        }
    }

    /// Changes the last generation for the one that undo or redo leads to.
    fn turn(&mut self, way: Way) -> Option<()> {
        match way {
            Way::Undo => {
                let before = self.changes.past.pop()?;
                let tail = self.take_tail();
                self.changes.future.push((self.current, tail));
                self.generations.extend(before);
            }
            Way::Redo => {
                let (_, after) = self.changes.future.pop()?;
                let tail = self.take_tail();
                self.changes.past.push(tail);
                self.generations.extend(after);
            }
        }
        self.stand_as_they_are();
        Some(())
    }

    /// Files whose records are in the data are taken, those whose records left them wait.
    fn stand_as_they_are(&mut self) {
        let came = self.generations.iter().flat_map(|generation| &generation.came);
        let came: Vec<&String> = came.map(|came| &came.file).collect();
        // No record came in a `dataset.toml`: what became of it, no record tells.
        let recordings = self.files.iter_mut().filter(|(name, _)| name.as_str() != MANIFEST);
        for (name, file) in recordings {
            file.stands = match file.stands {
                _ if came.contains(&name) => Stands::Taken,
                Stands::Taken => Stands::Waits,
                other => other,
            };
        }
    }

    /// What undo or redo would do, for its button; nothing where there is nothing to do.
    pub(crate) fn offered(&self, way: Way) -> Option<String> {
        match self.next(way)? {
            Next::Step(step) => Some(format!("to {}", self.steps.get(step)?.name())),
            Next::Data => {
                let mut other = self.clone();
                other.turn(way)?;
                let (earlier, later) = match way {
                    Way::Undo => (&other, self),
                    Way::Redo => (self, &other),
                };
                Some(difference(earlier, later))
            }
        }
    }
}

/// What became of the data from one state of the book to a later one.
fn difference(earlier: &Book, later: &Book) -> String {
    let came = |book: &Book| -> Vec<String> {
        let all = book.generations.iter().flat_map(|generation| &generation.came);
        all.map(|came| came.record.clone()).collect()
    };
    let before = came(earlier);
    let new: Vec<String> = came(later)
        .into_iter()
        .filter(|record| !before.contains(record))
        .collect();
    if !new.is_empty() {
        return format!("{} came in", new.join(", "));
    }
    let roles = |book: &Book| -> BTreeSet<String> {
        let all = book.generations.iter().flat_map(|generation| generation.roles.keys());
        all.cloned().collect()
    };
    let changed: Vec<String> = roles(earlier).symmetric_difference(&roles(later)).cloned().collect();
    format!("{} got another role", changed.join(", "))
}

/// Undoes or makes again what comes next.
pub(crate) fn go(app: &Arc<App>, way: Way) -> Result<(), Refusal> {
    let mut session = app.session();
    match session.book.next(way) {
        Some(Next::Step(step)) => {
            walk(&mut session, step)?;
            drop(session);
            app.changed();
            Ok(())
        }
        Some(Next::Data) => {
            drop(session);
            turn(app, way)
        }
        None => Err(Refusal::conflict(match way {
            Way::Undo => "there is nothing to undo",
            Way::Redo => "there is nothing to redo",
        })),
    }
}

/// Makes a step the current one.
pub(crate) fn walk(session: &mut Session, next: usize) -> Result<(), Refusal> {
    session.step(next)?;
    // Redo leads back to where one came from.
    let mut child = next;
    while let Some(parent) = session.book.steps[child].parent {
        session.book.steps[parent].redo = Some(child);
        child = parent;
    }
    session.book.current = Some(next);
    session.save()
}

fn turn(app: &Arc<App>, way: Way) -> Result<(), Refusal> {
    let own = Arc::clone(app);
    let kind = match way {
        Way::Undo => "taking the change of the data back",
        Way::Redo => "making the change of the data again",
    };
    jobs::start(app, kind, move |progress| {
        progress.at(0.1, "data");
        let none = || Refusal::conflict("the data were changed meanwhile");
        let folder = {
            let session = own.session();
            let mut book = session.book.clone();
            book.turn(way).ok_or_else(none)?;
            session.folder.join(&book.data().ok_or_else(none)?.data)
        };
        let dataset = uploads::read_native(&folder)?;
        let mut session = own.session();
        let mut book = session.book.clone();
        book.turn(way).ok_or_else(none)?;
        session.go_on(book, dataset)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::book::Came;
    use hysteron_data::Role;

    fn generation(data: &str, came: &[&str], roles: &[&str]) -> Generation {
        Generation {
            data: data.to_owned(),
            came: came
                .iter()
                .map(|&file| Came {
                    record: file.to_owned(),
                    file: file.to_owned(),
                    asked_by: None,
                })
                .collect(),
            roles: roles.iter().map(|&name| (name.to_owned(), Role::Identify)).collect(),
            ..Generation::default()
        }
    }

    /// Changes the data as a session does.
    fn grow(book: &mut Book, mut next: Generation) {
        let tail = book.take_tail();
        if let Some(before) = &tail {
            next.take_over(before);
        }
        for came in &next.came {
            book.files.entry(came.file.clone()).or_default().stands = Stands::Taken;
        }
        book.changes_from(tail);
        if !next.nothing_new() {
            book.generations.push(next);
        }
    }

    fn begun() -> Book {
        let mut book = Book {
            generations: vec![generation("data", &["a.csv"], &[])],
            ..Book::default()
        };
        grow(&mut book, generation("data-2", &["b.csv"], &[]));
        grow(&mut book, generation("data-3", &[], &["a.csv"]));
        book
    }

    #[test]
    fn val_each_change_of_the_data_is_taken_back_and_made_again() {
        let mut book = begun();
        let whole = book.clone();
        assert_eq!(book.offered(Way::Undo).as_deref(), Some("a.csv got another role"));
        assert_eq!(book.offered(Way::Redo), None);
        book.turn(Way::Undo).unwrap();
        assert_eq!(book.offered(Way::Undo).as_deref(), Some("b.csv came in"));
        assert_eq!(book.offered(Way::Redo).as_deref(), Some("a.csv got another role"));
        assert_eq!(book.data().unwrap().data, "data-2");
        book.turn(Way::Undo).unwrap();
        assert_eq!((book.generations.len(), book.files["b.csv"].stands), (1, Stands::Waits));
        assert_eq!(book.next(Way::Undo), None);
        // Nothing on disk is given up meanwhile.
        assert_eq!(book.folders(), whole.folders());
        book.turn(Way::Redo).unwrap();
        book.turn(Way::Redo).unwrap();
        assert_eq!(book, whole);
        assert_eq!(book.turn(Way::Redo), None);
    }

    #[test]
    fn val_another_change_ends_what_was_undone() {
        let mut book = begun();
        book.turn(Way::Undo).unwrap();
        grow(&mut book, generation("data-4", &["c.csv"], &[]));
        assert_eq!(book.next(Way::Redo), None);
        assert!(!book.folders().contains("data-3"));
        // A role that changes there and back is no generation, and two changes.
        grow(&mut book, generation("data-5", &[], &["a.csv"]));
        grow(&mut book, generation("data-6", &[], &["a.csv"]));
        for data in ["data-5", "data-4", "data-2", "data"] {
            book.turn(Way::Undo).unwrap();
            assert_eq!(book.data().unwrap().data, data);
        }
    }
}
