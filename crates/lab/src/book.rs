//! What is on disk in `session.json`: the data as they grew, the models as a tree of steps, the files that were brought.
//!
//! The data are a chain of generations, each a dataset of its own on disk that nothing changes any more: a step names the
//! generation that it was fitted on, so its figures and its command stay true when records come later.

use crate::campaign::Campaign;
use crate::controller::Made;
use crate::error::Refusal;
use crate::folder::write_whole;
use crate::reading::{MANIFEST, Reading, Source, Target, import_command, quoted};
use crate::undo::Changes;
use hysteron_data::{Dataset, Role};
use hysteron_identify::{EffectId, Family};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Version of `session.json`.
const VERSION: u32 = 2;

/// The session as it is written.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Book {
    pub(crate) version: u32,
    /// Grows with every change; a tab that saw an older one is told so.
    pub(crate) revision: u64,
    /// The data as they began and as they grew; the last are the present ones.
    pub(crate) generations: Vec<Generation>,
    /// The steps; a step's number is its place, from 0.
    pub(crate) steps: Vec<Step>,
    /// The step looked at.
    pub(crate) current: Option<usize>,
    /// What `learn` said, by the last step that it made.
    #[serde(default)]
    pub(crate) learned: BTreeMap<usize, String>,
    /// The tables for the firmware that were made, by step.
    pub(crate) tables: BTreeMap<usize, Made>,
    /// The controllers that were designed, by step.
    #[serde(default)]
    pub(crate) controllers: BTreeMap<usize, Made>,
    /// The runs of these controllers on the models of their steps.
    #[serde(default)]
    pub(crate) tracked: BTreeMap<usize, Made>,
    /// Their runs on simulated stages.
    #[serde(default)]
    pub(crate) on_stage: BTreeMap<usize, Made>,
    /// What undo and redo of a change of the data lead to.
    #[serde(default, skip_serializing_if = "Changes::is_empty")]
    pub(crate) changes: Changes,
    /// The files that were brought, by name.
    pub(crate) files: BTreeMap<String, Brought>,
    /// The campaign on a stage of the user's own, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) campaign: Option<Campaign>,
}

/// The data at one time of the session.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct Generation {
    /// Folder of the dataset, as the commands name it.
    pub(crate) data: String,
    /// The command that made it, where there is one.
    pub(crate) command: Option<String>,
    /// The folder or file of the user's own that it is a copy of.
    pub(crate) from: Option<String>,
    /// The records that came with it, where they came in files that were brought.
    pub(crate) came: Vec<Came>,
    /// Records of the generation before that are used otherwise now, with the role that they had.
    pub(crate) roles: BTreeMap<String, Role>,
}

/// Where a record came from.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Came {
    /// Its file in the dataset.
    pub(crate) record: String,
    /// The file that was brought.
    pub(crate) file: String,
    /// The step whose diagnosis asked for it.
    pub(crate) asked_by: Option<usize>,
}

/// A model and how it came about.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Step {
    /// The step it was made from.
    pub(crate) parent: Option<usize>,
    /// The step that redo leads to.
    pub(crate) redo: Option<usize>,
    /// The generation of the data that it was fitted on, and that its figures are of.
    pub(crate) generation: usize,
    /// What was done.
    pub(crate) recipe: Recipe,
    /// `mrpi, 10 plays` or `+ delay`.
    pub(crate) title: String,
    /// What a person calls it instead; empty for nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) named: String,
    /// What a person wrote about it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) note: String,
    /// Its file, as the commands name it.
    pub(crate) model: String,
    /// The command that makes it.
    pub(crate) command: String,
    /// Pooled error on the records it was fitted to, percent of peak to peak.
    pub(crate) identify_percent: Option<f64>,
    /// The same on validation records.
    pub(crate) validate_percent: Option<f64>,
    /// Whether it was taken off the ladder; its model stays in its file.
    #[serde(default)]
    pub(crate) removed: bool,
    /// Each record's error, percent of peak to peak, in the order of the dataset.
    pub(crate) records: Vec<(String, Option<f64>)>,
    /// What the noise alone would leave of each record, percent of peak to peak, in the same order.
    pub(crate) record_noise: Vec<Option<f64>>,
    /// The error that the noise alone would leave, percent of peak to peak, on the records that count.
    pub(crate) noise_percent: Option<f64>,
}

