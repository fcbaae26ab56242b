//! The same as the command line, to the digit; found again after a restart; two tabs.

use crate::server::Server;
use std::path::Path;

fn hysteron(folder: &Path, arguments: &[&str]) -> String {
    let out = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
        .current_dir(folder)
        .args(arguments)
        .assert()
        .success();
    String::from_utf8(out.get_output().stdout.clone()).unwrap()
}

#[test]
fn val_the_workbench_says_what_the_command_line_says_to_the_digit() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let server = Server::start(&session);
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"mpi","plays":6}"#);
    server.act(r#"{"what":"diagnose"}"#);
    server.act(r#"{"what":"add","effect":"rate-dependence"}"#);
    let state = server.state();
    assert_eq!(state["current"], 1, "{}", state["job"]);
    let same = |arguments: &[&str], path: &str| {
        let said = hysteron(&session, arguments);
        assert_eq!(
            server.ask("GET", path, b"").text(),
            said,
            "hysteron {}",
            arguments.join(" ")
        );
    };
    same(&["compare", "data", "models/1.toml", "--json"], "api/compare?step=0");
    same(&["compare", "data", "models/2.toml", "--json"], "api/compare?step=1");
    same(
        &["diagnose", "data", "models/1.toml", "--json"],
        "api/diagnosis?step=0&plain=yes",
    );
    hysteron(
        &session,
        &["fit", "data", "--model", "mpi", "--plays", "6", "-o", "../fit.toml"],
    );
    let models = [folder.path().join("fit.toml"), session.join("models/1.toml")];
    assert_eq!(std::fs::read(&models[0]).unwrap(), std::fs::read(&models[1]).unwrap());
    hysteron(&session, &["report", "data", "models/1.toml", "-o", "report.html"]);
    let typed = std::fs::read(session.join("report.html")).unwrap();
    // From the diagnosis that was kept: what is read back is what was written, to the last bit.
    server.act(r#"{"what":"go-to","step":0}"#);
    server.act(r#"{"what":"report"}"#);
    let report = server.ask("GET", "api/export/report?step=0", b"");
    assert!(report.body == typed, "the report's bytes");
}

#[test]
fn regress_a_restart_finds_the_session_and_a_stale_tab_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let before = {
        let server = Server::start(&session);
        server.act(r#"{"what":"start","name":"demo"}"#);
        server.act(r#"{"what":"fit","model":"pi","plays":4}"#);
        server.act(r#"{"what":"fit","model":"mpi","plays":4}"#);
        let state = server.state();
        let stale = state["revision"].as_u64().unwrap() - 1;
        let body = format!(r#"{{"revision":{stale},"do":{{"what":"fit","model":"pi","plays":4}}}}"#);
        let told = server.ask("POST", "api/do", body.as_bytes());
        assert_eq!(
            (
                told.status,
                told.json()["error"].as_str().unwrap().contains("another tab")
            ),
            (409, true)
        );
        // A second server on the same folder would overwrite the first one's book.
        let second = assert_cmd::Command::new(env!("CARGO_BIN_EXE_hysteron"))
            .args(["lab", "--no-open", "--session"])
            .arg(&session)
            .assert()
            .code(2);
        assert!(String::from_utf8_lossy(&second.get_output().stderr).contains("has it open"));
        state
    };
    let server = Server::start(&session);
    let after = server.state();
    for part in ["steps", "current", "data", "diagnosed"] {
        assert_eq!(before[part], after[part], "{part}");
    }
    assert_eq!(after["steps"].as_array().unwrap().len(), 2);
    assert_eq!(server.ask("GET", "api/compare?step=1", b"").status, 200);
}

#[test]
fn prop_a_diagnosis_that_is_stopped_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::start(&folder.path().join("session"));
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"mpi","plays":6}"#);
    let before = server.state();
    let ask = |deed: &str| {
        server.ask(
            "POST",
            "api/do",
            format!("{{\"revision\":{},\"do\":{deed}}}", before["revision"]).as_bytes(),
        )
    };
    assert_eq!(ask(r#"{"what":"diagnose"}"#).status, 200);
    assert_eq!(
        ask(r#"{"what":"fit","model":"pi","plays":4}"#).status,
        409,
        "one job at a time"
    );
    assert_eq!(ask(r#"{"what":"stop"}"#).status, 200);
    let after = server.wait();
    assert_eq!(
        (&after["job"]["stopped"], &after["job"]["failed"]),
        (&true.into(), &serde_json::Value::Null)
    );
    assert_eq!(
        (&after["revision"], &after["diagnosed"]),
        (&before["revision"], &before["diagnosed"])
    );
    server.act(r#"{"what":"diagnose"}"#);
    assert_eq!(server.state()["diagnosed"][0], true, "and it can be started again");
}
