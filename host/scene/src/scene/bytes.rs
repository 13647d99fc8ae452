//! Reading binary files, with the path and the byte offset in every error. All numbers are little endian.

use std::path::{Path, PathBuf};

use super::error::SceneError;
use super::fault::{FaultLocation, FileFault};
use super::files::{LONGEST_FILE, unreadable};
use viewfuse_job::files::read_at_most;

/// A binary file's contents.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    read_at_most(path, LONGEST_FILE).map_err(|cause| unreadable(path, cause))
}

/// A cursor over bytes.
#[derive(Clone, Debug)]
pub(super) struct Bytes<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Bytes<'a> {
        Bytes { path, bytes, at: 0 }
    }

    /// The offset of the next byte in the file.
    pub(super) fn place(&self) -> FaultLocation {
        FaultLocation::Byte(self.at)
    }

    fn damaged(&self, place: FaultLocation, fault: FileFault) -> SceneError {
        SceneError::Damaged { path: self.path(), place, fault }
    }

    fn truncated(&self, of: &'static str) -> SceneError {
        self.damaged(FaultLocation::File, FileFault::Truncated { length: self.bytes.len(), of })
    }

    pub(super) fn path(&self) -> PathBuf {
        self.path.to_path_buf()
    }

    /// This many bytes; `of` names what they are part of.
    pub(super) fn take(&mut self, count: usize, of: &'static str) -> Result<&'a [u8], SceneError> {
        let taken = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| self.truncated(of))?;
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, of: &'static str) -> Result<[u8; N], SceneError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, of)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self, of: &'static str) -> Result<u8, SceneError> {
        Ok(self.array::<1>(of)?[0])
    }

    pub(super) fn u32(&mut self, of: &'static str) -> Result<u32, SceneError> {
        Ok(u32::from_le_bytes(self.array(of)?))
    }

    pub(super) fn u64(&mut self, of: &'static str) -> Result<u64, SceneError> {
        Ok(u64::from_le_bytes(self.array(of)?))
    }

    /// A finite number.
    pub(super) fn f64(&mut self, of: &'static str) -> Result<f64, SceneError> {
        let place = self.place();
        let value = f64::from_le_bytes(self.array(of)?);
        if value.is_finite() {
            return Ok(value);
        }
        Err(SceneError::NotFinite { path: self.path(), place, word: value.to_string() })
    }

    /// Finite numbers.
    pub(super) fn f64s<const N: usize>(&mut self, of: &'static str) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(of)?;
        }
        Ok(numbers)
    }

    /// The count of the entries that follow, each of at least this many bytes; an error if the rest of the file is too
    /// short for them.
    pub(super) fn count(&mut self, least_bytes: usize, of: &'static str) -> Result<usize, SceneError> {
        let place = self.place();
        let count = self.u64(of)?;
        let most = (self.bytes.len() - self.at) / least_bytes.max(1);
        match usize::try_from(count) {
            Ok(count) if count <= most => Ok(count),
            _ => Err(self.damaged(place, FileFault::NoRoom { of, count, most })),
        }
    }

    /// The text up to the next zero byte.
    pub(super) fn text(&mut self, of: &'static str) -> Result<String, SceneError> {
        let place = self.place();
        let rest = &self.bytes[self.at..];
        let Some(length) = rest.iter().position(|byte| *byte == 0) else {
            return Err(self.truncated(of));
        };
        let text = std::str::from_utf8(&rest[..length])
            .map_err(|_| self.damaged(place, FileFault::NotText { of }))?
            .to_string();
        self.at += length + 1;
        Ok(text)
    }

    /// Errors if bytes are left.
    pub(super) fn end(&self) -> Result<(), SceneError> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            left => Err(self.damaged(self.place(), FileFault::LeftOver { left })),
        }
    }
}
