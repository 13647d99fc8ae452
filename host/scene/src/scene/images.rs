//! Image files: their headers when a scene is opened, their pixels when a view is needed.
//!
//! The orientation tag (EXIF), which states how the pixels must be turned to be upright, is read with the header. The
//! size of the cameras' images decides whether the poses are those of the stored or of the upright picture
//! ([`super::check`]); if it is ambiguous, the photograph is refused.

use std::fs::File;
use std::io::{BufRead, Cursor, Read, Seek};
use std::path::Path;

use image::buffer::ConvertBuffer;
use image::codecs::png::PngEncoder;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, ImageResult, Limits};
use viewfuse_job::panics::caught;

use super::error::SceneError;
use super::fault::{FilePlace, ImageFault};
use super::files::unreadable;
use super::jpeg::{self, Strictly, cut_short};
use super::{MAX_SIDE, Photograph};

/// Most bytes of a decoded pixel: four channels of 16 bits.
const MAX_PIXEL: u64 = 8;

/// Bytes of a pixel as it is kept.
const RGBA_BYTES: u64 = 4;

/// Decoded pixels of more bytes than this must have a file of fitting length.
const SMALL_IMAGE: u64 = 32 << 20;

/// Most decoded bytes for each byte of a file: twice what a plane of one colour takes in the format that packs it best
/// but one (PNG: 1032). A header of a few bytes must not take memory for pixels that cannot be in the file.
const MAX_RATIO: u64 = 2064;

/// Memory of a decoder in addition to the pixels: its rows, tables, colour profiles. The profile of a PNG is
/// compressed: a file of one megabyte may hold one of a gigabyte, which is then ignored.
const DECODER_ALLOWANCE: u64 = 16 << 20;

/// Most memory for the pixels of a photograph while it is decoded: as they are stored, and as 8-bit RGBA. 150
/// megapixels of 8-bit RGB fit.
const MAX_DECODING: u64 = 1 << 30;

/// Most bytes of an image file, twice what its pixels take apart: thumbnails, colour profiles, the moment's video that
/// some phones put behind the picture.
const FILE_ALLOWANCE: u64 = 256 << 20;

/// Bytes of a JPEG file that are read first for its header: the tags with their thumbnail, colour profiles. The decoder
/// would read the whole file.
const JPEG_HEADER: u64 = 256 << 10;

/// What decoders read from: one type for files and bytes in memory, because the decoders of every format are compiled
/// again for each type that they read from. Nothing outside this module decodes or encodes pictures of several formats.
trait Source: BufRead + Seek {}

impl<T: BufRead + Seek> Source for T {}

/// The properties in an image file's header.
pub(super) struct Header {
    /// Width and height as stored.
    pub(super) size: [u32; 2],
    /// How the pixels must be turned to be upright.
    pub(super) orientation: Orientation,
    /// Whether its pixels have an alpha channel.
    pub(super) has_alpha: bool,
    /// Bytes of the decoded pixels.
    bytes: u64,
}

/// Size and orientation; nothing of the size that the header states is allocated.
///
/// # Errors
/// [`ImageFault::TooLarge`] if a side has more than [`MAX_SIDE`] pixels, [`ImageFault::TooMuch`] if all pixels together
/// take too much memory, [`ImageFault::TooLong`] if the file is longer than such an image; otherwise as for any
/// unreadable image.
pub(super) fn header(path: &Path) -> Result<Header, SceneError> {
    let length = path.metadata().map_err(|cause| unreadable(path, cause))?.len();
    // Decoders of some formats read all of it, before they know a size.
    not_longer(path, length, 2 * MAX_DECODING, String::new)?;
    let found = match beginning_of_jpeg(path)? {
        Some(found) => found,
        None => described(path, open(path)?)?,
    };
    let [width, height] = found.size;
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(FilePlace::file(path).fault(ImageFault::TooLarge(width, height)));
    }
    let bytes = found.bytes + RGBA_BYTES * u64::from(width) * u64::from(height);
    if bytes > MAX_DECODING {
        return Err(FilePlace::file(path).fault(ImageFault::TooMuch(found.size, bytes, MAX_DECODING)));
    }
    not_longer(path, length, 2 * bytes + FILE_ALLOWANCE, || format!(" of {width} x {height}"))?;
    Ok(found)
}

fn not_longer(path: &Path, length: u64, most: u64, of_size: impl Fn() -> String) -> Result<(), SceneError> {
    let too_long = || FilePlace::file(path).fault(ImageFault::TooLong(length, of_size(), most));
    if length > most { Err(too_long()) } else { Ok(()) }
}

