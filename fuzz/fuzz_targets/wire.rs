#![no_main]

//! What a board and its host send: no panic of either side, and a packet that is found is the one that its contents make.

use hysteron_board::telemetry::Collector;
use hysteron_firmware::telemetry::{Found, Requests, find, order_packet, samples_to_packet};
use hysteron_firmware::upload::{Answer, Messages};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (mut requests, mut messages) = (Requests::default(), Messages::default());
    for &byte in bytes {
        requests.push(byte);
        messages.push(byte);
    }
    let made = match find(bytes) {
        Found::Sample(sample) => sample.to_packet().to_vec(),
        Found::Order(order) => order_packet(order).to_vec(),
        Found::SamplesTo(port) => samples_to_packet(port).to_vec(),
        Found::Answer => {
            let answer = bytes.first_chunk().and_then(Answer::from_packet);
            answer.map_or_else(Vec::new, |answer| answer.to_string().into_bytes());
            Vec::new()
        }
        // A description may hold a flag of another value than 0 and 1; an order may be none.
        Found::About(_) | Found::Incomplete | Found::Nothing => Vec::new(),
    };
    if let Found::Sample(_) | Found::SamplesTo(_) = find(bytes) {
        assert!(bytes.starts_with(&made));
    }
    for axis in 0..2 {
        let mut collector = Collector::of_axis(axis);
        if bytes.chunks(100).try_for_each(|chunk| collector.push(chunk)).is_ok() {
            let _ = collector.finish();
        }
    }
});
