//! What the server reads of a connection's bytes, without the server: for tests with broken input.

use crate::message::Message;
use crate::request::Request;
use viewfuse_weighting::Weighting;

/// The first request of a connection's bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FirstRequest {
    /// Its length in bytes, head and body.
    pub length: usize,
    /// Whether its body asks for a picture or for weights.
    pub asks: bool,
}

/// The first request of these bytes; `None` if more bytes have to come.
///
/// # Errors
/// The status code of the answer to bytes that are no request, or too long a one: the connection ends with it.
pub fn first_request(bytes: &[u8]) -> Result<Option<FirstRequest>, u16> {
    let read = Message::read(bytes).map_err(|answer| answer.status)?;
    Ok(read.map(|(message, length)| {
        let asks = Request::read(&message.body, &Weighting::default_scheme()).is_ok();
        FirstRequest { length, asks }
    }))
}
