//! Whether a JPEG file is whole.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::path::Path;

/// Whether a JPEG file ends before its picture does: decoders fill the rest with grey. Other formats' decoders say so.
pub(super) fn cut_short(path: &Path) -> io::Result<bool> {
    let mut reader = BufReader::new(File::open(path)?);
    let mut start = [0; 2];
    match reader.read_exact(&mut start) {
        Ok(()) if start == [0xff, 0xd8] => Ok(!has_end(reader)?),
        Ok(()) => Ok(false),
        Err(error) => if_ended(error, false),
    }
}

/// Whether the marker of the end stands behind that of the first scan, in what follows the first two bytes. Pictures
/// within segments (thumbnails) do not count.
fn has_end(mut reader: impl BufRead + Seek) -> io::Result<bool> {
    loop {
        let mut marker = [0; 4];
        if let Err(error) = reader.read_exact(&mut marker) {
            return if_ended(error, false);
        }
        match marker {
            [0xff, 0xda, ..] => return has_pair(reader, [0xff, 0xd9]),
            // A fill byte before the marker.
            [0xff, 0xff, ..] => reader.seek_relative(-3)?,
            [0xff, _, high, low] => reader.seek_relative(i64::from(u16::from_be_bytes([high, low])) - 2)?,
            _ => return Ok(false),
        }
    }
}

fn has_pair(mut reader: impl BufRead, pair: [u8; 2]) -> io::Result<bool> {
    let mut last = None;
    loop {
        let part = reader.fill_buf()?;
        let (Some(first), length) = (part.first(), part.len()) else { return Ok(false) };
        if last == Some(pair[0]) && *first == pair[1] || part.windows(2).any(|found| found == pair) {
            return Ok(true);
        }
        last = part.last().copied();
        reader.consume(length);
    }
}

/// The answer where a file ends.
fn if_ended(error: io::Error, answer: bool) -> io::Result<bool> {
    if error.kind() == ErrorKind::UnexpectedEof { Ok(answer) } else { Err(error) }
}
