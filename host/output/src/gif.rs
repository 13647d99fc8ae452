//! Animated GIF, for pages and messages that take no WebP: 256 colours a frame, chosen for it, without transparency.

use crate::rate::FrameRate;
pub(crate) use gif::EncodingError;
pub(crate) use gif::Frame;
use gif::{Encoder, Repeat};
use image::RgbImage;
use std::io::{self, Write};

/// How carefully colours are chosen, from 1 (best) to 30 (fastest).
const SPEED: i32 = 10;
/// The shortest time that players keep, in hundredths of a second: they show a shorter one as ten.
const MIN_DELAY: u64 = 2;

/// An animation that is written frame by frame, and repeats without end.
pub(crate) struct Gif<W: Write> {
    encoder: Encoder<W>,
    rate: FrameRate,
    /// Frames so far.
    count: u64,
    /// Hundredths of a second that are written.
    written: u64,
}

impl<W: Write> Gif<W> {
    /// Writes the header.
    pub(crate) fn begin(writer: W, size: [u32; 2], rate: FrameRate) -> Result<Gif<W>, EncodingError> {
        let mut encoder = Encoder::new(writer, side(size[0])?, side(size[1])?, &[])?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Gif { encoder, rate, count: 0, written: 0 })
    }

    /// Writes a frame of the animation's size. Of more than 50 a second some are left out, so that the pace is kept.
    pub(crate) fn add(&mut self, mut frame: Frame<'static>) -> Result<(), EncodingError> {
        self.count += 1;
        // Rounding the times, not the durations, keeps the pace.
        let end = (100.0 * self.count as f64 / self.rate.per_second()).round() as u64;
        let delay = end.saturating_sub(self.written);
        if delay < MIN_DELAY && self.count > 1 {
            return Ok(());
        }
        let delay = delay.clamp(MIN_DELAY, u64::from(u16::MAX));
        self.written += delay;
        frame.delay = delay as u16;
        self.encoder.write_frame(&frame)
    }

    /// Writes the end, and returns the writer.
    pub(crate) fn finish(self) -> Result<W, EncodingError> {
        self.encoder.into_inner()
    }
}

/// A picture in 256 colours, which are chosen for it.
pub(crate) fn frame(picture: &RgbImage) -> Result<Frame<'static>, EncodingError> {
    Ok(Frame::from_rgb_speed(side(picture.width())?, side(picture.height())?, picture.as_raw(), SPEED))
}

/// A side as the format says it.
fn side(pixels: u32) -> Result<u16, EncodingError> {
    let long =
        |_| io::Error::new(io::ErrorKind::InvalidInput, format!("{pixels} pixels are too many for a side of a GIF"));
    Ok(pixels.try_into().map_err(long)?)
}
