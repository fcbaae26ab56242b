//! A real browser without a screen, what a person does in it, and what is seen.

use crate::server::request;
use fantoccini::actions::{InputSource, MOUSE_BUTTON_LEFT, MouseActions, PointerAction};
use fantoccini::wd::{Capabilities, PrintConfiguration};
use fantoccini::{Client, ClientBuilder, Locator};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The driver, ended with the test.
struct Driver {
    child: Child,
    port: u16,
    /// The browser's session, closed with the driver: a driver that is killed leaves its browser behind.
    session: Option<String>,
}

/// Times that a driver is started: it takes a free port of IPv4, and ends where another program has that of IPv6.
const STARTS: usize = 5;

impl Driver {
    fn start() -> Self {
        let started = (0..STARTS).find_map(|_| {
            let mut child = Command::new("chromedriver")
                .arg("--port=0")
                .stdout(Stdio::piped())
                .spawn()
                .unwrap();
            let lines = BufReader::new(child.stdout.take().unwrap()).lines();
            let mut driver = Self {
                child,
                port: 0,
                session: None,
            };
            let port = lines.map_while(Result::ok).find_map(|line| {
                line.strip_suffix('.')?
                    .split("started successfully on port ")
                    .nth(1)
                    .map(str::to_owned)
            })?;
            driver.port = port.parse().unwrap();
            Some(driver)
        });
        // None: it ended each time before it was ready.
        started.unwrap()
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        if let Some(session) = &self.session {
            let close = || request(self.port, "DELETE", &format!("/session/{session}"), &[], b"");
            // A session that a test closed itself is gone, and that is well.
            let _ = std::panic::catch_unwind(close);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A browser on the workbench.
pub(crate) struct Browser {
    pub(crate) client: Client,
    driver: Driver,
    _profile: tempfile::TempDir,
}

/// A page that does not get there in this time hangs; a machine with other work diagnoses in less.
const PATIENCE_MS: u64 = 600_000;

/// Waits until the page is drawn.
const FRAMES: &str = "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done(1)))";

/// The checker of accessibility, axe-core 4.14.1 (MPL-2.0).
const AXE: &str = include_str!("../vendor/axe.min.js");

/// Whether there is a browser; where there is none, this is said, and `cargo xtask test` installs it.
#[expect(clippy::print_stdout, reason = "a test that is skipped says so")]
pub(crate) fn there() -> bool {
    let there = Command::new("chromedriver")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok();
    assert!(
        there || std::env::var_os("HYSTERON_BROWSER").is_none(),
        "chromedriver is not installed"
    );
    if !there {
        println!("skipped: no chromedriver; `cargo xtask test` installs it (Debian: chromium chromium-driver)");
    }
    there
}

/// Where pictures of the pages are kept for people, where somebody wants to look at them.
fn pictures() -> Option<PathBuf> {
    std::env::var_os("HYSTERON_PICTURES").map(PathBuf::from)
}

impl Browser {
    pub(crate) async fn open(address: &str, dark: bool) -> Self {
        let mut driver = Driver::start();
        let profile = tempfile::tempdir().unwrap();
        let mut arguments = vec![
            "--headless=new".to_owned(),
            "--no-sandbox".to_owned(),
            "--disable-gpu".to_owned(),
            "--disable-dev-shm-usage".to_owned(),
            "--no-first-run".to_owned(),
            "--disable-background-networking".to_owned(),
            "--disable-component-update".to_owned(),
            "--disable-sync".to_owned(),
            "--window-size=1400,1000".to_owned(),
            format!("--user-data-dir={}", profile.path().display()),
        ];
        if dark {
            arguments.push("--blink-settings=preferredColorScheme=0".to_owned());
        }
        let mut capabilities = Capabilities::new();
        capabilities.insert("goog:chromeOptions".to_owned(), json!({ "args": arguments }));
        capabilities.insert("timeouts".to_owned(), json!({ "script": PATIENCE_MS }));
        let client = ClientBuilder::new(hyper_util::client::legacy::connect::HttpConnector::new())
            .capabilities(capabilities)
            .connect(&format!("http://127.0.0.1:{}", driver.port))
            .await
            .unwrap();
        driver.session = client.session_id().await.unwrap();
        client.goto(address).await.unwrap();
        Self {
            client,
            driver,
            _profile: profile,
        }
    }

    /// A page is accessible and prints on at most six sheets, letter's size, with pictures of lines alone.
    pub(crate) async fn prints_on_six_sheets(page: &Path) {
        let browser = Self::open(&format!("file://{}", page.display()), false).await;
        browser.accessible(&page.display().to_string()).await;
        let pdf = browser.client.print(PrintConfiguration::default()).await.unwrap();
        browser.close().await;
        let count = |word: &[u8]| pdf.windows(word.len()).filter(|at| *at == word).count();
        let (sheets, pixels) = (count(b"/Type /Page\n"), count(b"/Subtype /Image"));
        assert!(
            (1..=6).contains(&sheets) && pixels == 0,
            "{sheets} sheets, {pixels} pictures of pixels"
        );
    }

    /// Waits until something is there, and for its text.
    pub(crate) async fn see(&self, css: &str) -> String {
        let look = "const [css, done] = arguments; const look = () => { const e = document.querySelector(css); if (e) done(e.innerText); return e; }; \
            if (!look()) { const o = new MutationObserver(() => { if (look()) o.disconnect(); }); o.observe(document, {subtree: true, childList: true, attributes: true}); }";
        match self.client.execute_async(look, vec![json!(css)]).await {
            Ok(text) => text.as_str().unwrap_or_default().to_owned(),
            Err(error) => panic!("{css}: {error}; the page says:\n{}", self.text().await),
        }
    }

    /// Waits until the page says something.
    pub(crate) async fn see_text(&self, text: &str) {
        let look = "const [text, done] = arguments; const look = () => { const there = document.querySelector('main').innerText.includes(text); if (there) done(1); return there; }; \
            if (!look()) { const o = new MutationObserver(() => { if (look()) o.disconnect(); }); o.observe(document, {subtree: true, childList: true, characterData: true}); }";
        if self.client.execute_async(look, vec![json!(text)]).await.is_err() {
            panic!("the page does not say {text:?} but:\n{}", self.text().await);
        }
    }

    /// The page's text.
    pub(crate) async fn text(&self) -> String {
        self.client
            .find(Locator::Css("body"))
            .await
            .unwrap()
            .text()
            .await
            .unwrap()
    }

    pub(crate) async fn click(&self, css: &str) {
        self.see(css).await;
        let script = "const e = document.querySelector(arguments[0]); if (e) e.scrollIntoView({block: 'center'}); return Boolean(e) && !e.disabled;";
        // News may redraw the page between looking and clicking; then once more.
        let mut last = String::new();
        for _ in 0..20 {
            if self.run(script, vec![json!(css)]).await == json!(true)
                && let Ok(element) = self.client.find(Locator::Css(css)).await
            {
                match element.click().await {
                    Ok(()) => return,
                    Err(error) => last = error.to_string(),
                }
            }
            self.run_async(FRAMES, vec![]).await;
        }
        panic!("{css} cannot be clicked: {last}");
    }

    /// Drags over an element, from one share of its width to another.
    pub(crate) async fn drag(&self, css: &str, from: f64, to: f64) {
        self.see(css).await;
        let middle =
            "const e = document.querySelector(arguments[0]); e.scrollIntoView({block: 'center'}); return e.clientWidth";
        let width = self.run(middle, vec![json!(css)]).await.as_f64().unwrap();
        let element = self.client.find(Locator::Css(css)).await.unwrap();
        let at = |x: f64| PointerAction::MoveToElement {
            element: element.clone(),
            duration: None,
            x: ((x - 0.5) * width).round(),
            y: 0.0,
        };
        let mouse = MouseActions::new("mouse".to_owned())
            .then(at(from))
            .then(PointerAction::Down {
                button: MOUSE_BUTTON_LEFT,
            })
            .then(at(0.5 * (from + to)))
            .then(at(to))
            .then(PointerAction::Up {
                button: MOUSE_BUTTON_LEFT,
            });
        self.client.perform_actions(mouse).await.unwrap();
    }

    /// Drops files and folders from the desktop onto an element: what WebDriver has no word for, by the browser's own protocol.
    pub(crate) async fn drop_files(&self, css: &str, files: &[PathBuf]) {
        self.see(css).await;
        let middle = "const e = document.querySelector(arguments[0]); e.scrollIntoView({block: 'center'}); const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]";
        let middle = self.run(middle, vec![json!(css)]).await;
        for step in ["dragEnter", "dragOver", "drop"] {
            let event = json!({"type": step, "x": middle[0], "y": middle[1], "data": {"items": [], "files": files, "dragOperationsMask": 1}});
            self.tell("Input.dispatchDragEvent", &event);
        }
    }

    /// A command of the browser's own protocol.
    fn tell(&self, command: &str, parameters: &Value) {
        let path = format!("/session/{}/goog/cdp/execute", self.driver.session.as_ref().unwrap());
        let body = json!({"cmd": command, "params": parameters}).to_string();
        let answer = request(self.driver.port, "POST", &path, &[], body.as_bytes());
        assert_eq!(answer.status, 200, "{command}: {}", answer.text());
    }

    /// Nothing on the page is wider than a screen of this width; its whole picture, where pictures are wanted.
    pub(crate) async fn picture_of_width(&self, name: &str, width: u32) {
        let screen = |height: u64| json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.tell("Emulation.setDeviceMetricsOverride", &screen(1000));
        let size = "const e = document.documentElement; return [e.scrollWidth, Math.min(6000, e.scrollHeight)]";
        let size = self.run(size, vec![]).await;
        assert!(
            size[0].as_u64().unwrap() <= u64::from(width),
            "{name}: {size} at {width}"
        );
        if let Some(folder) = pictures() {
            self.tell("Emulation.setDeviceMetricsOverride", &screen(size[1].as_u64().unwrap()));
            self.keep_picture(&folder, &format!("{name}-{width}")).await;
        }
        self.tell("Emulation.clearDeviceMetricsOverride", &json!({}));
    }

    async fn keep_picture(&self, folder: &Path, name: &str) {
        self.run_async(FRAMES, vec![]).await;
        let png = self.client.screenshot().await.unwrap();
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join(format!("{name}.png")), png).unwrap();
    }

    /// Types into a field.
    pub(crate) async fn type_into(&self, css: &str, text: &str) {
        self.see(css).await;
        let field = self.client.find(Locator::Css(css)).await.unwrap();
        field.clear().await.unwrap();
        field.send_keys(text).await.unwrap();
    }

    pub(crate) async fn run(&self, script: &str, arguments: Vec<Value>) -> Value {
        self.client.execute(script, arguments).await.unwrap()
    }

    /// A script that answers through a callback, its last argument.
    pub(crate) async fn run_async(&self, script: &str, arguments: Vec<Value>) -> Value {
        self.client.execute_async(script, arguments).await.unwrap()
    }

    pub(crate) async fn choose(&self, css: &str, value: &str) {
        self.see(css).await;
        self.client
            .find(Locator::Css(css))
            .await
            .unwrap()
            .select_by_value(value)
            .await
            .unwrap();
    }

    /// A picture of the whole page, where pictures are wanted.
    pub(crate) async fn picture(&self, name: &str) {
        let Some(folder) = pictures() else { return };
        let height = self
            .run("return Math.min(4000, document.documentElement.scrollHeight)", vec![])
            .await
            .as_u64()
            .unwrap();
        self.client
            .set_window_size(1400, u32::try_from(height).unwrap().max(1000))
            .await
            .unwrap();
        self.keep_picture(&folder, name).await;
        self.client.set_window_size(1400, 1000).await.unwrap();
    }

    /// No fault of accessibility that can be found by rules.
    pub(crate) async fn accessible(&self, place: &str) {
        self.run(AXE, vec![]).await;
        let found = self.run_async("const done = arguments[0]; axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'best-practice']}).then((r) => done(r.violations.map((v) => [v.impact, v.id, v.nodes.slice(0, 3).map((n) => n.html + ' :: ' + n.failureSummary)])))", vec![]).await;
        assert_eq!(found, json!([]), "{place}");
    }

    pub(crate) async fn close(self) {
        self.client.clone().close().await.unwrap();
    }
}