/// What makes a step of the one before: enough to do it again on other data.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Recipe {
    /// A model of the hysteresis alone, as a new root.
    Fit { family: Family, plays: usize },
    /// An effect, added to the model of the parent.
    Add { effect: EffectId },
    /// An effect of the user's own, by the text of its file.
    AddOwn { text: String },
    /// What learning made of the model of the parent in its step of this number, from 1 on.
    Learned { step: usize },
    /// Parameters of the model of the parent, moved by hand.
    Moved { turns: Vec<Turn> },
}

/// A parameter that was moved by hand.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Turn {
    /// Its name, with its effect's before it.
    pub(crate) parameter: String,
    /// Where it stands now.
    pub(crate) to: f64,
}

/// A file that was brought.
#[derive(Debug, Clone, Serialize, Deserialize, PartialEq, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct Brought {
    /// How it is read.
    pub(crate) reading: Reading,
    /// What the person wants its records for; without a word, what its `dataset.toml` says, else to fit.
    pub(crate) role: Option<Role>,
    /// The step whose diagnosis asked for it.
    pub(crate) asked_by: Option<usize>,
    /// Whether the data have it.
    pub(crate) stands: Stands,
}

/// How a file that was brought stands to the data.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, PartialEq, Eq, Default)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Stands {
    /// It waits to be used.
    #[default]
    Waits,
    /// Its records are in the data.
    Taken,
    /// Its records were in data that have ended: it is offered only where one begins anew.
    Aside,
}

/// What came to the data after a step was fitted.
#[derive(Debug, Clone, Serialize, PartialEq, Eq, Default)]
pub(crate) struct Since {
    /// Records that came.
    pub(crate) records: Vec<String>,
    /// Records that have another role.
    pub(crate) roles: Vec<String>,
}

impl Step {
    /// What it is called.
    pub(crate) fn name(&self) -> &str {
        if self.named.is_empty() {
            &self.title
        } else {
            &self.named
        }
    }
}

impl Generation {
    /// Whether it differs in nothing from the one before.
    pub(crate) fn nothing_new(&self) -> bool {
        self.came.is_empty() && self.roles.is_empty()
    }

    /// The command that makes a generation of the one before it, where there is one: a copy, the imports, and in words the roles.
    pub(crate) fn command(
        &self,
        before: &Self,
        files: &BTreeMap<String, Brought>,
        dataset: &Dataset,
    ) -> Option<String> {
        let role = |name: &str| {
            dataset
                .records
                .iter()
                .find(|record| record.file == name)
                .map(|record| record.role)
        };
        let mut sources: Vec<Source<'_>> = Vec::new();
        for came in &self.came {
            let (file, role) = (files.get(&came.file)?, role(&came.record)?);
            match sources.iter().find(|source| source.name == came.file) {
                Some(source) if source.role != role => return None,
                Some(_) => {}
                None => sources.push(Source {
                    name: &came.file,
                    reading: &file.reading,
                    role,
                }),
            }
        }
        let mut command = format!("cp -r {} {}", quoted(&before.data), quoted(&self.data));
        if !sources.is_empty() {
            command.push_str(&format!(" && {}", import_command(&sources, &self.data, Target::There)));
        }
        if !self.roles.is_empty() {
            let changed = |name: &String| Some(format!("{} is to {}", quoted(name), role(name)?.name()));
            let changed: Vec<String> = self.roles.keys().filter_map(changed).collect();
            command.push_str(&format!("    # then, in its dataset.toml, {}", changed.join(", ")));
        }
        Some(command)
    }

    /// Takes over what one brought that it was made of and takes the place of.
    pub(crate) fn take_over(&mut self, before: &Self) {
        for (record, &role) in &before.roles {
            // There are two roles: a second change is the way back.
            if self.roles.remove(record).is_none() {
                self.roles.insert(record.clone(), role);
            }
        }
        self.came.splice(0..0, before.came.iter().cloned());
        let came = &self.came;
        self.roles
            .retain(|record, _| came.iter().all(|came| came.record != *record));
    }
}

impl Default for Book {
    fn default() -> Self {
        Self {
            version: VERSION,
            revision: 0,
            generations: Vec::new(),
            steps: Vec::new(),
            current: None,
            learned: BTreeMap::new(),
            tables: BTreeMap::new(),
            controllers: BTreeMap::new(),
            tracked: BTreeMap::new(),
            on_stage: BTreeMap::new(),
            changes: Changes::default(),
            files: BTreeMap::new(),
            campaign: None,
        }
    }
}

