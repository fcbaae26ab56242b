//! The campaign on a stage of the user's own: plan, what comes back under any name, doubts, the next pass, the controller; each with the
//! digits and the bytes of the command line, and found again after a restart.

use crate::browser::{Browser, there};
use crate::controller::{design, table};
use crate::own_bench::{ZERO_UM, commands, played, short_rest};
use crate::server::Server;
use crate::way::in_browser;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Output;

/// A command as a page words it, run in a session.
pub(crate) fn typed(session: &Path, words: &str) -> Output {
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(session)
        .args(words.split(' ').skip(1))
        .output()
        .unwrap()
}

/// Without blanks, line ends and the box that errors are drawn in.
fn plain(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_whitespace() && !"│×".contains(*c))
        .collect()
}

/// The files of a pass, as they are downloaded, in a folder.
fn download(server: &Server, pass: usize, place: &Path) -> PathBuf {
    let zip = server.ask("GET", &format!("api/export/plan?pass={pass}"), b"");
    assert_eq!(zip.status, 200, "{}", zip.text());
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(zip.body)).unwrap();
    let folder = place.join(format!("download{pass}"));
    archive.extract(&folder).unwrap();
    folder.join("plan")
}

/// A folder's files with their bytes, those in it by their paths.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let inside = path.strip_prefix(folder).unwrap().to_owned();
                all.push((inside, std::fs::read(path).unwrap()));
            }
        }
    }
    all.sort();
    all
}

/// The state of the campaign as the page has it.
fn back(server: &Server) -> Value {
    server.state()["campaign"]["back"].clone()
}

fn sentences(back: &Value, kind: &str) -> Vec<String> {
    serde_json::from_value(back[kind].clone()).unwrap()
}

/// The commands under what came back, typed in the session with other outputs, say and write the same.
fn as_typed(server: &Server, session: &Path) {
    let back = back(server);
    let command = back["command"].as_str().unwrap();
    let (import, campaign) = command.split_once(" && ").unwrap();
    let import = import.replace("-o campaign/back", "-o typed/back");
    assert!(typed(session, &import).status.success(), "{import}");
    let campaign = campaign
        .replace("--recorded campaign/back", "--recorded typed/back")
        .replace("-o campaign/records", "-o typed/records");
    let before = files(&session.join("campaign/plan"));
    let output = typed(session, &campaign);
    let noted = plain(&String::from_utf8_lossy(&output.stderr));
    for kind in ["refused", "doubts", "notes"] {
        for sentence in sentences(&back, kind) {
            assert!(noted.contains(&plain(&sentence)), "{kind}: {sentence}\n{noted}");
        }
    }
    let Some(said) = back["said"].as_str() else {
        assert_eq!(output.status.code(), Some(2));
        return;
    };
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(
        printed.starts_with(&format!("{said}\nwritten to typed/records")),
        "{printed}\n{said}"
    );
    assert_eq!(
        noted.matches("warning").count(),
        sentences(&back, "doubts").len(),
        "{noted}"
    );
    assert!(files(&session.join("campaign/plan")) == before, "the bytes of the plan");
    assert!(
        files(&session.join("campaign/records")) == files(&session.join("typed/records")),
        "the bytes of the records"
    );
}

/// Recordings of commands in a folder, numbered as an instrument does it.
fn recorded(bench: &Path, instrument: &str, commands: &[PathBuf], (seed, before): (u64, usize)) -> Vec<PathBuf> {
    let record = |(number, file): (usize, &PathBuf)| {
        let there = bench.join(format!("{instrument}_{number}.csv"));
        std::fs::write(&there, played(seed + number as u64, &[], file, before)).unwrap();
        there
    };
    commands.iter().enumerate().map(record).collect()
}

/// Brings files, and waits until what came back is said.
async fn bring(browser: &Browser, files: &[PathBuf], verdict: &str) {
    browser.drop_files("#campaign-drop", files).await;
    browser.see_text(verdict).await;
}

/// The page in four looks, after a step of the way.
async fn looks(browser: &Browser, dark: &Browser, name: &str) {
    let open = "const e = document.querySelector('#campaign'); if (e) e.open = true; return null";
    for (browser, shade) in [(browser, "light"), (dark, "dark")] {
        browser.run(open, vec![]).await;
        for width in [390, 1440] {
            browser
                .picture_of_width(&format!("campaign-{name}-{shade}"), width)
                .await;
        }
        browser.accessible(&format!("campaign, {name}, {shade}")).await;
    }
}

