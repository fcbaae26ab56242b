//! Steps that are taken off the ladder and put back, their models staying in their files; what a person calls them and wrote of them.

use crate::error::Refusal;
use crate::session::Session;

/// Takes a step off the ladder, with all that are made of it.
pub(crate) fn remove(session: &mut Session, number: usize) -> Result<(), Refusal> {
    let parent = session.step(number)?.parent;
    let gone = session.book.made_of(number);
    let steps = &session.book.steps;
    let left = (0..steps.len()).rev().find(|k| !steps[*k].removed && !gone.contains(k));
    let next = parent.or(left).ok_or_else(|| {
        Refusal::conflict("this is the last model of the ladder; fit another one before it is taken off")
    })?;
    for &step in &gone {
        session.book.steps[step].removed = true;
    }
    for step in &mut session.book.steps {
        step.redo = step.redo.filter(|redo| !gone.contains(redo));
    }
    if session.book.current.is_none_or(|current| gone.contains(&current)) {
        session.book.current = Some(next);
    }
    session.save()
}

/// Puts a step back on the ladder, with those that it is made of.
pub(crate) fn keep(session: &mut Session, number: usize) -> Result<(), Refusal> {
    session.step(number)?;
    for step in session.book.way(number) {
        session.book.steps[step].removed = false;
    }
    session.book.current = Some(number);
    session.save()
}

/// Longest name of a step, characters.
const NAME: usize = 80;

/// Longest note on a step, characters.
const NOTE: usize = 4000;

/// Names a step, and keeps a note on it; with an empty name it is called by what made it again.
pub(crate) fn name(session: &mut Session, number: usize, name: &str, note: &str) -> Result<(), Refusal> {
    session.step(number)?;
    let name = name.trim();
    for (what, text, most) in [("name", name, NAME), ("note", note, NOTE)] {
        let count = text.chars().count();
        if count > most {
            return Err(Refusal::unusable(format!(
                "the {what} has {count} characters; at most {most} are kept"
            )));
        }
    }
    if name.chars().any(char::is_control) {
        return Err(Refusal::unusable("a name is one line without control characters"));
    }
    let step = &mut session.book.steps[number];
    // Called as it was made, it needs no name of its own.
    step.named = if name == step.title {
        String::new()
    } else {
        name.to_owned()
    };
    note.trim().clone_into(&mut step.note);
    session.save()
}
