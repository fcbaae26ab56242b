//! The real server on a session of its own, and plain requests to it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// `hysteron lab`, ended with the test.
pub(crate) struct Server {
    child: Child,
    pub(crate) port: u16,
    pub(crate) token: String,
}

/// What came back.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.text()))
    }
}

impl Server {
    /// Starts it on a session folder.
    pub(crate) fn start(session: &Path) -> Self {
        Self::with(session, None)
    }

    /// Starts it on a session folder with data of the user's own.
    pub(crate) fn start_with(session: &Path, data: &Path) -> Self {
        Self::with(session, Some(data))
    }

    fn with(session: &Path, data: Option<&Path>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hysteron"));
        command.args(["lab", "--no-open", "--session"]).arg(session).args(data);
        command.args(["--firmware", concat!(env!("CARGO_MANIFEST_DIR"), "/../../firmware")]);
        let (child, address) = started(&mut command, "workbench: http://127.0.0.1:");
        let (port, token) = address.split_once('/').unwrap();
        Self {
            port: port.parse().unwrap(),
            token: token.trim_end_matches('/').to_owned(),
            child,
        }
    }

    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Largest memory it ever had, bytes; Linux only.
    pub(crate) fn peak_memory(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).ok()?;
        let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
        Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
    }

    /// Processor time it has used on all cores, seconds; Linux only.
    pub(crate) fn processor_s(&self) -> Option<f64> {
        // user and system time, hundredths of a second, behind the name in brackets
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).ok()?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
    }

    /// A request as it stands on the wire.
    pub(crate) fn raw(&self, request: &[u8]) -> Answer {
        wire(self.port, request)
    }

    /// A request with the headers of an honest page, and more.
    pub(crate) fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        request(self.port, method, path, headers, body)
    }

    /// A request with the token.
    pub(crate) fn ask(&self, method: &str, path: &str, body: &[u8]) -> Answer {
        self.send(method, &format!("/{}/{path}", self.token), &[], body)
    }

    pub(crate) fn state(&self) -> serde_json::Value {
        self.ask("GET", "api/session", b"").json()
    }

    /// Does something and waits until the job it starts has ended.
    pub(crate) fn act(&self, deed: &str) -> Answer {
        let answer = self.begin(deed);
        self.wait();
        answer
    }

    /// The same, without the wait.
    pub(crate) fn begin(&self, deed: &str) -> Answer {
        let revision = self.state()["revision"].as_u64().unwrap();
        self.ask(
            "POST",
            "api/do",
            format!("{{\"revision\":{revision},\"do\":{deed}}}").as_bytes(),
        )
    }

    /// Waits for the job by asking for news.
    pub(crate) fn wait(&self) -> serde_json::Value {
        self.wait_for(|state| state["job"]["running"] == false)
    }

    /// Waits until something holds by asking for news.
    pub(crate) fn wait_for(&self, holds: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
        let mut state = self.state();
        while !holds(&state) {
            state = self
                .ask("GET", &format!("api/session?seen={}", state["tick"]), b"")
                .json();
        }
        state
    }
}

/// Starts a program that serves; what its first line says behind some words.
pub(crate) fn started(command: &mut Command, words: &str) -> (Child, String) {
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let said = line.trim().strip_prefix(words).unwrap_or_else(|| panic!("{line}"));
    (child, said.to_owned())
}

/// A request to a port of this machine.
pub(crate) fn request(port: u16, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let mut head = format!(
        "{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n",
        body.len()
    );
    if !headers.iter().any(|h| h.0 == "Host") {
        head.push_str(&format!("Host: 127.0.0.1:{port}\r\n"));
    }
    for (name, value) in headers {
        head.push_str(&format!("{name}: {value}\r\n"));
    }
    head.push_str("\r\n");
    wire(port, &[head.as_bytes(), body].concat())
}

fn wire(port: u16, request: &[u8]) -> Answer {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    // A server that refuses early closes while we still write; its answer is what counts.
    let _ = stream.write_all(request);
    let mut all = Vec::new();
    let mut piece = [0; 1 << 16];
    // Until the answer is whole: not every server closes when it was asked to.
    while !whole(&all) {
        match stream.read(&mut piece) {
            Ok(bytes) if bytes > 0 => all.extend(&piece[..bytes]),
            _ => break,
        }
    }
    let end = head_end(&all);
    let head = String::from_utf8_lossy(&all[..end]).into_owned();
    let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    Answer {
        status,
        head,
        body: all.get(end + 4..).unwrap_or_default().to_vec(),
    }
}

fn head_end(answer: &[u8]) -> usize {
    answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or(answer.len())
}

/// Whether an answer has as many bytes as its head says.
fn whole(answer: &[u8]) -> bool {
    let end = head_end(answer);
    let head = String::from_utf8_lossy(&answer[..end]).to_ascii_lowercase();
    let length = head
        .lines()
        .find_map(|line| line.strip_prefix("content-length:")?.trim().parse::<usize>().ok());
    length.is_some_and(|length| answer.len() >= end + 4 + length)
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
