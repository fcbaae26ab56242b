//! Learning as one button: the steps, the digits and the bytes of `hysteron learn`; steps taken off the ladder and put back.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::in_browser;
use serde_json::{Value, json};
use std::path::Path;

/// What `hysteron learn` prints and leaves in `typed.toml` and `typed.json` of the session.
fn typed(session: &Path, command: &str) -> (String, Value) {
    let run = |more: &[&str]| {
        let words = command.split(' ').skip(1).map(|word| {
            if word.starts_with("models/") {
                "typed.toml"
            } else {
                word
            }
        });
        let out = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .current_dir(session)
            .args(words)
            .args(more)
            .assert()
            .success();
        String::from_utf8(out.get_output().stdout.clone()).unwrap()
    };
    let json = serde_json::from_str(&run(&["--json"])).unwrap();
    (run(&[]), json)
}

#[test]
fn val_learn_is_one_button_and_says_what_the_command_line_says() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":4}"#);
    in_browser(async {
        let browser = Browser::open(&format!("{}#fit", server.address()), false).await;
        browser.choose("#model", "mpi").await;
        browser.click("#learn").await;
        let said = browser.see("#learned").await;
        let state = server.state();
        let steps = state["steps"].as_array().unwrap();
        let last = steps.len() - 1;
        assert!(last > 1, "a model, and a step at least: {steps:#?}");
        assert_eq!(
            (&steps[0]["title"], &steps[0]["removed"]),
            (&json!("pi, 4 plays"), &json!(false))
        );
        let (printed, typed) = typed(&session, steps[last]["command"].as_str().unwrap());
        assert_eq!(printed, format!("{}\n\nwritten to typed.toml\n", said.trim_end()));
        let rungs = typed["ladder"]["steps"].as_array().unwrap();
        assert_eq!(rungs.len(), last, "one step a rung: {rungs:#?}");
        for (step, rung) in steps[1..].iter().zip(rungs) {
            for error in ["identify_percent", "validate_percent"] {
                let [here, there] = [step, rung].map(|of| format!("{:.3}", of[error].as_f64().unwrap()));
                assert_eq!(here, there, "{error} of {}", step["title"]);
            }
        }
        let file = |name: &str| std::fs::read(session.join(name)).unwrap();
        let model = steps[last]["model"].as_str().unwrap();
        assert!(file(model) == file("typed.toml"), "the bytes of {model}");
        browser.picture("learn-ladder").await;
        browser.accessible("the ladder that was learned").await;
        taken_off_and_put_back(&browser, &server, last).await;
        fitted_anew(&browser, &server, &session, last).await;
        browser.close().await;
    });
}

/// The last step leaves the ladder; its model stays in its file, and it comes back as it was.
async fn taken_off_and_put_back(browser: &Browser, server: &Server, last: usize) {
    let model = format!("api/export/model?step={last}");
    let before = (server.state()["steps"].clone(), server.ask("GET", &model, b"").body);
    browser.click("#remove").await;
    browser.see(&format!("#keep-{last}")).await;
    browser.see(&format!("#step-{}[aria-current]", last - 1)).await;
    assert_eq!(
        browser
            .run(
                "return document.querySelector(arguments[0])",
                vec![json!(format!("#step-{last}"))]
            )
            .await,
        Value::Null
    );
    browser.picture("learn-taken-off").await;
    browser.click(&format!("#keep-{last}")).await;
    browser.see(&format!("#step-{last}[aria-current]")).await;
    let after = server.state()["steps"].clone();
    assert_eq!(after.as_array().unwrap().len(), last + 1);
    assert_eq!(after[last], before.0[last]);
    assert_eq!(server.ask("GET", &model, b"").body, before.1);
}

/// On changed data what was learned is learned anew by one button: root and effects, as the command line does on these data.
async fn fitted_anew(browser: &Browser, server: &Server, session: &Path, last: usize) {
    let before = server.state()["steps"].clone();
    let record = server.state()["data"]["records"][0]["file"].clone();
    assert_eq!(server.state()["data"]["records"][0]["role"], "identify");
    let deed = json!({"what": "role", "record": record, "role": "validate"});
    assert_eq!(server.act(&deed.to_string()).status, 200);
    browser.click("#refit").await;
    browser.see(&format!("#step-{}", last + 1)).await;
    browser.see("main:not(:has(#stale))").await;
    let state = server.state();
    let steps = state["steps"].as_array().unwrap();
    let current = usize::try_from(state["current"].as_u64().unwrap()).unwrap();
    assert_eq!(current, steps.len() - 1);
    assert!(
        steps[..=last]
            .iter()
            .zip(before.as_array().unwrap())
            .all(|(now, then)| now["model"] == then["model"])
    );
    assert!(
        steps[last + 1..].iter().all(|step| step["generation"] == 1),
        "{steps:#?}"
    );
    let (printed, _) = typed(session, steps[current]["command"].as_str().unwrap());
    let said = browser.see("#learned").await;
    assert_eq!(printed, format!("{}\n\nwritten to typed.toml\n", said.trim_end()));
    let file = |name: &str| std::fs::read(session.join(name)).unwrap();
    let model = steps[current]["model"].as_str().unwrap();
    assert!(file(model) == file("typed.toml"), "the bytes of {model}");
    assert!(
        file(model) != file(steps[last]["model"].as_str().unwrap()),
        "other data, the same model"
    );
}

#[test]
fn refuse_to_take_the_last_model_off_and_to_learn_with_no_plays() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("session"));
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":4}"#);
    let before = server.state();
    for (deed, status, words) in [
        (
            r#"{"what":"remove","step":0}"#,
            409,
            "this is the last model of the ladder",
        ),
        (r#"{"what":"remove","step":7}"#, 404, "there is no step 7"),
        (r#"{"what":"keep","step":7}"#, 404, "there is no step 7"),
        (
            r#"{"what":"learn","model":"mpi","plays":0}"#,
            400,
            "0 plays: allowed are 1 to 64",
        ),
        (
            r#"{"what":"learn","model":"best","plays":4}"#,
            400,
            "`best` is no model",
        ),
    ] {
        let told = server.act(deed);
        let said = told.json()["error"].as_str().unwrap().to_owned();
        assert!(
            (told.status, said.starts_with(words)) == (status, true),
            "{deed}: {} {said}",
            told.status
        );
    }
    assert_eq!(server.state()["revision"], before["revision"]);
}

#[test]
fn prop_learning_that_is_stopped_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("session"));
    server.act(r#"{"what":"start","name":"demo"}"#);
    let before = server.state();
    assert_eq!(server.begin(r#"{"what":"learn","model":"mpi","plays":6}"#).status, 200);
    assert_eq!(server.begin(r#"{"what":"stop"}"#).status, 200);
    let after = server.wait();
    assert_eq!(after["job"]["stopped"], true, "{}", after["job"]);
    assert_eq!((&after["revision"], &after["steps"]), (&before["revision"], &json!([])));
}
