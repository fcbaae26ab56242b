//! The practice cases beside the project against their truth: verdict, set, error on the records held out before and after `learn`.
//!
//! `cargo run --release -p host-tests --example practice -- [users|practice] [NN]`
#![expect(clippy::print_stdout, reason = "an example of the command line")]

use host_tests::users::practice::{Scored, folder, read, score};
use host_tests::users::score::Grade;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let which = match words.next().as_deref() {
        None | Some("users") => "practice-users",
        Some("practice") => "practice",
        Some(other) => return Err(format!("`{other}` is neither users nor practice").into()),
    };
    let only = words.next();
    let Some(folder) = folder(which) else {
        println!("../shared/data/{which} is absent: nothing to score");
        return Ok(());
    };
    let mut truths: Vec<_> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    truths.retain(|path| path.to_string_lossy().ends_with(".truth.json"));
    truths.sort();
    println!("| case | recorded as | hidden | said | starred | right | held out before -> after | learned | seconds |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let (mut right, mut wrong, mut fell, mut rose, mut all) = (0, 0, 0, 0, 0);
    for truth in truths {
        let files = read(&truth)?;
        if only.as_ref().is_some_and(|only| !files.name.ends_with(only)) {
            continue;
        }
        let scored = score(&files)?;
        all += 1;
        right += usize::from(scored.grade == Grade::Right);
        wrong += usize::from(scored.grade == Grade::Wrong);
        if let Some([before, after]) = scored.held_percent {
            fell += usize::from(after < 0.99 * before);
            rose += usize::from(after > 1.001 * before);
        }
        println!(
            "| {} | {} | {} | {}",
            files.name,
            files.recorded_as,
            files.effects.join(" + "),
            row(&scored)
        );
    }
    println!(
        "\n{all} cases: {right} right, {wrong} wrong alone; held out, the error falls on {fell} and rises on {rose}."
    );
    Ok(())
}

fn row(scored: &Scored) -> String {
    let said = &scored.said;
    let held = scored
        .held_percent
        .map_or(String::new(), |[before, after]| format!("{before:.3} -> {after:.3} %"));
    format!(
        "{} [{}] + [{}] | {} | {:?} | {held} | {} | {:.1} + {:.1} |",
        said.verdict,
        said.also_possible.join(", "),
        said.further.join(", "),
        said.starred.join(", "),
        scored.grade,
        scored.learned.join(", "),
        scored.took_s[0],
        scored.took_s[1]
    )
}
