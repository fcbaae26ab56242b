//! A project that only grows: records that come later, records that are used otherwise, models that stay and are fitted anew;
//! and nothing that was acknowledged is lost with the server.

use crate::bring::csv;
use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::{in_browser, shows_the_worst_of_all_where_none_is_judged};
use hysteron_data::{Dataset, Record, Role, read_dataset};
use serde_json::{Value, json};
use std::path::Path;

/// A session with two files in its data and one model.
fn begun(server: &Server) {
    for (name, samples) in [("first.csv", 1000), ("second.csv", 1250)] {
        let came = server.ask("POST", &format!("api/upload?name={name}"), csv(samples).as_bytes());
        assert_eq!(came.status, 200, "{}", came.text());
    }
    let judge = br#"{"file":"second.csv","role":"validate"}"#;
    assert_eq!(server.ask("POST", "api/use", judge).status, 200);
    server.act(r#"{"what":"take-files"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":3}"#);
}

/// A command as it stands on the page, typed in the session's folder, with `data-N` under another name.
fn typed(session: &Path, command: &str, from: &str, to: &str) {
    let command = command.replace("hysteron ", &format!("{} ", env!("CARGO_BIN_EXE_hysteron")));
    assert_cmd::Command::new("sh")
        .current_dir(session)
        .args(["-c", &command.replace(from, to)])
        .assert()
        .success();
}

fn names(state: &Value) -> Vec<&str> {
    let records = state["data"]["records"].as_array().unwrap().iter();
    records.map(|record| record["file"].as_str().unwrap()).collect()
}

#[test]
fn val_a_project_with_models_takes_more_records() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    begun(&server);
    let third = place.path().join("third.csv");
    std::fs::write(&third, csv(750)).unwrap();
    let bad = place.path().join("bad.csv");
    std::fs::write(&bad, "CH1,CH2\n1,2\n2,3\n3,4\n").unwrap();
    let again = place.path().join("first.csv");
    std::fs::write(&again, csv(1000)).unwrap();
    let model = std::fs::read(session.join("models/1.toml")).unwrap();
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        // A good file, one that cannot be read, and one that is in the project already.
        browser.drop_files("#drop", &[third, bad, again]).await;
        browser.see_text("Add 1 record to the project").await;
        let said = browser.see("#left-out").await;
        assert!(said.starts_with("bad.csv cannot be read and is left out"), "{said}");
        let refused = browser.see(".card.bad .refused").await;
        assert!(refused.len() > 20, "{refused}");
        browser.choose("#role-3", "identify").await;
        browser.picture("grow-files").await;
        browser.accessible("grow-files").await;
        browser.click("#add-files").await;
        let said = browser.see("#stale").await;
        assert!(said.contains("was fitted before third.csv came"), "{said}");
        browser.see("#forget-0").await;
        browser.picture("grow-data").await;
        browser.accessible("grow-data").await;
        browser.click("#way a[href='#ladder']").await;
        let rung = browser.see(".rung.here .since").await;
        assert_eq!(rung, "fitted before 1 record");
        browser.click("#refit").await;
        browser.see("#step-1[aria-current]").await;
        browser.see("main:not(:has(#stale))").await;
        browser.see("#step-0 .since").await;
        browser.picture("grow-ladder").await;
        browser.accessible("grow-ladder").await;
        // The file that cannot be read is corrected by itself, and added; what was read stays as it is.
        browser.click("#way a[href='#data']").await;
        browser.type_into("#column-voltage-0", "CH1:V").await;
        browser.type_into("#column-position-0", "CH2:um").await;
        browser.type_into("#rate-0", "1000").await;
        browser.click("#read-again-0").await;
        browser.click("#add-files:not([disabled])").await;
        browser.see("#stale").await;
        browser.see("#record-role-3").await;
        // And what a record is used for is changed in the data.
        browser.choose("#record-role-1", "identify").await;
        browser.see_text("the role of second.csv changed").await;
        // Each change is taken back and made again; the model that is looked at stays.
        let title = async |button: &str| {
            let script = format!("return document.querySelector('{button}').title");
            browser.run(&script, Vec::new()).await
        };
        assert_eq!(title("#undo").await, "Undo: second.csv got another role (Ctrl+Z)");
        browser.click("#undo").await;
        browser.see_text("bad.csv came. Its").await;
        browser.click("#undo").await;
        browser.see("#add-files:not([disabled])").await;
        browser.see("main:not(:has(#record-role-3))").await;
        assert_eq!(title("#redo").await, "Redo: bad.csv came in (Ctrl+Y)");
        browser.picture("grow-undone").await;
        browser.click("#redo").await;
        browser.see("#record-role-3").await;
        browser.click("#redo").await;
        browser.see_text("the role of second.csv changed").await;
        // Models do not end by one click.
        browser.click("details.other summary").await;
        browser.click("#start-demo").await;
        let asked = browser.client.get_alert_text().await.unwrap();
        assert!(asked.contains("2 models end with it"), "{asked}");
        browser.client.dismiss_alert().await.unwrap();
        browser.close().await;
    });
    let state = server.state();
    assert_eq!(names(&state), ["first.csv", "second.csv", "third.csv", "bad.csv"]);
    assert_eq!(state["data"]["path"], "data-4", "{}", state["data"]);
    let generations = [0, 1].map(|step| state["steps"][step]["generation"].as_u64().unwrap());
    assert_eq!(generations, [0, 1]);
    // Nothing of the first model or of its data has changed, and each command makes what it stands beside.
    assert!(std::fs::read(session.join("models/1.toml")).unwrap() == model);
    typed(
        &session,
        state["steps"][0]["command"].as_str().unwrap(),
        "models/1",
        "typed-1",
    );
    typed(
        &session,
        state["steps"][1]["command"].as_str().unwrap(),
        "models/2",
        "typed-2",
    );
    for number in [1, 2] {
        let [own, same] = [format!("models/{number}.toml"), format!("typed-{number}.toml")]
            .map(|file| std::fs::read_to_string(session.join(file)).unwrap());
        assert_eq!(own, same);
    }
    let command = state["data"]["command"].as_str().unwrap();
    assert!(
        command.ends_with("# then, in its dataset.toml, second.csv is to identify"),
        "{command}"
    );
    typed(&session, command, "data-4", "typed");
    let [mut own, same] = ["data-4", "typed"].map(|data| read_dataset(&session.join(data)).unwrap());
    own.records[1].role = Role::Validate;
    assert_eq!(own, same);
}

