//! A browser without a window that is driven as a hand does it: Chromium's DevTools protocol through a pipe, JSON
//! messages that end in a zero byte.

use super::super::browser::Browser;
use crate::{number_of, text_of};
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use viewfuse_tests::patience::PATIENCE;

/// What the page shows becomes `shows`, beside two of its functions.
const NAMES_FOR_TESTS: &str = "addEventListener('load', async () => {
    if (!location.protocol.startsWith('http')) return;
    const [{ state }, { matrixOf }, { goTo }] =
        await Promise.all(['state', 'poses', 'hand'].map((name) => import(`${document.baseURI}${name}.js`)));
    Object.assign(window, { matrixOf, goTo, shows: state });
})";

/// A running browser.
pub(super) struct Chromium {
    process: Child,
    input: RefCell<ChildStdin>,
    messages: Receiver<Value>,
    /// What was told without having been asked.
    events: RefCell<Vec<Value>>,
    calls: Cell<u64>,
    profile: TempDir,
}

/// One of its tabs.
pub(super) struct Tab<'a> {
    chromium: &'a Chromium,
    session: String,
    target: String,
}

impl Chromium {
    pub(super) fn start(browser: &Browser) -> Chromium {
        let profile = tempfile::tempdir().expect("a folder");
        // The protocol's pipes are the file descriptors 3 and 4.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"])
            .arg(browser.program())
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"])
            .args(["--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe"])
            // WebGL without a GPU.
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
            // Nothing behind this address answers; it is not used for this machine.
            .arg("--proxy-server=127.0.0.1:9")
            .arg(format!("--user-data-dir={}", profile.path().join("profile").display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell");
        let input = RefCell::new(process.stdin.take().expect("a pipe"));
        let output = BufReader::new(process.stdout.take().expect("a pipe"));
        let (sender, messages) = channel();
        spawn(move || {
            for message in output.split(0).map_while(Result::ok) {
                let message = serde_json::from_slice(&message).expect("JSON");
                if sender.send(message).is_err() {
                    return;
                }
            }
        });
        Chromium { process, input, messages, events: RefCell::default(), calls: Cell::new(0), profile }
    }

    /// A folder of its own, for downloads.
    pub(super) fn folder(&self) -> &std::path::Path {
        self.profile.path()
    }

    /// Calls a method of the browser, or of a tab, and returns its result.
    #[track_caller]
    pub(super) fn call(&self, session: Option<&str>, method: &str, parameters: Value) -> Value {
        let number = self.send(session, method, parameters);
        self.answer(number, method)
    }

    /// Sends a call, and returns its number.
    fn send(&self, session: Option<&str>, method: &str, parameters: Value) -> u64 {
        let number = self.calls.get() + 1;
        self.calls.set(number);
        let mut message = json!({"id": number, "method": method, "params": parameters});
        if let Some(session) = session {
            message["sessionId"] = session.into();
        }
        let mut text = message.to_string().into_bytes();
        text.push(0);
        self.input.borrow_mut().write_all(&text).expect("a browser that listens");
        number
    }

    /// Waits for the result of a call.
    #[track_caller]
    fn answer(&self, number: u64, method: &str) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            // It may have come before that of an earlier call.
            let mut events = self.events.borrow_mut();
            let known = events.iter().position(|event| event["id"] == number);
            if let Some(mut answer) = known.map(|place| events.remove(place)) {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
            let rest = end.saturating_duration_since(Instant::now());
            events.push(self.messages.recv_timeout(rest).unwrap_or_else(|error| panic!("{method}: {error}")));
        }
    }

    /// Opens a page in a new tab of this size, as a phone if it is touched.
    #[track_caller]
    pub(super) fn open(&self, address: &str, [width, height]: [u32; 2], is_phone: bool) -> Tab<'_> {
        let target = self.call(None, "Target.createTarget", json!({"url": "about:blank"}));
        let target = text_of(&target["targetId"]).to_owned();
        let session = self.call(None, "Target.attachToTarget", json!({"targetId": target, "flatten": true}));
        let session = text_of(&session["sessionId"]).to_owned();
        let tab = Tab { chromium: self, session, target };
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            tab.call(domain, json!({}));
        }
        let ratio = if is_phone { 2 } else { 1 };
        let size = json!({"width": width, "height": height, "deviceScaleFactor": ratio, "mobile": is_phone});
        tab.call("Emulation.setDeviceMetricsOverride", size);
        tab.call("Emulation.setTouchEmulationEnabled", json!({"enabled": is_phone, "maxTouchPoints": 5}));
        // Modules keep their names to themselves: the page's state and what leads to poses get names for the tests.
        tab.call("Page.addScriptToEvaluateOnNewDocument", json!({"source": NAMES_FOR_TESTS}));
        tab.call("Page.navigate", json!({"url": address}));
        tab
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // The profile is deleted after it.
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

impl Tab<'_> {
    #[track_caller]
    pub(super) fn call(&self, method: &str, parameters: Value) -> Value {
        self.chromium.call(Some(&self.session), method, parameters)
    }

