//! The server: who may ask, and for what.
//!
//! It listens on the loopback interface only. Every address begins with a random token, which other programs and sites
//! do not know. A request must name this server in `Host`, so that a site whose name was pointed at this machine (DNS
//! rebinding) gets nothing even if it knew the token; and one that a browser says comes from another site is refused.
//! Nothing is written but the frames of a video, to a scratch folder: a request changes no file and no state that
//! another tab can see.

use crate::Viewer;
use crate::connection::{Connection, is_gone};
use crate::connections::{Admission, Connections, Standing};
use crate::message::Message;
use crate::page::FILES;
use crate::render_loop::{Job, Shared};
use crate::request::{Request, VideoRequest};
use crate::response::Answer;
use serde::Serialize;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;
use viewfuse_job::hint::{Hint, Hinted};

/// The port that an address need not name.
const USUAL_PORT: u16 = 80;

/// Pause after a connection that could not be accepted, because the system has no more of them.
const PAUSE: Duration = Duration::from_millis(10);

/// At the end, answers that are on their way have so long to arrive.
const TIME_TO_END: Duration = Duration::from_millis(200);

/// Stack of a connection's thread: it parses and weighs, and renders nothing.
const STACK_BYTES: usize = 1 << 20;

/// Random bytes of the token.
const TOKEN_BYTES: usize = 16;

/// A listening server, whose address is known.
pub(crate) struct Server {
    listener: TcpListener,
    port: u16,
    token: String,
}

/// Why the server cannot listen.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// The port (0 for any) is taken, or may not be used.
    #[error("cannot listen on 127.0.0.1, port {0}: {1}")]
    Port(u16, std::io::Error),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(getrandom::Error),
}

impl Hinted for ListenError {
    fn hint(&self) -> Option<Hint> {
        match self {
            ListenError::Port { .. } => Some(Hint::Port),
            _ => None,
        }
    }
}

/// A route and what it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Route<'a> {
    /// A file of the page, as an index.
    Page(usize),
    Scene,
    Status,
    /// The photograph of a source.
    Source(&'a str),
    Picture,
    Weights,
    Video,
}

impl Server {
    /// Listens on a port of the loopback interface; 0 for any.
    pub(crate) fn listen(port: u16) -> Result<Server, ListenError> {
        let failed = |cause| ListenError::Port(port, cause);
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let mut token = [0; TOKEN_BYTES];
        getrandom::fill(&mut token).map_err(ListenError::Random)?;
        let token = token.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Server { listener, port, token })
    }

    /// The page's address.
    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Answers until it is over. Each connection has a thread.
    pub(crate) fn serve(&self, viewer: &Viewer<'_>, shared: &Shared, is_over: &AtomicBool) {
        let connections = Connections::default();
        thread::scope(|scope| {
            while !is_over.load(Ordering::Relaxed) {
                let Ok((stream, _)) = self.listener.accept() else {
                    // A client that is gone already, or one file too many: then one that idles makes way.
                    connections.make_way();
                    thread::sleep(PAUSE);
                    continue;
                };
                let stream = Arc::new(stream);
                if let Some(admission) = connections.admit(&stream) {
                    let answer_all = move || self.answer_all(&stream, &admission, viewer, shared);
                    // Without a thread the connection is closed.
                    thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, answer_all).ok();
                }
            }
            connections.close(TIME_TO_END);
        });
    }

    /// Lets [`Server::serve`] see that it is over: it waits for a connection.
    pub(crate) fn wake(&self) {
        // If there are no connections left for this one, another one wakes it.
        TcpStream::connect_timeout(&SocketAddr::from((Ipv4Addr::LOCALHOST, self.port)), TIME_TO_END).ok();
    }

    /// Answers the requests of a connection, one after another.
    fn answer_all(&self, stream: &TcpStream, admission: &Admission<'_>, viewer: &Viewer<'_>, shared: &Shared) {
        let mut connection = Connection::new(stream);
        loop {
            let (answer, is_head_only, is_last) = match connection.receive() {
                Ok(message) => {
                    let Some(answer) = self.answer(&message, stream, admission, viewer, shared) else { return };
                    (answer, message.method == "HEAD", message.is_last)
                }
                Err(Some(refused)) => {
                    admission.stands(Standing::Refused);
                    (refused, false, true)
                }
                Err(None) => return,
            };
            if connection.send(&answer, is_head_only, is_last).is_err() {
                return;
            }
            if is_last {
                return connection.end();
            }
        }
    }

    /// The answer to a request. None if the viewer ended before there was one.
    fn answer(
        &self,
        message: &Message,
        stream: &TcpStream,
        admission: &Admission<'_>,
        viewer: &Viewer<'_>,
        shared: &Shared,
    ) -> Option<Answer> {
        let headers = ["Host", "Origin", "Sec-Fetch-Site"].map(|name| message.header(name));
        let route = match check(self.port, &self.token, &message.method, &message.target, headers) {
            Ok(route) => route,
            Err(answer) => return Some(answer),
        };
        admission.stands(Standing::OfPage);
        let read = || {
            let request = Request::read(&message.body, viewer.viewed.weighting);
            request.map_err(|error| Answer::error(400, &error.to_string()))
        };
        Some(match route {
            Route::Page(file) => Answer::of(FILES[file].media_type, FILES[file].text),
            Route::Scene => json(&viewer.subject),
            Route::Status => Answer::json(shared.status.json()),
            Route::Source(number) => {
                let thumbnails = shared.thumbnails.get();
                let picture = number.parse().ok().and_then(|number: usize| thumbnails?.get(number));
                picture.map_or_else(not_found, |picture| Answer::of("image/jpeg", picture.clone()))
            }
            Route::Weights => read().map_or_else(|refused| refused, |request| weights(viewer, &request)),
            Route::Video => match VideoRequest::read(&message.body, viewer.viewed.weighting) {
                Err(error) => Answer::error(400, &error.to_string()),
                Ok(request) => match shared.studio.begin(&shared.status) {
                    None => Answer::error(409, "another video is being made: it ends first, or is cancelled"),
                    Some(turn) => {
                        admission.stands(Standing::Waits);
                        let answer = turn.make(request, viewer.subject.video.format, &|| is_gone(stream))?;
                        admission.stands(Standing::OfPage);
                        answer
                    }
                },
            },
            Route::Picture => match read() {
                Err(refused) => refused,
                Ok(request) => {
                    admission.stands(Standing::Waits);
                    let (reply, answer) = channel();
                    shared.mailbox.put(Job { request, reply });
                    let answer = answer.recv().ok()?;
                    admission.stands(Standing::OfPage);
                    answer
                }
            },
        })
    }
}

