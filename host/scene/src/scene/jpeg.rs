//! Whether a JPEG file is whole.

use image::{DynamicImage, GrayImage, RgbImage};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The pixels of a JPEG file.
pub(super) enum Strictly {
    /// All of them.
    Whole(DynamicImage),
    /// From somewhere on its data are no picture, says the decoder.
    Damaged(String),
    /// It is another file, or not in YCbCr or grey.
    Other,
}

/// The pixels of a JPEG file by the decoder that `image` has, which says here where it would make up the rest.
///
/// It takes the mark of the end for the end of the picture, and what is missing before it for zeros. Without that mark
/// it tells that there are too few bytes, at the next row of blocks; a few bytes that it has read ahead must not be the
/// whole last row, so that only wide pictures are looked at so.
pub(super) fn strictly(path: &Path) -> io::Result<Strictly> {
    let mut start = [0; 2];
    let is_jpeg = File::open(path)?.read_exact(&mut start).is_ok() && start == [0xff, 0xd8];
    if !is_jpeg {
        return Ok(Strictly::Other);
    }
    let bytes = fs::read(path)?;
    if let Some(end) = end_of_baseline(&bytes) {
        match decoded(&bytes[..end]) {
            // Of a file that lacks its end it may say other things.
            Strictly::Damaged(reason) if !TOO_FEW.iter().any(|words| reason.contains(words)) => {}
            told => return Ok(told),
        }
    }
    Ok(decoded(&bytes))
}

/// What the decoder says where data end before the picture does.
const TOO_FEW: [&str; 2] = ["Premature end of buffer", "Exhausted data"];
/// Width from which on a row of blocks has more bytes than are read ahead.
const MIN_WIDTH: u16 = 256;

fn decoded(bytes: &[u8]) -> Strictly {
    // An odd header is no damage.
    let options = DecoderOptions::default().set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options.set_strict_mode(false));
    let colours = match decoder.decode_headers().ok().and_then(|()| decoder.input_colorspace()) {
        Some(ColorSpace::YCbCr) => ColorSpace::RGB,
        Some(ColorSpace::Luma) => ColorSpace::Luma,
        _ => return Strictly::Other,
    };
    decoder.set_options(decoder.options().set_strict_mode(true).jpeg_set_out_colorspace(colours));
    let Some((width, height)) = decoder.dimensions() else { return Strictly::Other };
    let (width, height) = (width as u32, height as u32);
    match decoder.decode() {
        Err(error) => Strictly::Damaged(error.to_string()),
        Ok(pixels) => {
            let picture = match colours {
                ColorSpace::Luma => GrayImage::from_raw(width, height, pixels).map(DynamicImage::from),
                _ => RgbImage::from_raw(width, height, pixels).map(DynamicImage::from),
            };
            picture.map_or(Strictly::Other, Strictly::Whole)
        }
    }
}

/// Where the mark of the end stands behind a scan of all components, in a wide picture that is not progressive.
fn end_of_baseline(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    let mut components = None;
    loop {
        match *bytes.get(at..at + 4)? {
            [0xff, 0xff, ..] => at += 1,
            [0xff, 0xda, ..] if components == Some(*bytes.get(at + 4)?) => {
                let end = bytes[at..].windows(2).position(|pair| pair == [0xff, 0xd9])?;
                return Some(at + end);
            }
            [0xff, 0xda, ..] => return None,
            [0xff, kind, high, low] => {
                if matches!(kind, 0xc0 | 0xc1) {
                    let width = u16::from_be_bytes([*bytes.get(at + 7)?, *bytes.get(at + 8)?]);
                    components = (width >= MIN_WIDTH).then_some(*bytes.get(at + 9)?);
                }
                at += 2 + usize::from(u16::from_be_bytes([high, low]));
            }
            _ => return None,
        }
    }
}

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