/// Brings the record that the diagnosis of the first step asks for, as `a.csv`: by the button beside the verdict where there is a
/// browser.
fn bring_what_was_asked_for(server: &Server, place: &Path) {
    let asked = server.ask("GET", "api/diagnosis?step=0", b"").json();
    if !there() || asked["numbers"]["next_record"].is_null() {
        let came = server.ask("POST", "api/upload?name=a.csv&asked=0", csv(1000).as_bytes());
        assert_eq!(came.status, 200, "{}", came.text());
        return;
    }
    let file = place.join("a.csv");
    std::fs::write(&file, csv(1000)).unwrap();
    in_browser(async {
        let browser = Browser::open(&server.address(), true).await;
        browser.click("#way a[href='#diagnose']").await;
        browser.see("#bring-next").await;
        let field = browser
            .client
            .find(fantoccini::Locator::Css("#bring-next"))
            .await
            .unwrap();
        field.send_keys(file.to_str().unwrap()).await.unwrap();
        // The page goes to the data by itself, where the record waits to be added.
        browser
            .see_text("Brought as the record that the diagnosis of step 1, pi, 3 plays, asked for")
            .await;
        browser.see("#add-files:not([disabled])").await;
        browser.picture("grow-asked").await;
        browser.close().await;
    });
}