#[test]
fn val_a_campaign_in_the_workbench_ends_in_the_controller_of_the_command_line() {
    if !there() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (session, bench) = (folder.path().join("session"), folder.path().join("bench"));
    std::fs::create_dir(&bench).unwrap();
    let server = Server::start(&session);
    in_browser(async {
        let address = format!("{}#controller", server.address());
        let (browser, dark) = (
            Browser::open(&address, false).await,
            Browser::open(&address, true).await,
        );
        planned(&browser, &server, &session).await;
        looks(&browser, &dark, "planned").await;
        first_pass(&browser, &server, &session, &bench).await;
        looks(&browser, &dark, "first").await;
        second_pass(&browser, &dark, &server, &session, &bench).await;
        third_pass(&browser, &server, &session, &bench).await;
        looks(&browser, &dark, "complete").await;

        browser.click("#campaign-design").await;
        let said = design(&browser, &session, "WHILE IT WAS RECORDED").await;
        assert!(said.contains("drift to frf-small-again: gain "), "{said}");
        table_of_it(&browser, &session).await;
        browser.click("#to-campaign").await;
        browser.see("#campaign").await;
        dark.run("location.hash = '#controller/campaign'; return null", vec![])
            .await;
        dark.see("#export-table").await;
        dark.picture_of_width("campaign-controller-dark", 390).await;
        dark.accessible("the campaign's controller").await;
        dark.close().await;
        browser.close().await;
    });
    // Found again after a restart, and in the session that is taken home.
    let before = server.state()["campaign"].clone();
    drop(server);
    let server = Server::start(&session);
    assert_eq!(server.state()["campaign"], before);
    let zip = server.ask("GET", "api/export/session", b"").body;
    let zip = zip::ZipArchive::new(std::io::Cursor::new(zip)).unwrap();
    for name in [
        "controller.toml",
        "plan/campaign.toml",
        "files/scope_0.csv",
        "records/dataset.toml",
    ] {
        assert!(
            zip.index_for_name(&format!("session/campaign/{name}")).is_some(),
            "{name}"
        );
    }
}

/// The section is closed until it is asked for; its plan is the command's.
async fn planned(browser: &Browser, server: &Server, session: &Path) {
    browser.see("#campaign:not([open])").await;
    browser.accessible("a controller without a model").await;
    browser.click("#campaign > summary").await;
    browser.type_into("#campaign-top_v", "2000").await;
    browser.type_into("#campaign-rate_hz", "50000").await;
    browser.type_into("#campaign-latency_us", "20").await;
    browser.click("#campaign-plan").await;
    let said = browser.see("#campaign-plan-form #fault:not([hidden])").await;
    assert_eq!(said, "--top-v 2000: give 1 to 1000 V");
    browser.type_into("#campaign-top_v", "200").await;
    browser.click("#campaign-plan").await;
    browser.see("#campaign-download").await;
    let command = server.state()["campaign"]["command"].as_str().unwrap().to_owned();
    let output = typed(session, &command.replace("-o campaign/plan", "-o typed-plan"));
    assert!(output.status.success(), "{command}");
    assert!(
        files(&session.join("campaign/plan")) == files(&session.join("typed-plan")),
        "the bytes of the plan"
    );
    let words = server.state()["campaign"]["passes"][0].as_str().unwrap().to_owned();
    let printed = String::from_utf8(output.stdout).unwrap().replace("typed-plan", "plan");
    // Names are set in columns of forty characters.
    assert!(plain(&printed).starts_with(&plain(&words)), "{printed}\n{words}");
    let shown = browser.see("#campaign-words").await;
    assert_eq!(plain(&shown), plain(&words));
}

