//! The server under attack by programs that do not know its address: it goes on, other tabs are answered, and Ctrl-C
//! ends it. Requests of any bytes are a target of `fuzz`.

use super::super::BINARY;
use super::start;
use socket2::SockRef;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::thread::scope;
use std::time::Duration;
use viewfuse_tests::command::toy;
use viewfuse_tests::patience::PATIENCE;
use viewfuse_tests::scenes::Folder;
use viewfuse_tests::trials::lacking;
use viewfuse_tests::viewer::{Connection, Program, request};

/// Most memory of the program under any attack, in KiB.
const MAX_MEMORY: u64 = 100_000;

/// What a connection may send at most until it has to be refused, or to wait.
const MAX_SENT: usize = 1 << 28;

viewfuse_tests::trials![
    a_length_that_is_too_great_is_refused,
    idle_connections_keep_nobody_out,
    a_slow_body_holds_up_nobody,
    resets_are_not_reported;
    TcpListener::bind("127.0.0.1:80").err().map(|error| format!("port 80: {error}")) => port_80_needs_no_number;
    lacking(cfg!(target_os = "linux"), "the system does not say what a process takes") =>
        pipelined_requests_do_not_queue, an_endless_request_line_takes_no_memory,
];

struct Attacked {
    program: Program,
    _folder: Folder,
}

impl Attacked {
    /// With as many files as a process usually may open.
    fn start() -> Attacked {
        let folder = toy();
        let mut limited = Command::new("sh");
        limited.args(["-c", "ulimit -n 1024; exec \"$@\"", "sh", BINARY, "view", "toy", "--no-browser"]);
        limited.args("--device cpu --sources 0..3 --size 24x24".split(' ')).current_dir(&folder);
        Attacked { program: Program::of(limited), _folder: folder }
    }

    fn raw(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.program.host).expect("a server that listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time limit");
        stream.set_write_timeout(Some(PATIENCE)).expect("a time limit");
        stream
    }

    /// Sends bytes; the status of the answer, and the connection.
    fn status_of(&self, bytes: &[u8]) -> (u16, TcpStream) {
        let mut stream = self.raw();
        stream.write_all(bytes).expect("a server that listens");
        let mut start = [0; 12];
        stream.read_exact(&mut start).expect("an answer");
        let status = String::from_utf8_lossy(&start[9..]).parse().expect("a status");
        (status, stream)
    }

    /// An open tab and a new one get what they ask for.
    fn tabs_are_served(&self, open: &mut Connection<'_>) {
        let headers = [("Host", self.program.host.as_str())];
        assert_eq!(open.ask("GET", &format!("{}status", self.program.path), &headers, b"").status, 200);
        let start = &self.program.scene()["start"];
        self.program.connect().picture(&request("new", start, true)).unpacked();
    }

    fn memory_is_small(&self) {
        let memory = self.program.memory();
        assert!(memory < MAX_MEMORY, "{memory} KiB");
    }

    /// Ctrl-C ends it, and nothing was said about anybody's connection.
    fn ends(&mut self) {
        assert_eq!(self.program.interrupt(), (Some(0), String::new()));
    }
}

fn a_length_that_is_too_great_is_refused() {
    let mut attacked = Attacked::start();
    let (host, path) = (&attacked.program.host, &attacked.program.path);
    for (length, expected) in [
        ("100000000000000", 413),
        ("18446744073709551615", 413),
        ("18446744073709551616", 413),
        ("1025", 413),
        ("-1", 400),
        ("1e3", 400),
        ("", 400),
    ] {
        for (path, host) in [("/", "evil.example"), (&format!("{path}picture"), host)] {
            let text = format!("POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n");
            assert_eq!(attacked.status_of(text.as_bytes()).0, expected, "{length}");
        }
    }
    let two =
        format!("POST {path}picture HTTP/1.1\r\nHost: {host}\r\nContent-Length: 2\r\nContent-Length: 3\r\n\r\n{{}} ");
    assert_eq!(attacked.status_of(two.as_bytes()).0, 400);
    let chunked = format!(
        "POST {path}picture HTTP/1.1\r\nHost: {host}\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n"
    );
    assert_eq!(attacked.status_of(chunked.as_bytes()).0, 411);
    attacked.tabs_are_served(&mut attacked.program.connect());
    attacked.ends();
}

fn idle_connections_keep_nobody_out() {
    let mut attacked = Attacked::start();
    let mut open = attacked.program.connect();
    attacked.tabs_are_served(&mut open);
    let idle: Vec<TcpStream> = (0..510).map(|_| attacked.raw()).collect();
    attacked.tabs_are_served(&mut open);
    // One that is half through its head is not idle, and keeps nobody out either.
    let begun: Vec<TcpStream> = (0..510).map(|_| attacked.raw()).collect();
    for mut stream in &begun {
        // It may have been closed for a newer one.
        stream.write_all(b"GET / HTTP/1.1\r\nHost: ").ok();
    }
    attacked.tabs_are_served(&mut open);
    drop(open);
    attacked.ends();
    drop((idle, begun));
}

