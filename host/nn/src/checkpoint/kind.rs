//! The kind of a file, by its first bytes, independent of its name.

use super::error::Problem;
use super::legacy;
use std::fs::File;
use std::io::{Read, Seek};

/// The kinds of checkpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Safetensors.
    Safetensors,
    /// The zip archive of `torch.save` since PyTorch 1.6.
    TorchZip,
    /// The format of `torch.save` before PyTorch 1.6.
    TorchLegacy,
    /// A network that Python's own `pickle` wrote, as an object.
    Snapshot,
}

/// The length of a tar archive's header.
const LOOK: u64 = 512;
/// Where PyTorch's old magic number ends in a file.
const MAGIC_WITHIN: usize = 32;
/// The position and text of a tar header's magic number.
const TAR: (usize, &[u8]) = (257, b"ustar");

impl Kind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Safetensors => "safetensors",
            Kind::TorchZip => "PyTorch, zip",
            Kind::TorchLegacy => "PyTorch, before 1.6",
            Kind::Snapshot => "pickled network",
        }
    }

    /// Recognises a file.
    pub(super) fn of(mut file: &File) -> Result<Kind, Problem> {
        let mut start = Vec::new();
        file.rewind()?;
        file.take(LOOK).read_to_end(&mut start)?;
        if start.starts_with(b"PK\x03\x04") || start.starts_with(b"PK\x05\x06") {
            return Ok(Kind::TorchZip);
        }
        // The length of a header can begin like a pickle: the brace behind it decides.
        if start.get(8) == Some(&b'{') {
            return Ok(Kind::Safetensors);
        }
        if start.first() == Some(&0x80) {
            // Whatever the pickle's protocol, the magic number is among its first opcodes.
            let first = &start[..start.len().min(MAGIC_WITHIN)];
            let is_legacy = first.windows(legacy::MAGIC.len()).any(|bytes| bytes == legacy::MAGIC);
            return Ok(if is_legacy { Kind::TorchLegacy } else { Kind::Snapshot });
        }
        Err(Problem::NoCheckpoint(match () {
            () if start.is_empty() => "the file is empty; was the download complete?".to_owned(),
            () if start.starts_with(b"version https://git-lfs") => {
                "a pointer of git-lfs to the file; fetch the file itself with `git lfs pull`".to_owned()
            }
            () if looks_like_a_page(&start) => {
                "a web page; open the address in a browser and download the file by hand".to_owned()
            }
            () if start.get(TAR.0..).is_some_and(|rest| rest.starts_with(TAR.1)) => {
                "a tar archive: unpack it, or, if PyTorch before 0.1.10 wrote it, load it in PyTorch and save it again"
                    .to_owned()
            }
            () if start.iter().all(|&byte| byte >= b' ' || byte.is_ascii_whitespace()) => "a text".to_owned(),
            () => format!(
                "neither safetensors nor a file of torch.save; it begins with the bytes {}",
                start.iter().take(8).map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
            ),
        }))
    }
}

fn looks_like_a_page(start: &[u8]) -> bool {
    let text = start.trim_ascii_start();
    ["<!doctype", "<html", "<?xml"]
        .iter()
        .any(|tag| text.get(..tag.len()).is_some_and(|beginning| beginning.eq_ignore_ascii_case(tag.as_bytes())))
}
