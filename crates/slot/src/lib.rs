//! The parameter table as plain numbers: its rules, its bytes, and its two slots in a board's flash.
//!
//! `hysteron export`, the firmware's build and the board all check a table here and nowhere else.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod bytes;
mod chain_rules;
mod image;
mod inverse;
pub mod model;
mod numbers;
mod refusal;
mod rules;
mod short;
mod slots;
mod supervision;
mod words;

pub use bytes::{
    HEADER_BYTES, Header, MAGIC, MOST_BYTES, VERSION, bytes_of, checked_sum, decode, encode, most_bytes, seal, sum,
};
pub use image::Image;
pub use inverse::Inverse;
pub use numbers::{Chain, Covered, Family, Numbers, first};
pub use refusal::{Refusal, Rule};
pub use rules::{CORNERS_ABOVE, MOST_PLAYS, Sweep};
pub use short::short;
pub use slots::{Chosen, SLOTS, Slots, Verdict, check};
pub use supervision::LEAST_TRUST;
