//! Numbers and records to pages and pictures; computes nothing but what drawing needs: scales, ticks, decimation.
//!
//! A [`Page`] is one self-contained HTML file: one inline stylesheet, pictures as inline SVG, no script, no outside host,
//! light and dark by the reader's preference, printable. The same input gives the same bytes.
#![forbid(unsafe_code)]

mod axis;
mod canvas;
mod closeup;
mod comparison_page;
mod decimate;
pub mod figures;
mod headline;
mod ladder_page;
mod number;
mod page;
mod palette;
mod panel;
mod record_pictures;
mod table;

pub use canvas::{LegendEntry, Picture, Size, Swatch};
pub use comparison_page::{Context, comparison_page};
pub use ladder_page::ladder_page;
pub use number::{count, significant};
pub use page::{Block, Figure, Page, Section, Tile};
pub use palette::Ink;
pub use table::{Cell, PaperFigure, Table, paper_table};
