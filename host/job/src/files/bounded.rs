//! Reading files of limited length: a device or a pipe without end must not fill the memory.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes of what has no length: a pipe, a device.
const MAX_OF_A_PIPE: u64 = 64 << 20;

/// The bytes of a file that has at most `most` of them; of a pipe or a device at most 64 MiB.
///
/// # Errors
/// If it cannot be read, or is longer.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    let most = if metadata.is_file() { most } else { most.min(MAX_OF_A_PIPE) };
    let too_long = || io::Error::other(format!("it is longer than {most} bytes"));
    let length = metadata.len();
    if length > most {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    // Known lengths are allocated once.
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long()) } else { Ok(bytes) }
}
