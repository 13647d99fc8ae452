//! `viewfuse view` as a running program, and requests to it without a browser.

use super::super::BINARY;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse_tests::command::command;

const PATIENCE: Duration = Duration::from_secs(120);

/// A program that is ended with this value.
pub(super) struct Program {
    process: Child,
    /// `127.0.0.1:PORT`.
    pub(super) host: String,
    /// `/TOKEN/`.
    pub(super) path: String,
}

/// What the server answered.
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) head: String,
    pub(super) body: Vec<u8>,
}

/// A connection that is used again and again.
pub(super) struct Connection<'a> {
    program: &'a Program,
    stream: BufReader<TcpStream>,
}

impl Program {
    /// Starts it in a folder, on the CPU, and waits until it tells its address.
    #[track_caller]
    pub(super) fn start(folder: &Path, arguments: &str) -> Program {
        Program::start_on("cpu", folder, arguments)
    }

    /// The same on any device.
    #[track_caller]
    pub(super) fn start_on(device: &str, folder: &Path, arguments: &str) -> Program {
        let mut run = command(BINARY, folder, &format!("view {arguments} --no-browser --device {device}"));
        let mut process = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts");
        let mut lines = BufReader::new(process.stdout.take().expect("a pipe")).lines();
        let address = lines.find_map(|line| line.expect("text").strip_prefix("http://").map(str::to_owned));
        let Some(address) = address else {
            let mut said = String::new();
            process.stderr.take().expect("a pipe").read_to_string(&mut said).expect("text");
            panic!("no address: {said}");
        };
        let (host, path) = address.split_at(address.find('/').expect("a path"));
        Program { process, host: host.to_owned(), path: path.to_owned() }
    }

    pub(super) fn address(&self) -> String {
        format!("http://{}{}", self.host, self.path)
    }

    pub(super) fn id(&self) -> u32 {
        self.process.id()
    }

    pub(super) fn is_running(&mut self) -> bool {
        self.process.try_wait().expect("a process").is_none()
    }

    /// Resident set in KiB.
    pub(super) fn memory(&self) -> u64 {
        let text = std::fs::read_to_string(format!("/proc/{}/status", self.id())).expect("a process");
        let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("a line");
        line.trim().strip_suffix(" kB").expect("KiB").parse().expect("a number")
    }

    /// Ctrl-C: the exit code and what it said.
    pub(super) fn interrupt(&mut self) -> (Option<i32>, String) {
        let sent = Command::new("kill").args(["-INT", &self.id().to_string()]).status().expect("kill runs");
        assert!(sent.success());
        let start = Instant::now();
        while self.is_running() {
            assert!(start.elapsed() < PATIENCE, "Ctrl-C does not end it");
            sleep(Duration::from_millis(5));
        }
        let mut said = String::new();
        let error: Option<ChildStderr> = self.process.stderr.take();
        error.expect("a pipe").read_to_string(&mut said).expect("text");
        (self.process.wait().expect("a process").code(), said)
    }

    #[track_caller]
    pub(super) fn connect(&self) -> Connection<'_> {
        let stream = TcpStream::connect(&self.host).expect("a server");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time limit");
        Connection { program: self, stream: BufReader::new(stream) }
    }

    /// A request of its own connection.
    #[track_caller]
    pub(super) fn get(&self, path: &str) -> Answer {
        self.connect().ask("GET", &format!("{}{path}", self.path), &[("Host", &self.host)], b"")
    }

    #[track_caller]
    pub(super) fn scene(&self) -> Value {
        self.get("scene").json()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

impl Connection<'_> {
    #[track_caller]
    pub(super) fn ask(&mut self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        self.send(method, path, headers, body);
        self.receive()
    }

    #[track_caller]
    pub(super) fn send(&mut self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) {
        let mut text = format!("{method} {path} HTTP/1.1\r\nContent-Length: {}\r\n", body.len());
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        let message = [text.as_bytes(), b"\r\n", body].concat();
        self.stream.get_mut().write_all(&message).expect("a server that listens");
    }

    #[track_caller]
    pub(super) fn receive(&mut self) -> Answer {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            assert!(self.stream.read_line(&mut head).expect("an answer") > 0, "no answer: {head}");
        }
        let status = head.split(' ').nth(1).and_then(|word| word.parse().ok()).expect("a status");
        let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: "));
        let mut body = vec![0; length.map_or(0, |length| length.parse().expect("a number"))];
        self.stream.read_exact(&mut body).expect("the whole answer");
        Answer { status, head, body }
    }

    /// Sends a request for a picture as the page does.
    #[track_caller]
    pub(super) fn send_picture(&mut self, request: &Value) {
        let (host, path) = (self.program.host.clone(), format!("{}picture", self.program.path));
        self.send("POST", &path, &[("Host", &host)], request.to_string().as_bytes());
    }

    #[track_caller]
    pub(super) fn picture(&mut self, request: &Value) -> Answer {
        self.send_picture(request);
        self.receive()
    }
}

impl Answer {
    #[track_caller]
    pub(super) fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        serde_json::from_slice(&self.body).expect("JSON")
    }

    /// The JSON of a picture, and the picture.
    #[track_caller]
    pub(super) fn unpacked(&self) -> (Value, image::RgbImage) {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        let (length, rest) = self.body.split_first_chunk().expect("a length");
        let (json, rest) = rest.split_at(u32::from_le_bytes(*length) as usize);
        let json: Value = serde_json::from_slice(json).expect("JSON");
        let picture = &rest[..json["picture"]["bytes"].as_u64().expect("a length") as usize];
        (json, image::load_from_memory(picture).expect("a picture").to_rgb8())
    }
}

/// A request for a picture.
pub(super) fn request(tab: &str, pose: &Value, is_moving: bool) -> Value {
    json!({"tab": tab, "pose": pose, "scheme": "error:alpha=1", "moving": is_moving})
}