/// The header in the first bytes of a JPEG file; `None` for other files, and if more bytes are needed.
fn beginning_of_jpeg(path: &Path) -> Result<Option<Header>, SceneError> {
    let failed = |cause| unreadable(path, cause);
    let mut first = Vec::new();
    let mut file = File::open(path).map_err(failed)?.take(JPEG_HEADER);
    file.by_ref().take(2).read_to_end(&mut first).map_err(failed)?;
    if first != [0xff, 0xd8] {
        return Ok(None);
    }
    file.read_to_end(&mut first).map_err(failed)?;
    let source: Box<dyn Source> = Box::new(Cursor::new(first));
    Ok(described(path, ImageReader::with_format(source, ImageFormat::Jpeg)).ok())
}

/// What a decoder may allocate before the first pixel.
fn limits_of_header() -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(DECODER_ALLOWANCE);
    limits
}

fn described(path: &Path, reader: ImageReader<Box<dyn Source>>) -> Result<Header, SceneError> {
    decoding(path, || {
        let mut reader = reader;
        reader.limits(limits_of_header());
        let mut decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        // An unreadable tag is ignored.
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        let has_alpha = decoder.color_type().has_alpha();
        Ok(Header { size: [width, height], orientation, has_alpha, bytes: decoder.total_bytes() })
    })
}

/// How a photograph's pixels in memory were made from the stored ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    /// Width and height as stored.
    pub(super) stored: [u32; 2],
    /// How the stored pixels must be turned to be upright.
    pub(super) orientation: Orientation,
    /// Whether they were: the cameras are those of the upright picture.
    pub(super) is_applied: bool,
}

impl Turn {
    /// Of a photograph whose cameras are for pictures of this width and height.
    pub(super) fn of(header: &Header, size: [u32; 2]) -> Turn {
        let Header { size: stored, orientation, .. } = *header;
        Turn { stored, orientation, is_applied: stored != size && turned(stored, orientation) == size }
    }

    /// Width and height of the upright picture.
    pub(super) fn upright(&self) -> [u32; 2] {
        turned(self.stored, self.orientation)
    }

    /// Width and height of the pixels in memory.
    pub(super) fn size(&self) -> [u32; 2] {
        if self.is_applied { self.upright() } else { self.stored }
    }
}

/// The pixels of a photograph as straight 8-bit RGBA, of this width and height: turned upright if only that has this
/// size.
///
/// # Errors
/// [`ImageFault::SizeMismatch`] if the file has another size.
pub(super) fn decode(path: &Path, size: [u32; 2]) -> Result<(Photograph, Turn), SceneError> {
    let (mut decoded, orientation) = pixels(path)?;
    let bytes = decoded.as_bytes().len() as u64;
    let turn = Turn::of(
        &Header {
            size: [decoded.width(), decoded.height()],
            orientation,
            has_alpha: decoded.color().has_alpha(),
            bytes,
        },
        size,
    );
    if turn.is_applied {
        decoded.apply_orientation(orientation);
    }
    let found = [decoded.width(), decoded.height()];
    if found != size {
        let declared_in = "the scene as it was opened".to_string();
        return Err(FilePlace::file(path).fault(ImageFault::SizeMismatch { size: found, declared: size, declared_in }));
    }
    let has_channel = decoded.color().has_alpha();
    let pixels = match decoded {
        // Pixel by pixel; `into_rgba8` goes through the conversion of colour spaces, which takes ten times as long.
        DynamicImage::ImageRgb8(opaque) => opaque.convert(),
        other => other.into_rgba8(),
    };
    // SRN's photographs have an alpha channel that is 255 everywhere: it is ignored.
    let has_alpha = has_channel && pixels.pixels().any(|pixel| pixel[3] < u8::MAX);
    Ok((Photograph { pixels, has_alpha, seen: None }, turn))
}

/// The orientation that undoes this one.
pub(super) fn inverse(orientation: Orientation) -> Orientation {
    match orientation {
        Orientation::Rotate90 => Orientation::Rotate270,
        Orientation::Rotate270 => Orientation::Rotate90,
        // Flips and the turn by 180 degrees undo themselves.
        itself => itself,
    }
}

/// The size of an image when it is upright.
pub(super) fn turned(size: [u32; 2], orientation: Orientation) -> [u32; 2] {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    match orientation {
        Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => [size[1], size[0]],
        _ => size,
    }
}

