//! Writes the valid files that the fuzzers begin with to `corpus/`.

#[expect(dead_code, reason = "shared with the tests, which use all of it")]
#[path = "../crates/data/tests/fuzzing/mod.rs"]
mod fuzzing;

fn main() -> std::io::Result<()> {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in fuzzing::TARGETS {
        let folder = corpus.join(target.name);
        std::fs::create_dir_all(&folder)?;
        for (index, seed) in (target.seeds)().into_iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{index}")), seed)?;
        }
    }
    Ok(())
}