impl Book {
    /// Reads and checks it; nothing where there is no file.
    pub(crate) fn read(file: &Path) -> Result<Option<Self>, String> {
        #[derive(Deserialize)]
        struct Version {
            version: u32,
        }
        let text = match std::fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(format!("session.json: {error}")),
        };
        let broken = |error: serde_json::Error| format!("session.json: {error}; move the file away to begin anew");
        let Version { version } = serde_json::from_str(&text).map_err(broken)?;
        if version != VERSION {
            return Err(format!(
                "session.json is of version {version}, this program reads {VERSION}; give a new folder with --session, or open \
                 this one with the program that wrote it"
            ));
        }
        let book: Self = serde_json::from_str(&text).map_err(broken)?;
        book.check().map(|()| Some(book))
    }

    pub(crate) fn write(&self, file: &Path) -> Result<(), Refusal> {
        let text = serde_json::to_string_pretty(self).map_err(|error| Refusal::disk(file, &error))?;
        write_whole(file, text.as_bytes())
    }

    /// Whether every number in it names something that is there.
    fn check(&self) -> Result<(), String> {
        let count = self.steps.len();
        let there = |number: Option<usize>| number.is_none_or(|number| number < count);
        let sound = there(self.current)
            && self.steps.iter().enumerate().all(|(number, step)| {
                step.parent.is_none_or(|parent| parent < number)
                    && there(step.redo)
                    && step.model == model_name(number)
                    && step.generation < self.generations.len()
                    && step.parent.is_none() == matches!(step.recipe, Recipe::Fit { .. })
            })
            && self
                .tables
                .keys()
                .chain(self.learned.keys())
                .chain(self.controllers.keys())
                .chain(self.tracked.keys())
                .chain(self.on_stage.keys())
                .all(|&number| number < count);
        sound.then_some(()).ok_or_else(|| {
            "session.json names steps or data that are not there; move the file away to begin anew".to_owned()
        })
    }

    /// The folders of the data as they are, were and can be again.
    pub(crate) fn folders(&self) -> BTreeSet<String> {
        let generations = self.generations.iter().map(|generation| &generation.data);
        generations.chain(self.changes.folders()).cloned().collect()
    }

    /// The number of the present generation of the data.
    pub(crate) fn now(&self) -> Option<usize> {
        self.generations.len().checked_sub(1)
    }

    /// The present generation of the data.
    pub(crate) fn data(&self) -> Option<&Generation> {
        self.generations.last()
    }

    /// Whether a step was fitted on the data as they are.
    pub(crate) fn fresh(&self, step: &Step) -> bool {
        Some(step.generation) == self.now()
    }

    /// What came to the data after a step was fitted; nothing where it is on the present ones.
    pub(crate) fn since(&self, step: &Step) -> Option<Since> {
        let later = self.generations.get(step.generation + 1..).unwrap_or_default();
        if later.is_empty() {
            return None;
        }
        let mut since = Since::default();
        for generation in later {
            since
                .records
                .extend(generation.came.iter().map(|came| came.record.clone()));
            for record in generation.roles.keys() {
                if !since.records.contains(record) && !since.roles.contains(record) {
                    since.roles.push(record.clone());
                }
            }
        }
        Some(since)
    }

    /// The file that a record came in, where it came in one.
    pub(crate) fn origin(&self, record: &str) -> Option<&Came> {
        let mut all = self.generations.iter().flat_map(|generation| &generation.came);
        all.find(|came| came.record == record)
    }

    /// A step and all that are made of it.
    pub(crate) fn made_of(&self, number: usize) -> Vec<usize> {
        (0..self.steps.len())
            .filter(|&k| self.way(k).contains(&number))
            .collect()
    }

    /// The steps from the root to a step.
    pub(crate) fn way(&self, number: usize) -> Vec<usize> {
        let mut way = vec![number];
        while let Some(parent) = way.last().and_then(|&at| self.steps.get(at)?.parent) {
            way.push(parent);
        }
        way.reverse();
        way
    }

    /// How a file that comes is read: as all files before it, where they agree.
    pub(crate) fn reading_of_a_new_file(&self) -> Reading {
        let tables = |name: &&String| name.as_str() != MANIFEST;
        let mut readings = self
            .files
            .iter()
            .filter(|(name, _)| tables(name))
            .map(|(_, file)| &file.reading);
        match readings.next() {
            Some(first) if readings.all(|other| other == first) => first.clone(),
            _ => Reading::default(),
        }
    }
}