fn json(value: &impl Serialize) -> Answer {
    serde_json::to_vec(value).map_or_else(|error| Answer::error(503, &error.to_string()), Answer::json)
}

fn not_found() -> Answer {
    Answer::error(404, "there is no such address here")
}

fn weights(viewer: &Viewer<'_>, request: &Request) -> Answer {
    let weights = request.weighting.weigh(&viewer.sources, &viewer.unit.pose(&request.pose));
    json(&&weights.values()[..weights.count() as usize])
}

/// Which route a request takes, or why it is refused. The headers are `Host`, `Origin` and `Sec-Fetch-Site`.
fn check<'a>(
    port: u16,
    token: &str,
    method: &str,
    url: &'a str,
    [host, origin, site]: [Option<&str>; 3],
) -> Result<Route<'a>, Answer> {
    let forbidden = || Answer::error(403, "this address is for the page of this program alone");
    let other_host = || {
        let text = format!(
            "this address is for the page of this program alone, at port {port} of this machine: a tunnel must have \
             that port at both ends"
        );
        Answer::error(403, &text)
    };
    let is_own = |host: &str| {
        ["127.0.0.1", "localhost"].into_iter().any(|local| match host.strip_prefix(local) {
            Some("") => port == USUAL_PORT,
            Some(rest) => rest == format!(":{port}"),
            None => false,
        })
    };
    if !host.is_some_and(is_own) {
        return Err(other_host());
    }
    if origin.is_some_and(|origin| !origin.strip_prefix("http://").is_some_and(is_own)) {
        return Err(forbidden());
    }
    // A link from another program has the value `none`.
    if site.is_some_and(|site| site != "same-origin" && site != "none") {
        return Err(forbidden());
    }
    let path = url.strip_prefix('/').unwrap_or_default();
    let (given, rest) = path.split_once('/').map_or((path, None), |(given, rest)| (given, Some(rest)));
    if !is_same(given, token) {
        return Err(forbidden());
    }
    // Without the slash the page would look for its parts beside itself.
    let rest = rest.ok_or_else(|| Answer::error(404, "the address ends with a slash"))?;
    let route = match rest {
        "scene" => Route::Scene,
        "status" => Route::Status,
        "picture" => Route::Picture,
        "weights" => Route::Weights,
        "video" => Route::Video,
        rest => match rest.strip_prefix("source/") {
            Some(number) => Route::Source(number),
            None => Route::Page(FILES.iter().position(|file| file.name == rest).ok_or_else(not_found)?),
        },
    };
    let fits = match route {
        Route::Picture | Route::Weights | Route::Video => method == "POST",
        _ => matches!(method, "GET" | "HEAD"),
    };
    if fits { Ok(route) } else { Err(Answer::error(405, "this address does not take this method")) }
}

