//! One file a command.

pub(crate) mod compare;
pub(crate) mod fit;
pub(crate) mod import;
pub(crate) mod load;
