//! The session: data, models as a tree of steps, and the folder that holds them.
//!
//! The folder is written so that the command line opens it: `data/` is a dataset, and `data-2/` the same dataset once it has
//! grown; `models/N.toml` are models, and every step carries the command that does the same when typed in the folder.

use crate::book::{Book, Generation, Recipe, Stands, Step, effect_name, model_name};
use crate::campaign;
use crate::error::{LabError, Refusal};
use crate::folder::{RESULTS, finish_taking, nothing_else_in, write_whole};
use crate::hand::InHand;
use crate::reading::quoted;
use crate::uploads::{self, Uploads};
use hysteron_data::Dataset;
use hysteron_diagnose::{Comparison, RecordComparison};
use hysteron_identify::Model;
use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Comparisons held in memory: the one looked at, the one before, and one to set beside them.
const COMPARISONS: usize = 3;

/// Everything the server knows, behind one lock.
pub(crate) struct Session {
    pub(crate) folder: PathBuf,
    pub(crate) book: Book,
    pub(crate) uploads: Uploads,
    /// The present data.
    pub(crate) dataset: Option<Arc<Dataset>>,
    /// What the page shows of their records.
    pub(crate) shown: Vec<serde_json::Value>,
    /// What is to be said of the data the session began with, as they are now.
    pub(crate) notices: Vec<String>,
    /// Data as they were, for the step that was looked at last.
    earlier: Option<(usize, Arc<Dataset>)>,
    /// The model whose parameters are moved, with its step.
    pub(crate) in_hand: Option<(usize, Arc<InHand>)>,
    comparisons: VecDeque<(usize, Arc<Comparison>)>,
    /// Held as long as the server runs: two servers on one folder would overwrite each other.
    _lock: File,
}

impl Session {
    /// Opens a folder, new or used.
    pub(crate) fn open(folder: &Path) -> Result<Self, LabError> {
        let failed = |reason: String| LabError::Session {
            folder: folder.display().to_string(),
            reason,
        };
        let file = folder.join("session.json");
        if !file.exists() && !folder.join("fresh/session.json").exists() {
            nothing_else_in(folder).map_err(failed)?;
        }
        for part in RESULTS.into_iter().chain(["uploads"]) {
            std::fs::create_dir_all(folder.join(part)).map_err(|error| failed(error.to_string()))?;
        }
        let lock = File::create(folder.join(".lock")).map_err(|error| failed(error.to_string()))?;
        lock.try_lock()
            .map_err(|_| failed("another `hysteron lab` has it open; use that one or give --session".to_owned()))?;
        finish_taking(folder).map_err(|refusal| failed(refusal.message))?;
        let mut book = Book::read(&file).map_err(failed)?.unwrap_or_default();
        let uploads = Uploads::open(&folder.join("uploads"), &book.files);
        // The folder says which files there are: one may have come in just before the program ended.
        book.files
            .retain(|name, _| uploads.files.iter().any(|file| file.name == *name));
        for file in &uploads.files {
            book.files.entry(file.name.clone()).or_default();
        }
        let mut session = Self {
            folder: folder.to_owned(),
            uploads,
            book,
            dataset: None,
            shown: Vec::new(),
            notices: Vec::new(),
            earlier: None,
            in_hand: None,
            comparisons: VecDeque::new(),
            _lock: lock,
        };
        campaign::still_there(&mut session);
        if !file.exists() {
            session.save().map_err(|refusal| failed(refusal.message))?;
        }
        if let Some(generation) = session.book.data() {
            let dataset = hysteron_data::read_dataset(&folder.join(&generation.data))?;
            session.shown = dataset.records.iter().map(crate::state::record).collect();
            session.dataset = Some(Arc::new(dataset));
            session.uploads.let_go(&session.book);
        }
        Ok(session)
    }

    /// Writes the book as a whole, one revision on.
    pub(crate) fn save(&mut self) -> Result<(), Refusal> {
        self.book.revision += 1;
        self.book.write(&self.folder.join("session.json"))
    }

