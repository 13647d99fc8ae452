//! Reading binary files, with the path and the byte offset in every error. All numbers are little endian.

use std::path::Path;

use super::error::SceneError;
use super::fault::{FaultLocation, FileFault, FilePlace};
use super::files::{MAX_FILE, unreadable};
use viewfuse_job::files::read_at_most;

/// A binary file's contents.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    read_at_most(path, MAX_FILE).map_err(|cause| unreadable(path, cause))
}

/// A cursor over bytes. What it reads is `part` of the file, in words, for errors.
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
    pub(super) fn location(&self) -> FaultLocation {
        FaultLocation::Byte(self.at)
    }

    fn error(&self, location: FaultLocation, fault: FileFault) -> SceneError {
        FilePlace { path: self.path.to_path_buf(), location }.fault(fault)
    }

    fn truncated(&self, part: &'static str) -> SceneError {
        self.error(FaultLocation::File, FileFault::Truncated(self.bytes.len(), part))
    }

    /// This many bytes.
    pub(super) fn take(&mut self, count: usize, part: &'static str) -> Result<&'a [u8], SceneError> {
        let taken = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| self.truncated(part))?;
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, part: &'static str) -> Result<[u8; N], SceneError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, part)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self, part: &'static str) -> Result<u8, SceneError> {
        Ok(self.array::<1>(part)?[0])
    }

    pub(super) fn u32(&mut self, part: &'static str) -> Result<u32, SceneError> {
        Ok(u32::from_le_bytes(self.array(part)?))
    }

    pub(super) fn u64(&mut self, part: &'static str) -> Result<u64, SceneError> {
        Ok(u64::from_le_bytes(self.array(part)?))
    }

    /// A finite number.
    pub(super) fn f64(&mut self, part: &'static str) -> Result<f64, SceneError> {
        let location = self.location();
        let value = f64::from_le_bytes(self.array(part)?);
        if value.is_finite() { Ok(value) } else { Err(self.error(location, FileFault::NotFinite(value.to_string()))) }
    }

    /// Finite numbers.
    pub(super) fn f64s<const N: usize>(&mut self, part: &'static str) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(part)?;
        }
        Ok(numbers)
    }

    /// The count of the entries that follow, each of at least this many bytes; an error if the rest of the file is too
    /// short for them.
    pub(super) fn count(&mut self, least_bytes: usize, of: &'static str) -> Result<usize, SceneError> {
        let location = self.location();
        let count = self.u64(of)?;
        let most = (self.bytes.len() - self.at) / least_bytes.max(1);
        match usize::try_from(count) {
            Ok(count) if count <= most => Ok(count),
            _ => Err(self.error(location, FileFault::NoRoom(of, count, most))),
        }
    }

    /// The text up to the next zero byte.
    pub(super) fn text(&mut self, part: &'static str) -> Result<String, SceneError> {
        let location = self.location();
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|byte| *byte == 0).ok_or_else(|| self.truncated(part))?;
        let text = std::str::from_utf8(&rest[..length]).map_err(|_| self.error(location, FileFault::NotText(part)))?;
        self.at += length + 1;
        Ok(text.to_string())
    }

    /// Errors if bytes are left.
    pub(super) fn end(&self) -> Result<(), SceneError> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            left => Err(self.error(self.location(), FileFault::Surplus(left))),
        }
    }
}
