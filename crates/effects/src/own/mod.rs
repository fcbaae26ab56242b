//! Effects of the user's own, from effect files; see `docs/effect-files.md`.

mod expression;
mod fault;
mod parser;
mod user;
mod user_file;
mod user_states;

pub use user::UserEffect;
