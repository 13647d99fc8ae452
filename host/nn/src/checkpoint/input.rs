//! A range of a file, read from its start: memory is allocated for at most as many bytes as it has.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

/// A range of a file and the position in it.
#[derive(Debug)]
pub struct Input<'a> {
    reader: BufReader<&'a File>,
    at: u64,
    end: u64,
}

impl<'a> Input<'a> {
    /// The bytes from offset `start` up to `end`. While it exists, nothing else may read from the same file.
    ///
    /// # Errors
    /// If the system cannot seek to `start`.
    pub fn new(file: &'a File, start: u64, end: u64) -> io::Result<Input<'a>> {
        let mut reader = BufReader::new(file);
        reader.seek(SeekFrom::Start(start))?;
        Ok(Input { reader, at: start, end })
    }

    /// Offset in the file of the next byte.
    pub fn position(&self) -> u64 {
        self.at
    }

    /// Checks that this many bytes follow.
    ///
    /// # Errors
    /// [`io::ErrorKind::UnexpectedEof`] if they do not.
    pub fn check(&self, length: u64) -> io::Result<()> {
        if length > self.end - self.at { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
    }

    /// The next byte.
    ///
    /// # Errors
    /// If there is none, or if the system reports an error.
    pub fn byte(&mut self) -> io::Result<u8> {
        let [byte] = self.array()?;
        Ok(byte)
    }

    /// The next `N` bytes.
    ///
    /// # Errors
    /// As [`Input::byte`].
    pub fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Fills `bytes` with the next bytes.
    ///
    /// # Errors
    /// As [`Input::byte`].
    pub fn exact(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        self.check(bytes.len() as u64)?;
        self.reader.read_exact(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// An unsigned number of 1, 4 or 8 bytes.
    ///
    /// # Errors
    /// As [`Input::byte`].
    pub fn length(&mut self, width: usize) -> io::Result<u64> {
        let mut bytes = [0; 8];
        self.exact(&mut bytes[..width.min(8)])?;
        Ok(u64::from_le_bytes(bytes))
    }

    /// The next `length` bytes.
    ///
    /// # Errors
    /// As [`Input::byte`].
    pub fn take(&mut self, length: u64) -> io::Result<Vec<u8>> {
        self.check(length)?;
        let mut bytes = vec![0; length as usize];
        self.exact(&mut bytes)?;
        Ok(bytes)
    }

    /// Skips the next `length` bytes.
    ///
    /// # Errors
    /// As [`Input::byte`].
    pub fn skip(&mut self, length: u64) -> io::Result<()> {
        self.check(length)?;
        self.reader.seek_relative(length as i64)?;
        self.at += length;
        Ok(())
    }
}