    /// Begins with a dataset; steps on other data end. Where the fresh folder has data, they become the session's `data`. A server
    /// that ends in the midst of it leaves the session as it was or as it will be: the next one finishes.
    pub(crate) fn begin(&mut self, first: Generation, files: &[String], dataset: Dataset) -> Result<(), Refusal> {
        let mut book = Book {
            revision: self.book.revision + 1,
            generations: vec![first],
            files: self.book.files.clone(),
            // A campaign is of the stage, not of the data.
            campaign: self.book.campaign.clone(),
            ..Book::default()
        };
        for (name, file) in &mut book.files {
            file.stands = match file.stands {
                _ if files.contains(name) => Stands::Taken,
                Stands::Taken | Stands::Aside => Stands::Aside,
                Stands::Waits => Stands::Waits,
            };
            file.asked_by = None;
        }
        book.write(&self.folder.join("fresh/session.json"))?;
        finish_taking(&self.folder)?;
        self.book = book;
        self.uploads.let_go(&self.book);
        self.comparisons.clear();
        self.earlier = None;
        self.in_hand = None;
        self.shown = dataset.records.iter().map(crate::state::record).collect();
        self.dataset = Some(Arc::new(dataset));
        Ok(())
    }

    /// Goes on with the data as they have grown; they lie in their folder already. Steps stay, and stay on the data that they
    /// were fitted on. A generation that no step was fitted on gives way to the new one; undo leads back to it.
    pub(crate) fn grow(&mut self, mut next: Generation, files: &[String], dataset: Dataset) -> Result<(), Refusal> {
        let mut book = self.book.clone();
        let tail = book.take_tail();
        if let Some(before) = &tail {
            next.take_over(before);
        }
        for name in files {
            if let Some(file) = book.files.get_mut(name) {
                file.stands = Stands::Taken;
            }
        }
        book.changes_from(tail);
        let mut gone = None;
        if next.nothing_new() {
            gone = Some(self.folder.join(&next.data));
        } else {
            let before = book.data();
            next.command = before.and_then(|before| next.command(before, &book.files, &dataset));
            book.generations.push(next);
        }
        self.go_on(book, dataset)?;
        if let Some(folder) = gone {
            // The book does not name it; where it cannot be removed it does no harm.
            let _ = std::fs::remove_dir_all(folder);
        }
        Ok(())
    }

    /// Goes on with another state of the same data, as the book has it.
    pub(crate) fn go_on(&mut self, mut book: Book, dataset: Dataset) -> Result<(), Refusal> {
        let now = self.book.now().unwrap_or_default();
        let fitted = self.book.steps.iter().any(|step| step.generation == now);
        book.revision = self.book.revision + 1;
        self.take_book(book)?;
        self.uploads.let_go(&self.book);
        // To find a record's period takes a transform of it: what is known of those that were there stays.
        self.shown.truncate(dataset.records.len());
        for (shown, record) in self.shown.iter_mut().zip(&dataset.records) {
            shown["role"] = serde_json::json!(record.role);
        }
        let new = dataset.records.iter().skip(self.shown.len());
        self.shown.extend(new.map(crate::state::record));
        let before = self.dataset.replace(Arc::new(dataset));
        self.earlier = before.filter(|_| fitted).map(|dataset| (now, dataset));
        Ok(())
    }

    /// Writes another book and goes on with it; data that it does not name any more end.
    fn take_book(&mut self, book: Book) -> Result<(), Refusal> {
        book.write(&self.folder.join("session.json"))?;
        let before = std::mem::replace(&mut self.book, book);
        let named = self.book.folders();
        for folder in before.folders().difference(&named) {
            // Where it cannot be removed it does no harm.
            let _ = std::fs::remove_dir_all(self.folder.join(folder));
        }
        Ok(())
    }

