//! Answers of the server. Every one forbids other sites to use it and browsers to keep it.

use std::io::{self, Write};
use tiny_http::{HTTPVersion, Header, Method, Request, Response};

/// Headers of every answer: nothing is kept, embedded, guessed, or told to other sites, and the page loads nothing from
/// elsewhere.
const HEADERS: [(&str, &str); 6] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
];

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    status: u16,
    media_type: &'static str,
    body: Vec<u8>,
}

impl Answer {
    pub(crate) fn of(media_type: &'static str, body: impl Into<Vec<u8>>) -> Answer {
        Answer { status: 200, media_type, body: body.into() }
    }

    pub(crate) fn json(body: Vec<u8>) -> Answer {
        Answer::of("application/json", body)
    }

    /// Nothing: the request was overtaken by a newer one.
    pub(crate) fn stale() -> Answer {
        Answer { status: 204, media_type: "text/plain", body: Vec::new() }
    }

    /// An error, as a line of text.
    pub(crate) fn error(status: u16, message: &str) -> Answer {
        Answer { status, media_type: "text/plain; charset=utf-8", body: message.as_bytes().to_vec() }
    }

    #[cfg(test)]
    pub(crate) fn status(&self) -> u16 {
        self.status
    }

    /// Sends it. A client that is gone is no error: a page may be closed at any time.
    pub(crate) fn send(self, request: Request) {
        // Head and body in one piece: in two, each answer would wait for the client's delayed acknowledgement.
        let sent = self.bytes(&request).and_then(|bytes| {
            let mut writer = request.into_writer();
            writer.write_all(&bytes)?;
            writer.flush()
        });
        drop(sent);
    }

    fn bytes(self, request: &Request) -> io::Result<Vec<u8>> {
        let Answer { status, media_type, body } = self;
        let mut response = Response::from_data(body).with_status_code(status).with_chunked_threshold(usize::MAX);
        for (name, value) in HEADERS.into_iter().chain([("Content-Type", media_type)]) {
            if let Ok(header) = Header::from_bytes(name, value) {
                response.add_header(header);
            }
        }
        let mut bytes = Vec::new();
        response.raw_print(
            &mut bytes,
            HTTPVersion(1, 1),
            request.headers(),
            *request.method() == Method::Head,
            None,
        )?;
        Ok(bytes)
    }
}