/// Under an instrument's names, each begun before its command.
async fn first_pass(browser: &Browser, server: &Server, session: &Path, bench: &Path) {
    let plan = download(server, 0, bench);
    assert!(
        files(&plan) == files(&session.join("campaign/plan")),
        "the bytes of the archive"
    );
    let files = recorded(bench, "scope", &commands(&plan), (1, 777));
    bring(browser, &files, "The next pass is ready.").await;
    let findings = browser.see("#campaign-findings").await;
    browser.click("#campaign-notes-part > summary").await;
    let notes = browser.see("#campaign-notes").await;
    assert!(notes.contains("begins 777 samples"), "{notes}");
    assert!(findings.contains("a skew between the channels"), "{findings}");
    browser.click("#campaign-said-part > summary").await;
    let said = browser.see("#campaign-said").await;
    let zero = said.split_once("the sensor reads ").unwrap().1;
    let zero_um: f64 = zero.split_once(' ').unwrap().0.parse().unwrap();
    // Rests of seconds leave a stage that creeps by 1.5 % of 15 um a decade a third of a percent above its zero.
    assert!((zero_um - ZERO_UM).abs() < 0.05, "{zero_um}");
    as_typed(server, session);
}

/// One of them after too short a rest, and a file that is none.
async fn second_pass(browser: &Browser, dark: &Browser, server: &Server, session: &Path, bench: &Path) {
    let plan = download(server, 1, bench).join("pass1");
    let commands = commands(&plan);
    let files = recorded(bench, "CH2", &commands, (20, 0));
    std::fs::write(&files[1], played(2, &short_rest(), &commands[1], 0)).unwrap();
    bring(browser, &files, "They cannot be used yet: one thing is to be mended.").await;
    let findings = browser.see("#campaign-findings").await;
    let record = commands[1].file_stem().unwrap().to_str().unwrap();
    assert!(
        findings.contains(&format!("{record} does not begin at rest")),
        "{findings}"
    );
    assert!(findings.contains("(in CH2_1.csv)"), "{findings}");
    assert!(
        findings.contains("at the rest voltage before it, as the plan has it"),
        "{findings}"
    );
    as_typed(server, session);
    looks(browser, dark, "refused").await;

    let before = server.state()["campaign"].clone();
    let none = bench.join("none.csv");
    std::fs::write(&none, "a word\nand another\n").unwrap();
    browser
        .drop_files("#campaign-drop", &[none, plan.join("all.csv")])
        .await;
    let fault = browser.see("#fault:not([hidden])").await;
    assert!(fault.contains("none.csv") && fault.contains("all.csv"), "{fault}");
    assert_eq!(server.state()["campaign"], before);

    browser.click("button[aria-label='Take away: CH2_1.csv']").await;
    browser
        .see_text(&format!("{record}: not there; play pass1/{record}.csv"))
        .await;
    let good = bench.join("again.csv");
    std::fs::write(&good, played(60, &[], &commands[1], 0)).unwrap();
    bring(browser, &[good], "The next pass is ready.").await;
    as_typed(server, session);
}

/// The last pass, under names that files have already.
async fn third_pass(browser: &Browser, server: &Server, session: &Path, bench: &Path) {
    let plan = download(server, 2, bench).join("pass2");
    let files = recorded(bench, "scope", &commands(&plan), (40, 0));
    bring(browser, &files, "The campaign is complete.").await;
    let came = server.state()["campaign"]["files"].to_string();
    assert!(
        came.contains("\"scope_0.csv\"") && came.contains("\"scope_0-2.csv\""),
        "{came}"
    );
    as_typed(server, session);
}

/// The table asks for the converters that nobody has named, and is the command's.
async fn table_of_it(browser: &Browser, session: &Path) {
    for (field, value) in [
        ("#table-dac_min_v", "0"),
        ("#table-dac_full_v", "200"),
        ("#table-adc_min_um", "-25"),
        ("#table-adc_full_um", "25"),
    ] {
        browser.type_into(field, value).await;
    }
    table(browser, session).await;
    browser.picture("campaign-controller").await;
}