    /// Appends models as steps, each made of the one before it, and makes the last the current one; all of them or none.
    pub(crate) fn take_steps(&mut self, parent: Option<usize>, fitted: Vec<Fitted>) -> Result<(), Refusal> {
        let generation = self.book.now().unwrap_or_default();
        let mut book = self.book.clone();
        let mut parent = parent;
        let mut comparisons = Vec::new();
        // `learn` leaves the model of its last step.
        let is_learned = |one: &Fitted| matches!(one.recipe, Recipe::Learned { .. });
        let last_learned = book.steps.len() + fitted.iter().rposition(is_learned).unwrap_or_default();
        for one in fitted {
            let number = book.steps.len();
            let file = model_name(number);
            one.model.write(&self.folder.join(&file)).map_err(Refusal::unusable)?;
            let data = self.data_word(generation);
            let command = match &one.recipe {
                Recipe::Fit { family, plays } => {
                    format!(
                        "hysteron fit {data} --model {} --plays {plays} -o {file}",
                        family.name()
                    )
                }
                Recipe::Add { effect } => {
                    let before = model_name(parent.unwrap_or_default());
                    format!("hysteron add {effect} {data} {before} -o {file}")
                }
                Recipe::AddOwn { text } => {
                    let (own, before) = (effect_name(number), model_name(parent.unwrap_or_default()));
                    write_whole(&self.folder.join(&own), text.as_bytes())?;
                    format!("hysteron add ./{own} {data} {before} -o {file}")
                }
                Recipe::Learned { .. } => learn_command(&book, parent, &data, last_learned),
                Recipe::Moved { .. } => {
                    let before = model_name(parent.unwrap_or_default());
                    let said = one.said.as_deref().unwrap_or_default();
                    format!("cp {before} {file}    # then, in it, {said}")
                }
            };
            let is_moved = matches!(one.recipe, Recipe::Moved { .. });
            let made_of = if matches!(one.recipe, Recipe::Fit { .. }) {
                None
            } else {
                parent
            };
            book.steps.push(step(
                (made_of, number, generation),
                (one.recipe, one.title),
                command,
                &one.comparison,
            ));
            book.learned
                .extend(one.said.filter(|_| !is_moved).map(|said| (number, said)));
            if let Some(parent) = made_of {
                book.steps[parent].redo = Some(number);
            }
            parent = Some(number);
            comparisons.push((number, one.comparison));
        }
        book.current = parent;
        book.settle();
        book.revision += 1;
        self.take_book(book)?;
        for (number, comparison) in comparisons {
            self.remember(number, Arc::new(comparison));
        }
        Ok(())
    }

    /// Reads the files anew whose samples were let go and that are wanted again.
    pub(crate) fn read_again(&mut self, which: impl Fn(Stands) -> bool) {
        self.uploads.read_again(&self.book, which);
    }

    /// The model of a step.
    pub(crate) fn model(&self, number: usize) -> Result<Model, Refusal> {
        Model::read(&self.folder.join(&self.step(number)?.model)).map_err(Refusal::unusable)
    }

    /// A step by its number.
    pub(crate) fn step(&self, number: usize) -> Result<&Step, Refusal> {
        self.book.steps.get(number).ok_or_else(|| {
            Refusal::absent(format!(
                "there is no step {number}; the session has {}",
                self.book.steps.len()
            ))
        })
    }

    /// The present data.
    pub(crate) fn data(&self) -> Result<Arc<Dataset>, Refusal> {
        self.dataset
            .clone()
            .ok_or_else(|| Refusal::conflict("there are no recordings yet; bring some first"))
    }

    /// The data that a step was fitted on.
    pub(crate) fn data_of(&mut self, number: usize) -> Result<Arc<Dataset>, Refusal> {
        let step = self.step(number)?;
        let generation = step.generation;
        if self.book.fresh(step) {
            return self.data();
        }
        if let Some((_, dataset)) = self.earlier.as_ref().filter(|earlier| earlier.0 == generation) {
            return Ok(Arc::clone(dataset));
        }
        let dataset = Arc::new(uploads::read_native(&self.data_folder(generation))?);
        self.earlier = Some((generation, Arc::clone(&dataset)));
        Ok(dataset)
    }

