//! Hidden effects outside of the catalogue, and effect files that describe them:
//! `cargo run --release -p host-tests --example own_effects [CASES]`.
#![expect(clippy::print_stdout, reason = "an example prints")]

use host_tests::hidden::own::{Subject, answers};
use host_tests::hidden::{Example, generate};
use hysteron_plant::challenge::{Spec, StageFamily, Strength};

fn main() {
    let argument = |n: usize| std::env::args().nth(n).and_then(|text| text.parse::<u64>().ok());
    let (count, first) = (argument(1).unwrap_or(4), argument(2).unwrap_or(0));
    let families = StageFamily::ALL.into_iter().filter(|family| family.is_play_class());
    for (k, family) in (first..first + count).zip(families.cycle().skip(first as usize % 4)) {
        for subject in [Subject::Ripple, Subject::ForgetfulPlays] {
            for hidden in [true, false] {
                let spec = Spec {
                    family: Some(family),
                    ..if hidden {
                        Spec::one(subject.hidden(), Strength::Strong)
                    } else {
                        Spec::default()
                    }
                };
                match generate(900 + k, &spec) {
                    Ok(example) => tell(&example, subject),
                    Err(error) => println!("{error}"),
                }
            }
        }
    }
}

fn tell(example: &Example, subject: Subject) {
    let truth = &example.truth;
    let hidden = truth
        .hidden
        .first()
        .map(|hidden| (hidden.contribution_percent, &hidden.parameters));
    println!(
        "seed {} {subject:?} {} {hidden:?} from {}",
        truth.seed,
        truth.family.name(),
        example.start
    );
    println!("  {:?}", answers(example, subject, true));
}
