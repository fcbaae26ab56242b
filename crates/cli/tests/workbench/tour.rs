//! The tour: an example from its records to the board, and its examples as data to begin with.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::in_browser;
use serde_json::{Value, json};

#[test]
fn val_the_tour_goes_the_whole_way_on_an_example() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("session"));
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        let dark = Browser::open(&server.address(), true).await;
        browser.see("#start-outside-catalogue").await;
        browser.picture("tour-start").await;
        browser.click("#take-tour").await;
        // What is to be seen at each stop.
        let stops = [
            ("data", "fifteen records"),
            ("compare", "it is judged by first"),
            ("diagnose", "The verdict comes first"),
            ("ladder", "The error fell from"),
            ("controller", "The effect brought its compensator"),
            ("board", "That is the whole way"),
        ];
        for (k, (station, words)) in stops.iter().enumerate() {
            let number = format!("{} of {}", k + 1, stops.len());
            let shown = format!(
                "return location.hash === '#{station}' && document.querySelector('#tour-words')?.textContent.includes('{words}')"
            );
            while browser.run(&shown, vec![]).await != json!(true) {
                tokio::time::sleep(std::time::Duration::from_millis(50)).await;
            }
            let said = browser.see("#tour-words").await;
            assert!(said.starts_with(&number), "{said}");
            browser.see("main h2").await;
            browser.picture(&format!("tour-{station}")).await;
            browser.accessible(&format!("tour, {station}")).await;
            if k + 1 < stops.len() {
                browser.click("#tour-next:not([disabled])").await;
            }
        }
        // It is the page's own, and ends where one says so; a page beside it has none.
        assert_eq!(
            dark.run("return document.querySelector('#tour').hidden", vec![]).await,
            json!(true)
        );
        browser.click("#tour-end").await;
        assert_eq!(
            browser
                .run("return document.querySelector('#tour').hidden", vec![])
                .await,
            json!(true)
        );
        browser.close().await;
        dark.close().await;
        // Fifteen records, two steps, forty parameters: a report still goes on six sheets.
        assert_eq!(server.act(r#"{"what":"report"}"#).status, 200);
        let report = place.path().join("session/reports/2.html");
        Browser::prints_on_six_sheets(&report).await;
    });
    let state = server.state();
    let errors: Vec<f64> = [0, 1]
        .map(|k| state["steps"][k]["validate_percent"].as_f64().unwrap())
        .to_vec();
    assert_eq!(state["steps"][1]["title"], "+ resonance");
    assert!(errors[1] < 0.5 * errors[0], "{errors:?}");
    assert_ne!(state["tables"], json!({}));
}

#[test]
fn val_each_example_is_there_to_begin_with() {
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("session"));
    let starts = server.state()["starts"].clone();
    let names: Vec<&str> = starts
        .as_array()
        .unwrap()
        .iter()
        .map(|start| start["name"].as_str().unwrap())
        .collect();
    assert_eq!(names.len(), 9, "{names:?}");
    for name in ["nothing-hidden", "stage-739hz"] {
        assert!(names.contains(&name));
        assert_eq!(
            server.act(&json!({"what": "start", "name": name}).to_string()).status,
            200
        );
        let data = server.state()["data"].clone();
        assert_eq!(data["name"], name);
        // What its command makes.
        let made = place.path().join(name);
        assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .args(["example", name, "-o"])
            .arg(&made)
            .assert()
            .success();
        let own = hysteron_data::read_dataset(&place.path().join("session/data")).unwrap();
        assert_eq!(own, hysteron_data::read_dataset(&made).unwrap());
        assert_eq!(data["command"], Value::from(format!("hysteron example {name} -o data")));
    }
}
