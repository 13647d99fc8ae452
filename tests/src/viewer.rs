//! `viewfuse view` as a running program, and requests to it without a browser.

use crate::command::{command, resident_kib, spawn};
use crate::patience::{PATIENCE, end, send};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command};

/// A program that is ended with this value.
pub struct Program {
    process: Child,
    /// `127.0.0.1:PORT`.
    pub host: String,
    /// `/TOKEN/`.
    pub path: String,
}

/// What the server answered.
pub struct Answer {
    /// The status code.
    pub status: u16,
    /// All lines before the body.
    pub head: String,
    /// What follows them.
    pub body: Vec<u8>,
}

/// A connection that is used again and again.
pub struct Connection<'a> {
    program: &'a Program,
    stream: BufReader<TcpStream>,
}

impl Program {
    /// Starts `view` in a folder and waits until it tells its address.
    #[track_caller]
    pub fn start(binary: &str, device: &str, folder: &Path, arguments: &str) -> Program {
        Program::of(command(binary, folder, &format!("view {arguments} --no-browser --device {device}")))
    }

    /// Starts a command and waits until it tells its address.
    #[track_caller]
    pub fn of(command: Command) -> Program {
        let mut process = spawn(command);
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

    /// Where the page is.
    pub fn address(&self) -> String {
        format!("http://{}{}", self.host, self.path)
    }

    /// The process.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Whether it still runs.
    pub fn is_running(&mut self) -> bool {
        self.process.try_wait().expect("a process").is_none()
    }

    /// Resident set in KiB.
    pub fn memory(&self) -> u64 {
        let size = resident_kib(self.id());
        assert!(size > 0, "the process is gone");
        size
    }

    /// Ctrl-C: the exit code and what it said.
    pub fn interrupt(&mut self) -> (Option<i32>, String) {
        send("-INT", &self.process);
        let status = end(&mut self.process).unwrap_or_else(|error| panic!("Ctrl-C does not end it: {error}"));
        let mut said = String::new();
        let error: Option<ChildStderr> = self.process.stderr.take();
        error.expect("a pipe").read_to_string(&mut said).expect("text");
        (status.code(), said)
    }

    /// A new connection.
    #[track_caller]
    pub fn connect(&self) -> Connection<'_> {
        let stream = TcpStream::connect(&self.host).expect("a server");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time limit");
        self.connection_of(stream)
    }

    /// A connection that was opened elsewhere.
    pub fn connection_of(&self, stream: TcpStream) -> Connection<'_> {
        Connection { program: self, stream: BufReader::new(stream) }
    }

    /// A request of its own connection.
    #[track_caller]
    pub fn get(&self, path: &str) -> Answer {
        self.connect().ask("GET", &format!("{}{path}", self.path), &[("Host", &self.host)], b"")
    }

    /// What the page is told of the scene.
    #[track_caller]
    pub fn scene(&self) -> Value {
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
    /// Sends a request and waits for the answer.
    #[track_caller]
    pub fn ask(&mut self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        self.send(method, path, headers, body);
        self.receive()
    }

    /// Sends a request.
    #[track_caller]
    pub fn send(&mut self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) {
        let mut text = format!("{method} {path} HTTP/1.1\r\nContent-Length: {}\r\n", body.len());
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        let message = [text.as_bytes(), b"\r\n", body].concat();
        self.stream.get_mut().write_all(&message).expect("a server that listens");
    }

    /// Waits for an answer.
    #[track_caller]
    pub fn receive(&mut self) -> Answer {
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
    pub fn send_picture(&mut self, request: &Value) {
        let (host, path) = (self.program.host.clone(), format!("{}picture", self.program.path));
        self.send("POST", &path, &[("Host", &host)], request.to_string().as_bytes());
    }

    /// Sends a request for a picture and waits for the answer.
    #[track_caller]
    pub fn picture(&mut self, request: &Value) -> Answer {
        self.send_picture(request);
        self.receive()
    }
}

impl Answer {
    /// The body of an answer that is well.
    #[track_caller]
    pub fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        serde_json::from_slice(&self.body).expect("JSON")
    }

    /// The JSON of a picture, and the picture.
    #[track_caller]
    pub fn unpacked(&self) -> (Value, image::RgbImage) {
        assert_eq!(self.status, 200, "{}", String::from_utf8_lossy(&self.body));
        let (length, rest) = self.body.split_first_chunk().expect("a length");
        let (json, rest) = rest.split_at(u32::from_le_bytes(*length) as usize);
        let json: Value = serde_json::from_slice(json).expect("JSON");
        let picture = &rest[..json["picture"]["bytes"].as_u64().expect("a length") as usize];
        (json, image::load_from_memory(picture).expect("a picture").to_rgb8())
    }
}

/// A request for a picture.
pub fn request(tab: &str, pose: &Value, is_moving: bool) -> Value {
    json!({"tab": tab, "pose": pose, "scheme": "error:alpha=1", "moving": is_moving})
}
