//! Parameters moved by hand: the user's own record follows while a slider moves, and what was moved can be kept.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::{hysteron, in_browser, least_s};
use fantoccini::Locator;
use fantoccini::key::Key;
use hysteron_data::{Dataset, Overwrite, Record, Role, read_dataset, write_dataset};
use hysteron_identify::{Change, MOVED_BY_HAND, Model};
use serde_json::{Value, json};
use std::path::Path;

/// A stage with a loop and a lag, over a range that no period repeats: the start of each record is looked for.
fn recorded(folder: &Path, samples: usize) {
    let record = |file: &str, role: Role, tones: [f64; 2]| {
        let voltage_v: Vec<f64> = (0..samples)
            .map(|k| {
                let t = k as f64 * 1e-4;
                let swing = |hz: f64| (std::f64::consts::TAU * hz * t).sin();
                50.0 - 30.0 * swing(tones[0]) - 19.0 * swing(tones[1])
            })
            .collect();
        let (mut play, mut lagged) = (voltage_v[0], 0.1 * voltage_v[0]);
        let position_um = voltage_v
            .iter()
            .map(|v| {
                play = play.clamp(v - 4.0, v + 4.0);
                lagged = 0.8 * lagged + 0.2 * (0.06 * v + 0.04 * play);
                lagged
            })
            .collect();
        Record::new(file, role, 1e-4, voltage_v, position_um)
    };
    let dataset = Dataset {
        name: "lagging".to_owned(),
        records: vec![
            record("fitted.csv", Role::Identify, [3.0, 37.0 / 7.0]),
            record("judged.csv", Role::Validate, [5.0, 23.0 / 3.0]),
        ],
        ..Dataset::default()
    };
    write_dataset(&dataset, folder, Overwrite::Refuse).unwrap();
}

/// A session with a model of this stage.
fn begun(place: &Path, samples: usize) -> Server {
    recorded(&place.join("stage"), samples);
    fitted(Server::start_with(&place.join("session"), &place.join("stage")))
}

