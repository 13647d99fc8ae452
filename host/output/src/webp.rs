//! Animated WebP: frames that `image` encodes without loss, in the container of the format's specification. The result
//! is the same to the bit for the same frames.
//!
//! ```text
//! RIFF size WEBP
//!   VP8X  flags, width, height of the canvas
//!   ANIM  background, number of repetitions
//!   ANMF  place, size and duration of a frame, with its VP8L chunk inside; one a frame
//! ```

use crate::rate::FrameRate;
use image::codecs::webp::WebPEncoder;
use image::error::EncodingError;
use image::{DynamicImage, ImageError, ImageFormat};

/// Flags of a canvas with frames, and with transparency.
const ANIMATED: u8 = 0b0000_0010;
const TRANSPARENT: u8 = 0b0001_0000;
/// Flag of a frame that replaces what was there, instead of being blended with it.
const REPLACES: u8 = 0b0000_0010;
/// Bytes before the first chunk of a file: `RIFF`, size, `WEBP`.
const RIFF: usize = 12;
/// Bytes of the chunk of the canvas and of that of the animation, behind their names and sizes.
const CANVAS: usize = 10;
const ANIMATION: usize = 6;
/// The largest size that a file may state, which does not count the first 8 bytes.
const MAX_STATED: u64 = (1 << 32) - 10;

/// A frame without loss, not yet in an animation.
pub struct EncodedFrame {
    /// The chunks of a file of this picture alone.
    chunks: Vec<u8>,
    is_transparent: bool,
}

/// Encodes a frame.
///
/// # Errors
/// The encoder's error.
pub fn encoded(frame: &DynamicImage) -> Result<EncodedFrame, ImageError> {
    let mut file = Vec::new();
    frame.write_with_encoder(WebPEncoder::new_lossless(&mut file))?;
    Ok(EncodedFrame {
        chunks: file.get(RIFF..).unwrap_or_default().to_vec(),
        is_transparent: frame.color().has_alpha(),
    })
}

/// The size that a file with so many bytes of frames states.
///
/// # Errors
/// If the format has no such size: that of a file is less than 4 GiB.
pub fn stated_size(frame_bytes: u64) -> Result<u32, ImageError> {
    let size = frame_bytes.saturating_add((4 + 8 + CANVAS + 8 + ANIMATION) as u64);
    u32::try_from(size).ok().filter(|_| size <= MAX_STATED).ok_or_else(|| {
        let problem = "its frames take 4 GiB or more, and a WebP file holds less";
        ImageError::Encoding(EncodingError::new(ImageFormat::WebP.into(), problem))
    })
}

/// An animation that grows frame by frame; its frames stay in memory as they are encoded, less than 4 GiB.
pub struct Animation {
    size: [u32; 2],
    rate: FrameRate,
    frames: Vec<u8>,
    count: u64,
    is_transparent: bool,
}

impl Animation {
    /// Without frames, of this width and height (from 1 to 16,384).
    pub fn new(size: [u32; 2], rate: FrameRate) -> Animation {
        Animation { size, rate, frames: Vec::new(), count: 0, is_transparent: false }
    }

    /// Appends a frame of the animation's size.
    ///
    /// # Errors
    /// That of [`stated_size`], if the file would be too long with it.
    pub fn add(&mut self, frame: &EncodedFrame) -> Result<(), ImageError> {
        let picture = &frame.chunks;
        stated_size(self.frames.len() as u64 + 8 + 16 + picture.len() as u64)?;
        self.is_transparent |= frame.is_transparent;
        // Durations are whole milliseconds: rounding the times, not the durations, keeps the pace.
        let time = |index: u64| (1000.0 * index as f64 / self.rate.per_second()).round() as u64;
        let duration = time(self.count + 1) - time(self.count);
        self.frames.extend(b"ANMF");
        self.frames.extend((16 + picture.len() as u32).to_le_bytes());
        let [width, height] = self.size;
        for value in [0, 0, width - 1, height - 1, duration.min(0xff_ffff) as u32] {
            self.frames.extend(&value.to_le_bytes()[..3]);
        }
        self.frames.push(REPLACES);
        self.frames.extend(picture);
        self.count += 1;
        Ok(())
    }

    /// The file, which repeats without end.
    ///
    /// # Errors
    /// That of [`stated_size`].
    pub fn finish(self) -> Result<Vec<u8>, ImageError> {
        let Animation { size: [width, height], frames, is_transparent, .. } = self;
        let mut canvas = [0; CANVAS];
        canvas[0] = ANIMATED | if is_transparent { TRANSPARENT } else { 0 };
        for (place, side) in canvas[4..].chunks_exact_mut(3).zip([width - 1, height - 1]) {
            place.copy_from_slice(&side.to_le_bytes()[..3]);
        }
        // Background: transparent; 0 repetitions stand for no end.
        let repetition = [0; ANIMATION];
        let mut file = b"RIFF".to_vec();
        file.extend(stated_size(frames.len() as u64)?.to_le_bytes());
        file.extend(b"WEBP");
        for (name, content) in [(b"VP8X", &canvas[..]), (b"ANIM", &repetition[..])] {
            file.extend(name);
            file.extend((content.len() as u32).to_le_bytes());
            file.extend(content);
        }
        file.extend(frames);
        Ok(file)
    }
}
