//! Targets that fall on certain inputs, to see that it is noticed.

use super::{Target, Verdict, verdict};
use std::path::Path;

/// The way in which it falls.
pub(crate) struct Fall(pub(crate) &'static str);

impl Target for Fall {
    fn seeds(&self) -> Vec<Vec<u8>> {
        vec![b"fal".to_vec(), b"stands".to_vec()]
    }

    fn words(&self) -> &'static [&'static str] {
        &["fall", "l"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        if !bytes.starts_with(b"fall") {
            return Ok(if bytes.len().is_multiple_of(2) { Verdict::Read } else { Verdict::Refused("odd".to_owned()) });
        }
        match self.0 {
            "panics" => panic!("a panic of fuzzing"),
            "hangs" => loop {
                std::thread::sleep(std::time::Duration::from_millis(10));
            },
            "aborts" => std::process::abort(),
            "devours" => {
                let much = vec![1_u8; 300 << 20];
                Ok(if much[bytes.len()] == 1 { Verdict::Read } else { Verdict::Refused(String::new()) })
            }
            _ => verdict(Err::<(), _>("nothing is named"), Path::new("/file")),
        }
    }
}
