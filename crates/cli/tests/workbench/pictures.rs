//! Pictures hold what they say: steps over one record, the noise's band, correlations, the answer to small signals; each taken home as SVG,
//! PNG and CSV.

use crate::browser::{Browser, there};
use crate::server::Server;
use crate::way::{hysteron, in_browser};
use hysteron_control::design::Controller;
use hysteron_control::design::curves::MeasuredLoop;
use hysteron_data::{Dataset, Overwrite, Record, Role, write_dataset};
use hysteron_identify::{Model, small_signal_response};
use serde_json::{Value, json};
use std::path::Path;

/// Columns of a chart's data, without gaps.
async fn columns(browser: &Browser, host: &str) -> Vec<Vec<f64>> {
    let data = browser
        .run(
            "return document.querySelector(arguments[0]).chart.data.map((column) => [...column])",
            vec![json!(host)],
        )
        .await;
    serde_json::from_value(data).unwrap()
}

/// A form of a picture: its text, or of a PNG its first bytes and its size in pixels.
async fn taken(browser: &Browser, host: &str, form: &str) -> Value {
    let script =
        "const [host, form, done] = arguments; document.querySelector(host).forms[form]().then(async (blob) => {
        if (form !== 'png') { done(await blob.text()); return; }
        const image = await createImageBitmap(blob);
        const bytes = new Uint8Array(await blob.arrayBuffer());
        done([[...bytes.slice(0, 4)], image.width, image.height]);
    })";
    browser.run_async(script, vec![json!(host), json!(form)]).await
}

/// Each picture of a page in each form: a drawing that parses, pixels, and a table with a row for each of its points.
async fn each_can_be_taken(browser: &Browser, hosts: &[&str]) {
    for host in hosts {
        browser.see(&format!("{host} + .take")).await;
        let svg = taken(browser, host, "svg").await;
        let svg = svg.as_str().unwrap();
        let drawn = "const s = new DOMParser().parseFromString(arguments[0], 'image/svg+xml'); return [s.querySelectorAll('parsererror').length, s.documentElement.tagName, s.querySelectorAll('path, rect').length, s.documentElement.textContent]";
        let drawn = browser.run(drawn, vec![json!(svg)]).await;
        assert_eq!((&drawn[0], &drawn[1]), (&json!(0), &json!("svg")), "{host}");
        assert!(drawn[2].as_u64().unwrap() > 3, "{host}: {drawn}");
        assert!(!svg.contains("NaN") && !svg.contains("undefined"), "{host}: {svg}");
        let png = taken(browser, host, "png").await;
        assert_eq!(png[0], json!([137, 80, 78, 71]), "{host}");
        assert!(
            png[1].as_u64().unwrap() > 500 && png[2].as_u64().unwrap() > 200,
            "{host}: {png}"
        );
        let csv = taken(browser, host, "csv").await;
        let rows = csv.as_str().unwrap().lines().count();
        assert!(rows > 5, "{host}: {rows} rows");
    }
}

/// A curve of a step as the server gives it.
fn series(server: &Server, step: usize, record: u64, which: usize) -> Vec<f64> {
    let path = format!("api/series?step={step}&record={record}&width=1200");
    serde_json::from_value(server.ask("GET", &path, b"").json()["points"]["y"][which].clone()).unwrap()
}

