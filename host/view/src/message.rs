//! Requests as HTTP/1.1 writes them, from the bytes of a connection, within limits.

use crate::response::Answer;
use httparse::{EMPTY_HEADER, Error, Request as Parsed, Status};

/// Most bytes of a request line and its headers. Browsers send the cookies of other programs on this machine along.
pub(crate) const MAX_HEAD: usize = 16 * 1024;

/// Most headers of a request.
const MAX_HEADERS: usize = 64;

/// Most bytes of a body: the page's own take at most half of it.
pub(crate) const MAX_BODY: usize = 1024;

/// The same of the path of a video, whose address ends so.
const MAX_VIDEO_BODY: usize = 128 * 1024;
const VIDEO: &str = "/video";

/// A request whose head and body are there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub(crate) method: String,
    /// What follows the method: a path.
    pub(crate) target: String,
    headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
    /// The client sends no other request on this connection.
    pub(crate) is_last: bool,
}

impl Message {
    /// The first request of these bytes and its length in bytes; `None` if more bytes have to come.
    ///
    /// # Errors
    /// The answer to a request that is none, or that is too long. No other request can follow it.
    pub(crate) fn read(bytes: &[u8]) -> Result<Option<(Message, usize)>, Answer> {
        let mut headers = [EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = Parsed::new(&mut headers);
        let status = parsed.parse(&bytes[..bytes.len().min(MAX_HEAD)]).map_err(|error| match error {
            Error::TooManyHeaders => Answer::error(431, "the request has too many headers"),
            error => Answer::error(400, &format!("the request cannot be read: {error}")),
        })?;
        let Status::Complete(head_length) = status else {
            let is_too_long = bytes.len() >= MAX_HEAD;
            return if is_too_long { Err(Answer::error(431, "the head of the request is too long")) } else { Ok(None) };
        };
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let mut message = Message {
            method: parsed.method.unwrap_or_default().to_owned(),
            target: parsed.path.unwrap_or_default().to_owned(),
            headers: parsed.headers.iter().map(|header| (header.name.to_owned(), text(header.value))).collect(),
            body: Vec::new(),
            is_last: false,
        };
        let closes = message.header("Connection").is_some_and(|value| !value.eq_ignore_ascii_case("keep-alive"));
        message.is_last = closes || parsed.version != Some(1);
        let length = head_length + message.body_length()?;
        if bytes.len() < length {
            return Ok(None);
        }
        message.body = bytes[head_length..length].to_vec();
        Ok(Some((message, length)))
    }

    /// The value of a header; empty if there are two of them, which is a trick.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut values = self.headers.iter().filter(|(header, _)| header.eq_ignore_ascii_case(name));
        let first = values.next().map(|(_, value)| value.as_str());
        if values.next().is_some() { Some("") } else { first }
    }

    fn body_length(&self) -> Result<usize, Answer> {
        if self.header("Transfer-Encoding").is_some() {
            return Err(Answer::error(411, "the request has no length"));
        }
        if self.header("Expect").is_some() {
            return Err(Answer::error(417, "nothing is promised before a request is there"));
        }
        let Some(written) = self.header("Content-Length") else { return Ok(0) };
        if written.is_empty() || !written.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(Answer::error(400, "the length of the request is no number"));
        }
        // What has too many digits for a number is too long, too.
        let length = written.parse().unwrap_or(usize::MAX);
        let most = if self.target.ends_with(VIDEO) { MAX_VIDEO_BODY } else { MAX_BODY };
        if length > most { Err(Answer::error(413, "the request is too long")) } else { Ok(length) }
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_HEAD, Message};

    fn read(text: &str) -> Result<Option<(Message, usize)>, u16> {
        Message::read(text.as_bytes()).map_err(|answer| answer.status)
    }

    #[test]
    fn requests_come_one_after_another_and_in_pieces() {
        let first = "POST /a HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc";
        let both = format!("{first}GET / HTTP/1.0\r\n\r\n");
        for end in 0..first.len() {
            assert_eq!(read(&both[..end]), Ok(None), "{end}");
        }
        let (message, length) = read(&both).expect("a request").expect("whole");
        assert_eq!((message.method.as_str(), message.target.as_str(), length), ("POST", "/a", first.len()));
        assert_eq!((message.body.as_slice(), message.is_last), (b"abc".as_slice(), false));
        assert_eq!((message.header("HOST"), message.header("Origin")), (Some("x"), None));
        let (second, length) = read(&both[first.len()..]).expect("a request").expect("whole");
        assert!(second.is_last && second.body.is_empty() && length == both.len() - first.len());
    }

    #[test]
    fn what_ends_a_connection_is_seen() {
        let is_last = |header: &str| {
            let text = format!("GET / HTTP/1.1\r\n{header}\r\n");
            read(&text).expect("a request").expect("whole").0.is_last
        };
        assert!(!is_last("") && !is_last("Connection: keep-alive\r\n") && is_last("Connection: close\r\n"));
        assert!(is_last("Connection: Upgrade, HTTP2-Settings\r\n"));
    }

    #[test]
    fn broken_and_great_requests_are_refused() {
        let post = |header: &str| read(&format!("POST / HTTP/1.1\r\n{header}\r\n\r\n")).map(|_| ());
        for length in ["1025", "100000000000000", "18446744073709551615", "99999999999999999999999"] {
            assert_eq!(post(&format!("Content-Length: {length}")), Err(413), "{length}");
        }
        for length in ["", "-1", "+1", "0x10", "1 2", "1\r\nContent-Length: 1"] {
            assert_eq!(post(&format!("Content-Length: {length}")), Err(400), "{length}");
        }
        assert_eq!(post("Transfer-Encoding: chunked"), Err(411));
        assert_eq!(post("Expect: 100-continue"), Err(417));
        assert_eq!(read(&"a".repeat(MAX_HEAD - 1)), Ok(None));
        assert_eq!(read(&"a".repeat(MAX_HEAD)), Err(431));
        assert_eq!(read(&format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(65))), Err(431));
        for text in
            ["\0", "GET /\r\n", "GET / HTTP/9.9\r\n\r\n", "GET  HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\na\r\n\r\n"]
        {
            assert_eq!(read(text), Err(400), "{text:?}");
        }
    }
}
