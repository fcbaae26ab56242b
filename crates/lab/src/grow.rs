//! How the data come to be and grow: a dataset to begin with, records that are added, records that are used otherwise.
//!
//! Each change makes a folder of its own in which the records that stay are linked or copied, and the book names it once it is
//! whole: a server that ends in the midst of it leaves the data as they were.

use crate::App;
use crate::book::{Book, Came, Generation, Stands};
use crate::error::Refusal;
use crate::folder;
use crate::jobs;
use crate::reading::{MANIFEST, Source, Target, import_command, in_order, quoted};
use crate::session::Session;
use crate::uploads::{self, Uploads};
use hysteron_data::import::name_apart;
use hysteron_data::{Dataset, Manifest, Overwrite, Record, Role, append_records, write_dataset};
use std::path::Path;
use std::sync::Arc;

/// Begins with the files that were brought, all that can be used; what cannot stays as it stands.
pub(crate) fn take_files(app: &Arc<App>) -> Result<(), Refusal> {
    let own = Arc::clone(app);
    jobs::start(app, "writing the recordings", move |progress| {
        progress.at(0.1, "data");
        let (folder, first, files) = {
            let mut session = own.session();
            session.read_again(|_| true);
            let data = folder::fresh(&session.folder)?.join("data");
            let (first, files) = write_first(&session, &data)?;
            (session.folder.clone(), first, files)
        };
        progress.at(0.9, "data");
        let dataset = uploads::read_native(&folder.join("fresh/data"))?;
        own.session().begin(first, &files, dataset)
    })
}

/// Makes the data of a starting point.
pub(crate) fn take_start(app: &Arc<App>, name: &str) -> Result<(), Refusal> {
    let index = app
        .starts
        .iter()
        .position(|start| start.name == name)
        .ok_or_else(|| Refusal::absent(format!("there is no starting point `{name}`")))?;
    let own = Arc::clone(app);
    jobs::start(app, "recording", move |progress| {
        let start = &own.starts[index];
        progress.at(0.05, &start.title);
        let folder = own.session().folder.clone();
        let data = folder::fresh(&folder)?.join("data");
        (start.make)(&data, &|share| progress.at(0.8 * share, &start.title)).map_err(Refusal::unusable)?;
        let dataset = uploads::read_native(&data)?;
        let first = Generation {
            data: "data".to_owned(),
            command: Some(start.command.clone()),
            ..Generation::default()
        };
        own.session().begin(first, &[], dataset)
    })
}

/// Writes the files that can be used as a new dataset, and says which they were. Those that a `dataset.toml` lists are copied
/// byte by byte, others are imported.
fn write_first(session: &Session, data: &Path) -> Result<(Generation, Vec<String>), Refusal> {
    let (uploads, book) = (&session.uploads, &session.book);
    let sources = uploads.usable(book, |_| true);
    let listed = |name: &str| {
        uploads
            .manifest()
            .is_some_and(|m| m.records.iter().any(|entry| entry.file == name))
    };
    let (native, foreign): (Vec<Source<'_>>, Vec<Source<'_>>) =
        sources.into_iter().partition(|source| listed(source.name));
    if native.is_empty() && foreign.is_empty() {
        return Err(Refusal::unusable("there is no recording that can be used"));
    }
    let mut commands = Vec::new();
    let mut came: Vec<Came> = Vec::new();
    if let Some(manifest) = uploads.manifest().filter(|_| !native.is_empty()) {
        commands.push(copy_native(&uploads.folder, data, manifest, &native)?);
        came.extend(native.iter().map(|source| came_in(book, source.name, source.name)));
    }
    let target = if native.is_empty() { Target::New } else { Target::There };
    if !foreign.is_empty() {
        let there = native.iter().map(|source| source.name);
        let (records, named) = imported(uploads, book, &foreign, there);
        match target {
            Target::New => write_dataset(&dataset_of(records), data, Overwrite::Refuse),
            Target::There => append_records(data, &records),
        }
        .map_err(Refusal::unusable)?;
        came.extend(named);
        commands.push(Some(import_command(&foreign, "data", target)));
    }
    let mut files: Vec<String> = native
        .iter()
        .chain(&foreign)
        .map(|source| source.name.to_owned())
        .collect();
    if !native.is_empty() {
        files.push(MANIFEST.to_owned());
    }
    let first = Generation {
        data: "data".to_owned(),
        command: commands
            .into_iter()
            .collect::<Option<Vec<_>>>()
            .map(|all| all.join(" && ")),
        came,
        ..Generation::default()
    };
    Ok((first, files))
}

