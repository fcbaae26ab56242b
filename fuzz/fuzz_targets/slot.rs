#![no_main]

//! What lies in a slot of a board's flash: whatever it is, it is refused with a reason or makes a law that the rules allow.

use hysteron_core::tracking_law::PLAYS;
use hysteron_firmware::law::Complete;
use hysteron_firmware::parameters::Parameters;
use hysteron_slot::{Image, check};
use hysteron_table::Table;

const TABLE: &str = include_str!("../../firmware/tables/tracking-8k.toml");

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let table = Table::parse(TABLE).expect("the table of this repository");
    let mut numbers = table.numbers::<PLAYS>();
    let image = Image::of(&numbers);
    if let Ok((_, sweep)) = check(bytes, &image, &mut numbers) {
        let _ = Complete::of(&numbers, &sweep).and_then(|law| Parameters::of(law, &numbers, &sweep));
    }
});