/// The file of a step's model.
pub(crate) fn model_name(number: usize) -> String {
    format!("models/{}.toml", number + 1)
}

/// The effect file of a step that added an effect of the user's own.
pub(crate) fn effect_name(number: usize) -> String {
    format!("effects/{}.toml", number + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(generation: usize) -> Step {
        Step {
            parent: None,
            redo: None,
            generation,
            recipe: Recipe::Fit {
                family: Family::Pi,
                plays: 3,
            },
            title: String::new(),
            named: String::new(),
            note: String::new(),
            model: model_name(0),
            command: String::new(),
            identify_percent: None,
            validate_percent: None,
            removed: false,
            records: Vec::new(),
            record_noise: Vec::new(),
            noise_percent: None,
        }
    }

    fn grown() -> Book {
        let came = |record: &str| Came {
            record: record.to_owned(),
            file: record.to_owned(),
            asked_by: None,
        };
        let generation = |came: Vec<Came>, roles: &[&str]| Generation {
            data: "data".to_owned(),
            came,
            roles: roles
                .iter()
                .map(|&record| (record.to_owned(), Role::Identify))
                .collect(),
            ..Generation::default()
        };
        Book {
            generations: vec![
                generation(vec![came("a.csv")], &[]),
                generation(vec![came("b.csv")], &[]),
                generation(Vec::new(), &["a.csv", "b.csv"]),
            ],
            ..Book::default()
        }
    }

    #[test]
    fn val_a_step_knows_what_came_after_it() {
        let book = grown();
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let first = book.since(&step(0)).unwrap();
        // A record that came after it and changed its role is new, and that is all there is to say of it.
        assert_eq!((first.records, first.roles), (names(&["b.csv"]), names(&["a.csv"])));
        let second = book.since(&step(1)).unwrap();
        assert_eq!((second.records, second.roles), (names(&[]), names(&["a.csv", "b.csv"])));
        assert_eq!(book.since(&step(2)), None);
        assert!(book.fresh(&step(2)) && !book.fresh(&step(1)));
    }

    #[test]
    fn val_a_generation_that_no_step_needs_goes_into_the_next() {
        let [_, came, _] = <[Generation; 3]>::try_from(grown().generations).unwrap();
        let roles = |records: &[&str]| Generation {
            roles: records
                .iter()
                .map(|&record| (record.to_owned(), Role::Identify))
                .collect(),
            ..Generation::default()
        };
        let after = |before: &Generation, next: &[&str]| {
            let mut next = roles(next);
            next.take_over(before);
            next
        };
        // The record that came has its role from the beginning; another one's change counts.
        let both = after(&came, &["a.csv", "b.csv"]);
        assert_eq!(
            (both.came.len(), both.roles.keys().collect::<Vec<_>>()),
            (1, vec![&"a.csv".to_owned()])
        );
        // There and back is no change, there alone is one.
        assert!(after(&roles(&["a.csv"]), &["a.csv"]).nothing_new());
        assert_eq!(after(&roles(&["a.csv"]), &["c.csv"]).roles.len(), 2);
    }

    #[test]
    fn refuse_a_book_whose_numbers_name_nothing() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("session.json");
        let mut book = grown();
        book.steps.push(step(2));
        book.write(&file).unwrap();
        assert_eq!(Book::read(&file).unwrap(), Some(book.clone()));
        book.steps[0].generation = 3;
        book.write(&file).unwrap();
        assert!(Book::read(&file).unwrap_err().contains("not there"));
        std::fs::write(&file, r#"{"version": 1, "steps": []}"#).unwrap();
        assert!(
            Book::read(&file)
                .unwrap_err()
                .starts_with("session.json is of version 1")
        );
    }

    #[test]
    fn val_a_new_file_is_read_as_those_before_where_they_agree() {
        let mut book = Book::default();
        let scope = Reading {
            columns: vec!["voltage=CH1:mV*20".to_owned()],
            ..Reading::default()
        };
        let brought = |reading: &Reading| Brought {
            reading: reading.clone(),
            ..Brought::default()
        };
        assert_eq!(book.reading_of_a_new_file(), Reading::default());
        book.files.insert("a.csv".to_owned(), brought(&scope));
        book.files.insert("dataset.toml".to_owned(), Brought::default());
        assert_eq!(book.reading_of_a_new_file(), scope);
        book.files.insert("b.csv".to_owned(), Brought::default());
        assert_eq!(book.reading_of_a_new_file(), Reading::default());
    }
}
