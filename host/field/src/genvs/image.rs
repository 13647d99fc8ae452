//! Images in a device's memory, which may lie side by side in wider ones, and buffers that are used again.

use viewfuse_core::network::resample::UpsampleBlock;
use viewfuse_device::{Device, Memory};

/// Height, width and channels of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Size {
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) channels: u32,
}

impl Size {
    /// How many pixels it has.
    pub(super) fn pixel_count(self) -> u32 {
        self.height * self.width
    }

    /// The same with other channels.
    pub(super) fn with_channels(self, channels: u32) -> Size {
        Size { channels, ..self }
    }

    /// Half as many rows and columns; both are even.
    pub(super) fn halved(self) -> Size {
        Size { height: self.height / 2, width: self.width / 2, ..self }
    }

    /// Twice as many rows and columns.
    pub(super) fn doubled(self) -> Size {
        Size { height: self.height * 2, width: self.width * 2, ..self }
    }
}

/// An image `[row][column][channel]` in a device's memory: some of the channels of what its buffer holds.
pub(super) struct Image<D: Memory> {
    pub(super) values: D::Buffer<f32>,
    pub(super) size: Size,
    /// Numbers from a pixel to the next.
    pub(super) pitch: u32,
    /// Where the first pixel's first channel lies.
    pub(super) first: u32,
    capacity: usize,
}

impl<D: Memory> Image<D> {
    /// The same buffer, seen as other channels of it: `channels` from `first` on.
    pub(super) fn seen_as(self, first: u32, channels: u32) -> Image<D> {
        Image { size: self.size.with_channels(channels), first, ..self }
    }
}

/// Buffers that are free. Every kernel writes all of its output: what they hold from before is never seen.
pub(super) struct Scratch<'a, D: Memory> {
    device: &'a D,
    free: Vec<(usize, D::Buffer<f32>)>,
}

impl<'a, D: Device> Scratch<'a, D> {
    /// None yet.
    pub(super) fn new(device: &'a D) -> Scratch<'a, D> {
        Scratch { device, free: Vec::new() }
    }

    /// An image that fills its buffer.
    pub(super) fn image(&mut self, size: Size) -> Result<Image<D>, D::Error> {
        self.beside(size, size.channels, 0)
    }

    /// An image that is the channels from `first` on of one with `pitch` channels.
    pub(super) fn beside(&mut self, size: Size, pitch: u32, first: u32) -> Result<Image<D>, D::Error> {
        let len = size.pixel_count() as usize * pitch as usize;
        // A buffer that is much too large is kept for those that need it.
        let fits = |capacity: usize| (len..=2 * len).contains(&capacity);
        let best = self.free.iter().enumerate().filter(|(_, (capacity, _))| fits(*capacity));
        let (capacity, values) = match best.min_by_key(|(_, (capacity, _))| *capacity).map(|(index, _)| index) {
            Some(index) => self.free.swap_remove(index),
            None => (len, self.device.zeros(len)?),
        };
        Ok(Image { values, size, pitch, first, capacity })
    }

    /// An image with these values.
    pub(super) fn uploaded(&mut self, size: Size, values: &[f32]) -> Result<Image<D>, D::Error> {
        Ok(Image { values: self.device.upload(values)?, size, pitch: size.channels, first: 0, capacity: values.len() })
    }

    /// Takes an image back.
    pub(super) fn give(&mut self, image: Image<D>) {
        self.free.push((image.capacity, image.values));
    }
}

/// Enlarges an image that fills its buffer, bilinear with aligned corners, into the channels of another from `first` on.
pub(super) fn enlarge<D: Device>(
    device: &D,
    image: &Image<D>,
    first_channel: u32,
    output: &mut Image<D>,
) -> Result<(), D::Error> {
    let block = UpsampleBlock {
        in_height: image.size.height,
        in_width: image.size.width,
        in_channels: image.size.channels,
        out_height: output.size.height,
        out_width: output.size.width,
        out_channels: output.pitch,
        first_channel,
    };
    device.upsample(&block, &image.values, &mut output.values)
}
