//! The server: who may ask, and for what.
//!
//! It listens on the loopback interface only. Every address begins with a random token, which other programs and sites do
//! not know. A request must name this server in `Host`, so that a site whose name was pointed at this machine (DNS
//! rebinding) gets nothing even if it knew the token; and one that a browser says comes from another site is refused.
//! Nothing is written: a request changes no file and no state that another tab can see.

use crate::Viewer;
use crate::page::FILES;
use crate::render_loop::{Job, PATIENCE, Shared};
use crate::request::Request;
use crate::response::Answer;
use serde::Serialize;
use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};
use tiny_http::Method;
use viewfuse_job::progress::Progress;
use viewfuse_weighting::sources::SourcePoses;

/// Most bytes of a request's body. What is shorter than this is read before the request arrives here.
const LONGEST_BODY: usize = 1024;

/// So often a connection of the server to itself is opened and closed. When several connections arrive at once, tiny_http's
/// pool may count on a thread that is taken already, and leave one of them waiting until the next one arrives.
const NUDGE: Duration = Duration::from_millis(100);

/// Random bytes of the token.
const TOKEN_BYTES: usize = 16;

/// A listening server, whose address is known.
pub(crate) struct Server {
    http: tiny_http::Server,
    port: u16,
    token: String,
}

/// Why the server cannot listen.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// The port is taken, or may not be used.
    #[error("cannot listen on 127.0.0.1, port {port}: {cause}")]
    Port {
        /// The port; 0 for any.
        port: u16,
        /// The system's error.
        cause: std::io::Error,
    },
    /// The server could not be started.
    #[error("the server cannot be started: {0}")]
    Start(Box<dyn std::error::Error + Send + Sync>),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(getrandom::Error),
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
}

impl Server {
    /// Listens on a port of the loopback interface; 0 for any.
    ///
    /// # Errors
    /// [`ListenError`].
    pub(crate) fn listen(port: u16) -> Result<Server, ListenError> {
        let failed = |cause| ListenError::Port { port, cause };
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let mut token = [0; TOKEN_BYTES];
        getrandom::fill(&mut token).map_err(ListenError::Random)?;
        let token = token.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Server { http: tiny_http::Server::from_listener(listener, None).map_err(ListenError::Start)?, port, token })
    }

    /// The page's address.
    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Answers until the progress says that it is cancelled, or `is_over`.
    pub(crate) fn serve(
        &self,
        viewer: &Viewer<'_>,
        shared: &Shared,
        progress: &dyn Progress,
        is_over: impl Fn() -> bool,
    ) {
        let mut nudged = Instant::now();
        while !progress.is_cancelled() && !is_over() {
            if nudged.elapsed() > NUDGE {
                drop(TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)));
                nudged = Instant::now();
            }
            // An error is that of a single connection.
            let Ok(Some(request)) = self.http.recv_timeout(PATIENCE) else { continue };
            self.answer(request, viewer, shared);
        }
    }

    fn answer(&self, mut connection: tiny_http::Request, viewer: &Viewer<'_>, shared: &Shared) {
        let url = connection.url().to_owned();
        let named = |name: &'static str| {
            let mut values = connection.headers().iter().filter(move |header| header.field.equiv(name));
            let first = values.next().map(|header| header.value.as_str());
            // Two of a kind are a trick.
            if values.next().is_some() { Some("") } else { first }
        };
        let checked = check(
            self.port,
            &self.token,
            connection.method(),
            &url,
            [named("Host"), named("Origin"), named("Sec-Fetch-Site")],
        );
        let answer = match checked {
            Err(answer) => answer,
            Ok(Route::Page(file)) => Answer::of(FILES[file].media_type, FILES[file].text),
            Ok(Route::Scene) => json(&viewer.subject),
            Ok(Route::Status) => Answer::json(shared.status.json()),
            Ok(Route::Source(number)) => {
                let thumbnails = shared.thumbnails.get();
                let picture = number.parse().ok().and_then(|number: usize| thumbnails?.get(number));
                picture.map_or_else(not_found, |picture| Answer::of("image/jpeg", picture.clone()))
            }
            Ok(route) => match read(&mut connection, viewer) {
                Err(answer) => answer,
                Ok(request) if route == Route::Picture => {
                    return shared.mailbox.put(Job { request, connection });
                }
                Ok(request) => weights(&viewer.sources, &request),
            },
        };
        answer.send(connection);
    }
}

fn json(value: &impl Serialize) -> Answer {
    serde_json::to_vec(value).map_or_else(|error| Answer::error(500, &error.to_string()), Answer::json)
}

fn not_found() -> Answer {
    Answer::error(404, "there is no such address here")
}

fn weights(sources: &SourcePoses, request: &Request) -> Answer {
    let weights = request.weighting.weigh(sources, &request.pose);
    json(&&weights.values()[..weights.count() as usize])
}

