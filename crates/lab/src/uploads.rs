//! Files that were brought: kept as they came, each read in its own way, until the data take them.

use crate::book::{Book, Brought, Stands};
use crate::error::Refusal;
use crate::reading::{MANIFEST, Reading, Source};
use hysteron_data::import::import;
use hysteron_data::{Dataset, Manifest, Record, Role};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use tempfile::TempPath;

/// Largest file taken, bytes: some twenty million samples as text.
pub(crate) const FILE_LIMIT: u64 = 512 << 20;

/// Most files in one session.
pub(crate) const FILES: usize = 500;

/// A file, read or refused.
pub(crate) struct Upload {
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) read: Result<Found, String>,
    /// What the page shows of its records.
    pub(crate) shown: Vec<serde_json::Value>,
    /// Whether its records' samples were let go: the data have them.
    gone: bool,
}

/// What is in a file.
pub(crate) enum Found {
    /// Recordings, and what was found out about them in words.
    Records { records: Vec<Record>, preview: String },
    /// Names, roles and what is known, of recordings beside it.
    Manifest(Manifest),
}

impl Found {
    pub(crate) fn records(&self) -> &[Record] {
        match self {
            Self::Records { records, .. } => records,
            Self::Manifest(_) => &[],
        }
    }
}

/// The files of a session.
pub(crate) struct Uploads {
    pub(crate) folder: PathBuf,
    pub(crate) files: Vec<Upload>,
}

impl Uploads {
    /// The files of a folder that is there, read as they were before.
    pub(crate) fn open(folder: &Path, brought: &BTreeMap<String, Brought>) -> Self {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries
            .filter(|entry| entry.path().is_file())
            .filter_map(|entry| entry.file_name().into_string().ok())
            .filter(|name| {
                let whole = safe_name(name).is_ok();
                if !whole {
                    // What a transfer that broke off left; where it cannot be removed it stays unseen.
                    let _ = std::fs::remove_file(folder.join(name));
                }
                whole
            })
            .collect();
        names.sort();
        let automatic = Reading::default();
        let reading = |name: &str| brought.get(name).map_or(&automatic, |file| &file.reading);
        Self {
            folder: folder.to_owned(),
            files: names
                .iter()
                .map(|name| read_one(folder, name, reading(name), &mut |_| ()))
                .collect(),
        }
    }

    /// Puts files that were read anew in place of those of the same name; one that was taken away meanwhile stays away.
    pub(crate) fn renew(&mut self, new: Vec<Upload>) {
        for upload in new {
            if let Some(file) = self.files.iter_mut().find(|file| file.name == upload.name) {
                *file = upload;
            }
        }
    }

    /// Takes files into the list in place of those of the same name.
    pub(crate) fn take(&mut self, new: Vec<Upload>) {
        for upload in new {
            self.files.retain(|file| file.name != upload.name);
            self.files.push(upload);
        }
        self.files.sort_by(|a, b| a.name.cmp(&b.name));
    }

    /// Lets the samples of those go that the data have: nobody looks at them here.
    pub(crate) fn let_go(&mut self, book: &Book) {
        let taken = |file: &&mut Upload| {
            book.files
                .get(&file.name)
                .is_some_and(|file| file.stands == Stands::Taken)
        };
        for file in self.files.iter_mut().filter(taken) {
            if let Ok(Found::Records { records, .. }) = &mut file.read {
                for record in records {
                    *record = Record::new(
                        record.file.as_str(),
                        record.role,
                        record.period_s,
                        Vec::new(),
                        Vec::new(),
                    );
                }
                file.gone = true;
            }
        }
    }

    /// Reads those anew whose samples were let go.
    pub(crate) fn read_again(&mut self, book: &Book, which: impl Fn(Stands) -> bool) {
        for file in self.files.iter_mut().filter(|file| file.gone) {
            if let Some(brought) = book.files.get(&file.name).filter(|file| which(file.stands)) {
                *file = read_one(&self.folder, &file.name, &brought.reading, &mut |_| ());
            }
        }
    }

    /// The dataset that some of the files are, where there is one.
    pub(crate) fn manifest(&self) -> Option<&Manifest> {
        self.files.iter().find_map(|file| match &file.read {
            Ok(Found::Manifest(manifest)) => Some(manifest),
            _ => None,
        })
    }

    /// What a file's records are for: as the person said, else as its dataset says, else to fit.
    pub(crate) fn role(&self, name: &str, brought: Option<&Brought>) -> Role {
        let said = brought.and_then(|file| file.role);
        let listed = || {
            let records = self.manifest().map_or(&[][..], |manifest| &manifest.records);
            records.iter().find(|entry| entry.file == name).map(|entry| entry.role)
        };
        said.or_else(listed).unwrap_or(Role::Identify)
    }