/// All pixels of an image file, as stored.
///
/// The header is checked first, and the decoder may allocate no more than an image of that size needs.
pub(super) fn pixels(path: &Path) -> Result<(DynamicImage, Orientation), SceneError> {
    let Header { size: [width, height], orientation, bytes, .. } = header(path)?;
    let length = path.metadata().map_err(|cause| unreadable(path, cause))?.len();
    if bytes > SMALL_IMAGE && bytes / MAX_RATIO > length {
        return Err(FilePlace::file(path).fault(ImageFault::Hollow([width, height], length)));
    }
    if cut_short(path).map_err(|cause| unreadable(path, cause))? {
        return Err(FilePlace::file(path).fault(ImageFault::CutShort));
    }
    // Of what it refuses or panics on, the usual decoder says why.
    let strictly = caught(|| jpeg::strictly(path)).unwrap_or(Ok(Strictly::Other));
    let damage = match strictly.map_err(|cause| unreadable(path, cause))? {
        Strictly::Whole(picture) => return Ok((picture, orientation)),
        Strictly::Damaged(reason) => Some(reason),
        Strictly::Other => None,
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(width);
    limits.max_image_height = Some(height);
    limits.max_alloc = Some(u64::from(width) * u64::from(height) * MAX_PIXEL + DECODER_ALLOWANCE);
    let mut reader = open(path)?;
    reader.limits(limits_of_header());
    let decode = || {
        // A colour profile was unpacked within the limits of a header; those of the pixels come after it.
        let mut decoder = reader.into_decoder()?;
        decoder.set_limits(limits)?;
        DynamicImage::from_decoder(decoder)
    };
    let picture = decoding(path, decode)?;
    match damage {
        Some(reason) => Err(FilePlace::file(path).fault(ImageFault::Damaged(reason))),
        None => Ok((picture, orientation)),
    }
}

/// What a decoder makes of a file; it may fail or panic.
fn decoding<T>(path: &Path, decode: impl FnOnce() -> image::ImageResult<T>) -> Result<T, SceneError> {
    let fault = match caught(decode) {
        Ok(Ok(decoded)) => return Ok(decoded),
        Ok(Err(cause)) => match kind_of(path) {
            Some("") => ImageFault::Empty,
            Some(kind) => ImageFault::Kind(kind),
            None => ImageFault::Unreadable(Box::new(cause)),
        },
        Err(panic) => ImageFault::Decoder(panic),
    };
    Err(FilePlace::file(path).fault(fault))
}

/// What a file that is not read is, by its first bytes; nothing of an empty file.
fn kind_of(path: &Path) -> Option<&'static str> {
    let mut first = Vec::new();
    File::open(path).ok()?.take(12).read_to_end(&mut first).ok()?;
    Some(match &first[..] {
        [] => "",
        [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..] => match brand {
            b"avif" | b"avis" => "a picture of the format AVIF",
            [b'h', b'e', ..] | b"mif1" | b"msf1" => "a picture of the format HEIC",
            _ => "a video",
        },
        [b'B', b'M', ..] => "a picture of the format BMP",
        [b'G', b'I', b'F', b'8', ..] => "a picture of the format GIF",
        _ => return None,
    })
}

/// The pixels of any picture, upright as its orientation tag (EXIF) says: PNG, JPEG, WebP or TIFF of at most
/// [`MAX_SIDE`] pixels on a side. Every picture that no camera belongs to is read here.
///
/// # Errors
/// [`SceneError`] if it cannot be read or decoded, or is too large.
pub fn read_picture(path: &Path) -> Result<DynamicImage, SceneError> {
    let (mut picture, orientation) = pixels(path)?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

/// Width and height of any upright picture, from its header.
///
/// # Errors
/// As [`read_picture`].
pub fn picture_size(path: &Path) -> Result<[u32; 2], SceneError> {
    let Header { size, orientation, .. } = header(path)?;
    Ok(turned(size, orientation))
}

/// A picture as a PNG file.
///
/// # Errors
/// The encoder's.
pub fn encode_png(picture: &DynamicImage) -> ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut bytes))?;
    Ok(bytes)
}

/// A reader for the format of the content, independent of the file's extension.
fn open(path: &Path) -> Result<ImageReader<Box<dyn Source>>, SceneError> {
    let found = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    let found = found.map_err(|cause| unreadable(path, cause))?;
    let format = found.format();
    let mut reader = ImageReader::new(Box::new(found.into_inner()) as Box<dyn Source>);
    if let Some(format) = format {
        reader.set_format(format);
    }
    Ok(reader)
}