    /// The value of an expression in the page.
    #[track_caller]
    pub(super) fn evaluate(&self, expression: &str) -> Value {
        let parameters =
            json!({"expression": expression, "awaitPromise": true, "returnByValue": true, "userGesture": true});
        let mut result = self.call("Runtime.evaluate", parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {}", result["exceptionDetails"]);
        result["result"]["value"].take()
    }

    #[track_caller]
    pub(super) fn text(&self, expression: &str) -> String {
        let value = self.evaluate(expression);
        value.as_str().unwrap_or_else(|| panic!("{expression} is {value}")).to_owned()
    }

    #[track_caller]
    pub(super) fn number(&self, expression: &str) -> f64 {
        let value = self.evaluate(expression);
        value.as_f64().unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub(super) fn wait_for(&self, expression: &str) {
        let start = Instant::now();
        while self.evaluate(&format!("Boolean({expression})")) != true {
            if start.elapsed() > PATIENCE {
                let text = self.evaluate("document.body ? document.body.innerText : ''");
                panic!("{expression} does not become true: {text}");
            }
            sleep(Duration::from_millis(20));
        }
    }

    #[track_caller]
    pub(super) fn mouse(&self, kind: &str, [x, y]: [f64; 2], more: Value) {
        let mut parameters = json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1});
        if let (Value::Object(all), Value::Object(more)) = (&mut parameters, more) {
            all.extend(more);
        }
        self.call("Input.dispatchMouseEvent", parameters);
    }

    /// Presses at a place, moves in steps to another, and lets go.
    #[track_caller]
    pub(super) fn drag(&self, from: [f64; 2], to: [f64; 2], steps: u32) {
        self.mouse("mousePressed", from, json!({}));
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            self.mouse("mouseMoved", [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])), json!({}));
        }
        self.mouse("mouseReleased", to, json!({}));
    }

    /// Fingers are put down at places, move to the next ones in turn, and are lifted.
    #[track_caller]
    pub(super) fn slide(&self, places: &[&[[f64; 2]]]) {
        for (step, fingers) in places.iter().chain([&&[][..]]).enumerate() {
            let kind = if step == 0 {
                "touchStart"
            } else if fingers.is_empty() {
                "touchEnd"
            } else {
                "touchMove"
            };
            let point = |(id, [x, y]): (usize, &[f64; 2])| json!({"x": x, "y": y, "id": id});
            let points: Vec<Value> = fingers.iter().enumerate().map(point).collect();
            self.call("Input.dispatchTouchEvent", json!({"type": kind, "touchPoints": points}));
        }
    }

    #[track_caller]
    pub(super) fn key(&self, key: &str) {
        self.keys(key, 1);
    }

    /// Presses a key so many times, faster than pictures follow.
    #[track_caller]
    pub(super) fn keys(&self, key: &str, count: usize) {
        const METHOD: &str = "Input.dispatchKeyEvent";
        let text = if key.len() == 1 { key } else { "" };
        let events = [json!({"type": "keyDown", "key": key, "text": text}), json!({"type": "keyUp", "key": key})];
        let send = |event: &Value| self.chromium.send(Some(&self.session), METHOD, event.clone());
        let sent: Vec<u64> = (0..count).flat_map(|_| &events).map(send).collect();
        sent.into_iter().for_each(|number| _ = self.chromium.answer(number, METHOD));
    }

    /// The middle of an element, in the window.
    #[track_caller]
    pub(super) fn middle_of(&self, selector: &str) -> [f64; 2] {
        let place = self.evaluate(&format!(
            "(() => {{ const element = document.querySelector('{selector}'); element.scrollIntoView({{block: \
             'nearest'}}); const box = element.getBoundingClientRect(); return [box.x + box.width / 2, box.y + \
             box.height / 2]; }})()"
        ));
        [0, 1].map(|axis| number_of(&place[axis]))
    }

    /// What the console of this tab was told: messages of scripts, exceptions, failed requests.
    pub(super) fn console(&self) -> Vec<String> {
        // Whatever was sent before the answer to this call has arrived.
        self.evaluate("0");
        let events = self.chromium.events.borrow();
        let received = events.iter().filter(|event| event["sessionId"] == self.session.as_str());
        let is_message = |event: &&Value| {
            ["Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"]
                .iter()
                .any(|method| event["method"] == *method)
        };
        received.filter(is_message).map(|event| event["params"].to_string()).collect()
    }

    /// The window, as PNG.
    pub(super) fn picture(&self) -> Vec<u8> {
        use base64::Engine;
        let result = self.call("Page.captureScreenshot", json!({"format": "png"}));
        let text = text_of(&result["data"]);
        base64::engine::general_purpose::STANDARD.decode(text).expect("base64")
    }

    pub(super) fn close(self) {
        self.chromium.call(None, "Target.closeTarget", json!({"targetId": self.target}));
    }
}
