//! The workbench as people meet it: in a real browser; as strangers meet it: refused.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot set up its files fails"
)]

mod board;
mod bring;
mod browser;
mod campaign;
mod commands;
mod controller;
mod grow;
mod hand;
mod hostile;
mod learn;
mod own;
#[path = "../own_bench/mod.rs"]
mod own_bench;
mod pictures;
mod projects;
mod same;
mod server;
#[path = "../small_board/mod.rs"]
mod small_board;
mod tour;
mod way;
