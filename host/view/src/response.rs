//! Answers of the server. Every one forbids other sites to use it and browsers to keep it.

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

/// The status of an answer that has no body, and no length of one.
const NO_CONTENT: u16 = 204;

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    pub(crate) status: u16,
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
        Answer { status: NO_CONTENT, media_type: "text/plain", body: Vec::new() }
    }

    /// An error, as a line of text.
    pub(crate) fn error(status: u16, message: &str) -> Answer {
        Answer { status, media_type: "text/plain; charset=utf-8", body: message.as_bytes().to_vec() }
    }

    /// Head and body as they are sent; to a request for the head alone, no body.
    pub(crate) fn to_bytes(&self, is_head_only: bool, is_last: bool) -> Vec<u8> {
        let Answer { status, media_type, body } = self;
        let mut head = format!("HTTP/1.1 {status} {}\r\n", reason(*status));
        // The length of nothing is not told.
        if *status != NO_CONTENT {
            head += &format!("Content-Length: {}\r\nContent-Type: {media_type}\r\n", body.len());
        }
        HEADERS.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
        head += if is_last { "Connection: close\r\n\r\n" } else { "\r\n" };
        let mut bytes = head.into_bytes();
        bytes.extend(if is_head_only { &[] } else { body.as_slice() });
        bytes
    }
}

/// What a status is called. Programs read its number.
fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        NO_CONTENT => "No Content",
        400..500 => "Refused",
        _ => "Failed",
    }
}

#[cfg(test)]
mod tests {
    use super::Answer;

    #[test]
    fn an_answer_is_its_head_and_its_body() {
        let text = |answer: &Answer, is_head_only, is_last| {
            String::from_utf8(answer.to_bytes(is_head_only, is_last)).expect("text")
        };
        let answer = Answer::of("text/css", "abc");
        let (whole, head) = (text(&answer, false, false), text(&answer, true, false));
        assert!(whole.starts_with("HTTP/1.1 200 OK\r\nContent-Length: 3\r\nContent-Type: text/css\r\n"), "{whole}");
        assert_eq!(whole, format!("{head}abc"));
        assert!(head.ends_with("\r\n\r\n") && !head.contains("Connection") && head.contains("no-store"), "{head}");
        assert_eq!(text(&answer, true, true), head.replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n"));
        let nothing = text(&Answer::stale(), false, false);
        assert!(!nothing.contains("Content-Length") && !nothing.contains("\nContent-Type"), "{nothing}");
        assert!(text(&Answer::error(404, "no"), false, false).starts_with("HTTP/1.1 404 "));
    }
}
