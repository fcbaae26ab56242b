//! An effect of one's own, written on the page: what is wrong is shown at its place, the text outlives the program, and what is fitted
//! is what the command line fits.

use crate::browser::{Browser, there};
use crate::campaign;
use crate::server::Server;
use crate::way::in_browser;
use serde_json::json;
use std::path::Path;

/// A lag that says `y` where it means `z`.
const WRONG: &str = r#"# The amplifier, as I think of it: µs.
name = "my-lag"
place = "amplifier"
summary = "The amplifier charges the stack through a resistance."
output = "z"

[[parameter]]
name = "tau"
unit = "s"
what = "time constant"
min = 1e-6
max = 1e-2

[[state]]
name = "z"
at_rest = "u"
rate = "(u - y) / tau"
"#;

fn typed(session: &Path, words: &str) -> (i32, String) {
    let output = campaign::typed(session, words);
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    (output.status.code().unwrap(), text)
}

/// Puts a text in the place of what is written, as pasting does it.
async fn write(browser: &Browser, text: &str) {
    browser.see("#own-text").await;
    let paste = "const f = document.querySelector('#own-text'); f.focus(); f.select(); document.execCommand('insertText', false, arguments[0]); return f.value";
    assert_eq!(browser.run(paste, vec![json!(text)]).await, json!(text));
}

async fn looks(browser: &Browser, dark: &Browser, name: &str) {
    for (browser, shade) in [(browser, "light"), (dark, "dark")] {
        for width in [390, 1440] {
            browser.picture_of_width(&format!("own-{name}-{shade}"), width).await;
        }
        browser
            .accessible(&format!("an effect of one's own, {name}, {shade}"))
            .await;
    }
}

#[test]
fn val_an_effect_that_is_written_on_the_page_is_that_of_the_command_line() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    in_browser(async {
        let browser = Browser::open(&format!("{}#effects/own", server.address()), false).await;
        // An example stands there, and there is nothing yet to add it to.
        let said = browser.see("#own-judged.told").await;
        assert!(said.starts_with("The file is right: encoder-ripple."), "{said}");
        browser.see("#own-add:disabled").await;
        write(&browser, WRONG).await;
        at_its_place(&browser, &session).await;
        browser.close().await;
    });
    // A server that is killed: what was written is there.
    drop(server);
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"mpi","plays":4}"#);
    in_browser(async {
        let address = format!("{}#effects/own", server.address());
        let (browser, dark) = (
            Browser::open(&address, false).await,
            Browser::open(&address, true).await,
        );
        at_its_place(&browser, &session).await;
        dark.see("#own-judged.refused").await;
        looks(&browser, &dark, "wrong").await;
        browser.click("#own-show").await;
        let marked = "const f = document.activeElement; return f.value.slice(f.selectionStart, f.selectionEnd)";
        assert_eq!(browser.run(marked, vec![]).await, json!("y"));

        let right = WRONG.replace("- y", "- z");
        write(&browser, &right).await;
        browser.see("#own-judged.told").await;
        dark.run("location.reload(); return null", vec![]).await;
        dark.see("#own-judged.told").await;
        looks(&browser, &dark, "right").await;
        browser.click("#own-add").await;
        browser.see("#step-1[aria-current]").await;
        let text = browser.see("main").await;
        assert!(text.contains("+ my-lag"), "{text}");
        as_typed(&server, &session, 1, &right);
        dark.close().await;
        fitted_anew(&browser, &server, &session, &right).await;
        browser.close().await;
    });
}

/// The sentence, the mark and the words of the command line.
async fn at_its_place(browser: &Browser, session: &Path) {
    let said = browser.see("#own-judged.refused").await;
    assert!(
        said.starts_with("Line 17, column 14: unknown name `y`; known here are u, du, t,"),
        "{said}"
    );
    assert_eq!(browser.see(".editor mark").await, "y");
    browser.see("#own-add:disabled").await;
    let (code, printed) = typed(session, "hysteron explain ./own-effect.toml");
    let plain = |text: &str| {
        text.split([' ', '\n', '│', '×'])
            .filter(|word| !word.is_empty())
            .collect::<String>()
    };
    let why = plain(said.split_once(": ").unwrap().1.trim_end_matches('.'));
    assert!(code == 2 && plain(&printed).contains(&why), "{code} {printed}\n{why}");
}

/// The command of a step, typed in the session, leaves the bytes of its model.
fn as_typed(server: &Server, session: &Path, number: usize, text: &str) {
    let step = server.state()["steps"][number].clone();
    assert_eq!(step["title"], "+ my-lag");
    let (command, model) = (step["command"].as_str().unwrap(), step["model"].as_str().unwrap());
    let effect = format!("effects/{}.toml", number + 1);
    assert!(
        command.starts_with(&format!("hysteron add ./{effect} data")),
        "{command}"
    );
    let (code, said) = typed(session, &command.replace(&format!("-o {model}"), "-o typed.toml"));
    assert_eq!(code, 0, "{said}");
    let file = |name: &str| std::fs::read_to_string(session.join(name)).unwrap();
    assert_eq!(file(model), file("typed.toml"));
    assert_eq!(file(&effect), text);
}

/// On data that have changed the effect is added anew from the text of its step, whatever the page says by then.
async fn fitted_anew(browser: &Browser, server: &Server, session: &Path, text: &str) {
    let record = server.state()["data"]["records"][0]["file"].clone();
    let deed = json!({"what": "role", "record": record, "role": "validate"});
    assert_eq!(server.act(&deed.to_string()).status, 200);
    assert_eq!(
        server.ask("POST", "api/own-effect", br#"{"text":"name = 1"}"#).status,
        200
    );
    browser.click("#refit").await;
    browser.see("#step-3[aria-current]").await;
    as_typed(server, session, 3, text);
    let refused = server.act(r#"{"what":"add-own"}"#);
    assert_eq!(refused.status, 422, "{}", refused.text());
    assert!(refused.text().contains("line 1"), "{}", refused.text());
}