/// Reads and checks the body of a request for a picture or for weights.
fn read(connection: &mut tiny_http::Request, viewer: &Viewer<'_>) -> Result<Request, Answer> {
    let length = connection.body_length().ok_or_else(|| Answer::error(411, "the request has no length"))?;
    if length > LONGEST_BODY {
        return Err(Answer::error(413, "the request is too long"));
    }
    let mut body = Vec::new();
    let read = connection.as_reader().take(LONGEST_BODY as u64).read_to_end(&mut body);
    read.map_err(|error| Answer::error(400, &error.to_string()))?;
    Request::read(&body, viewer.viewed.weighting).map_err(|error| Answer::error(400, &error.to_string()))
}

/// Which route a request takes, or why it is refused. The headers are `Host`, `Origin` and `Sec-Fetch-Site`.
fn check<'a>(
    port: u16,
    token: &str,
    method: &Method,
    url: &'a str,
    [host, origin, site]: [Option<&str>; 3],
) -> Result<Route<'a>, Answer> {
    let forbidden = || Answer::error(403, "this address is for the page of this program alone");
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let is_own = |host: &str| own.iter().any(|own| own == host);
    if !host.is_some_and(is_own) {
        return Err(forbidden());
    }
    if origin.is_some_and(|origin| !origin.strip_prefix("http://").is_some_and(is_own)) {
        return Err(forbidden());
    }
    // A link from another program has the value `none`.
    if site.is_some_and(|site| site != "same-origin" && site != "none") {
        return Err(forbidden());
    }
    let path = url.strip_prefix('/').unwrap_or_default();
    let (given, rest) = path.split_once('/').unwrap_or((path, ""));
    if !is_same(given, token) {
        return Err(forbidden());
    }
    let route = match rest {
        "scene" => Route::Scene,
        "status" => Route::Status,
        "picture" => Route::Picture,
        "weights" => Route::Weights,
        rest => match rest.strip_prefix("source/") {
            Some(number) => Route::Source(number),
            None => Route::Page(FILES.iter().position(|file| file.name == rest).ok_or_else(not_found)?),
        },
    };
    let fits = match route {
        Route::Picture | Route::Weights => *method == Method::Post,
        _ => matches!(method, Method::Get | Method::Head),
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
    use tiny_http::Method;

    const TOKEN: &str = "0123456789abcdef";

    fn status(method: Method, url: &str, headers: [Option<&str>; 3]) -> u16 {
        check(80, TOKEN, &method, url, headers).map_or_else(|answer| answer.status(), |_| 200)
    }

    #[test]
    fn other_hosts_and_sites_are_refused() {
        let url = format!("/{TOKEN}/");
        let get = |headers| status(Method::Get, &url, headers);
        let own = Some("127.0.0.1:80");
        assert_eq!(get([own, None, None]), 200);
        assert_eq!(get([Some("localhost:80"), Some("http://localhost:80"), Some("same-origin")]), 200);
        assert_eq!(get([own, None, Some("none")]), 200, "typed in, or opened by another program");
        for host in [
            None,
            Some(""),
            Some("127.0.0.1"),
            Some("127.0.0.1:81"),
            Some("evil.example:80"),
            Some("127.0.0.1:80.evil"),
        ] {
            assert_eq!(get([host, None, None]), 403, "{host:?}");
        }
        for origin in ["null", "http://evil.example", "https://127.0.0.1:80", "http://127.0.0.1:81", ""] {
            assert_eq!(get([own, Some(origin), None]), 403, "{origin}");
        }
        for site in ["cross-site", "same-site", ""] {
            assert_eq!(get([own, None, Some(site)]), 403, "{site}");
        }
    }

    #[test]
    fn nothing_without_the_token_and_nothing_else_with_it() {
        let own = [Some("127.0.0.1:80"), None, None];
        let get = |url: &str| status(Method::Get, url, own);
        for url in [
            "",
            "/",
            "/view.js",
            "/0123456789abcdee/",
            "/0123456789abcde/",
            "/0123456789abcdef0/",
            "//0123456789abcdef/",
        ] {
            assert_eq!(get(url), 403, "{url}");
        }
        for (rest, expected) in
            [("view.js", 200), ("scene", 200), ("../Cargo.toml", 404), ("view.js?x", 404), ("picture", 405)]
        {
            assert_eq!(get(&format!("/{TOKEN}/{rest}")), expected, "{rest}");
        }
        for method in [Method::Put, Method::Delete, Method::Options] {
            assert_eq!(status(method, &format!("/{TOKEN}/scene"), own), 405);
        }
        let url = format!("/{TOKEN}/source/7");
        assert_eq!(check(80, TOKEN, &Method::Get, &url, own), Ok(Route::Source("7")));
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