#[test]
fn refuse_what_is_no_part_of_a_campaign_and_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    let upload = |name: &str, text: &str| {
        let answer = server.ask("POST", &format!("api/campaign/upload?name={name}"), text.as_bytes());
        (answer.status, answer.text())
    };
    let refused = |deed: &str, words: &str| {
        let answer = server.act(deed);
        let failed = server.state()["job"]["failed"].as_str().unwrap_or_default().to_owned();
        let said = if answer.status == 200 { failed } else { answer.text() };
        assert!(said.contains(words), "{deed}: {said}");
    };
    let row = "time_s,voltage_v,position_um\n0,0,0\n0.0001,1,0.3\n0.0002,2,0.5\n";
    assert_eq!(upload("a.csv", row).0, 409, "without a plan");
    refused(
        r#"{"what":"campaign-plan","asked":{"top_v":20}}"#,
        "give --top-v and --rate-hz",
    );
    refused(
        r#"{"what":"campaign-plan","asked":{"top_v":20,"rate_hz":10000,"latency_us":20000}}"#,
        "--latency-us 20000: give 0 to 10000 us",
    );
    assert_eq!(server.state()["campaign"], Value::Null);
    let plan = r#"{"what":"campaign-plan","asked":{"top_v":20,"rate_hz":10000}}"#;
    assert_eq!(server.act(plan).status, 200);
    refused(plan, "there is a plan already");
    refused(
        r#"{"what":"design","wishes":{},"of":"campaign"}"#,
        "not recorded to its end yet",
    );
    assert_eq!(server.ask("GET", "api/export/plan?pass=1", b"").status, 404);

    let hold = std::fs::read_to_string(session.join("campaign/plan/hold.csv")).unwrap();
    for (name, text, words) in [
        ("none.csv", "a word", "none.csv"),
        ("hold.csv", hold.as_str(), "position"),
        (
            "dataset.toml",
            "format = 1\nname = \"b\"\n[known]\ndelay_s = 1e-5\n[[record]]\nfile = \"b.csv\"\nrole = \"identify\"\n",
            "its [known] is not read here",
        ),
        ("..", "x", "is no name of a recording"),
    ] {
        let (status, said) = upload(name, text);
        assert!(status >= 400 && said.contains(words), "{name}: {status} {said}");
    }
    assert_eq!(server.state()["campaign"]["files"], json!([]));
    assert_eq!(upload("one.csv", row).0, 200);
    assert!(
        upload("other.csv", row).1.contains("other.csv"),
        "the same bytes are known"
    );
    refused(
        r#"{"what":"campaign-look","looked":{}}"#,
        "the latency of your controller, from reading to command, is not known",
    );
    assert_eq!(back(&server), Value::Null);
    assert_eq!(
        server
            .act(r#"{"what":"campaign-look","looked":{"latency_us":20}}"#)
            .status,
        200
    );
    let said = sentences(&back(&server), "refused");
    assert!(
        said[0].starts_with("one.csv: its voltage is that of no planned record"),
        "{said:?}"
    );
    assert!(
        said.iter()
            .any(|said| said.starts_with("hold: not there; play hold.csv of the plan")),
        "{said:?}"
    );
    as_typed(&server, &session);

    refused(
        r#"{"what":"campaign-forget","file":"two.csv"}"#,
        "there is no such file",
    );
    let reading = r#"{"columns":["voltage=nothing"],"rate_hz":null,"missing":"","gaps":"","jitter":""}"#;
    refused(
        &format!("{{\"what\":\"campaign-reading\",\"reading\":{reading}}}"),
        "nothing",
    );
    assert_eq!(server.state()["campaign"]["reading"]["columns"], json!([]));
    drop(server);
    let server = Server::start(&session);
    assert_eq!(server.state()["campaign"]["files"], json!(["one.csv"]));
    assert_eq!(server.act(r#"{"what":"campaign-end"}"#).status, 200);
    assert_eq!(server.state()["campaign"], Value::Null);
    assert!(!session.join("campaign").exists());
}

/// The fields of a plan begin with what the recordings of the session know; without any they are empty.
#[test]
fn val_the_plan_is_filled_in_from_the_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("session"));
    let usual = || server.ask("GET", "api/campaign/usual", b"").json();
    assert_eq!(usual(), json!({"top_v": null, "rate_hz": null, "latency_us": null}));
    for (name, text) in [
        (
            "a.csv",
            "time_s,voltage_v,position_um\n0,0,0\n0.0001,40,2\n0.0002,10,1\n",
        ),
        (
            "dataset.toml",
            "format = 1\nname = \"b\"\n[known]\ndelay_s = 7e-5\nvoltage_max_v = 120.0\n[[record]]\nfile = \"a.csv\"\nrole = \"identify\"\n",
        ),
    ] {
        let answer = server.ask("POST", &format!("api/upload?name={name}"), text.as_bytes());
        assert_eq!(answer.status, 200, "{}", answer.text());
    }
    assert_eq!(server.act(r#"{"what":"take-files"}"#).status, 200);
    // Half a sample of hold is no latency.
    assert_eq!(usual(), json!({"top_v": 120.0, "rate_hz": 10000.0, "latency_us": 20.0}));
}
