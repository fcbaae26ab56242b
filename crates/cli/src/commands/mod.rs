//! One file a command.

pub(crate) mod add;
pub(crate) mod board;
pub(crate) mod challenge;
pub(crate) mod compare;
pub(crate) mod control;
pub(crate) mod demo;
pub(crate) mod diagnose;
pub(crate) mod example;
pub(crate) mod excitation;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod fit;
pub(crate) mod import;
pub(crate) mod lab;
pub(crate) mod ladder;
pub(crate) mod learn;
pub(crate) mod load;
pub(crate) mod paper;
pub(crate) mod predict;
pub(crate) mod report;
pub(crate) mod simulate;
