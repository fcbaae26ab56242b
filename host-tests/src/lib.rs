//! Helpers shared by the tests across crates.

pub mod hidden;
pub mod users;
