//! Images in a device's memory, which may be some of the channels of wider ones, and on the host.

use viewfuse_device::{DeviceError, Memory};

/// Height, width and channels of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Channels of a pixel.
    pub channels: u32,
}

impl Size {
    /// How many pixels it has; at most `u32::MAX` is told.
    pub fn pixel_count(self) -> u32 {
        self.height.saturating_mul(self.width)
    }

    /// The same with other channels.
    pub fn with_channels(self, channels: u32) -> Size {
        Size { channels, ..self }
    }

    /// Half as many rows and columns; both are even.
    pub fn halved(self) -> Size {
        Size { height: self.height / 2, width: self.width / 2, ..self }
    }

    /// Twice as many rows and columns.
    pub fn doubled(self) -> Size {
        Size { height: self.height * 2, width: self.width * 2, ..self }
    }
}

/// An image `[row][column][channel]` in a device's memory: all or some of the channels of what its buffer holds.
pub struct Image<D: Memory> {
    /// The buffer. It may be longer than the image needs.
    pub values: D::Buffer<f32>,
    /// Rows, columns and channels.
    pub size: Size,
    /// Numbers from a pixel to the next.
    pub pitch: u32,
    /// Where the first pixel's first channel lies.
    pub first: u32,
    /// Numbers that the buffer holds.
    pub(crate) capacity: usize,
}

impl<D: Memory> Image<D> {
    /// An image of zeros that fills its buffer.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn zeros(device: &D, size: Size) -> Result<Image<D>, DeviceError> {
        let capacity = size.pixel_count() as usize * size.channels as usize;
        Ok(Image { values: device.zeros(capacity)?, size, pitch: size.channels, first: 0, capacity })
    }

    /// An image with these values, `[row][column][channel]`.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn upload(device: &D, size: Size, values: &[f32]) -> Result<Image<D>, DeviceError> {
        Ok(Image { values: device.upload(values)?, size, pitch: size.channels, first: 0, capacity: values.len() })
    }

    /// Other channels of the same buffer: `channels` from `first` on.
    pub fn channel_slice(self, first: u32, channels: u32) -> Image<D> {
        Image { size: self.size.with_channels(channels), first, ..self }
    }

    /// The image on the host. It is not a slice of a wider one.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn download(&self, device: &D) -> Result<HostImage, DeviceError> {
        debug_assert_eq!((self.pitch, self.first), (self.size.channels, 0), "a slice is not downloaded");
        let [height, width, channels] = [self.size.height, self.size.width, self.size.channels].map(|n| n as usize);
        let mut values = device.download(&self.values)?;
        values.truncate(height * width * channels);
        Ok(HostImage { height, width, channels, values })
    }
}

/// An image on the host.
#[derive(Clone, Debug, PartialEq)]
pub struct HostImage {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Numbers of a pixel.
    pub channels: usize,
    /// `[row][column][channel]`.
    pub values: Vec<f32>,
}

impl HostImage {
    /// The channels of a pixel.
    ///
    /// # Panics
    /// Outside of the image.
    pub fn pixel(&self, row: usize, column: usize) -> &[f32] {
        &self.values[(row * self.width + column) * self.channels..][..self.channels]
    }

    /// The channels of every pixel.
    pub fn pixels(&self) -> impl Iterator<Item = &[f32]> {
        self.values.chunks_exact(self.channels.max(1))
    }

    /// A channel of every pixel.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn channel(&self, channel: usize) -> impl Iterator<Item = f64> + '_ {
        self.values[channel..].iter().step_by(self.channels).map(|value| f64::from(*value))
    }

    /// The same image in a device's memory.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn upload<D: Memory>(&self, device: &D) -> Result<Image<D>, DeviceError> {
        let [height, width, channels] = [self.height, self.width, self.channels].map(|n| n as u32);
        Image::upload(device, Size { height, width, channels }, &self.values)
    }
}