#[test]
fn val_steps_of_the_ladder_stand_over_one_record_with_the_noise_and_what_the_error_remembers() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"mpi","plays":6}"#);
    server.act(r#"{"what":"add","effect":"rate-dependence"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":4}"#);
    server.act(r#"{"what":"go-to","step":1}"#);
    in_browser(async {
        let browser = Browser::open(&format!("{}#compare", server.address()), false).await;
        browser.see("#with-drive canvas").await;
        let alone = columns(&browser, "#overlay").await;
        assert_eq!(alone.len(), 3, "time, measured, model");
        browser.click("#beside-0").await;
        browser.click("#beside-2").await;
        let both = "const done = arguments[0]; const look = () => (document.querySelector('#overlay').chart.data.length === 5 ? done(1) : setTimeout(look, 20)); look()";
        browser.run_async(both, vec![]).await;
        let record = browser
            .run("return Number(document.querySelector('#record').value)", vec![])
            .await;
        let record = record.as_u64().unwrap();
        let shown = columns(&browser, "#overlay").await;
        assert_eq!(shown[..3], alone[..]);
        for (column, step) in [(3, 0), (4, 2)] {
            assert_eq!(shown[column], series(&server, step, record, 1), "step {step}");
        }
        let errors = columns(&browser, "#residual").await;
        for (column, step) in [(1, 1), (2, 0), (3, 2)] {
            assert_eq!(errors[column], series(&server, step, record, 2), "step {step}");
        }
        let said = hysteron(&session, &["compare", "data", "models/2.toml", "--json"]);
        let noise = said["noise_rms_um"].as_f64().unwrap();
        assert_eq!((errors[4][0], errors[5][0]), (2.0 * noise, -2.0 * noise));
        remembered(&browser, &server, record).await;
        opens_where_the_error_is(&browser, &server, &said).await;
        let pictures = [
            "#overlay",
            "#residual",
            "#loop",
            "#own",
            "#with-drive",
            "#spectrum",
            ".map",
        ];
        each_can_be_taken(&browser, &pictures).await;
        let csv = taken(&browser, "#residual", "csv").await;
        let head = csv.as_str().unwrap().lines().next().unwrap().to_owned();
        assert!(
            head.starts_with("\"time, s\",\"error, µm\",\"error of step 1, µm\""),
            "{head}"
        );
        browser.picture("compare-beside").await;
        browser.accessible("steps beside each other").await;
        // What was chosen stays for the next record.
        browser.choose("#record", "0").await;
        let next = "const done = arguments[0]; const look = () => (document.querySelector('#overlay').chart && document.querySelector('#overlay').chart.data[3]?.[5] === arguments[1] ? done(1) : setTimeout(look, 20)); look()";
        let next = next.replace("arguments[1]", &series(&server, 0, 0, 1)[5].to_string());
        browser.run_async(&next, vec![]).await;
        // Of the recordings and of an effect in the model as well.
        browser.click("#way a[href='#data']").await;
        each_can_be_taken(&browser, &["#raw-record-data-time", "#raw-record-data-loop"]).await;
        // Before any model: what these records can tell. No record has the other axis' voltage.
        let told = browser.see("#told li").await;
        let told = told + &browser.see("#told").await;
        assert!(
            told.contains("They can show delay")
                && told.contains("Nothing of cross coupling: no record has a moving column"),
            "{told}"
        );
        browser.click("#small-data-2").await;
        let chosen = "return document.querySelector('#raw-record-data').selectedIndex";
        assert_eq!(browser.run(chosen, vec![]).await, json!(2));
        browser.picture("data-told").await;
        browser.accessible("what the records tell").await;
        for effect in ["delay", "creep"] {
            browser
                .run(&format!("location.hash = 'effects/{effect}'"), vec![])
                .await;
            let named = format!("#effect-shown + .take button[aria-label^='{effect}']");
            browser.see(&named).await;
            each_can_be_taken(&browser, &["#effect-shown"]).await;
        }
        browser.close().await;
    });
}

/// The page says of the drive what the correlations are.
/// Small pictures of all records, the spectrum of one or of all, and cells of the maps lead to what they show.
async fn opens_where_the_error_is(browser: &Browser, server: &Server, said: &Value) {
    let records = said["records"].as_array().unwrap();
    let pressed = "return [...document.querySelectorAll('#small-step button')].map((one) => one.getAttribute('aria-pressed') === 'true')";
    let chosen = "return Number(document.querySelector('#record').value)";
    let strip = async || -> Vec<bool> { serde_json::from_value(browser.run(pressed, vec![]).await).unwrap() };
    let begun = browser.run(chosen, vec![]).await.as_u64().unwrap() as usize;
    let shown = strip().await;
    assert_eq!(shown.len(), records.len());
    assert!(shown[begun] && shown.iter().filter(|one| **one).count() == 1);
    browser.click("#small-step-3").await;
    assert_eq!((browser.run(chosen, vec![]).await, strip().await[3]), (json!(3), true));
    // The spectrum is that of the record, or of all, as the command line has it.
    let spectrum = async |wanted: &str| {
        let script = "const [name, done] = arguments; const look = () => { const chart = document.querySelector('#spectrum').chart; \
            const taken = document.querySelector('#spectrum + .take button'); \
            return chart && taken && taken.getAttribute('aria-label') === `${name} as SVG` ? done([...chart.data[2]]) : setTimeout(look, 20); }; look()";
        let found = browser.run_async(script, vec![json!(wanted)]).await;
        serde_json::from_value::<Vec<f64>>(found).unwrap()
    };
    let one = spectrum(&format!("spectrum {}", records[3]["file"].as_str().unwrap())).await;
    browser.choose("#spectrum-of", "all").await;
    let all = spectrum("spectrum").await;
    let pooled = server.ask("GET", "api/spectrum?step=1", b"").json()["residual_um_per_rthz"].clone();
    let pooled: Vec<f64> = serde_json::from_value(pooled).unwrap();
    assert!(all == pooled && one != pooled);
    browser.choose("#spectrum-of", "one").await;
    // The brightest cell of the map over frequency and amplitude.
    let map = &said["swing_map"];
    let most = map["rms_um"]
        .as_array()
        .unwrap()
        .iter()
        .zip(map["worst"].as_array().unwrap());
    let cells = most.flat_map(|(rms, worst)| rms.as_array().unwrap().iter().zip(worst.as_array().unwrap()));
    let cells: Vec<(f64, &Value)> = cells.filter_map(|(rms, worst)| Some((rms.as_f64()?, worst))).collect();
    let (brightest, (_, worst)) = cells.iter().enumerate().max_by(|a, b| a.1.0.total_cmp(&b.1.0)).unwrap();
    let click = "document.querySelectorAll('.map')[0].querySelectorAll('.cell')[arguments[0]].dispatchEvent(new MouseEvent('click'))";
    browser.run(click, vec![json!(brightest)]).await;
    let [from, to] = ["from_s", "to_s"].map(|end| hysteron_report::significant(worst[end].as_f64().unwrap()));
    browser.see_text(&format!("{from} to {to} s")).await;
    let index = records
        .iter()
        .position(|record| record["file"] == worst["file"])
        .unwrap();
    assert_eq!(
        (browser.run(chosen, vec![]).await, strip().await[index]),
        (json!(index), true)
    );
    let view = "const { min, max } = document.querySelector('#overlay').chart.scales.x; return [min, max]";
    let view: [f64; 2] = serde_json::from_value(browser.run(view, vec![]).await).unwrap();
    assert!(view[0] <= worst["from_s"].as_f64().unwrap() && view[1] >= worst["to_s"].as_f64().unwrap());
    browser.picture("compare-opened").await;
    // Back to where it began.
    browser.click(&format!("#small-step-{begun}")).await;
}

async fn remembered(browser: &Browser, server: &Server, record: u64) {
    let found = server
        .ask("GET", &format!("api/correlation?step=1&record={record}"), b"")
        .json();
    let drive = columns(browser, "#with-drive").await;
    let (value, band) = (&found["with_drive"]["value"], &found["with_drive"]["band"]);
    assert_eq!((&json!(drive[1]), &json!(drive[2])), (value, band));
    let times = found["with_drive"]["largest"]["times"].as_f64().unwrap();
    let most = drive[1].iter().zip(&drive[2]).map(|(r, band)| r.abs() / band);
    assert!((most.fold(0.0, f64::max) - times).abs() < 1e-9, "{times}");
    let said = browser.see("#correlated").await;
    let words = if times > 1.0 {
        format!("by {} times what chance allows", hysteron_report::significant(times))
    } else {
        "at no lag by more than chance allows".to_owned()
    };
    assert!(said.contains(&words), "{said} should say: {words}");
}

/// Numbers between -1 and 1 that repeat from run to run.
fn noise(seed: u64, samples: usize) -> Vec<f64> {
    let mut state = seed;
    (0..samples)
        .map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        })
        .collect()
}

