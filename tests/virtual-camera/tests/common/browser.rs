// SPDX-License-Identifier: MPL-2.0

//! A headless Chromium, for the tests of pages. Whoever includes it has a `PATIENCE`.
// Not every page is clicked by the mouse.
#![allow(dead_code)]

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc;

use serde_json::{Value, json};

use super::PATIENCE;

/// A browser that is spoken to through pipes (Chrome DevTools Protocol, messages end in a zero byte).
pub struct Browser {
    child: Child,
    commands: ChildStdin,
    answers: mpsc::Receiver<Vec<u8>>,
    profile: PathBuf,
    page: Option<String>,
    sent: u64,
}

impl Browser {
    /// With a profile of its own.
    pub fn start(profile: &str) -> Self {
        // The shell that starts it would not say so.
        let there = Command::new("chromium").arg("--version").output();
        assert!(there.is_ok(), "chromium is not installed: `make test` installs it");
        let profile =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{profile}-{}", std::process::id()));
        // The browser reads commands from descriptor 3 and answers on 4.
        let mut child = Command::new("sh")
            .args(["-c", r#"exec chromium "$@" 3<&0 4>&1 </dev/null >/dev/null 2>&1"#, "chromium"])
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--disable-dev-shm-usage", "--window-size=1300,900", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let commands = child.stdin.take().unwrap();
        let (sender, answers) = mpsc::channel();
        let messages = BufReader::new(child.stdout.take().unwrap()).split(0);
        std::thread::spawn(move || {
            messages.map_while(Result::ok).try_for_each(|message| sender.send(message))
        });
        Self { child, commands, answers, profile, page: None, sent: 0 }
    }

    /// The result of a command.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let mut command = json!({"id": self.sent, "method": method, "params": params});
        if let Some(page) = &self.page {
            command["sessionId"] = json!(page);
        }
        self.commands.write_all(format!("{command}\0").as_bytes()).unwrap();
        loop {
            // What is waited for within the page has its own limit, which is to come first.
            let message = self.answers.recv_timeout(2 * PATIENCE);
            let message = message.unwrap_or_else(|error| panic!("the browser answers no {method}: {error}"));
            let message: Value = serde_json::from_slice(&message).unwrap();
            if message["id"] == json!(self.sent) {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].clone();
            }
        }
    }

    /// Goes to a page.
    pub fn open(&mut self, url: &str) {
        let target = self.call("Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let session = self.call("Target.attachToTarget", attach);
        self.page = session["sessionId"].as_str().map(Into::into);
        // It returns when the new document is there, so that no expression meets the old one.
        self.call("Page.navigate", json!({"url": url}));
    }

    /// The value of a JavaScript expression, awaited.
    pub fn value(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let result = self.call("Runtime.evaluate", params);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub fn wait_for(&mut self, condition: &str) {
        let seconds = PATIENCE.as_secs();
        let came = self.value(&format!(
            "(async () => {{ for (let i = 0; i < {seconds} * 20; i++) {{ \
               if ({condition}) return true; await new Promise(r => setTimeout(r, 50)); }} return false; }})()"
        ));
        if came != json!(true) {
            let page = self.value("document.body.innerText");
            panic!("never came: {condition}\n{page}");
        }
    }

    /// Keeps what the page looks like, for a person.
    pub fn save_picture(&mut self, name: &str) {
        let shot = self.call("Page.captureScreenshot", json!({"format": "png"}));
        let png = glib::base64_decode(shot["data"].as_str().unwrap());
        std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), png).unwrap();
    }

    /// The left button, `mousePressed` or `mouseReleased`, over an element by its id.
    pub fn mouse(&mut self, kind: &str, element: &str) {
        let place = self.value(&format!(
            "(() => {{ const r = document.getElementById('{element}').getBoundingClientRect(); \
             return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        ));
        let event = json!({"type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1});
        self.call("Input.dispatchMouseEvent", event);
    }

    /// A click on an element by its id.
    pub fn click(&mut self, element: &str) {
        self.mouse("mousePressed", element);
        self.mouse("mouseReleased", element);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may be gone already; its folder is only litter.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.profile);
    }
}