    /// The files with recordings that can be used, as the importer gets them.
    pub(crate) fn usable<'a>(&'a self, book: &'a Book, which: impl Fn(Stands) -> bool) -> Vec<Source<'a>> {
        let wanted = self.files.iter().filter_map(|file| {
            let brought = book.files.get(&file.name)?;
            let there = file.read.is_ok() && !file.shown.is_empty();
            (there && which(brought.stands)).then(|| Source {
                name: &file.name,
                reading: &brought.reading,
                role: self.role(&file.name, Some(brought)),
            })
        });
        wanted.collect()
    }

    /// The records of a file.
    pub(crate) fn records(&self, name: &str) -> &[Record] {
        let file = self.files.iter().find(|file| file.name == name);
        file.and_then(|file| file.read.as_ref().ok())
            .map_or(&[], Found::records)
    }
}

/// Puts files that are whole into the folder of a session, and says under which names. One that the data have already, byte by
/// byte, is not put anywhere; another one of its name gets a number, because the data keep where their records came from. One
/// that waits is replaced.
pub(crate) fn put(
    (folder, data): (&Path, &[PathBuf]),
    book: &Book,
    whole: Vec<(String, TempPath)>,
) -> Result<Put, Refusal> {
    let new = whole.iter().filter(|(name, _)| !book.files.contains_key(name)).count();
    if book.files.len() + new > FILES {
        return Err(Refusal::unusable(format!(
            "more than {FILES} files; take some away first"
        )));
    }
    let mut put = Put::default();
    for (name, file) in whole {
        let taken = |name: &str| book.files.get(name).is_some_and(|file| file.stands == Stands::Taken);
        let there = data.iter().map(|data| data.join(&name));
        let mut there = there.chain(taken(&name).then(|| folder.join(&name)));
        if there.any(|there| same_bytes(&there, &file)) {
            put.known.push(name);
            continue;
        }
        let mut free = name.clone();
        let mut number = 1;
        while taken(&free) {
            number += 1;
            free = match name.rsplit_once('.') {
                Some((stem, kind)) => format!("{stem}-{number}.{kind}"),
                None => format!("{name}-{number}"),
            };
        }
        // A dataset is told by this name alone; the one that was taken has done its work.
        let free = if name == MANIFEST { name } else { free };
        let path = folder.join(&free);
        file.persist(&path)
            .map_err(|error| Refusal::disk(&path, &error.error))?;
        put.names.push(free);
    }
    Ok(put)
}

/// What became of files that came.
#[derive(Debug, Default)]
pub(crate) struct Put {
    /// Those that are kept, by the names that they have now.
    pub(crate) names: Vec<String>,
    /// Those that the data have already.
    pub(crate) known: Vec<String>,
}

/// Whether two files are there and hold the same.
pub(crate) fn same_bytes(a: &Path, b: &Path) -> bool {
    let length = |path: &Path| std::fs::metadata(path).ok().map(|data| data.len());
    if length(a).is_none() || length(a) != length(b) {
        return false;
    }
    let (Ok(a), Ok(b)) = (std::fs::File::open(a), std::fs::File::open(b)) else {
        return false;
    };
    let (mut a, mut b) = (std::io::BufReader::new(a).bytes(), std::io::BufReader::new(b).bytes());
    loop {
        match (a.next(), b.next()) {
            (None, None) => return true,
            (Some(Ok(x)), Some(Ok(y))) if x == y => {}
            _ => return false,
        }
    }
}

/// Reads a recording that was brought; `told` gets the share of its bytes that is read.
pub(crate) fn read(path: &Path, name: &str, reading: &Reading, told: &mut dyn FnMut(f64)) -> Result<Found, String> {
    let here = path
        .parent()
        .map_or_else(String::new, |folder| format!("{}/", folder.display()));
    let options = reading.options(Role::Identify).map_err(|refusal| refusal.message)?;
    // The importer is built never to panic; should it, the file is at fault and the server goes on.
    let mut share = |bytes: u64, of: u64| told(bytes as f64 / of.max(1) as f64);
    let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| import(path, &options, &mut share)));
    match read {
        Err(_) => Err(format!(
            "{name}: the reader failed on this file; please report it with the file"
        )),
        Ok(Err(error)) => Err(error.to_string().replace(&here, "")),
        Ok(Ok(imported)) => {
            let mut preview = imported.preview.to_string().replace(&here, "");
            let dataset = Dataset {
                records: imported.records,
                ..Dataset::default()
            };
            for finding in hysteron_acquisition::mistakes(&dataset) {
                preview.push_str(&format!("  warning: {finding}\n"));
            }
            Ok(Found::Records {
                records: dataset.records,
                preview,
            })
        }
    }
}