/// Whether two texts are the same, in a time that does not tell where they differ.
fn is_same(given: &str, token: &str) -> bool {
    let differ = given.bytes().zip(token.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
    given.len() == token.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::{Route, Server, check};

    const TOKEN: &str = "0123456789abcdef";

    fn status(method: &str, url: &str, headers: [Option<&str>; 3]) -> u16 {
        check(8000, TOKEN, method, url, headers).map_or_else(|answer| answer.status, |_| 200)
    }

    #[test]
    fn other_hosts_and_sites_are_refused() {
        let url = format!("/{TOKEN}/");
        let get = |headers| status("GET", &url, headers);
        let local = Some("127.0.0.1:8000");
        assert_eq!(get([local, None, None]), 200);
        assert_eq!(get([Some("localhost:8000"), Some("http://localhost:8000"), Some("same-origin")]), 200);
        assert_eq!(get([local, None, Some("none")]), 200, "typed in, or opened by another program");
        for host in [
            None,
            Some(""),
            Some("127.0.0.1"),
            Some("127.0.0.1:"),
            Some("127.0.0.1:80"),
            Some("127.0.0.1:81"),
            Some("evil.example:8000"),
            Some("127.0.0.1:8000.evil"),
        ] {
            assert_eq!(get([host, None, None]), 403, "{host:?}");
        }
        for origin in ["null", "http://evil.example", "https://127.0.0.1:8000", "http://127.0.0.1:81", ""] {
            assert_eq!(get([local, Some(origin), None]), 403, "{origin}");
        }
        for site in ["cross-site", "same-site", ""] {
            assert_eq!(get([local, None, Some(site)]), 403, "{site}");
        }
    }

    #[test]
    fn the_usual_port_need_not_be_named() {
        let url = format!("/{TOKEN}/");
        let get = |host: &str, origin: &str| {
            [None, Some(origin)].map(|origin| check(80, TOKEN, "GET", &url, [Some(host), origin, None]).is_ok())
        };
        for host in ["127.0.0.1", "127.0.0.1:80", "localhost", "localhost:80"] {
            assert_eq!(get(host, &format!("http://{host}")), [true; 2], "{host}");
        }
        for host in ["127.0.0.1.evil", "127.0.0.1:", "127.0.0.1:8", "localhost.evil"] {
            assert_eq!(get(host, "http://localhost"), [false; 2], "{host}");
            assert_eq!(get("localhost", &format!("http://{host}")), [true, false], "{host}");
        }
    }

    #[test]
    fn nothing_without_the_token_and_nothing_else_with_it() {
        let headers = [Some("127.0.0.1:8000"), None, None];
        let get = |url: &str| status("GET", url, headers);
        for url in [
            "", "/", "/view.js", "/0123456789abcdee/", "/0123456789abcde/", "/0123456789abcdef0/",
            "//0123456789abcdef/",
        ] {
            assert_eq!(get(url), 403, "{url}");
        }
        for (rest, expected) in [
            ("view.js", 200),
            ("scene", 200),
            ("../Cargo.toml", 404),
            ("view.js?x", 404),
            ("picture", 405),
            ("video", 405),
        ] {
            assert_eq!(get(&format!("/{TOKEN}/{rest}")), expected, "{rest}");
        }
        for method in ["PUT", "DELETE", "OPTIONS", "get"] {
            assert_eq!(status(method, &format!("/{TOKEN}/scene"), headers), 405);
        }
        let url = format!("/{TOKEN}/source/7");
        assert_eq!(check(8000, TOKEN, "GET", &url, headers), Ok(Route::Source("7")));
    }

    #[test]
    fn every_server_has_its_own_token_on_the_loopback_interface() {
        let [first, second] = [0, 0].map(|port| Server::listen(port).expect("a server"));
        assert!(first.address().starts_with("http://127.0.0.1:") && first.token.len() == 32);
        assert_ne!(first.token, second.token);
        let taken = Server::listen(first.port).err().expect("the port is taken").to_string();
        assert!(taken.contains(&first.port.to_string()), "{taken}");
    }
}
