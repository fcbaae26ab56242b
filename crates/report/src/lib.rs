//! Numbers and records to pages and pictures; computes nothing but what drawing needs: scales, ticks, decimation.
//!
//! A [`Page`] is one self-contained HTML file: one inline stylesheet, pictures as inline SVG, no script, no outside host,
//! light and dark by the reader's preference, printable. The same input gives the same bytes.
#![forbid(unsafe_code)]

mod axis;
mod canvas;
mod closeup;
mod comparison_page;
pub mod decimate;
mod diagnosis_page;
mod diagnosis_part;
mod diagnosis_words;
mod equation;
pub mod figures;
mod headline;
mod ladder_page;
mod lights;
mod lock_words;
mod number;
mod options;
mod page;
mod palette;
mod panel;
mod provenance;
mod record_pictures;
mod report_page;
mod table;
mod text;

pub use canvas::{LegendEntry, Picture, Size, Swatch};
pub use comparison_page::{Context, comparison_page};
pub use diagnosis_page::diagnosis_page;
pub use diagnosis_words::{OddsWords, diagnosis_lines, odds_in_words, reason_in_words, verdict_sentence};
pub use equation::equation;
pub use headline::headline;
pub use ladder_page::ladder_page;
pub use lights::{Light, Shine, design_lights};
pub use lock_words::{failing_lines, lock_in_words};
pub use number::{count, significant};
pub use options::option;
pub use page::{Block, Figure, Page, Section, Tile};
pub use palette::Ink;
pub use provenance::{facts, frozen, hashes};
pub use report_page::{Findings, report_page};
pub use table::{Cell, PaperFigure, Table, paper_table};
pub use text::{
    Runs, adapted_line, adapted_text, amounts, beyond_text, bounds_text, came_back_text, comparison_text, design_text,
    diagnosis_details, diagnosis_text, explanation, ladder_details, ladder_text, law_table_text, learned_text,
    misfit_text, model_text, records_text, reference_name, tracked_text,
};
