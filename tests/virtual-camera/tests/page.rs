//! The live page, in a headless Chromium.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::{
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc,
    time::Duration,
};

use common::{PATIENCE, settings};
use serde_json::{Value, json};
use virtual_camera::{Clock, RoomSettings, Settings, SyntheticSettings, VirtualCamera, Waypoint, World};

/// A browser that is spoken to through pipes (Chrome DevTools Protocol, messages end in a zero byte).
struct Browser {
    child: Child,
    commands: ChildStdin,
    answers: mpsc::Receiver<Vec<u8>>,
    profile: PathBuf,
    page: Option<String>,
    sent: u64,
}

impl Browser {
    /// With a profile of its own. `None`, and a line that says so, where there is no Chromium.
    fn start(profile: &str) -> Option<Self> {
        if Command::new("chromium").arg("--version").output().is_err() {
            eprintln!("SKIPPED: chromium is not installed (`make test` installs it)");
            return None;
        }
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
        Some(Self { child, commands, answers, profile, page: None, sent: 0 })
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
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

    fn open(&mut self, url: &str) {
        let target = self.call("Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let session = self.call("Target.attachToTarget", attach);
        self.page = session["sessionId"].as_str().map(Into::into);
        // It returns when the new document is there, so that no expression meets the old one.
        self.call("Page.navigate", json!({"url": url}));
    }

    /// The value of a JavaScript expression, awaited.
    fn value(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let result = self.call("Runtime.evaluate", params);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    #[track_caller]
    fn wait_for(&mut self, condition: &str) {
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

    fn mouse(&mut self, kind: &str, element: &str) {
        let place = self.value(&format!(
            "(() => {{ const r = document.getElementById('{element}').getBoundingClientRect(); \
             return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        ));
        let event = json!({"type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1});
        self.call("Input.dispatchMouseEvent", event);
    }

    fn click(&mut self, element: &str) {
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

const TRUTH_DRAWN: &str = "$('truth').getContext('2d') \
     .getImageData(0, 0, $('truth').width, $('truth').height).data.some(value => value > 200)";

fn save(shot: &Value, name: &str) {
    let png = glib::base64_decode(shot["data"].as_str().unwrap());
    std::fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), png).unwrap();
}

/// Before somebody who stands a little to the right.
fn with_a_person() -> Settings {
    let here = Waypoint { time: Duration::ZERO, pan_deg: 6.0, tilt_deg: -2.0 };
    let world = SyntheticSettings { size: (512, 384), path: vec![here], stays: true, ..Default::default() };
    Settings { world: World::Synthetic(world), ..settings() }
}

#[test]
fn the_page_shows_the_camera_and_steers_it() {
    let Some(mut browser) = Browser::start("chromium-steering") else {
        return;
    };
    let auth = virtual_camera::Auth::Digest { qop: true };
    let camera = VirtualCamera::start(Settings { auth, ..with_a_person() }).unwrap();
    browser.open(&camera.url());

    // It shows the picture, the overview with the view drawn in, and the numbers, and asks for no password.
    browser.wait_for("typeof $ == 'function' && $('picture').naturalWidth == 160");
    browser.wait_for("$('overview').naturalWidth == 512");
    browser.wait_for("$('pan').textContent == '0.00°' && $('state').textContent == 'at rest'");
    browser.wait_for(
        "$('outline').getContext('2d').getImageData(0, 0, $('outline').width, $('outline').height) \
         .data.some(value => value > 200)",
    );
    assert_eq!(browser.value("$('commands').children.length"), json!(0));

    // The truth is drawn in where it is asked for.
    assert_eq!(browser.value(TRUTH_DRAWN), json!(false));
    browser.click("show-truth");
    browser.wait_for(TRUTH_DRAWN);
    let shot = browser.call("Page.captureScreenshot", json!({"format": "png"}));
    save(&shot, "live-page-truth.png");
    browser.click("show-truth");
    browser.wait_for(&format!("!({TRUTH_DRAWN})"));

    // A button held moves the camera, released it stops.
    browser.mouse("mousePressed", "right");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s > 1.0));
    browser.wait_for("$('state').textContent == 'moving' && parseFloat($('pan').textContent) > 0.5");
    browser.mouse("mouseReleased", "right");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    browser.wait_for("$('commands').children.length == 2");
    browser.wait_for("$('commands').firstChild.textContent.endsWith('204  continuouspantiltmove=0,0')");
    browser.wait_for("$('commands').lastChild.textContent.endsWith('204  continuouspantiltmove=25,0')");

    // Zoom, and the way home.
    browser.mouse("mousePressed", "zoom-in");
    assert!(camera.wait_for(PATIENCE, |status| status.magnification > 1.2));
    browser.mouse("mouseReleased", "zoom-in");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    let shot = browser.call("Page.captureScreenshot", json!({"format": "png"}));
    save(&shot, "live-page.png");
    browser.click("home");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg == 0.0 && status.zoom_step == 1.0));
    browser.wait_for("$('pan').textContent == '0.00°' && $('zoom').textContent.startsWith('1 (')");

    // A page that is closed while a button is held leaves no camera moving.
    browser.mouse("mousePressed", "left");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s < -1.0));
    browser.call("Page.navigate", json!({"url": "about:blank"}));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

#[test]
fn the_room_is_shown_with_the_truth_if_the_address_asks_for_it() {
    let Some(mut browser) = Browser::start("chromium-room") else {
        return;
    };
    let world = World::Room(RoomSettings::test(7, 1).unwrap());
    let settings = Settings { world, clock: Clock::Stepped, ..Settings::default() };
    let camera = VirtualCamera::start(settings).unwrap();
    // Somebody is in the middle of the room and, as nobody steps on, stays there.
    camera.advance_to(Duration::from_secs(6));
    browser.open(&format!("{}/?truth=1", camera.url()));
    browser.wait_for("typeof $ == 'function' && $('overview').naturalWidth == 1280");
    browser.wait_for(TRUTH_DRAWN);
    browser.wait_for("$('picture').naturalWidth == 640 && $('fov').textContent == '55.00° wide'");
    let shot = browser.call("Page.captureScreenshot", json!({"format": "png"}));
    save(&shot, "live-page-room.png");
}
