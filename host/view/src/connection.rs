//! One connection: requests come in, one after another, and answers go out, each within a stated time.
//!
//! What a client sends before its answer is there waits in the system's buffer, so that nothing queues here.

use crate::message::Message;
use crate::response::Answer;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// So long a connection may be silent between two requests.
const MAX_IDLE: Duration = Duration::from_secs(60);

/// Time from the first byte of a request to its last.
const MAX_REQUEST_TIME: Duration = Duration::from_secs(10);

/// Time in which a client has to take an answer.
const MAX_ANSWER_TIME: Duration = Duration::from_secs(60);

/// So long, and so many bytes, are thrown away after a refusal: a connection that is closed with bytes unread is reset,
/// and the client could not read why.
const MAX_LINGER: Duration = Duration::from_secs(1);
const MAX_LINGER_BYTES: usize = 64 * 1024;

/// Bytes that are read at once.
const PIECE: usize = 4096;

/// A connection with what was read ahead.
pub(crate) struct Connection<'a> {
    stream: &'a TcpStream,
    buffer: Vec<u8>,
}

impl<'a> Connection<'a> {
    pub(crate) fn new(stream: &'a TcpStream) -> Connection<'a> {
        // An answer is written in one piece: it need not wait for the acknowledgement of the one before. Without the
        // option it only comes later.
        stream.set_nodelay(true).ok();
        Connection { stream, buffer: Vec::new() }
    }

    /// The next request.
    ///
    /// # Errors
    /// The answer to what is no request, after which the connection ends; `None` if it ended.
    pub(crate) fn receive(&mut self) -> Result<Message, Option<Answer>> {
        let mut deadline = Instant::now() + MAX_IDLE;
        let mut is_begun = false;
        loop {
            if let Some((message, length)) = Message::read(&self.buffer)? {
                self.buffer.drain(..length);
                return Ok(message);
            }
            if !is_begun && !self.buffer.is_empty() {
                (is_begun, deadline) = (true, Instant::now() + MAX_REQUEST_TIME);
            }
            let mut piece = [0; PIECE];
            match self.read(&mut piece, deadline) {
                Ok(0) => return Err(None),
                Ok(count) => self.buffer.extend_from_slice(&piece[..count]),
                Err(error) => {
                    let is_late = matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut);
                    return Err((is_late && is_begun).then(|| Answer::error(408, "the request takes too long")));
                }
            }
        }
    }

    /// Sends an answer; to a request for the head alone, no body.
    ///
    /// # Errors
    /// That of the connection. A client that is gone is nothing to report: a page may be closed at any time.
    pub(crate) fn send(&mut self, answer: &Answer, is_head_only: bool, is_last: bool) -> io::Result<()> {
        let deadline = Instant::now() + MAX_ANSWER_TIME;
        // Head and body in one piece: in two, each answer would wait for the client's delayed acknowledgement.
        let bytes = answer.to_bytes(is_head_only, is_last);
        let mut rest = bytes.as_slice();
        while !rest.is_empty() {
            self.stream.set_write_timeout(Some(time_until(deadline)?))?;
            match self.stream.write(rest) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => rest = &rest[count..],
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Ends it, so that the client can read the last answer.
    pub(crate) fn end(self) {
        let deadline = Instant::now() + MAX_LINGER;
        let mut left = MAX_LINGER_BYTES;
        let mut piece = [0; PIECE];
        let mut is_open = self.stream.shutdown(Shutdown::Write).is_ok();
        while is_open && left > 0 {
            let count = self.read(&mut piece, deadline).unwrap_or(0);
            (is_open, left) = (count > 0, left.saturating_sub(count));
        }
    }

    fn read(&self, piece: &mut [u8], deadline: Instant) -> io::Result<usize> {
        loop {
            self.stream.set_read_timeout(Some(time_until(deadline)?))?;
            match (&mut &*self.stream).read(piece) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                result => return result,
            }
        }
    }
}

/// Whether the client of a connection has closed it.
pub(crate) fn is_gone(stream: &TcpStream) -> bool {
    let is_there = || {
        stream.set_read_timeout(Some(Duration::from_millis(1)))?;
        stream.peek(&mut [0])
    };
    match is_there() {
        Ok(count) => count == 0,
        Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted),
    }
}

/// # Errors
/// If it has come.
fn time_until(deadline: Instant) -> io::Result<Duration> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}
