//! YUV4MPEG2 (`.y4m`): video without compression, which nearly every video program reads.
//!
//! A header line, then each frame as `FRAME` and its planes Y, Cb, Cr at full resolution (`C444`), 8 bits, BT.601 with
//! the limited range 16 to 235, which readers assume where nothing is said. Whole-number arithmetic: the same bytes on
//! every machine.

use crate::rate::FrameRate;
use image::RgbImage;
use std::io::{self, Write};

/// A video that is written frame by frame.
pub struct Y4m<W: Write> {
    writer: W,
    planes: [Vec<u8>; 3],
}

impl<W: Write> Y4m<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn begin(mut writer: W, [width, height]: [u32; 2], rate: FrameRate) -> io::Result<Y4m<W>> {
        let [numerator, denominator] = rate.ratio();
        writeln!(writer, "YUV4MPEG2 W{width} H{height} F{numerator}:{denominator} Ip A1:1 C444")?;
        Ok(Y4m { writer, planes: Default::default() })
    }

    /// Writes a frame, of the size in the header.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn frame(&mut self, picture: &RgbImage) -> io::Result<()> {
        self.planes.iter_mut().for_each(Vec::clear);
        for pixel in picture.pixels() {
            for (plane, value) in self.planes.iter_mut().zip(bt601(pixel.0)) {
                plane.push(value);
            }
        }
        self.writer.write_all(b"FRAME\n")?;
        self.planes.iter().try_for_each(|plane| self.writer.write_all(plane))
    }

    /// Flushes what is buffered and returns the writer.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn finish(mut self) -> io::Result<W> {
        self.writer.flush()?;
        Ok(self.writer)
    }
}

/// Luma and two differences of colour, from 16 to 240.
fn bt601([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(i32::from);
    // The matrix times 2^16 (luma: 65.481, 128.553, 24.966; differences: 112 / 255 and so on), rounded to nearest.
    let sum = |weights: [i32; 3], offset: i32| {
        ((weights[0] * r + weights[1] * g + weights[2] * b + (1 << 15)) >> 16) + offset
    };
    let luma = sum([16829, 33039, 6416], 16);
    let blue = sum([-9714, -19071, 28784], 128);
    let red = sum([28784, -24103, -4681], 128);
    [luma, blue, red].map(|value| value.clamp(0, 255) as u8)
}
