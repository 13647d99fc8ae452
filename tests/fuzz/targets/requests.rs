//! What a browser, or another program, sends to the viewer's server.

use super::{Target, Verdict};
use viewfuse::view::protocol::first_request;

pub(crate) struct Requests;

/// Most bytes of a head and a body together.
const MAX_BYTES: usize = 17 * 1024;

fn request(method: &str, target: &str, headers: &str, body: &str) -> Vec<u8> {
    let length = if body.is_empty() { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
    format!("{method} {target} HTTP/1.1\r\nHost: 127.0.0.1:8008\r\n{headers}{length}\r\n{body}").into_bytes()
}

impl Target for Requests {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let body = r#"{"tab":"a","pose":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],"scheme":"mean","layer":"depth","moving":true}"#;
        let frame = request("POST", "/0123456789abcdef/frame", "Content-Type: application/json\r\n", body);
        vec![
            request("GET", "/", "", ""),
            request("GET", "/status", "Connection: close\r\nOrigin: http://127.0.0.1:8008\r\n", ""),
            [frame.clone(), request("GET", "/", "", "")].concat(),
            frame,
        ]
    }

    fn words(&self) -> &'static [&'static str] {
        &[
            "\r\n", "\r\n\r\n", "Content-Length: ", "Transfer-Encoding: chunked\r\n", "Expect: 100-continue\r\n",
            "Connection: ", "HTTP/1.0", "keep-alive", "\"scheme\":", "attention:/etc/passwd",
        ]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let read = first_request(bytes);
        if let Ok(Some(first)) = &read {
            if first.length == 0 || first.length > bytes.len().min(MAX_BYTES) {
                return Err(format!("a request of {} bytes among {}", first.length, bytes.len()));
            }
            // It ends where it ends: what follows it changes nothing, and without its last byte it is not there.
            if first_request(&bytes[..first.length]) != read {
                return Err("what follows a request changes it".to_owned());
            }
            if matches!(first_request(&bytes[..first.length - 1]), Ok(Some(_))) {
                return Err("a request is there before its last byte".to_owned());
            }
        }
        Ok(match read {
            Ok(Some(first)) if first.asks => Verdict::Read,
            Ok(Some(_)) => Verdict::Refused("asks for nothing".to_owned()),
            Ok(None) if bytes.len() > MAX_BYTES + 1024 => return Err("waits for more than it would take".to_owned()),
            Ok(None) => Verdict::Refused("waits".to_owned()),
            Err(status @ 400..=599) => Verdict::Refused(format!("status {}", "x".repeat(usize::from(status % 100)))),
            Err(status) => return Err(format!("an error with the status {status}")),
        })
    }
}