#[test]
fn val_a_dataset_of_the_users_own_grows_in_the_session_alone() {
    let place = tempfile::tempdir().unwrap();
    let (session, stage) = (place.path().join("session"), place.path().join("stage"));
    let record = |file: &str, role| {
        let wave = |k: i32| f64::from((k % 100 - 50).abs());
        let voltage_v: Vec<f64> = (0..400).map(wave).collect();
        let position_um = (0..400).map(|k| 0.1 * wave(k + 2)).collect();
        Record::new(file, role, 1e-3, voltage_v, position_um)
    };
    let own = Dataset {
        name: "my stage".to_owned(),
        records: vec![record("a.csv", Role::Identify), record("b.csv", Role::Validate)],
        ..Dataset::default()
    };
    hysteron_data::write_dataset(&own, &stage, hysteron_data::Overwrite::Refuse).unwrap();
    let listed = |stage: &Path| -> Vec<(String, Vec<u8>)> {
        let files = std::fs::read_dir(stage).unwrap().flatten();
        let mut files: Vec<_> = files
            .map(|file| {
                (
                    file.file_name().into_string().unwrap(),
                    std::fs::read(file.path()).unwrap(),
                )
            })
            .collect();
        files.sort();
        files
    };
    let before = listed(&stage);
    {
        let server = Server::start_with(&session, &stage);
        server.act(r#"{"what":"fit","model":"pi","plays":3}"#);
        server.act(r#"{"what":"diagnose"}"#);
        // What the dataset has already is not brought twice; the record that was asked for is.
        for name in ["a.csv", "dataset.toml"] {
            let came = server.ask(
                "POST",
                &format!("api/upload?name={name}"),
                &std::fs::read(stage.join(name)).unwrap(),
            );
            assert_eq!(came.json()["known"], json!([name]), "{}", came.text());
        }
        assert_eq!(server.state()["files"], json!([]));
        bring_what_was_asked_for(&server, place.path());
        server.act(r#"{"what":"add-files"}"#);
        let state = server.state();
        assert_eq!(names(&state), ["a.csv", "b.csv", "a-2.csv"], "{}", state["job"]);
        let added = &state["data"]["records"][2];
        assert_eq!(
            (&added["came_in"], &added["asked_by"], &added["role"]),
            (&json!("a.csv"), &json!(0), &json!("identify"))
        );
        assert_eq!(state["steps"][0]["since"]["records"], json!(["a-2.csv"]));
        // What was computed before is still of the data it was computed on.
        let compared = server.ask("GET", "api/compare?step=0", b"").json();
        assert_eq!(compared["records"].as_array().unwrap().len(), 2);
        assert_eq!(server.ask("GET", "api/diagnosis?step=0", b"").status, 200);
        // Further work goes on the data as they are: the model is fitted anew before the effect is added to it.
        server.act(r#"{"what":"add","effect":"delay"}"#);
        let state = server.state();
        let steps: Vec<(Value, Value, Value)> = state["steps"]
            .as_array()
            .unwrap()
            .iter()
            .map(|step| {
                (
                    step["title"].clone(),
                    step["parent"].clone(),
                    step["generation"].clone(),
                )
            })
            .collect();
        assert_eq!(
            steps,
            [
                (json!("pi, 3 plays"), json!(null), json!(0)),
                (json!("pi, 3 plays"), json!(null), json!(1)),
                (json!("+ delay"), json!(1), json!(1)),
            ]
        );
        assert_eq!(
            server.ask("GET", "api/compare?step=2", b"").json()["records"]
                .as_array()
                .unwrap()
                .len(),
            3
        );
        assert_eq!(
            server.act(r#"{"what":"refit"}"#).status,
            409,
            "it is on the present data"
        );
        assert!(listed(&stage) == before, "the user's own folder is as it was");
    }
    // The user's own dataset grows, and the same call opens the session again: what is new in it waits, with its role.
    hysteron_data::append_records(&stage, &[record("c.csv", Role::Validate)]).unwrap();
    let server = Server::start_with(&session, &stage);
    let state = server.state();
    assert_eq!(names(&state), ["a.csv", "b.csv", "a-2.csv"]);
    let waits = |state: &Value| -> Vec<Value> {
        let files = state["files"].as_array().unwrap().iter();
        let files = files.filter(|file| file["stands"] == "waits");
        files.map(|file| json!([file["name"], file["role"]])).collect()
    };
    assert_eq!(waits(&state), [json!(["c.csv", "validate"])]);
    server.act(r#"{"what":"add-files"}"#);
    server.act(r#"{"what":"role","record":"b.csv","role":"identify"}"#);
    drop(server);
    let server = Server::start_with(&session, &stage);
    let state = server.state();
    assert_eq!(names(&state), ["a.csv", "b.csv", "a-2.csv", "c.csv"]);
    assert_eq!(waits(&state), [] as [Value; 0]);
    let said = state["data"]["notices"][0].as_str().unwrap();
    assert!(
        said.starts_with("b.csv: ") && said.contains("validate now, here it is identify"),
        "{said}"
    );
}

/// Every command in an answer.
fn commands(answer: &Value, found: &mut Vec<String>) {
    match answer {
        Value::Object(parts) => {
            for (name, part) in parts {
                match part.as_str() {
                    Some(text) if name.ends_with("command") => found.push(text.to_owned()),
                    _ => commands(part, found),
                }
            }
        }
        Value::Array(parts) => parts.iter().for_each(|part| commands(part, found)),
        _ => {}
    }
}

#[test]
fn regress_no_name_ends_the_line_of_a_command() {
    let place = tempfile::tempdir().unwrap();
    let (session, stage) = (place.path().join("ses\nsion"), place.path().join("sta\ntouch evil\nge"));
    let position_um: Vec<f64> = (0..400).map(|k| f64::from((k % 100 - 50_i32).abs())).collect();
    let own = Dataset {
        name: "x\ntouch evil\n".to_owned(),
        records: vec![Record::new(
            "a.csv",
            Role::Identify,
            1e-3,
            position_um.clone(),
            position_um,
        )],
        ..Dataset::default()
    };
    hysteron_data::write_dataset(&own, &stage, hysteron_data::Overwrite::Refuse).unwrap();
    let server = Server::start_with(&session, &stage);
    let mut found = Vec::new();
    commands(&server.state(), &mut found);
    server.act(r#"{"what":"fit","model":"pi","plays":3}"#);
    let came = server.ask("POST", "api/upload?name=b.csv", csv(1000).as_bytes());
    assert_eq!(came.status, 200, "{}", came.text());
    server.act(r#"{"what":"add-files"}"#);
    server.act(r#"{"what":"role","record":"a.csv","role":"validate"}"#);
    commands(&server.state(), &mut found);
    commands(&server.ask("GET", "api/words?step=0", b"").json(), &mut found);
    assert!(found.iter().any(|command| command.contains("touch evil")), "{found:?}");
    for command in &found {
        assert!(!command.contains(char::is_control), "{command:?}");
    }
}

/// The parts of the state that must not be lost.
fn kept(server: &Server) -> Value {
    let state = server.state();
    json!([
        state["data"],
        state["files"],
        state["steps"],
        state["current"],
        state["diagnosed"],
        state["undo"],
        state["redo"],
        state["project"]
    ])
}

#[test]
fn regress_nothing_acknowledged_is_lost_when_the_server_is_killed() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let act = |server: &Server, deed: &str| assert_eq!(server.act(deed).status, 200, "{deed}");
    let deeds: [&dyn Fn(&Server); 11] = [
        &begun,
        &|server| {
            let came = server.ask("POST", "api/upload?name=third.csv&asked=0", csv(750).as_bytes());
            assert_eq!(came.status, 200);
        },
        &|server| {
            let judge = br#"{"file":"third.csv","role":"validate"}"#;
            assert_eq!(server.ask("POST", "api/use", judge).status, 200);
        },
        &|server| {
            assert_eq!(server.act(r#"{"what":"add-files"}"#).status, 200);
        },
        &|server| {
            let deed = r#"{"what":"role","record":"second.csv","role":"identify"}"#;
            assert_eq!(server.act(deed).status, 200);
        },
        &|server| {
            assert_eq!(server.act(r#"{"what":"refit"}"#).status, 200);
        },
        &|server| {
            let deed = r#"{"what":"role","record":"second.csv","role":"validate"}"#;
            assert_eq!(server.act(deed).status, 200);
        },
        &|server| act(server, r#"{"what":"undo"}"#),
        &|server| act(server, r#"{"what":"redo"}"#),
        &|server| act(server, r#"{"what":"name","step":1,"name":"both","note":"of a Monday"}"#),
        &|server| {
            act(server, r#"{"what":"new-project","name":"another"}"#);
            assert_eq!(server.state()["steps"], json!([]));
            act(server, r#"{"what":"open-project","name":""}"#);
        },
    ];
    let mut before = None;
    for (k, deed) in deeds.iter().enumerate() {
        let server = Server::start(&session);
        if let Some(before) = &before {
            assert_eq!(kept(&server), *before, "after deed {k}");
        }
        deed(&server);
        before = Some(kept(&server));
        // The server ends by SIGKILL.
    }
    let server = Server::start(&session);
    assert_eq!(Some(kept(&server)), before);
    let state = server.state();
    assert_eq!(names(&state), ["first.csv", "second.csv", "third.csv"]);
    assert_eq!(state["steps"].as_array().unwrap().len(), 2);
    assert_eq!(
        [&state["steps"][1]["title"], &state["steps"][1]["note"]],
        ["both", "of a Monday"]
    );
    assert_eq!(
        state["steps"][1]["since"],
        json!({"records": [], "roles": ["second.csv"]})
    );
}

/// Killed in the midst of a job: what was there is there, and a step is there as a whole or not at all.
#[test]
fn regress_a_server_that_is_killed_at_work_leaves_what_was_there() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    begun(&server);
    let mut before = kept(&server);
    drop(server);
    let deeds = [
        r#"{"what":"fit","model":"mrpi","plays":10}"#,
        r#"{"what":"add","effect":"delay"}"#,
        r#"{"what":"diagnose"}"#,
        r#"{"what":"role","record":"second.csv","role":"identify"}"#,
        r#"{"what":"learn","model":"mpi","plays":4}"#,
    ];
    for (k, deed) in deeds.into_iter().cycle().take(10).enumerate() {
        let server = Server::start(&session);
        let revision = &server.state()["revision"];
        let body = format!("{{\"revision\":{revision},\"do\":{deed}}}");
        assert_eq!(server.ask("POST", "api/do", body.as_bytes()).status, 200, "{deed}");
        // At another moment of the job each time.
        for _ in 0..k * k {
            server.state();
        }
        drop(server);
        let server = Server::start(&session);
        let now = kept(&server);
        let steps = |kept: &Value| kept[2].as_array().unwrap().clone();
        let (was, is) = (steps(&before), steps(&now));
        assert!(is.len() >= was.len(), "after kill {k}");
        for (number, step) in was.iter().enumerate() {
            for part in ["title", "command", "model", "validate_percent", "records"] {
                assert_eq!(is[number][part], step[part], "step {number} after kill {k}");
            }
        }
        for number in 0..is.len() {
            let words = server.ask("GET", &format!("api/words?step={number}"), b"");
            assert_eq!(words.status, 200, "{}", words.text());
        }
        let state = server.state();
        assert_eq!(names(&state), ["first.csv", "second.csv"]);
        before = now;
    }
}

#[test]
fn regress_a_growth_that_is_cut_off_leaves_the_data_as_they_were_or_as_they_will_be() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    {
        let server = Server::start(&session);
        begun(&server);
    }
    // What a server that was cut off leaves: a folder that no book names, and one half made.
    std::fs::create_dir_all(session.join("data-2")).unwrap();
    std::fs::create_dir_all(session.join("fresh/data")).unwrap();
    std::fs::write(session.join("fresh/data/half.csv"), "time_s").unwrap();
    let mut count = 2;
    for k in 0..4_u32 {
        let server = Server::start(&session);
        let state = server.state();
        let now = names(&state).len();
        assert!(now == count || now == count + usize::from(k > 0), "{:?}", names(&state));
        count = now;
        assert_eq!(state["steps"].as_array().unwrap().len(), 1);
        assert_eq!(
            server.ask("GET", "api/compare?step=0", b"").json()["records"]
                .as_array()
                .unwrap()
                .len(),
            2
        );
        let came = server.ask(
            "POST",
            &format!("api/upload?name=more-{k}.csv"),
            csv(500 + 50 * k).as_bytes(),
        );
        assert_eq!(came.status, 200, "{}", came.text());
        let revision = server.state()["revision"].as_u64().unwrap();
        let deed = format!(r#"{{"revision":{revision},"do":{{"what":"add-files"}}}}"#);
        assert_eq!(server.ask("POST", "api/do", deed.as_bytes()).status, 200);
        // Killed at once, wherever the job is.
    }
    let server = Server::start(&session);
    server.act(r#"{"what":"add-files"}"#);
    let state = server.state();
    assert!(
        names(&state).len() >= 3 && state["data"]["path"] != "data-2",
        "{}",
        state["data"]
    );
}

#[test]
fn val_a_bookmark_and_an_open_tab_go_on_after_a_restart() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    let address = server.address();
    if !there() {
        drop(server);
        assert_eq!(Server::start(&session).address(), address);
        return;
    }
    in_browser(async {
        let browser = Browser::open(&address, false).await;
        browser.see("#files").await;
        drop(server);
        let said = browser.see("#fault:not([hidden])").await;
        assert!(said.contains("start `hysteron lab` on the same folder again"), "{said}");
        let server = Server::start(&session);
        assert_eq!(server.address(), address);
        let said = browser.see("#back:not([hidden])").await;
        assert!(said.contains("This page goes on where it was"), "{said}");
        browser.see("#fault[hidden]").await;
        shows_the_worst_of_all_where_none_is_judged(&browser).await;
        browser.click("#start-demo").await;
        browser.see_text("The data: paper-stage").await;
        // An address of another session says what to do, as a page.
        let other = format!("http://127.0.0.1:{}/{}/", server.port, "0".repeat(32));
        browser.client.goto(&other).await.unwrap();
        let said = browser.text().await;
        assert!(
            said.contains("hysteron lab") && said.contains("another session"),
            "{said}"
        );
        browser.close().await;
    });
}
