//! SHA-256 of a run's inputs, as hexadecimal digits.

use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// The digest of a file's bytes.
///
/// # Errors
/// If it cannot be read.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    sha256_of_part(path, 0, u64::MAX)
}

/// The digest of at most `length` of a file's bytes, from byte `start` on.
///
/// # Errors
/// If it cannot be read.
pub fn sha256_of_part(path: &Path, start: u64, length: u64) -> io::Result<String> {
    let mut digest = Sha256::new();
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(start))?;
    let mut file = file.take(length);
    let mut piece = vec![0; 1 << 20];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(hexadecimal(&digest.finalize())),
            length => digest.update(&piece[..length]),
        }
    }
}

/// The digest of some bytes.
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// Length of the seal before bytes that are kept.
pub const SEAL: usize = 64;

/// Bytes as they are kept in a file of this name: before them stands the digest of the name, of their number and of
/// themselves.
pub fn sealed(name: &str, bytes: &[u8]) -> Vec<u8> {
    [seal(name, bytes).as_bytes(), bytes].concat()
}

/// The bytes that [`sealed`] was given with this name; `None` if these are not what it made of them, or were kept under
/// another name.
pub fn unsealed<'a>(name: &str, kept: &'a [u8]) -> Option<&'a [u8]> {
    let (stated, bytes) = kept.split_at_checked(SEAL)?;
    (seal(name, bytes).as_bytes() == stated).then_some(bytes)
}

fn seal(name: &str, bytes: &[u8]) -> String {
    let mut digest = Sha256::new();
    for part in [name.as_bytes(), bytes] {
        digest.update((part.len() as u64).to_le_bytes());
        digest.update(part);
    }
    hexadecimal(&digest.finalize())
}

/// Two digits a byte.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::{SEAL, sealed, unsealed};

    #[test]
    fn a_seal_covers_name_and_bytes() {
        let kept = sealed("a", b"bc");
        assert_eq!(
            (unsealed("a", &kept), unsealed("a", &sealed("a", b""))),
            (Some(b"bc".as_slice()), Some([].as_slice()))
        );
        assert_eq!((unsealed("b", &kept), unsealed("ab", &[&kept[..SEAL], b"c"].concat())), (None, None));
        for at in 0..kept.len() {
            let mut changed = kept.clone();
            changed[at] ^= 1;
            assert_eq!((unsealed("a", &changed), unsealed("a", &kept[..at])), (None, None), "byte {at}");
        }
    }
}
