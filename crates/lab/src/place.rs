//! Where controllers are: each step of the ladder has one, and the campaign has one.

use crate::api::number;
use crate::book::Book;
use crate::campaign::{FOLDER, RECORDS};
use crate::controller::Made;
use crate::error::Refusal;
use crate::session::Session;
use crate::work;
use hysteron_identify::Model;
use serde::Deserialize;
use std::collections::HashMap;
use std::path::PathBuf;

/// Whose controller is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Of {
    /// The current step's.
    #[default]
    Step,
    /// That of the campaign's records.
    Campaign,
}

/// The place of a controller in the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// A step's.
    Step(usize),
    /// The campaign's.
    Campaign,
}

/// What a controller is designed from.
pub(crate) enum Origin {
    /// The model of a step.
    Model(Box<Model>),
    /// The dataset in a folder.
    Records(PathBuf),
}

/// What a controller was run on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum On {
    Model,
    Stage,
}

impl Place {
    /// The place that is meant, with something to design from.
    pub(crate) fn of(session: &Session, of: Of) -> Result<Self, Refusal> {
        match of {
            Of::Step => Ok(Self::Step(work::Base::of(session)?.number)),
            Of::Campaign => {
                let complete = session
                    .book
                    .campaign
                    .as_ref()
                    .is_some_and(|campaign| campaign.complete());
                complete.then_some(Self::Campaign).ok_or_else(|| {
                    Refusal::conflict("the campaign is not recorded to its end yet; bring what came back of every pass")
                })
            }
        }
    }

    /// The place that an address names.
    pub(crate) fn asked(parameters: &HashMap<String, String>) -> Result<Self, Refusal> {
        match parameters.get("of").map(String::as_str) {
            Some("campaign") => Ok(Self::Campaign),
            _ => Ok(Self::Step(number(parameters, "step")?)),
        }
    }

    /// What the controller is designed from, and its name in commands.
    pub(crate) fn origin(self, session: &Session) -> Result<(String, Origin), Refusal> {
        match self {
            Self::Step(step) => {
                let name = session.step(step)?.model.clone();
                Ok((name, Origin::Model(Box::new(session.model(step)?))))
            }
            Self::Campaign => Ok((RECORDS.to_owned(), Origin::Records(session.folder.join(RECORDS)))),
        }
    }

    /// The controller's file, as the commands name it.
    pub(crate) fn controller(self) -> String {
        match self {
            Self::Step(step) => format!("controllers/{}.toml", step + 1),
            Self::Campaign => format!("{FOLDER}/controller.toml"),
        }
    }

    /// Its table's file, as the commands name it.
    pub(crate) fn table(self) -> String {
        match self {
            Self::Step(step) => format!("tables/{}.toml", step + 1),
            Self::Campaign => format!("{FOLDER}/table.toml"),
        }
    }

    /// What tells it apart in the name of a download.
    pub(crate) fn mark(self) -> String {
        match self {
            Self::Step(step) => (step + 1).to_string(),
            Self::Campaign => FOLDER.to_owned(),
        }
    }

    /// Whether there is a controller.
    pub(crate) fn has_one(self, book: &Book) -> bool {
        match self {
            Self::Step(step) => book.controllers.contains_key(&step),
            Self::Campaign => book
                .campaign
                .as_ref()
                .is_some_and(|campaign| campaign.controller.is_some()),
        }
    }

    /// Whether there is its table.
    pub(crate) fn has_table(self, book: &Book) -> bool {
        match self {
            Self::Step(step) => book.tables.contains_key(&step),
            Self::Campaign => book.campaign.as_ref().is_some_and(|campaign| campaign.table.is_some()),
        }
    }

    /// Puts a controller there; what was made of the one before goes.
    pub(crate) fn put_controller(self, book: &mut Book, made: Made) {
        match self {
            Self::Step(step) => {
                book.controllers.insert(step, made);
                book.tracked.remove(&step);
                book.on_stage.remove(&step);
                book.tables.remove(&step);
            }
            Self::Campaign => {
                if let Some(campaign) = &mut book.campaign {
                    (campaign.controller, campaign.on_stage, campaign.table) = (Some(made), None, None);
                }
            }
        }
    }

    /// Puts a run of the controller there.
    pub(crate) fn put_run(self, book: &mut Book, on: On, made: Made) {
        match (self, on) {
            (Self::Step(step), On::Model) => drop(book.tracked.insert(step, made)),
            (Self::Step(step), On::Stage) => drop(book.on_stage.insert(step, made)),
            (Self::Campaign, _) => {
                if let Some(campaign) = &mut book.campaign {
                    campaign.on_stage = Some(made);
                }
            }
        }
    }

    /// Puts its table there.
    pub(crate) fn put_table(self, book: &mut Book, made: Made) {
        match self {
            Self::Step(step) => drop(book.tables.insert(step, made)),
            Self::Campaign => {
                if let Some(campaign) = &mut book.campaign {
                    campaign.table = Some(made);
                }
            }
        }
    }
}
