//! The constants of the compiled-in parameter table, and the table as the controller takes it; made and checked by the build script,
//! which has run the same constructors on the same numbers, so that they refuse nothing here.
#![expect(
    missing_docs,
    reason = "generated: each constant is the field of its name of hysteron_table::Table"
)]

include!(concat!(env!("OUT_DIR"), "/table.rs"));