    /// The folder of a generation of the data.
    pub(crate) fn data_folder(&self, generation: usize) -> PathBuf {
        let data = self
            .book
            .generations
            .get(generation)
            .map_or("data", |generation| &generation.data);
        self.folder.join(data)
    }

    /// The same as a command names it.
    pub(crate) fn data_word(&self, generation: usize) -> String {
        quoted(
            self.book
                .generations
                .get(generation)
                .map_or("data", |generation| &generation.data),
        )
    }

    /// A comparison still in memory.
    pub(crate) fn remembered(&self, number: usize) -> Option<Arc<Comparison>> {
        self.comparisons
            .iter()
            .find(|c| c.0 == number)
            .map(|c| Arc::clone(&c.1))
    }

    /// Keeps a comparison, and lets the oldest go.
    pub(crate) fn remember(&mut self, number: usize, comparison: Arc<Comparison>) {
        self.comparisons.retain(|c| c.0 != number);
        self.comparisons.push_back((number, comparison));
        while self.comparisons.len() > COMPARISONS {
            self.comparisons.pop_front();
        }
    }

    /// Where a step's diagnosis is kept.
    pub(crate) fn diagnosis_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}.json"))
    }

    /// Where is kept what the candidates of a step's diagnosis do to the data.
    pub(crate) fn signatures_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}-signatures.json"))
    }

    /// Where a step's report is kept.
    pub(crate) fn report_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("reports/{}.html", number + 1))
    }

    /// Where the voltage of the record to take next is kept.
    pub(crate) fn next_record_file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("diagnoses/{number}-next.csv"))
    }
}

/// A model that was fitted and compared, not a step yet.
pub(crate) struct Fitted {
    pub(crate) recipe: Recipe,
    /// What the page calls the step.
    pub(crate) title: String,
    pub(crate) model: Model,
    /// What `learn` said, of its last step; of a step moved by hand what was moved.
    pub(crate) said: Option<String>,
    pub(crate) comparison: Comparison,
}

/// The command that learns a model and leaves it in the file of the last step.
fn learn_command(book: &Book, parent: Option<usize>, data: &str, last: usize) -> String {
    let root = parent.and_then(|parent| book.way(parent).first().copied());
    let Some(Recipe::Fit { family, plays }) = root.map(|root| book.steps[root].recipe.clone()) else {
        return String::new();
    };
    let file = model_name(last);
    format!(
        "hysteron learn {data} --model {} --plays {plays} -o {file}",
        family.name()
    )
}

/// A step with the figures of its comparison.
fn step(
    (parent, number, generation): (Option<usize>, usize, usize),
    (recipe, title): (Recipe, String),
    command: String,
    comparison: &Comparison,
) -> Step {
    let records = || comparison.records.iter();
    Step {
        parent,
        redo: None,
        generation,
        recipe,
        title,
        named: String::new(),
        note: String::new(),
        model: model_name(number),
        command,
        identify_percent: comparison.identify.map(|pooled| pooled.nrmse_percent),
        validate_percent: comparison.validate.map(|pooled| pooled.nrmse_percent),
        removed: false,
        records: records().map(|r| (r.file.clone(), r.nrmse_percent)).collect(),
        record_noise: records().map(|r| noise_of(r, comparison.noise_rms_um)).collect(),
        noise_percent: noise_percent(comparison),
    }
}

/// The noise in percent of each record's peak to peak, pooled like the errors that count.
fn noise_percent(comparison: &Comparison) -> Option<f64> {
    let pool = |role| {
        let squares: Vec<f64> = comparison
            .records
            .iter()
            .filter(|record| record.role == role)
            .filter_map(|record| Some(noise_of(record, comparison.noise_rms_um)?.powi(2)))
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    pool(hysteron_data::Role::Validate).or_else(|| pool(hysteron_data::Role::Identify))
}

/// The noise in percent of a record's peak to peak; nothing where it does not move.
fn noise_of(record: &RecordComparison, noise_rms: f64) -> Option<f64> {
    let percent = record.nrmse_percent?;
    (record.rms_um > 0.0).then(|| percent * noise_rms / record.rms_um)
}
