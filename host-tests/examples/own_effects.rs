//! Hidden effects outside of the catalogue, and effect files that describe them: `cargo run --release -p host-tests --example own_effects`.
#![expect(clippy::print_stdout, reason = "an example prints")]

use host_tests::hidden::generate;
use host_tests::hidden::own::{self, Subject};
use hysteron_plant::challenge::{Asked, Spec, StageFamily, Strength};

fn main() {
    let families: Vec<_> = StageFamily::ALL.into_iter().filter(|f| f.is_play_class()).collect();
    let count: u64 = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(4);
    for subject in [Subject::Ripple, Subject::ForgetfulPlays] {
        for k in 0..count {
            for hidden in [true, false] {
                let spec = Spec {
                    hidden: if hidden {
                        vec![Asked {
                            effect: subject.hidden(),
                            strength: Strength::Strong,
                        }]
                    } else {
                        Vec::new()
                    },
                    family: Some(families[k as usize % families.len()]),
                    noise_seed: 0,
                };
                match generate(900 + k, &spec) {
                    Ok(example) => println!(
                        "{subject:?} {hidden} {:?} {:#?}",
                        example.truth.hidden,
                        own::answers(&example, subject, hidden)
                    ),
                    Err(error) => println!("{error}"),
                }
            }
        }
    }
}
