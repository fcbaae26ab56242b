//! The session's folder on disk: nothing of others in it, nothing half done after a server that was cut off.

use crate::book::Book;
use crate::error::Refusal;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Folders of a session that hold what came of its data.
pub(crate) const RESULTS: [&str; 6] = ["models", "effects", "diagnoses", "reports", "controllers", "tables"];

/// Refuses a folder that is used for something else: what the workbench writes would take the place of what is there.
pub(crate) fn nothing_else_in(folder: &Path) -> Result<(), String> {
    let full = |part: &&str| std::fs::read_dir(folder.join(part)).is_ok_and(|mut entries| entries.next().is_some());
    match RESULTS
        .into_iter()
        .chain(["uploads", "data", "fresh", "campaign"])
        .find(full)
    {
        Some(part) => Err(format!(
            "it has `{part}` but no session.json, so these files are not the workbench's; give a new folder with --session"
        )),
        None => Ok(()),
    }
}

/// A folder in which new data are made before they replace those that are there; what an earlier try left is gone.
pub(crate) fn fresh(folder: &Path) -> Result<PathBuf, Refusal> {
    let fresh = folder.join("fresh");
    if fresh.exists() {
        std::fs::remove_dir_all(&fresh).map_err(|error| Refusal::disk(&fresh, &error))?;
    }
    std::fs::create_dir_all(&fresh).map_err(|error| Refusal::disk(&fresh, &error))?;
    Ok(fresh)
}

/// The folders of the data as they grew, by the book that is there; none where it cannot be read.
fn grown(folder: &Path) -> Vec<PathBuf> {
    let Ok(Some(book)) = Book::read(&folder.join("session.json")) else {
        return Vec::new();
    };
    let names = book.folders().into_iter();
    // Only what the workbench itself names so.
    let own = |name: &String| {
        name.strip_prefix("data-")
            .is_some_and(|number| number.parse::<u32>().is_ok())
    };
    names.filter(own).map(|name| folder.join(name)).collect()
}

/// Puts what lies ready in the fresh folder into its place: data and their key, if there are any, and the book. The book is
/// written last into the fresh folder and leaves it last, so this can be broken off anywhere and begun again; results on
/// the data that were there go with them.
pub(crate) fn finish_taking(folder: &Path) -> Result<(), Refusal> {
    let (fresh, data) = (folder.join("fresh"), folder.join("data"));
    let (key, book) = (folder.join("data.key"), fresh.join("session.json"));
    if !book.exists() {
        return Ok(());
    }
    let moved = || -> std::io::Result<()> {
        for generation in grown(folder).iter().filter(|generation| generation.exists()) {
            std::fs::remove_dir_all(generation)?;
        }
        if fresh.join("data").exists() {
            if data.exists() {
                std::fs::remove_dir_all(&data)?;
            }
            if key.exists() {
                std::fs::remove_file(&key)?;
            }
            std::fs::rename(fresh.join("data"), &data)?;
        }
        if fresh.join("data.key").exists() {
            std::fs::rename(fresh.join("data.key"), &key)?;
        }
        for part in RESULTS {
            for file in std::fs::read_dir(folder.join(part))? {
                std::fs::remove_file(file?.path())?;
            }
        }
        std::fs::rename(&book, folder.join("session.json"))?;
        std::fs::remove_dir_all(&fresh)
    };
    moved().map_err(|error| Refusal::disk(&data, &error))
}

/// Writes a file beside its place, to the disk, then into its place.
pub(crate) fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), Refusal> {
    write_for(file, bytes, Readers::AsUsual)
}

/// Who may read a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Readers {
    /// As the system does it for every file.
    AsUsual,
    /// Only who started the program; where the system knows no such thing, as the folder does it.
    Owner,
}

