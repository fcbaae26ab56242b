#![no_main]

//! What a board and its host send: no panic of either side, and a packet that is found is the one that its contents make.

use hysteron_board::telemetry::Collector;
use hysteron_firmware::telemetry::{Found, Requests, find, samples_to_packet};
use hysteron_firmware::upload::{Answer, Messages};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (mut requests, mut messages) = (Requests::default(), Messages::default());
    for &byte in bytes {
        requests.push(byte);
        messages.push(byte);
    }
    match find(bytes) {
        Found::Sample(sample) => assert!(bytes.starts_with(&sample.to_packet())),
        Found::SamplesTo(port) => assert!(bytes.starts_with(&samples_to_packet(port))),
        Found::Answer => {
            let answer = bytes.first_chunk().and_then(Answer::from_packet);
            let _ = answer.map(|answer| answer.to_string());
        }
        // An order may be none; a description may hold a flag of another value than 0 and 1.
        Found::Order(_) | Found::About(_) | Found::Incomplete | Found::Nothing => {}
    }
    for axis in 0..2 {
        let mut collector = Collector::of_axis(axis);
        if bytes.chunks(100).try_for_each(|chunk| collector.push(chunk)).is_ok() {
            let _ = collector.finish();
        }
    }
});
