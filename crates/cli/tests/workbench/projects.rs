//! Several projects under one address, and steps that a person names.

use crate::bring::csv;
use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::in_browser;
use serde_json::{Value, json};

/// One recording and a model of it.
fn modelled(server: &Server, samples: u32) {
    let came = server.ask("POST", "api/upload?name=a.csv", csv(samples).as_bytes());
    assert_eq!(came.status, 200, "{}", came.text());
    server.act(r#"{"what":"take-files"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":3}"#);
}

/// All but what a look at it changes.
fn project(server: &Server) -> [Value; 4] {
    let state = server.state();
    ["data", "steps", "files", "folder"].map(|part| state[part].clone())
}

#[test]
fn val_a_second_project_leaves_the_first_as_it_was() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("piezo");
    let server = Server::start(&session);
    modelled(&server, 1000);
    let stale = server.state()["revision"].clone();
    let mut first = project(&server);
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        // A step gets a name and a note.
        browser.click("#way a[href='#ladder']").await;
        browser.click("#naming summary").await;
        browser.type_into("#step-name", "Before the new amplifier").await;
        browser.type_into("#step-note", "taken in March, 22 degrees").await;
        browser.click("#keep-name").await;
        browser.see_text("taken in March").await;
        browser.see_text("1: Before the new amplifier").await;
        browser.picture("projects-named").await;
        browser.accessible("projects-named").await;
        first = project(&server);
        // A name that leads elsewhere is refused where it was typed.
        browser.click("#to-projects").await;
        browser.type_into("#project-name", "../evil").await;
        browser.click("#begin-project").await;
        let said = browser.see("#fault:not([hidden])").await;
        assert!(said.starts_with("`../evil` is no name of a project"), "{said}");
        browser.type_into("#project-name", "x axis").await;
        browser.click("#begin-project").await;
        browser.see_text("Bring recordings").await;
        let footer = browser.see("#folder").await;
        assert!(footer.starts_with("Project x axis, in"), "{footer}");
        modelled(&server, 750);
        browser.see_text("The data").await;
        browser.click("#to-projects").await;
        browser.see("#project-1[aria-current]").await;
        browser.see_text("Before the new amplifier").await;
        browser.picture("projects").await;
        browser.accessible("projects").await;
        browser.click("#project-0").await;
        browser.see_text("taken in March").await;
        browser.close().await;
    });
    assert_eq!(project(&server), first);
    // A tab that shows the other one cannot act on this one.
    let late = format!("{{\"revision\":{stale},\"do\":{{\"what\":\"undo\"}}}}");
    assert_eq!(server.ask("POST", "api/do", late.as_bytes()).status, 409);
    // The one that is open when the server ends is open when it begins again.
    assert_eq!(server.act(r#"{"what":"open-project","name":"x axis"}"#).status, 200);
    let second = project(&server);
    assert_eq!(second[1][0]["records"].as_array().unwrap().len(), 1);
    drop(server);
    let server = Server::start(&session);
    assert_eq!(project(&server), second);
    // It is a session's folder like any other.
    let own = session.join("projects/x axis");
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(&own)
        .args(["compare", "data", "models/1.toml"])
        .assert()
        .success();
    let listed = server.ask("GET", "api/projects", b"").json();
    let names: Vec<&Value> = listed["projects"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| &p["title"])
        .collect();
    assert_eq!(names, ["piezo", "x axis"]);
}

#[test]
fn refuse_projects_that_are_not_there_or_there_already() {
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("piezo"));
    assert_eq!(server.act(r#"{"what":"new-project","name":"other"}"#).status, 200);
    let before = project(&server);
    for (deed, name, status) in [
        ("new-project", "other", 409),
        ("new-project", "", 422),
        ("new-project", "..", 422),
        ("new-project", "a/b", 422),
        ("new-project", "a\nb", 422),
        ("open-project", "third", 404),
        ("open-project", "../piezo", 404),
    ] {
        let deed = json!({"what": deed, "name": name}).to_string();
        let answer = server.act(&deed);
        assert_eq!(answer.status, status, "{deed}: {}", answer.text());
    }
    assert_eq!(project(&server), before);
    let named = |name: &str, note: &str| json!({"what": "name", "step": 0, "name": name, "note": note}).to_string();
    assert_eq!(server.act(&named("none", "")).status, 404);
    modelled(&server, 750);
    for (name, note) in [("a\nb", ""), (&"x".repeat(81), ""), ("", &"x".repeat(4001))] {
        let answer = server.act(&named(name, note));
        assert_eq!(answer.status, 422, "{}", answer.text());
    }
    // Without a name of its own a step is called by what made it.
    assert_eq!(server.act(&named("mine", "")).status, 200);
    assert_eq!(server.state()["steps"][0]["title"], "mine");
    assert_eq!(server.act(&named("", "")).status, 200);
    assert_eq!(server.state()["steps"][0]["title"], "pi, 3 plays");
}