/// Copies what is there of a dataset of ours byte by byte, its `dataset.toml` as well where nothing of it is changed, and gives
/// the command that does the same, where there is one.
fn copy_native(from: &Path, to: &Path, manifest: &Manifest, files: &[Source<'_>]) -> Result<Option<String>, Refusal> {
    std::fs::create_dir_all(to).map_err(|error| Refusal::disk(to, &error))?;
    let copy = |name: &str| {
        std::fs::copy(from.join(name), to.join(name))
            .map(drop)
            .map_err(|error| Refusal::disk(&to.join(name), &error))
    };
    let mut kept = manifest.clone();
    kept.records
        .retain(|entry| files.iter().any(|file| file.name == entry.file));
    for entry in &mut kept.records {
        copy(&entry.file)?;
        if let Some(file) = files.iter().find(|file| file.name == entry.file) {
            entry.role = file.role;
        }
    }
    if kept != *manifest {
        kept.write(to).map_err(Refusal::unusable)?;
        return Ok(None);
    }
    copy(MANIFEST)?;
    let names = files.iter().map(|file| file.name).chain([MANIFEST]);
    let words: Vec<String> = names.map(|name| quoted(&format!("uploads/{name}"))).collect();
    Ok(Some(format!("mkdir data && cp {} data", words.join(" "))))
}

/// The records of files, named apart from each other and from those that are there, and where each came from.
fn imported<'a>(
    uploads: &Uploads,
    book: &Book,
    files: &[Source<'_>],
    there: impl IntoIterator<Item = &'a str>,
) -> (Vec<Record>, Vec<Came>) {
    let mut records = Vec::new();
    let mut names = Vec::new();
    for source in in_order(files) {
        let listed = uploads.manifest().map_or(&[][..], |manifest| &manifest.records);
        let excitation = listed
            .iter()
            .find(|entry| entry.file == source.name)
            .map(|entry| &entry.excitation);
        for record in uploads.records(source.name) {
            let mut record = record.clone();
            record.role = source.role;
            if let Some(excitation) = excitation {
                record.excitation.clone_from(excitation);
            }
            records.push(record);
            names.push(source.name);
        }
    }
    name_apart(&mut records, there);
    let came = records
        .iter()
        .zip(names)
        .map(|(record, name)| came_in(book, &record.file, name));
    let came = came.collect();
    (records, came)
}

fn came_in(book: &Book, record: &str, file: &str) -> Came {
    Came {
        record: record.to_owned(),
        file: file.to_owned(),
        asked_by: book.files.get(file).and_then(|file| file.asked_by),
    }
}

fn dataset_of(records: Vec<Record>) -> Dataset {
    Dataset {
        name: "data".to_owned(),
        description: "imported".to_owned(),
        records,
        ..Dataset::default()
    }
}

/// Adds the files that wait and can be used to the data.
pub(crate) fn add_files(app: &Arc<App>) -> Result<(), Refusal> {
    let dataset = app.session().data()?;
    let own = Arc::clone(app);
    jobs::start(app, "adding the recordings", move |progress| {
        progress.at(0.1, "data");
        let (records, came, mut files) = {
            let mut session = own.session();
            session.read_again(|stands| stands == Stands::Waits);
            let waiting = session.uploads.usable(&session.book, |stands| stands == Stands::Waits);
            let there = dataset.records.iter().map(|record| record.file.as_str());
            let (records, came) = imported(&session.uploads, &session.book, &waiting, there);
            let files: Vec<String> = waiting.iter().map(|source| source.name.to_owned()).collect();
            (records, came, files)
        };
        if records.is_empty() {
            return Err(Refusal::unusable("no file waits that could be added"));
        }
        files.push(MANIFEST.to_owned());
        next(&own, &dataset, came, &files, |folder, _| {
            append_records(folder, &records).map_err(Refusal::unusable)
        })
    })
}

/// Uses a record of the data otherwise.
pub(crate) fn change_role(app: &Arc<App>, name: &str, role: Role) -> Result<(), Refusal> {
    let dataset = app.session().data()?;
    let record = dataset.records.iter().find(|record| record.file == name);
    let record = record.ok_or_else(|| {
        Refusal::absent(format!(
            "the data have no record `{}`",
            name.chars().take(80).collect::<String>()
        ))
    })?;
    if record.role == role {
        return Ok(());
    }
    let (own, name) = (Arc::clone(app), name.to_owned());
    jobs::start(app, "changing a role", move |progress| {
        progress.at(0.1, "data");
        next(&own, &dataset, Vec::new(), &[], |folder, generation| {
            let mut manifest = Manifest::read(folder).map_err(Refusal::unusable)?;
            for entry in manifest.records.iter_mut().filter(|entry| entry.file == name) {
                generation
                    .roles
                    .insert(name.clone(), std::mem::replace(&mut entry.role, role));
            }
            manifest.write(folder).map_err(Refusal::unusable)
        })
    })
}

/// Makes the next generation of the data: the records as they are, then `change` in its folder.
fn next(
    app: &App,
    dataset: &Dataset,
    came: Vec<Came>,
    files: &[String],
    change: impl FnOnce(&Path, &mut Generation) -> Result<(), Refusal>,
) -> Result<(), Refusal> {
    let (session, from) = {
        let session = app.session();
        let now = session.book.now().unwrap_or_default();
        (session.folder.clone(), session.data_folder(now))
    };
    let making = folder::fresh(&session)?.join("data");
    // Nothing changes a generation any more, so that a link is as good as a copy; some file systems have none.
    stay(dataset, &from, &making, |file, place| {
        std::fs::hard_link(file, place).or_else(|_| std::fs::copy(file, place).map(drop))
    })?;
    let mut generation = Generation {
        came,
        ..Generation::default()
    };
    change(&making, &mut generation)?;
    generation.data = free_name(&session);
    let place = session.join(&generation.data);
    std::fs::rename(&making, &place).map_err(|error| Refusal::disk(&place, &error))?;
    let grown = uploads::read_native(&place).and_then(|dataset| app.session().grow(generation, files, dataset));
    if grown.is_err() {
        // The book does not name it.
        let _ = std::fs::remove_dir_all(&place);
    }
    grown
}

/// The records of a dataset in another folder, each put there by `put`, and its `dataset.toml`.
pub(crate) fn stay(
    dataset: &Dataset,
    from: &Path,
    to: &Path,
    put: impl Fn(&Path, &Path) -> std::io::Result<()>,
) -> Result<(), Refusal> {
    for record in &dataset.records {
        let place = to.join(&record.file);
        let failed = |error: std::io::Error| Refusal::disk(&place, &error);
        std::fs::create_dir_all(place.parent().unwrap_or(to)).map_err(failed)?;
        let file = if from.is_dir() {
            from.join(&record.file)
        } else {
            from.to_owned()
        };
        put(&file, &place).map_err(failed)?;
    }
    Manifest::of(dataset).write(to).map_err(Refusal::unusable)
}

/// The next `data-N` that is not there.
fn free_name(session: &Path) -> String {
    let mut number = 2;
    while session.join(format!("data-{number}")).exists() {
        number += 1;
    }
    format!("data-{number}")
}