/// Reads a file; a manifest is no recording, it says what those beside it are. `told` gets the share that is read.
pub(crate) fn read_one(folder: &Path, name: &str, reading: &Reading, told: &mut dyn FnMut(f64)) -> Upload {
    let path = folder.join(name);
    let here = format!("{}/", folder.display());
    let read = if name == MANIFEST {
        let manifest = Manifest::read(folder);
        manifest
            .map(Found::Manifest)
            .map_err(|error| error.to_string().replace(&here, ""))
    } else {
        read(&path, name, reading, told)
    };
    let records = read.iter().flat_map(Found::records);
    Upload {
        name: name.to_owned(),
        bytes: std::fs::metadata(&path).map_or(0, |data| data.len()),
        shown: records.map(crate::state::record).collect(),
        gone: false,
        read,
    }
}

/// Reads the files of a dataset of ours.
pub(crate) fn read_native(folder: &Path) -> Result<Dataset, Refusal> {
    hysteron_data::read_dataset(folder)
        .map_err(|error| Refusal::unusable(error.to_string().replace(&format!("{}/", folder.display()), "")))
}

/// The name under which a file is kept: one component, nothing hidden, nothing that a folder or a shell takes amiss. The
/// folders in which it came are part of the name, so that `a/run.csv` and `b/run.csv` are two.
pub(crate) fn safe_name(given: &str) -> Result<String, Refusal> {
    let refuse = || {
        Refusal::bad(format!(
            "`{}` is no name of a recording",
            given.chars().take(80).collect::<String>()
        ))
    };
    let unfit = |c: char| c.is_control() || "\\:*?\"<>|".contains(c);
    let mut parts = Vec::new();
    for part in Path::new(given).components() {
        match part {
            Component::Normal(name) => parts.push(name.to_str().ok_or_else(refuse)?),
            _ => return Err(refuse()),
        }
    }
    let name = parts.join("-");
    if parts.is_empty() || parts.iter().any(|part| part.starts_with('.')) || name.len() > 200 || name.contains(unfit) {
        return Err(refuse());
    }
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(place: &Path, name: &str, text: &str) -> (String, TempPath) {
        let mut file = tempfile::NamedTempFile::new_in(place).unwrap();
        std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
        (name.to_owned(), file.into_temp_path())
    }

    #[test]
    fn val_a_name_that_the_data_have_is_never_overwritten() {
        let place = tempfile::tempdir().unwrap();
        let [folder, data] = ["uploads", "data"].map(|part| place.path().join(part));
        for (path, text) in [
            (folder.join("a.csv"), "old"),
            (folder.join("w.csv"), "old"),
            (data.join("n.csv"), "old"),
        ] {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let mut book = Book::default();
        for (name, stands) in [("a.csv", Stands::Taken), ("w.csv", Stands::Waits)] {
            let brought = Brought {
                stands,
                ..Brought::default()
            };
            book.files.insert(name.to_owned(), brought);
        }
        let put = |name: &str, text: &str| {
            let came = vec![whole(place.path(), name, text)];
            let put = put((&folder, std::slice::from_ref(&data)), &book, came).unwrap();
            (put.names, put.known)
        };
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        assert_eq!(put("a.csv", "old"), (names(&[]), names(&["a.csv"])));
        assert_eq!(put("n.csv", "old"), (names(&[]), names(&["n.csv"])));
        assert_eq!(put("a.csv", "new"), (names(&["a-2.csv"]), names(&[])));
        assert_eq!(put("n.csv", "new"), (names(&["n.csv"]), names(&[])));
        assert_eq!(put("w.csv", "new"), (names(&["w.csv"]), names(&[])));
        assert_eq!(std::fs::read_to_string(folder.join("a.csv")).unwrap(), "old");
        assert_eq!(std::fs::read_to_string(folder.join("w.csv")).unwrap(), "new");
    }

    #[test]
    fn refuse_names_that_leave_the_folder() {
        assert_eq!(safe_name("up/run.csv").unwrap(), "up-run.csv");
        assert_eq!(safe_name("run.csv").unwrap(), "run.csv");
        for name in [
            "", "..", "../a.csv", "/a.csv", ".a.csv", "a/.b.csv", "a\\b.csv", "a\0.csv", "a:b.csv",
        ] {
            assert!(safe_name(name).is_err(), "{name:?}");
        }
    }
}