/// The same, for certain readers.
pub(crate) fn write_for(file: &Path, bytes: &[u8], readers: Readers) -> Result<(), Refusal> {
    let beside = file.with_extension("part");
    let mut options = File::options();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    if readers == Readers::Owner {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
        // The mode counts for a file that is made.
        let _ = std::fs::remove_file(&beside);
    }
    options
        .open(&beside)
        .and_then(|mut out| out.write_all(bytes).and_then(|()| out.sync_all()))
        .and_then(|()| std::fs::rename(&beside, file))
        .map_err(|error| Refusal::disk(file, &error))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A session whose new data lie ready to be put into their place.
    fn ready() -> tempfile::TempDir {
        let place = tempfile::tempdir().unwrap();
        for (file, text) in [
            ("session.json", "old"),
            ("data/a.csv", "old"),
            ("data.key", "old"),
            ("models/1.toml", "old"),
            ("effects/1.toml", "old"),
            ("diagnoses/0.json", "old"),
            ("reports/1.html", "old"),
            ("controllers/1.toml", "old"),
            ("tables/1.toml", "old"),
            ("fresh/data/b.csv", "new"),
            ("fresh/data.key", "new"),
            ("fresh/session.json", "new"),
        ] {
            let file = place.path().join(file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        place
    }

    #[test]
    fn regress_taking_data_is_finished_wherever_it_was_broken_off() {
        use std::fs::{remove_dir_all, remove_file, rename};
        type Move = fn(&Path);
        let moves: [Move; 8] = [
            |_| (),
            |f| remove_file(f.join("data/a.csv")).unwrap(),
            |f| remove_dir_all(f.join("data")).unwrap(),
            |f| remove_file(f.join("data.key")).unwrap(),
            |f| rename(f.join("fresh/data"), f.join("data")).unwrap(),
            |f| rename(f.join("fresh/data.key"), f.join("data.key")).unwrap(),
            |f| remove_file(f.join("models/1.toml")).unwrap(),
            |f| rename(f.join("fresh/session.json"), f.join("session.json")).unwrap(),
        ];
        for done in 1..moves.len() {
            let place = ready();
            let folder = place.path();
            for step in &moves[..done] {
                step(folder);
            }
            finish_taking(folder).unwrap();
            finish_taking(folder).unwrap();
            let read = |file: &str| std::fs::read_to_string(folder.join(file)).ok();
            for file in ["session.json", "data/b.csv", "data.key"] {
                assert_eq!(read(file).as_deref(), Some("new"), "{file} after {done} moves");
            }
            for file in [
                "data/a.csv",
                "models/1.toml",
                "effects/1.toml",
                "diagnoses/0.json",
                "reports/1.html",
                "controllers/1.toml",
                "tables/1.toml",
            ] {
                assert_eq!(read(file), None, "{file} after {done} moves");
            }
            assert!(!folder.join("fresh").exists());
        }
    }

    #[test]
    fn val_the_data_as_they_grew_end_with_the_book_that_names_them() {
        use crate::book::Generation;
        let place = ready();
        let folder = place.path();
        let generation = |data: &str| Generation {
            data: data.to_owned(),
            ..Generation::default()
        };
        let book = Book {
            generations: ["data", "data-2", "elsewhere", "data-x"].map(generation).to_vec(),
            ..Book::default()
        };
        book.write(&folder.join("session.json")).unwrap();
        for own in ["data-2", "data-3", "data-x", "elsewhere"] {
            std::fs::create_dir_all(folder.join(own)).unwrap();
        }
        finish_taking(folder).unwrap();
        let left = ["data-2", "data-3", "data-x", "elsewhere"].map(|own| folder.join(own).exists());
        assert_eq!(left, [false, true, true, true]);
    }

    #[test]
    fn regress_data_that_were_not_ready_change_nothing() {
        let place = ready();
        std::fs::remove_file(place.path().join("fresh/session.json")).unwrap();
        finish_taking(place.path()).unwrap();
        for file in [
            "session.json",
            "data/a.csv",
            "data.key",
            "models/1.toml",
            "diagnoses/0.json",
        ] {
            assert_eq!(
                std::fs::read_to_string(place.path().join(file)).unwrap(),
                "old",
                "{file}"
            );
        }
    }

    #[test]
    fn refuse_a_folder_of_something_else() {
        let place = tempfile::tempdir().unwrap();
        assert_eq!(nothing_else_in(place.path()), Ok(()));
        std::fs::create_dir_all(place.path().join("data")).unwrap();
        assert_eq!(nothing_else_in(place.path()), Ok(()));
        std::fs::write(place.path().join("data/thesis.csv"), "1").unwrap();
        let said = nothing_else_in(place.path()).unwrap_err();
        assert!(said.starts_with("it has `data` but no session.json"), "{said}");
    }
}