fn fitted(server: Server) -> Server {
    assert_eq!(server.act(r#"{"what":"fit","model":"mpi","plays":10}"#).status, 200);
    assert_eq!(server.act(r#"{"what":"add","effect":"first-order-lag"}"#).status, 200);
    server
}

fn asked(server: &Server, more: &str) -> crate::server::Answer {
    server.ask("GET", &format!("api/by-hand?step=1&record=1&width=500{more}"), b"")
}

/// Values of the sliders, in their order.
fn values(shown: &Value) -> Vec<f64> {
    let knobs = shown["knobs"].as_array().unwrap().iter();
    knobs.map(|knob| knob["value"].as_f64().unwrap()).collect()
}

fn joined(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// Seconds, frames that are drawn, and whether a question was asked before the last was answered, while the first slider moves
/// with every frame of the screen.
const MOVES: &str = "const done = arguments[0]; const chart = document.querySelector('#hand-overlay').chart; const slider = document.querySelector('#hand-0'); \
    performance.clearResourceTimings(); performance.setResourceTimingBufferSize(1000); \
    const draw = chart.setData; let drawn = 0; chart.setData = function (...all) { drawn += 1; return draw.apply(this, all); }; \
    const begun = performance.now(); const move = () => { const t = performance.now() - begun; \
    if (t > 4000) { chart.setData = draw; \
        const asked = performance.getEntriesByType('resource').filter(one => one.name.includes('by-hand')); \
        const at_once = asked.some((one, k) => k > 0 && one.startTime < asked[k - 1].responseEnd); \
        done([t / 1000, drawn, at_once]); return; } \
    slider.value = 0.3 + 0.1 * Math.sin(t / 300); slider.dispatchEvent(new Event('input', {bubbles: true})); requestAnimationFrame(move); }; move();";

#[test]
fn val_a_record_of_60_000_samples_follows_a_slider() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    recorded(&place.path().join("stage"), 60_000);
    let [session, stage] = ["session", "stage"].map(|part| place.path().join(part));
    let server = fitted(Server::start_with(&session, &stage));
    in_browser(async {
        let browser = Browser::open(&format!("{}#compare/by-hand", server.address()), false).await;
        browser.see("#hand-error canvas").await;
        let before_s = server.processor_s();
        let moved = browser.run_async(MOVES, vec![]).await;
        let [seconds, frames] = [0, 1].map(|k| moved[k].as_f64().unwrap());
        assert_eq!(
            moved[2], false,
            "one question at a time: a queue would lag behind the slider"
        );
        assert!(frames >= 2.0, "{moved}");
        // Both figures are of one machine, and of processor time: what else runs there does not count.
        let model = Model::read(&session.join("models/2.toml")).unwrap();
        let record = &read_dataset(&stage).unwrap().records[1];
        let initial = model.simulate(record).initial;
        let alone_s = least_s(|| drop(model.simulate_starting(record, initial)));
        println!(
            "60 000 samples follow a slider with {:.0} frames a second",
            frames / seconds
        );
        if let (Some(before_s), Some(after_s)) = (before_s, server.processor_s()) {
            let ratio = (after_s - before_s) / frames / alone_s;
            println!("a frame costs {ratio:.2} runs of its record");
            // A run, its error and its points. To choose the record's start anew takes some 25 runs.
            assert!(ratio < 8.0, "a frame costs {ratio} runs of its record");
        }
        browser.close().await;
    });
}

#[test]
fn val_what_is_moved_is_what_compare_says_and_can_be_kept() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = begun(place.path(), 3000);
    in_browser(async {
        let browser = Browser::open(&server.address(), false).await;
        browser.click("#way a[href='#ladder']").await;
        browser.click("a[href='#compare/by-hand']").await;
        browser.see("#hand-error canvas").await;
        let slider = browser.client.find(Locator::Css("#hand-0")).await.unwrap();
        let shown = browser.see("#hand-0").await;
        assert_eq!(shown, "");
        assert_eq!(browser.see("#hand-back:disabled").await, "Back to the fitted values");
        // A person with a keyboard.
        for _ in 0..40 {
            slider.send_keys(&Key::Right.to_string()).await.unwrap();
        }
        browser.see("#hand-keep:not([disabled])").await;
        let moved = browser.see(".slider:has(#hand-0) output").await;
        assert!(moved.starts_with("1.0"), "{moved}");
        browser.picture("by-hand").await;
        browser.accessible("moved by hand").await;
        browser.click("#hand-back").await;
        browser.see("#hand-keep:disabled").await;
        assert_eq!(browser.see(".slider:has(#hand-0) output").await, "1.00");
        browser
            .client
            .find(Locator::Css("#hand-2"))
            .await
            .unwrap()
            .send_keys(&Key::Right.to_string())
            .await
            .unwrap();
        browser.see("#hand-keep:not([disabled])").await;
        browser.see(".unseen:not(:empty)").await;
        let said = browser.see("#hand-said").await;
        browser.click("#hand-keep").await;
        browser.see("#step-2[aria-current]").await;
        let compared = hysteron(&session, &["compare", "data", "models/3.toml", "--json"]);
        let file = said.split(':').next().unwrap();
        let record = compared["records"]
            .as_array()
            .unwrap()
            .iter()
            .find(|record| record["file"] == file);
        let percent = hysteron_report::significant(record.unwrap()["nrmse_percent"].as_f64().unwrap());
        assert!(
            said.contains(&format!("moved {percent}\u{a0}%")),
            "{said} should say {percent}"
        );
        browser.see_text(&format!("3: {MOVED_BY_HAND}")).await;
        browser.accessible("a step moved by hand").await;
        browser.click("#undo").await;
        browser.see("#step-1[aria-current]").await;
        browser.close().await;
    });
    let state = server.state();
    let command = state["steps"][2]["command"].as_str().unwrap();
    assert!(
        command.starts_with("cp models/2.toml models/3.toml    # then, in it, first-order-lag: "),
        "{command}"
    );
    let model = Model::read(&session.join("models/3.toml")).unwrap();
    assert_eq!(model.history.last().unwrap().change, Change::Moved);
    assert!(
        model
            .notices
            .iter()
            .any(|notice| notice.starts_with("moved by hand: first-order-lag: "))
    );
    let moved = &model.effects[0].parameters[0];
    assert_eq!(moved.standard_error, None);
    assert_ne!(
        moved.value,
        Model::read(&session.join("models/2.toml")).unwrap().effects[0].parameters[0].value
    );
}

#[test]
fn val_a_moved_step_is_made_again_when_the_data_grow() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = begun(place.path(), 2000);
    let shown = asked(&server, "").json();
    let mut at = values(&shown);
    assert_eq!(shown["knobs"][0]["name"], "gain");
    at[0] = 1.25;
    let played = asked(&server, &format!("&values={}&rest=1", joined(&at))).json();
    let percent = |shown: &Value| shown["nrmse_percent"].as_f64().unwrap();
    assert!(
        percent(&played) > 2.0 * percent(&shown),
        "{} {}",
        percent(&played),
        percent(&shown)
    );
    assert_eq!(
        server
            .act(&json!({"what": "keep-moved", "values": at}).to_string())
            .status,
        200
    );
    let kept = server.state()["steps"][2]["records"][1][1].as_f64().unwrap();
    assert!((kept / played["nrmse_percent"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let slope = |number: usize| {
        Model::read(&session.join(format!("models/{number}.toml")))
            .unwrap()
            .coefficients[1]
    };
    assert!((slope(3) / slope(2) - 1.25).abs() < 1e-12);

    assert_eq!(
        server
            .act(r#"{"what":"role","record":"judged.csv","role":"identify"}"#)
            .status,
        200
    );
    let refused = server.act(&json!({"what": "keep-moved", "values": at}).to_string());
    assert_eq!(
        refused.json()["error"],
        "this step was fitted before the data grew; fit it anew, then move what comes of it"
    );
    server.act(r#"{"what":"refit"}"#);
    let state = server.state();
    assert_eq!(state["steps"][5]["title"], MOVED_BY_HAND, "{}", state["job"]);
    assert!((slope(6) / slope(5) - 1.25).abs() < 1e-12);
}

#[test]
fn refuse_what_cannot_be_moved() {
    let place = tempfile::tempdir().unwrap();
    let server = begun(place.path(), 1000);
    let at = values(&asked(&server, "").json());
    let with = |first: &str| format!("&values={first},{}", joined(&at[1..]));
    for (more, said) in [
        (with("7"), "gain = 7: allowed are 0.500000 to 2.000000"),
        (with("NaN"), "gain = NaN: allowed are"),
        (with("x"), "values: `x` is no number"),
        ("&values=1".to_owned(), "1 values for 4 parameters; give one for each"),
    ] {
        let refused = asked(&server, &more);
        assert_eq!(refused.status, 400, "{more}");
        assert!(
            refused.json()["error"].as_str().unwrap().starts_with(said),
            "{}",
            refused.text()
        );
    }
    assert_eq!(
        server.ask("GET", "api/by-hand?step=9&record=0&width=9", b"").status,
        404
    );
    assert_eq!(
        server.ask("GET", "api/by-hand?step=1&record=9&width=9", b"").status,
        404
    );
    let still = server.act(&json!({"what": "keep-moved", "values": at}).to_string());
    assert_eq!(
        still.json()["error"],
        "every parameter stands where it was fitted; move one before the model is kept"
    );
    assert_eq!(server.state()["steps"].as_array().unwrap().len(), 2);
}
