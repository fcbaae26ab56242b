//! Pages that commands write: accessible, as those of the workbench are.

use crate::browser::{Browser, there};
use crate::way::in_browser;
use std::path::Path;

/// Runs a command in a folder.
fn run(folder: &Path, words: &str) {
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(words.split(' '))
        .assert()
        .success();
}

#[test]
fn val_each_page_that_a_command_writes_is_accessible() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let commands = [
        "example scope -o capture",
        "import capture/slow.csv --validate capture/mixed.csv --column voltage=CH1:V*10 --column position=CH2:um*2 -o stage",
        "fit stage --model mpi --plays 4 -o first.toml",
        "compare stage first.toml -o compare.html",
        "explain delay -o delay.html",
        "explain creep stage first.toml -o creep.html",
        "add first-order-lag stage first.toml -o model.toml",
        "ladder model.toml -o ladder.html",
        "report stage model.toml -o report.html",
        "diagnose stage first.toml --page missing.html",
        "design model.toml -o controller.toml",
        "track controller.toml --stage paper-rate --alone -o track.html",
    ];
    for words in commands {
        run(folder.path(), words);
    }
    let mut pages: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|kind| kind == "html"))
        .collect();
    pages.sort();
    assert_eq!(pages.len(), 7, "{pages:?}");
    in_browser(async {
        for dark in [false, true] {
            let browser = Browser::open("about:blank", dark).await;
            for page in &pages {
                browser
                    .client
                    .goto(&format!("file://{}", page.display()))
                    .await
                    .unwrap();
                let name = page.file_stem().unwrap().to_string_lossy();
                browser
                    .picture(&format!("page-{name}-{}", if dark { "dark" } else { "light" }))
                    .await;
                browser.accessible(&name).await;
            }
            browser.close().await;
        }
    });
}
