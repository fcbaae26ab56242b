//! The board in the workbench: a simulated one that runs the project's own table is watched, changed, recorded into the data and given
//! another table; a closed page leaves it at rest; what is lost is shown.

use crate::browser::{Browser, there};
use crate::server::{Server, started};
use crate::small_board::SmallBoard;
use crate::way::{hysteron, in_browser};
use hysteron_board::Mode;
use hysteron_board::live::{Ask, AxisStatus, Live};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

/// Longest wait for what takes a fraction of a second.
const PATIENCE: Duration = Duration::from_secs(120);

/// A session on the demo stage with a fitted model.
fn fitted(session: &Path) -> Server {
    let server = Server::start(session);
    assert_eq!(server.act(r#"{"what":"start","name":"demo"}"#).status, 200);
    assert_eq!(server.act(r#"{"what":"fit","model":"mrpi","plays":10}"#).status, 200);
    server
}

/// Designs the step's controller with wishes and makes its table.
fn designed(server: &Server, wishes: Value) {
    let design = json!({"what": "design", "wishes": wishes});
    for deed in [design, json!({"what": "table", "bench": {}})] {
        let answer = server.act(&deed.to_string());
        assert_eq!(answer.status, 200, "{}", answer.text());
        assert!(server.state()["job"]["failed"].is_null(), "{}", server.state()["job"]);
    }
}

fn board(server: &Server) -> Value {
    server.ask("GET", "api/board", b"").json()
}

/// Waits until something holds of the board; the server answers each second.
fn until(server: &Server, holds: impl Fn(&Value) -> bool) {
    while !holds(&board(server)) {}
}

/// Rows of a table below an element, cell by cell.
async fn rows(browser: &Browser, host: &str) -> Vec<Vec<String>> {
    let cells = "return [...document.querySelectorAll(arguments[0] + ' tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))";
    serde_json::from_value(browser.run(cells, vec![json!(host)]).await).unwrap()
}

async fn recorded(browser: &Browser, count: usize) -> Vec<Vec<String>> {
    browser.see(&format!("#runs[data-count='{count}'] table")).await;
    rows(browser, "#runs").await
}

#[test]
fn val_a_board_is_watched_changed_recorded_and_given_another_table() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = fitted(&session);
    in_browser(async {
        let address = format!("{}#board", server.address());
        let browser = Browser::open(&address, false).await;
        let dark = Browser::open(&address, true).await;
        browser.see("#no-table").await;
        browser.accessible("no board, no table").await;
        // First a law that is not told the reference before it is due; the second table's is.
        designed(&server, json!({"reference": "live"}));
        browser.see("#simulate").await;
        browser.picture("board-none").await;
        browser.accessible("no board").await;
        browser.choose("#simulate-stage", "paper-rate").await;
        browser.click("#simulate").await;
        browser.see("#scope-position canvas").await;
        browser.see_text("at rest").await;
        let first = board(&server);
        assert_eq!(
            (first["name"].as_str(), first["stage"].as_str()),
            (Some("simulated"), Some("paper-rate"))
        );

        // Gains at any time; each answer is shown.
        browser.type_into("#gains-integral_v_per_um_s", "0").await;
        browser.click("#gains").await;
        browser.see_text("other gains: taken at tick").await;

        // Played, recorded, and into the data.
        browser.type_into("#record-hz", "50").await;
        browser.type_into("#record-seconds", "0.5").await;
        browser.click("#record").await;
        let runs = recorded(&browser, 1).await;
        assert_eq!(
            (runs[0][0].as_str(), runs[0][5].as_str()),
            ("sine 50 Hz", "0"),
            "{runs:?}"
        );
        browser.click("#keep-validate").await;
        browser.see("#came[hidden]").await;
        let state = server.wait_for(|state| {
            state["data"]["records"]
                .as_array()
                .is_some_and(|records| records.len() == 10)
        });
        let record = &state["data"]["records"][9];
        assert_eq!(
            (record["file"].as_str(), record["role"].as_str()),
            (Some("board-001.csv"), Some("validate"))
        );
        assert!(record["samples"].as_u64().unwrap() >= 25_000, "{record}");
        let data = state["data"]["path"].as_str().unwrap();
        let compared = hysteron(&session, &["compare", data, "models/1.toml", "--json"]);
        let files: Vec<&str> = compared["records"]
            .as_array()
            .unwrap()
            .iter()
            .map(|r| r["file"].as_str().unwrap())
            .collect();
        assert!(files.contains(&"board-001.csv"), "{files:?}");

        // The scope: what it shows is what the board says, a trigger holds it still, figures can be pinned, the spectrum is there.
        browser.click("#board-start").await;
        browser.see_text("running").await;
        browser.see("#scope-position[data-triggered='true']").await;
        browser.click("#pin").await;
        assert_eq!(rows(&browser, "#pins").await.len(), 1);
        browser.click("#scope-with-spectrum").await;
        browser.see("#scope-spectrum canvas").await;
        // While it runs, the reference stays; the board says so.
        browser.click("#play").await;
        browser.see_text("another reference: refused at tick").await;
        browser.picture("board").await;
        for (browser, shade) in [(&browser, "light"), (&dark, "dark")] {
            browser.see("#scope-position canvas").await;
            for width in [390, 1024, 1440, 1920] {
                browser.picture_of_width(&format!("board-{shade}"), width).await;
            }
            browser.accessible(&format!("a board, {shade}")).await;
        }
        browser.click("#hold").await;
        browser.see("#hold[aria-pressed='true']").await;
        browser.click("#hold").await;
        browser.click("#board-stop").await;
        browser.see_text("at rest").await;

        // Another table, and the error after it beside the one before.
        designed(&server, json!({}));
        browser.see("#upload").await;
        let before = board(&server)["tables"][0][0]["table"].clone();
        browser.click("#upload").await;
        until(&server, |now| {
            now["tables"][0][0]["table"].is_string() && now["tables"][0][0]["table"] != before
        });
        browser.see("#record").await;
        browser.click("#record").await;
        let runs = recorded(&browser, 2).await;
        assert_ne!(runs[0][1], runs[1][1], "two tables");
        let percent = |row: &[String]| row[3].trim_end_matches(['%', '\u{a0}']).parse::<f64>().unwrap();
        assert!(
            percent(&runs[1]) < 5.0 && percent(&runs[1]) < percent(&runs[0]),
            "{runs:?}"
        );
        browser.picture("board-two-tables").await;
        browser.click("#leave").await;
        browser.see("#connect").await;
        assert_eq!(board(&server)["connected"], false);
        dark.close().await;
        browser.close().await;
    });
}

/// Whether QEMU is there; said where it is not and need not be.
#[expect(clippy::print_stdout, reason = "a skipped test says why")]
fn emulator() -> bool {
    let there = Command::new("qemu-system-arm").arg("--version").output().is_ok();
    assert!(
        there || std::env::var_os("HYSTERON_EMULATOR").is_none(),
        "no qemu-system-arm"
    );
    if !there {
        println!("skipped: no qemu-system-arm; `cargo xtask test` installs it");
    }
    there
}

/// `hysteron board serve`, ended with the test.
struct Serving(Child);

impl Serving {
    fn start() -> (Self, String) {
        let table = concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware/tables/tracking-8k.toml");
        Self::of(&[table], "8k")
    }

    fn of(law: &[&str], stage: &str) -> (Self, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hysteron"));
        command.args(["board", "serve"]).args(law).args(["--stage", stage]);
        let (child, address) = started(&mut command, "board: ");
        (Self(child), address)
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn val_a_closed_page_leaves_the_stage_at_rest() {
    if !there() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("session"));
    let (serving, address) = Serving::start();
    in_browser(async {
        let browser = Browser::open(&format!("{}#board", server.address()), false).await;
        browser.type_into("#connect-from", &address).await;
        browser.click("#connect").await;
        browser.see_text("at rest").await;
        browser.click("#board-start").await;
        browser.see_text("running").await;
        // Another page of the workbench keeps it going.
        browser.click("#way a[href='#data']").await;
        browser.see("#files").await;
        assert_eq!(board(&server)["axes"][0]["running"], true);
        browser.close().await;
    });
    // Nobody looks any more: the workbench lets the board go.
    server.wait_for(|state| state["board"] == false);
    let live = Live::open(&address).unwrap();
    let rests = |axis: &AxisStatus| axis.mode == Mode::Off;
    let status = live.wait(PATIENCE, |status| status.axes.first().is_some_and(rests));
    assert_eq!(status.axes[0].mode, Mode::Off);
    assert_eq!(board(&server)["connected"], false);
    drop(live);

    // A link that is lost is shown, and asked nothing more.
    let connect = json!({"what": "connect", "from": address}).to_string();
    assert_eq!(server.ask("POST", "api/board", connect.as_bytes()).status, 200);
    drop(serving);
    until(&server, |now| now["ended"].is_string());
    let start = server.ask("POST", "api/board", br#"{"what":"start"}"#);
    assert_eq!(start.status, 422);
    assert!(
        start.text().contains("the connection to the board is over"),
        "{}",
        start.text()
    );
}

/// The whole way to the chip: the controller's own image is built, runs in the emulator, is seen and played, and its record comes into the data.
#[test]
fn val_the_controller_s_own_image_is_a_board_for_the_page() {
    if !there() || !emulator() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = fitted(&session);
    designed(&server, json!({}));
    in_browser(async {
        let browser = Browser::open(&format!("{}#controller", server.address()), false).await;
        browser.choose("#image-board", "mps2-an386").await;
        browser.click("#build-image").await;
        browser.see("#export-image-mps2-an386").await;
        browser.picture("controller-image").await;
        browser.accessible("an image").await;
        let image = session.join("tables/1-mps2-an386.elf");
        let taken = server.ask("GET", "api/export/image?step=0&board=mps2-an386", b"");
        assert!(taken.status == 200 && taken.body == std::fs::read(&image).unwrap());
        let law = ["--emulator", "mps2-an386", "--image", image.to_str().unwrap()];
        let (_serving, address) = Serving::of(&law, "paper-rate");
        browser.run("location.hash = 'board'", vec![]).await;
        browser.type_into("#connect-from", &address).await;
        browser.click("#connect").await;
        browser.see("#scope-position canvas").await;
        browser.see_text("mps2-an386").await;
        browser.type_into("#record-hz", "200").await;
        browser.type_into("#record-seconds", "0.05").await;
        browser.click("#record").await;
        let runs = recorded(&browser, 1).await;
        assert_eq!(
            (runs[0][0].as_str(), runs[0][5].as_str()),
            ("sine 200 Hz", "0"),
            "{runs:?}"
        );
        browser.picture("board-emulated").await;
        browser.click("#keep-validate").await;
        browser.see("#came[hidden]").await;
        browser.click("#leave").await;
        browser.see("#connect").await;
        browser.close().await;
    });
    let records = server.state()["data"]["records"].clone();
    let last = records.as_array().unwrap().last().unwrap();
    assert_eq!(
        (last["file"].as_str(), last["rate_hz"].as_f64()),
        (Some("board-001.csv"), Some(50e3))
    );
    // Another table takes the images of this one away.
    designed(&server, json!({"reference": "live"}));
    assert_eq!(server.state()["images"]["there"], json!({"1": []}));
    // A build says what is compiled, and ends when it is stopped.
    assert_eq!(server.begin(r#"{"what":"image","board":"mps2-an386"}"#).status, 200);
    server.wait_for(|state| state["job"]["message"].as_str().unwrap().starts_with("Compiling"));
    assert_eq!(server.begin(r#"{"what":"stop"}"#).status, 200);
    let job = server.wait()["job"].clone();
    assert_eq!((&job["stopped"], &job["failed"]), (&json!(true), &Value::Null));
    assert_eq!(
        std::fs::read_dir(session.join("tables")).unwrap().count(),
        1,
        "the table alone"
    );
    for (query, status) in [
        ("step=0&board=mps2-an386", 404),
        ("step=0&board=moon", 400),
        ("step=7&board=mps2-an386", 404),
    ] {
        assert_eq!(
            server.ask("GET", &format!("api/export/image?{query}"), b"").status,
            status,
            "{query}"
        );
    }
}

/// Data that begin with a recording of a board know its delay; those that were there do not take it, and the page says so.
#[test]
fn val_data_that_begin_with_a_recording_know_the_board_s_delay() {
    let place = tempfile::tempdir().unwrap();
    let session = place.path().join("session");
    let server = Server::start(&session);
    let say = |deed: Value| {
        let answer = server.ask("POST", "api/board", deed.to_string().as_bytes());
        assert_eq!(answer.status, 200, "{}", answer.text());
    };
    let known_s = hysteron_board::budget::BOARDS[0].known_delay_s();
    for (count, with_delay) in [(1, true), (2, false)] {
        let mut small = SmallBoard::new();
        let address = small.address();
        let ticking = std::thread::spawn(move || small.serve(5000));
        say(json!({"what": "connect", "from": address}));
        until(&server, |now| {
            now["tables"].as_array().is_some_and(|tables| !tables.is_empty())
        });
        let wish = json!({"bank": null, "shape": "sine", "trajectory": null, "hz": 500, "low_um": null, "high_um": null, "seconds": 0.02});
        say(json!({"what": "record", "wish": wish}));
        until(&server, |now| now["came"].is_object());
        let came = board(&server)["came"].clone();
        let taken = server.state()["takes_known"].clone();
        assert_eq!((&came["delay_s"], taken), (&json!(known_s), json!(with_delay)));
        say(json!({"what": "keep", "role": "identify"}));
        let state = server.wait_for(|state| {
            let records = state["data"]["records"].as_array();
            records.is_some_and(|records| records.len() == count) && state["job"]["running"] == false
        });
        say(json!({"what": "leave"}));
        ticking.join().unwrap();
        let folder = session.join(state["data"]["path"].as_str().unwrap());
        let dataset = hysteron_data::read_dataset(&folder).unwrap();
        assert_eq!((dataset.known.delay_s, dataset.records.len()), (Some(known_s), count));
        assert!(
            dataset.records[0].excitation.starts_with("reference of the board"),
            "{:?}",
            dataset.records[0].excitation
        );
    }
}

#[test]
fn refuse_what_no_board_can_do() {
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(&place.path().join("session"));
    let say = |deed: &str| server.ask("POST", "api/board", deed.as_bytes());
    for (deed, status, said) in [
        (r#"{"what":"start"}"#, 409, "no board is connected"),
        (r#"{"what":"connect","from":"nowhere"}"#, 422, "nowhere"),
        (r#"{"what":"connect","from":"127.0.0.1:1"}"#, 422, "127.0.0.1:1"),
        (r#"{"what":"simulate","stage":"8k"}"#, 409, ""),
        (r#"{"what":"jump"}"#, 400, "the request cannot be read"),
        (r#"{"what":"keep","role":"validate"}"#, 409, "no board is connected"),
    ] {
        let answer = say(deed);
        assert_eq!(answer.status, status, "{deed}: {}", answer.text());
        assert!(answer.text().contains(said), "{deed}: {}", answer.text());
    }
    let (_serving, address) = Serving::start();
    assert_eq!(
        say(&json!({"what": "connect", "from": address}).to_string()).status,
        200
    );
    until(&server, |now| {
        now["tables"].as_array().is_some_and(|tables| !tables.is_empty())
    });
    let play = |more: Value| {
        let mut wish = json!({"bank": null, "shape": "sine", "trajectory": null, "hz": 50, "low_um": null, "high_um": null, "seconds": 0.1});
        wish.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        say(&json!({"what": "record", "wish": wish}).to_string())
    };
    for (more, said) in [
        (json!({"hz": 1e9}), "frequency, hertz = 1000000000 must lie in"),
        (
            json!({"low_um": -100.0, "high_um": 5.0}),
            "lowest reference, micrometres = -100 must lie in",
        ),
        (
            json!({"low_um": 5.0}),
            "give the lowest and the highest reference, or neither",
        ),
        (json!({"seconds": 1e6}), "seconds = 1000000 must lie in"),
        (json!({"trajectory": "1\n2\n"}), "256"),
        (
            json!({"shape": "moon"}),
            "there is no reference `moon`; there are sine, complex-harmonic",
        ),
        (json!({"axis": 1}), "the board has one axis"),
        (json!({"axis": 7}), "allowed are 0 and 1"),
        (json!({"bank": 3}), "bank 3"),
    ] {
        let answer = play(more.clone());
        assert!((400..500).contains(&answer.status), "{more}: {}", answer.text());
        assert!(answer.text().contains(said), "{more}: {}", answer.text());
    }
    let gains = say(r#"{"what":"gains","axis":0,"proportional_v_per_um":-1,"integral_v_per_um_s":0}"#);
    assert!(
        gains.text().contains("K_p = -1: allowed are 0 to 1e9"),
        "{}",
        gains.text()
    );
    for query in [
        "ticks=100&width=50&trigger=moon&level=1",
        "ticks=100&width=50&trigger=position",
        "ticks=x&width=50",
    ] {
        assert_eq!(
            server.ask("GET", &format!("api/board?{query}"), b"").status,
            400,
            "{query}"
        );
    }
    // A huge window is answered, not allocated.
    assert_eq!(
        server
            .ask("GET", "api/board?ticks=99999999999&width=99999999", b"")
            .status,
        200
    );
    // A second listener would take the first one's board away.
    assert_eq!(
        say(&json!({"what": "connect", "from": address}).to_string()).status,
        409
    );
    let live_is_alone = Live::open(&address).unwrap();
    live_is_alone.ask(Ask::Stop).unwrap();
}
