//! As [`crate::table`], of the second axis; the same table again where the build was not given another.
#![expect(missing_docs, reason = "generated: as `table`")]

include!(concat!(env!("OUT_DIR"), "/table_y.rs"));
