//! Writes what the fuzzers begin with to `corpus/`: valid files, packets and a table of a slot.

#[expect(dead_code, reason = "shared with the tests, which use all of it")]
#[path = "../crates/data/tests/fuzzing/mod.rs"]
mod fuzzing;

use hysteron_board::slots::packed;
use hysteron_firmware::telemetry::{About, order_packet, samples_to_packet};
use hysteron_firmware::upload::Message;
use hysteron_firmware::wire::Order;
use hysteron_table::Table;

const TABLE: &str = include_str!("../firmware/tables/tracking-8k.toml");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for target in fuzzing::TARGETS {
        write(target.name, (target.seeds)())?;
    }
    let packets = [
        About::of("nucleo-h743zi").to_packet().to_vec(),
        order_packet(Order::Start).to_vec(),
        samples_to_packet(9090).to_vec(),
        Message::Begin { length: 1760, sum: 0 }.to_packet().to_vec(),
    ];
    write("wire", packets.to_vec())?;
    write("slot", vec![packed(&Table::parse(TABLE)?, TABLE)?])
}

fn write(target: &str, seeds: Vec<Vec<u8>>) -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target);
    std::fs::create_dir_all(&folder)?;
    for (index, seed) in seeds.into_iter().enumerate() {
        std::fs::write(folder.join(format!("seed-{index}")), seed)?;
    }
    Ok(())
}