fn a_slow_body_holds_up_nobody() {
    let mut attacked = Attacked::start();
    let path = format!("{}picture", attacked.program.path);
    let mut open = attacked.program.connect();
    let host = &attacked.program.host;
    let slow: Vec<TcpStream> =
        [("/", "evil.example", 1000), (&path, host, 1000), ("/", "evil.example", 5000), (&path, host, 5000)]
            .into_iter()
            .map(|(path, host, length)| {
                let mut stream = attacked.raw();
                let head = format!("POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n{{");
                stream.write_all(head.as_bytes()).expect("a server that listens");
                stream
            })
            .collect();
    for mut stream in &slow {
        attacked.tabs_are_served(&mut open);
        // One that is too long is refused, and no longer read.
        stream.write_all(b" ").ok();
    }
    drop(open);
    attacked.ends();
}

fn pipelined_requests_do_not_queue() {
    const REQUESTS: usize = 80_000;
    let mut attacked = Attacked::start();
    let mut open = attacked.program.connect();
    let text = format!("GET / HTTP/1.1\r\nHost: {}\r\n\r\n", attacked.program.host);
    let mut stream = attacked.raw();
    // As many as the server takes without an answer being read; it is not asked to take all.
    stream.set_nonblocking(true).expect("no waiting");
    let (all, mut sent) = (text.repeat(REQUESTS), 0);
    for _ in 0..10 {
        while let Ok(count) = stream.write(&all.as_bytes()[sent..]) {
            sent += count;
            if sent == all.len() {
                break;
            }
        }
        attacked.tabs_are_served(&mut open);
        attacked.memory_is_small();
    }
    assert!(sent > text.len(), "nothing was sent");
    // Whoever reads the answers gets one for each request.
    drop(stream);
    let stream = attacked.raw();
    let answered = scope(|scope| {
        let sending = scope.spawn(|| (&stream).write_all(&all.as_bytes()[..1000 * text.len()]));
        let mut connection = attacked.program.connection_of(stream.try_clone().expect("the same connection"));
        let answered = (0..1000).filter(|_| connection.receive().status == 403).count();
        sending.join().expect("no panic").expect("all are taken");
        answered
    });
    assert_eq!(answered, 1000);
    drop(open);
    attacked.ends();
}

fn an_endless_request_line_takes_no_memory() {
    let mut attacked = Attacked::start();
    let mut open = attacked.program.connect();
    let head = format!("GET / HTTP/1.1\r\nHost: {}\r\nX: ", attacked.program.host);
    for start in ["GET /", &head, "GET / HTTP/1.1\r\n"] {
        let mut stream = attacked.raw();
        stream.write_all(start.as_bytes()).expect("a server that listens");
        let (piece, mut sent) = ([b'a'; 1 << 16], 0);
        // It closes the connection.
        while stream.write_all(&piece).is_ok() {
            sent += piece.len();
            assert!(sent < MAX_SENT, "{start:?}: {sent} bytes are taken");
        }
        attacked.tabs_are_served(&mut open);
        attacked.memory_is_small();
    }
    let long = format!("GET /{} HTTP/1.1\r\nHost: {}\r\n\r\n", "a".repeat(20_000), attacked.program.host);
    assert_eq!(attacked.status_of(long.as_bytes()).0, 431);
    let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(200));
    assert_eq!(attacked.status_of(many.as_bytes()).0, 431);
    drop(open);
    attacked.ends();
}

/// Connections that are reset: by a client that does not linger, also before the server saw them, and by one that
/// leaves an answer unread.
fn resets_are_not_reported() {
    let mut attacked = Attacked::start();
    let mut open = attacked.program.connect();
    for number in 0..400 {
        let mut stream = attacked.raw();
        if number % 2 == 0 {
            SockRef::from(&stream).set_linger(Some(Duration::ZERO)).expect("no lingering");
        }
        let count = [0, 0, 1, 50][number % 4];
        // It may have been closed for a newer one.
        stream.write_all("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".repeat(count).as_bytes()).ok();
        if count > 0 && number % 3 == 1 {
            stream.read_exact(&mut [0]).ok();
        }
    }
    attacked.tabs_are_served(&mut open);
    drop(open);
    attacked.ends();
}

/// A browser leaves the scheme's own port out.
fn port_80_needs_no_number() {
    let folder = toy();
    let program = start(&folder, "toy --sources 0..3 --size 24x24 --port 80");
    let path = format!("{}status", program.path);
    for host in ["127.0.0.1", "localhost", "127.0.0.1:80", "localhost:80"] {
        assert_eq!(program.connect().ask("GET", &path, &[("Host", host)], b"").status, 200, "{host}");
        let origin = format!("http://{host}");
        let headers = [("Host", host), ("Origin", origin.as_str())];
        assert_eq!(program.connect().ask("GET", &path, &headers, b"").status, 200, "{origin}");
    }
    assert_eq!(program.connect().ask("GET", &path, &[("Host", "127.0.0.1:81")], b"").status, 403);
}
