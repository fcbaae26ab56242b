//! Helpers shared by the tests across crates.

pub mod benchmark;
pub mod foreign;
pub mod hidden;
pub mod odds;
pub mod stored;
pub mod users;
