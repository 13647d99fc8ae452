//! What a network of images runs with: scratch buffers, memory for the images between layers, which is reused, and the
//! precision of its convolutions.

use super::image::{Image, Size};
use viewfuse_device::{Device, DeviceError, Precision};

/// A device and its free buffers. Every kernel writes all of its output: earlier content of a buffer is never read.
/// Dropping it frees them.
pub struct Scratch<'a, D: Device> {
    device: &'a D,
    /// The precision of convolutions that run with it from now on, on devices that have another than the exact one.
    pub precision: Precision,
    free: Vec<(usize, D::Buffer<f32>)>,
    /// Statistics of parts of an image, and for how many there is room.
    partials: Option<(usize, D::Buffer<[f32; 2]>)>,
}

impl<'a, D: Device> Scratch<'a, D> {
    /// Without any buffers. Convolutions are exact.
    pub fn new(device: &'a D) -> Scratch<'a, D> {
        Scratch { device, precision: Precision::Exact, free: Vec::new(), partials: None }
    }

    /// The device.
    pub fn device(&self) -> &'a D {
        self.device
    }

    /// An image with a buffer of its own, its values undefined.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn image(&mut self, size: Size) -> Result<Image<D>, DeviceError> {
        self.channel_slice(size, size.channels, 0)
    }

    /// An image that is the channels from `first` on of a new one with `pitch` channels, all of its values undefined.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn channel_slice(&mut self, size: Size, pitch: u32, first: u32) -> Result<Image<D>, DeviceError> {
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

    /// The buffer for statistics of the parts of one image after the other, of at least so many, undefined.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn partials(&mut self, count: usize) -> Result<&mut D::Buffer<[f32; 2]>, DeviceError> {
        let known = self.partials.take().filter(|(room, _)| *room >= count);
        let (_, partials) = self.partials.insert(match known {
            Some(partials) => partials,
            None => (count, self.device.zeros(count)?),
        });
        Ok(partials)
    }

    /// Takes an image's buffer back for reuse.
    pub fn recycle(&mut self, image: Image<D>) {
        self.free.push((image.capacity, image.values));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_device::cpu::Cpu;

    #[test]
    fn buffers_are_used_again_if_they_are_not_much_too_large() -> Result<(), DeviceError> {
        let mut scratch = Scratch::new(&Cpu);
        let size = Size { height: 2, width: 3, channels: 4 };
        let image = scratch.image(size)?;
        assert_eq!((image.values.len(), image.pitch, image.first), (24, 4, 0));
        scratch.recycle(image);
        let small = scratch.image(size.with_channels(1))?;
        assert_eq!(small.values.len(), 6, "24 numbers are too many for 6");
        let half = scratch.channel_slice(size.with_channels(1), 2, 1)?;
        assert_eq!((half.values.len(), half.pitch, half.first), (24, 2, 1));
        let another = scratch.image(size)?;
        assert_eq!(another.values.len(), 24, "the first is in use");
        Ok(())
    }
}