/// A stage of 0.1 um/V behind a lag of three samples, recorded over its range and with small signals.
fn recorded(folder: &Path) {
    let answer = |file: &str, role: Role, voltage_v: Vec<f64>, seed: u64| {
        let mut lagged = voltage_v[0];
        let heard = noise(seed, voltage_v.len());
        let position_um = voltage_v.iter().zip(heard).map(|(v, heard)| {
            lagged = 0.7 * lagged + 0.3 * v;
            0.1 * lagged + 0.02 * heard
        });
        Record::new(file, role, 1e-4, voltage_v.clone(), position_um.collect())
    };
    let large = (0..4000).map(|k| 50.0 - 50.0 * (std::f64::consts::TAU * f64::from(k) / 1000.0).cos());
    let small = noise(7, 40_000).into_iter().map(|value| 50.0 + 5.0 * value);
    let records = vec![
        answer("large.csv", Role::Identify, large.collect(), 1),
        answer("small.csv", Role::Validate, small.collect(), 2),
    ];
    let dataset = Dataset {
        name: "lagging".to_owned(),
        records,
        ..Dataset::default()
    };
    write_dataset(&dataset, folder, Overwrite::Refuse).unwrap();
}

#[test]
fn val_the_stage_s_answer_to_small_signals_stands_beside_the_model_s() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (session, data) = (folder.path().join("session"), folder.path().join("lagging"));
    recorded(&data);
    let server = Server::start_with(&session, &data);
    server.act(r#"{"what":"fit","model":"mpi","plays":4}"#);
    server.act(r#"{"what":"add","effect":"first-order-lag"}"#);
    server.act(r#"{"what":"design","wishes":{}}"#);
    let model = Model::read(&session.join("models/2.toml")).unwrap();
    let found = small_signal_response(&model, &hysteron_data::read_dataset(&session.join("data")).unwrap()).unwrap();
    in_browser(async {
        let browser = Browser::open(&format!("{}#controller", server.address()), true).await;
        browser.see("#stage-phase canvas").await;
        let gain = columns(&browser, "#stage-gain").await;
        assert_eq!(gain[0], found.frequency_hz);
        for (k, measured) in found.measured.iter().enumerate() {
            assert!((gain[1][k] / measured.norm() - 1.0).abs() < 1e-9);
            let upper = measured.norm() * (1.0 + 1.96 * found.deviation[k]);
            assert!((gain[3][k] / upper - 1.0).abs() < 1e-9 && gain[4][k] < gain[1][k]);
        }
        let phase = columns(&browser, "#stage-phase").await;
        assert_eq!([&phase[1], &phase[2]], [&found.phases_deg()[0], &found.phases_deg()[1]]);
        let said = browser.see("#response-said").await;
        let told = hysteron_report::significant(found.told_to_hz.unwrap());
        assert!(
            said.contains("small.csv") && said.contains(&format!("up to {told} Hz")),
            "{said}"
        );
        let lights = browser.see("#lights").await;
        assert!(lights.contains("by the record small.csv"), "{lights}");
        let pictures = [
            "#stage-gain",
            "#stage-phase",
            "#loop-sensitivity",
            "#loop-gain",
            "#loop-phase",
        ];
        each_can_be_taken(&browser, &pictures).await;
        // The loop through what the stage answered, and its margins beside the model's, as the library has them.
        let controller = Controller::read(&session.join("controllers/2.toml")).unwrap();
        let measured = MeasuredLoop::of(&controller, &found).unwrap();
        let margins = browser.see("#margins").await;
        let (phase, at) = measured.margins.phase_deg.unwrap();
        let [phase, at] = [phase, at].map(hysteron_report::significant);
        assert!(
            margins.contains("As measured") && margins.contains(&format!("{phase}° at {at} Hz")),
            "{margins}, not {phase}° at {at} Hz"
        );
        // Where nothing was measured there is none of it.
        let script = "return document.querySelector('#loop-gain').chart.data.map((column) => [...column])";
        let curve: Vec<Vec<Option<f64>>> = serde_json::from_value(browser.run(script, vec![]).await).unwrap();
        let last = curve.last().unwrap();
        assert!(last[0].is_none());
        let (k, hz) = (
            measured.frequency_hz.len() / 2,
            measured.frequency_hz[measured.frequency_hz.len() / 2],
        );
        let off = |at: &usize| (curve[0][*at].unwrap() - hz).abs();
        let near = (0..last.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        let ratio = last[near.unwrap()].unwrap() / measured.gain[k];
        assert!((0.8..1.25).contains(&ratio), "{ratio} at {hz} Hz");
        browser.picture("controller-response").await;
        browser.accessible("the stage's response").await;
        browser.close().await;
    });
}
