//! A headless Chromium, driven by its DevTools protocol over a pipe.

use std::{
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::can;

/// A page becomes as it should within seconds, later only on a loaded machine.
const LIMIT: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(100);
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page. Dropped, it is killed.
pub struct Browser {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    session: Option<String>,
    sent: u64,
    /// Errors of the page: exceptions, and errors that the page or the browser logs.
    pub errors: Vec<String>,
    _profile: TempDir,
}

impl Browser {
    /// Starts a browser; prints why a test is skipped if there is no browser.
    pub fn start() -> Option<Self> {
        let program = PROGRAMS.into_iter().find(|it| can(&[it, "--version"]))?;
        let profile = tempfile::tempdir().unwrap();
        // The browser reads its requests at descriptor 3, and answers at 4. Its sandbox does not
        // work as root, and it opens our page alone.
        let mut child = Command::new("sh")
            .args([
                "-c",
                "exec \"$0\" \"$@\" 3<&0 4>&1 < /dev/null > /dev/null 2>&1",
            ])
            .arg(program)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
            ])
            .args(["--disable-dev-shm-usage", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut browser = Self {
            requests: child.stdin.take().unwrap(),
            answers: BufReader::new(child.stdout.take().unwrap()),
            child,
            session: None,
            sent: 0,
            errors: Vec::new(),
            _profile: profile,
        };
        browser.open_page();
        Some(browser)
    }

    fn open_page(&mut self) {
        let target = self.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let attached = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = self.ask("Target.attachToTarget", attached);
        self.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            self.ask(domain, json!({}));
        }
    }

    pub fn go_to(&mut self, address: &str) -> &mut Self {
        self.ask("Page.navigate", json!({ "url": address }));
        self.until("location.href !== 'about:blank' && document.readyState === 'complete'")
    }

    /// Takes the size of a window, or of a phone's display.
    pub fn resize(&mut self, width: u32, height: u32, is_phone: bool) -> &mut Self {
        let size =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone });
        self.ask("Emulation.setDeviceMetricsOverride", size);
        self
    }

    pub fn evaluate(&mut self, expression: &str) -> Value {
        let request =
            json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut evaluated = self.ask("Runtime.evaluate", request);
        assert!(evaluated.get("exceptionDetails").is_none(), "{evaluated}");
        evaluated["result"]["value"].take()
    }

    pub fn text(&mut self, id: &str) -> String {
        let text = self.evaluate(&format!(
            "document.getElementById('{id}')?.textContent ?? ''"
        ));
        text.as_str().unwrap_or_default().to_owned()
    }

    pub fn until(&mut self, expression: &str) -> &mut Self {
        let since = Instant::now();
        while self.evaluate(expression) != json!(true) {
            let shown = since.elapsed() >= LIMIT;
            let page = shown.then(|| self.evaluate("document.body.innerText"));
            assert!(
                !shown,
                "waited in vain for {expression}: {page:?}, {:?}",
                self.errors
            );
            thread::sleep(LOOK);
        }
        self
    }

    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.sent += 1;
        let mut request = json!({ "id": self.sent, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            request["sessionId"] = json!(session);
        }
        write!(self.requests, "{request}\0").unwrap();
        self.requests.flush().unwrap();
        loop {
            let mut answer = self.receive();
            if answer["id"] == json!(self.sent) {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].take();
            }
            self.note(&answer);
        }
    }

    fn receive(&mut self) -> Value {
        let mut message = Vec::new();
        let received = self.answers.read_until(0, &mut message).unwrap();
        assert!(received > 0, "the browser has ended");
        serde_json::from_slice(&message[..received - 1]).unwrap()
    }

    fn note(&mut self, event: &Value) {
        let parameters = &event["params"];
        let is_error = match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => parameters["type"] == "error",
            Some("Log.entryAdded") => parameters["entry"]["level"] == "error",
            _ => false,
        };
        if is_error {
            self.errors.push(parameters.to_string());
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
