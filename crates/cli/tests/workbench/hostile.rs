//! Fifty bad requests and fifty broken uploads: refused in words, and the session as it was.

use crate::server::{Answer, Server};
use std::io::Write;

/// A refusal: of this kind, in words, as JSON, with nothing of the machine in it.
fn refused(what: &str, answer: &Answer, statuses: &[u16]) {
    assert!(
        statuses.contains(&answer.status),
        "{what}: {} {}",
        answer.head,
        answer.text()
    );
    let json = answer.json();
    let said = json["error"].as_str().unwrap_or_else(|| panic!("{what}: {json}"));
    assert!(
        said.len() > 8 && !said.contains("panicked") && !said.contains("root:"),
        "{what}: {said}"
    );
}

#[test]
fn refuse_fifty_bad_requests() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("secret.txt"), "root: secret").unwrap();
    let server = Server::start(&folder.path().join("session"));
    server.act(r#"{"what":"start","name":"demo"}"#);
    server.act(r#"{"what":"fit","model":"pi","plays":3}"#);
    let before = server.state();
    let token = server.token.clone();
    let port = server.port;
    let mut count = 0;
    let mut bad = |what: &str, answer: Answer, statuses: &[u16]| {
        refused(what, &answer, statuses);
        count += 1;
    };
    // Without the token, or with another.
    let wrong = "0".repeat(token.len());
    for path in [
        "/",
        "/api/session",
        "/app/app.js",
        "/api/compare?step=0",
        "/favicon.ico",
        "//",
        "/%2e%2e/",
    ] {
        bad(path, server.send("GET", path, &[], b""), &[403]);
    }
    for other in [
        wrong.as_str(),
        &token[1..],
        &token.to_uppercase().replace(|c: char| c.is_ascii_digit(), "A"),
        "%00",
    ] {
        bad(
            other,
            server.send("GET", &format!("/{other}/api/session"), &[], b""),
            &[403],
        );
    }
    bad(
        "token in the query",
        server.send("GET", &format!("/api/session?token={token}"), &[], b""),
        &[403],
    );
    // Foreign hosts (a name that was rebound to loopback) and origins (another page).
    let inside = format!("/{token}/api/session");
    let near = format!("127.0.0.1:{}", port.wrapping_add(1));
    for host in [
        "evil.example",
        "127.0.0.1",
        "localhost:1",
        &near,
        "127.0.0.1.evil.example",
        "",
    ] {
        bad(host, server.send("GET", &inside, &[("Host", host)], b""), &[403]);
    }
    let near = format!("http://{near}");
    let secure = format!("https://127.0.0.1:{port}");
    for origin in ["http://evil.example", "null", &near, &secure, "file://"] {
        bad(
            origin,
            server.send(
                "POST",
                &format!("/{token}/api/do"),
                &[("Origin", origin)],
                br#"{"revision":0,"do":{"what":"undo"}}"#,
            ),
            &[403],
        );
    }
    bad(
        "another site",
        server.send("GET", &inside, &[("Sec-Fetch-Site", "cross-site")], b""),
        &[403],
    );
    // Paths outside.
    for path in [
        "app/../../../etc/passwd",
        "app/..%2f..%2fsession.json",
        "app/%2e%2e/session.json",
        "session.json",
        "data/dataset.toml",
        "app//etc/passwd",
        "api/export/..%2f..%2fsecret.txt?step=0",
        ".lock",
        "models/1.toml",
    ] {
        bad(path, server.ask("GET", path, b""), &[404]);
    }
    for name in [
        "../evil.csv",
        "/etc/evil.csv",
        "a/../../evil.csv",
        "..",
        ".hidden",
        "",
        "a%00b.csv",
        "..%5cevil.csv",
        "con:stream.csv",
    ] {
        bad(
            name,
            server.ask(
                "POST",
                &format!("api/upload?name={name}"),
                b"time_s,voltage_v,position_um\n",
            ),
            &[400],
        );
    }
    // Malformed and oversized bodies, numbers that are none.
    let long = format!(
        r#"{{"revision":0,"do":{{"what":"start","name":"{}"}}}}"#,
        "x".repeat(200_000)
    );
    for body in [
        "",
        "{",
        "[]",
        "null",
        r#"{"revision":-1,"do":{"what":"undo"}}"#,
        r#"{"revision":0,"do":{"what":"rm -rf"}}"#,
        r#"{"revision":0,"do":{"what":"fit","model":"pi","plays":1e99}}"#,
        "\u{0}\u{1}",
        &"[".repeat(30_000),
    ] {
        bad(
            &body.chars().take(40).collect::<String>(),
            server.ask("POST", "api/do", body.as_bytes()),
            &[400],
        );
    }
    let answer = server.ask("POST", "api/do", long.as_bytes());
    assert_eq!(answer.status, 413, "{}", answer.head);
    for path in [
        "api/compare?step=7",
        "api/compare?step=-1",
        "api/compare",
        "api/series?step=0&record=99&width=10",
        "api/series?step=0&record=0&width=ten",
        "api/effect?step=0&name=nothing&frequency=100",
        "api/effect?step=0&name=delay&frequency=NaN",
        "api/export/passwd?step=0",
        "api/export/next?step=0",
        "api/export/report?step=0",
        "api/export/report?step=8",
        "api/export/controller?step=0",
        "api/controller?step=7",
        "api/diagnosis?step=0",
        "api/region?step=0&record=0&from=0&to=0",
    ] {
        bad(path, server.ask("GET", path, b""), &[400, 404, 422]);
    }
    for (path, body) in [
        (
            "api/upload?name=a.csv&asked=9",
            "time_s,voltage_v,position_um\n0,1,2\n0.1,1,2\n",
        ),
        (
            "api/upload?name=a.csv&asked=x",
            "time_s,voltage_v,position_um\n0,1,2\n0.1,1,2\n",
        ),
        ("api/reading", r#"{"files":["nothing.csv"],"reading":{}}"#),
        (
            "api/reading",
            r#"{"files":[],"reading":{"columns":["voltage=a:parsec"]}}"#,
        ),
        ("api/use", r#"{"file":"nothing.csv","role":"identify"}"#),
    ] {
        bad(path, server.ask("POST", path, body.as_bytes()), &[400, 404, 422]);
    }
    bad("a deed by GET", server.ask("GET", "api/do", b""), &[405]);
    let revision = &before["revision"];
    for deed in [
        r#"{"what":"fit","model":"pi","plays":0}"#,
        r#"{"what":"fit","model":"pi","plays":65}"#,
        r#"{"what":"fit","model":"none","plays":3}"#,
        r#"{"what":"add","effect":"magic"}"#,
        r#"{"what":"go-to","step":9}"#,
        r#"{"what":"undo"}"#,
        r#"{"what":"redo"}"#,
        r#"{"what":"stop"}"#,
        r#"{"what":"answer","effects":["delay"]}"#,
        r#"{"what":"reveal"}"#,
        r#"{"what":"table","bench":{"amplifier_min_v":1}}"#,
        r#"{"what":"table","bench":{"dac_min_v":10,"dac_full_v":-10}}"#,
        r#"{"what":"table","bench":{"mode_hz":100}}"#,
        r#"{"what":"table","bench":{}}"#,
        r#"{"what":"design","wishes":{"margin":99}}"#,
        r#"{"what":"design","wishes":{"output":"../x"}}"#,
        r#"{"what":"track","along":{"range_min_um":1}}"#,
        r#"{"what":"start","name":"../x"}"#,
        r#"{"what":"refit"}"#,
        r#"{"what":"role","record":"../x","role":"identify"}"#,
        r#"{"what":"role","record":"x.csv","role":"admire"}"#,
    ] {
        bad(
            deed,
            server.ask(
                "POST",
                "api/do",
                format!("{{\"revision\":{revision},\"do\":{deed}}}").as_bytes(),
            ),
            &[400, 404, 409, 422],
        );
    }
    assert!(count >= 50, "{count} bad requests");
    assert_eq!(
        server.raw(b"\x16\x03\x01\x02\x00garbage\r\n\r\n").status,
        400,
        "not HTTP at all"
    );
    let after = server.state();
    for part in ["revision", "steps", "data", "files"] {
        assert_eq!(before[part], after[part], "{part}");
    }
    let page = server.ask("GET", "", b"");
    assert_eq!(page.status, 200);
    for header in [
        "content-security-policy: default-src 'self'",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "x-frame-options: DENY",
    ] {
        assert!(page.head.to_lowercase().contains(&header.to_lowercase()), "{header}");
    }
}

/// Recordings that cannot be used, each in its own way.
fn broken() -> Vec<(String, Vec<u8>)> {
    let rows = |n: usize| {
        (0..n)
            .map(|k| format!("{},{},{}\n", k as f64 * 1e-3, k % 7, k % 5))
            .collect::<String>()
    };
    let head = "time_s,voltage_v,position_um\n";
    let good = format!("{head}{}", rows(50));
    let mut all: Vec<(String, Vec<u8>)> = Vec::new();
    let mut add = |name: &str, bytes: Vec<u8>| all.push((format!("{:02}-{name}", all.len()), bytes));
    add("empty.csv", vec![]);
    add("blank.csv", b" \n\n \n".to_vec());
    add("nul.csv", vec![0; 4096]);
    add(
        "noise.csv",
        (0..5000_u32)
            .map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8)
            .collect(),
    );
    add("head-only.csv", head.into());
    add("one-row.csv", format!("{head}0,1,2\n").into());
    add("words.csv", b"the quick brown fox\njumps over the dog\n".to_vec());
    add("html.csv", b"<html><script>alert(1)</script></html>\n".to_vec());
    add("carriage.csv", good.replace('\n', "\r").into());
    add("ragged.csv", format!("{head}0,1,2\n0.001,3\n0.002,1,2,3\n").into());
    for (name, cell) in [
        ("nan", "NaN"),
        ("inf", "inf"),
        ("huge", "1e999"),
        ("word", "abc"),
        ("quote", "\"1"),
        ("formula", "=1+1"),
        ("hex", "0x10"),
        ("two-points", "1.2.3"),
        ("gap", ""),
        ("sign", "+-1"),
        ("semicolon", "1;2"),
        ("unit", "1 V"),
        ("bracket", "(1)"),
        ("dashes", "--"),
    ] {
        add(
            &format!("{name}.csv"),
            format!("{head}{}0.05,{cell},2\n0.051,1,2\n", rows(50)).into(),
        );
    }
    add("backwards.csv", format!("{head}{}0.01,1,2\n", rows(50)).into());
    add("same-time.csv", format!("{head}0,1,2\n0,1,2\n0,1,2\n").into());
    add("time-gap.csv", format!("{head}{}9,1,2\n9.001,1,2\n", rows(50)).into());
    add("no-voltage.csv", b"time_s,position_um\n0,1\n0.1,2\n0.2,3\n".to_vec());
    add("no-position.csv", b"time_s,voltage_v\n0,1\n0.1,2\n0.2,3\n".to_vec());
    add("unknown-names.csv", b"a,b,c\n0,1,2\n1,2,3\n2,3,4\n".to_vec());
    add(
        "two-voltages.csv",
        b"time_s,voltage_v,voltage_v,position_um\n0,1,1,2\n1,1,1,2\n2,1,1,2\n".to_vec(),
    );
    add(
        "utf16-cut.csv",
        [
            b"\xff\xfe".to_vec(),
            good.encode_utf16().flat_map(u16::to_le_bytes).take(301).collect(),
        ]
        .concat(),
    );
    add("bom-only.csv", b"\xef\xbb\xbf".to_vec());
    add("long-line.csv", vec![b'1'; 3_000_000]);
    add(
        "many-columns.csv",
        format!("{}\n{}\n", vec!["a"; 20_000].join(","), vec!["1"; 20_000].join(",")).into(),
    );
    for n in [4, 100, 127, 128, 132, 200] {
        let mut mat = b"MATLAB 5.0 MAT-file, by hand".to_vec();
        mat.resize(124, b' ');
        mat.extend([0, 1, b'I', b'M']);
        mat.extend([14, 0, 0, 0, 0xff, 0xff, 0xff, 0x7f]);
        mat.extend(vec![0xff; 100]);
        mat.truncate(n);
        add(&format!("cut-at-{n}.mat"), mat);
    }
    let mut v73 = b"MATLAB 7.3 MAT-file".to_vec();
    v73.resize(512, 0);
    add("v73.mat", v73);
    add("png.csv", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec());
    add("gzip.csv", b"\x1f\x8b\x08\0\0\0\0\0".to_vec());
    add("gcs.csv", b"# REM\n# VERSION = 1\n# END_HEADER\n".to_vec());
    add("garbage.zip", b"PK\x03\x04 and nothing more".to_vec());
    add("not.zip", good.clone().into());
    for (name, inside) in [
        ("climbs", "../../evil.csv"),
        ("absolute", "/tmp/evil.csv"),
        ("picture", "a.png"),
        ("broken", "inside.csv"),
        ("backslash", "..\\evil.csv"),
    ] {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        zip.start_file(inside, zip::write::SimpleFileOptions::default())
            .unwrap();
        zip.write_all(if name == "broken" { b"a,b\n1\n" } else { good.as_bytes() })
            .unwrap();
        add(&format!("{name}.zip"), zip.finish().unwrap().into_inner());
    }
    // The first recording is whole, the second is cut: neither is kept.
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let plain = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for name in ["whole.csv", "hurt.csv"] {
        zip.start_file(name, plain).unwrap();
        zip.write_all(good.as_bytes()).unwrap();
    }
    let mut bytes = zip.finish().unwrap().into_inner();
    let second = bytes.windows(8).position(|w| w == b"hurt.csv").unwrap();
    bytes[second + 200] ^= 1;
    add("hurt.zip", bytes);
    let mut twice = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for name in ["up/run.csv", "up-run.csv"] {
        twice.start_file(name, plain).unwrap();
        twice.write_all(good.as_bytes()).unwrap();
    }
    add("twice.zip", twice.finish().unwrap().into_inner());
    let mut empty = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    empty
        .add_directory("folder", zip::write::SimpleFileOptions::default())
        .unwrap();
    add("empty.zip", empty.finish().unwrap().into_inner());
    all
}

#[test]
fn refuse_fifty_broken_uploads() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("deep/session");
    let server = Server::start(&session);
    let good: String = (0..400)
        .map(|k| format!("{},{},{}\n", f64::from(k) * 1e-3, (k % 100) - 50, (k % 100) * 2))
        .collect();
    let good = format!("time_s,voltage_v,position_um\n{good}");
    assert_eq!(
        server.ask("POST", "api/upload?name=good.csv", good.as_bytes()).status,
        200
    );
    let broken = broken();
    assert!(broken.len() >= 50, "{} broken uploads", broken.len());
    for (name, bytes) in &broken {
        let answer = server.ask("POST", &format!("api/upload?name={name}"), bytes);
        refused(name, &answer, &[400, 422]);
        let said = answer.json()["error"].as_str().unwrap().to_owned();
        assert!(
            !said.contains(folder.path().to_str().unwrap()),
            "{name} tells the folder: {said}"
        );
    }
    // The good one is still there, of a broken archive nothing is, and the server works.
    let state = server.state();
    let kept: Vec<_> = std::fs::read_dir(session.join("uploads"))
        .unwrap()
        .flatten()
        .map(|e| e.file_name())
        .collect();
    assert_eq!(kept.len(), state["files"].as_array().unwrap().len(), "{kept:?}");
    assert!(
        kept.iter().all(|name| name != "whole.csv" && name != "up-run.csv"),
        "{kept:?}"
    );
    let found = state["files"]
        .as_array()
        .unwrap()
        .iter()
        .find(|file| file["name"] == "good.csv")
        .unwrap()
        .clone();
    assert_eq!(
        (found["error"].is_null(), found["records"][0]["samples"].as_u64()),
        (true, Some(400))
    );
    // The good one is used, and those that cannot be read stay where they are, each with its reason and to be taken away.
    server.act(r#"{"what":"take-files"}"#);
    let after = server.state();
    assert_eq!(after["job"]["failed"], serde_json::Value::Null);
    assert_eq!(after["data"]["records"].as_array().unwrap().len(), 1);
    let waits = |state: &serde_json::Value| -> usize {
        let files = state["files"].as_array().unwrap().iter();
        files
            .filter(|file| file["stands"] == "waits" && file["error"].as_str().is_some())
            .count()
    };
    assert_eq!(waits(&after), state["files"].as_array().unwrap().len() - 1);
    for file in state["files"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|file| file["name"] != "good.csv")
    {
        let gone = server.ask(
            "POST",
            "api/forget",
            serde_json::json!({"name": file["name"]}).to_string().as_bytes(),
        );
        assert_eq!(gone.status, 200, "{}", gone.text());
    }
    assert_eq!(waits(&server.state()), 0);
    // Nothing was written outside.
    let outside: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .flatten()
        .map(|entry| entry.file_name())
        .collect();
    assert_eq!(outside, ["deep"]);
    assert!(!std::path::Path::new("/tmp/evil.csv").exists());
}
