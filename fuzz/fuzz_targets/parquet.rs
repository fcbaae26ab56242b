#![no_main]

#[expect(dead_code, reason = "shared with the tests, which use all of it")]
#[path = "../../crates/data/tests/fuzzing/mod.rs"]
mod fuzzing;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| (fuzzing::TARGETS[12].run)(bytes));
