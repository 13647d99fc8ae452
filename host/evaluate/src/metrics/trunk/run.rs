//! A trunk on a device.

use super::layer::{Loaded, load};
use super::{Convolution, LargestOf, Step, pool, tensors};
use crate::metrics::MetricError;
use std::rc::Rc;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_device::Device;
use viewfuse_field::finite::check_finite;
use viewfuse_nn::checkpoint::Checkpoint;

/// An image of any number of channels on the host.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Numbers of a pixel.
    pub channels: usize,
    /// `[row][column][channel]`.
    pub values: Vec<f32>,
}

impl Map {
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
}

/// A trunk with its parameters on a device.
pub struct Trunk<D: Device> {
    steps: Vec<Step<Loaded<D>>>,
}

/// An image `[row][column][channel]` in a device's memory.
struct Image<D: Device> {
    height: u32,
    width: u32,
    channels: u32,
    values: D::Buffer<f32>,
}

impl<D: Device> Trunk<D> {
    /// Reads these steps of pictures of three channels from a checkpoint, which must have exactly their tensors and
    /// perhaps others that `optional` accepts.
    ///
    /// # Errors
    /// [`MetricError::Checkpoint`] with the tensors that are missing, unexpected or of another shape;
    /// [`MetricError::Device`].
    pub fn load(
        device: &D,
        checkpoint: &Checkpoint,
        steps: &[Step<Convolution>],
        optional: impl Fn(&str) -> bool,
    ) -> Result<Trunk<D>, MetricError<D::Error>> {
        checkpoint.check(&tensors(steps, 3).0, optional)?;
        Ok(Trunk { steps: load(device, checkpoint, steps)? })
    }

    /// The images at the taps, in order.
    ///
    /// # Errors
    /// [`MetricError::Small`] if a window is larger than what it is to slide over; [`MetricError::NotFinite`];
    /// [`MetricError::Device`].
    pub fn taps(&self, device: &D, input: &Map) -> Result<Vec<Map>, MetricError<D::Error>> {
        let mut run = Run { device, input, taps: Vec::new() };
        let image = Rc::new(run.upload(input)?);
        run.steps(&self.steps, image)?;
        Ok(run.taps)
    }
}

/// One picture on its way.
struct Run<'a, D: Device> {
    device: &'a D,
    input: &'a Map,
    taps: Vec<Map>,
}

type Outcome<D, T> = Result<T, MetricError<<D as viewfuse_device::Memory>::Error>>;

impl<D: Device> Run<'_, D> {
    fn steps(&mut self, steps: &[Step<Loaded<D>>], mut image: Rc<Image<D>>) -> Outcome<D, Rc<Image<D>>> {
        for step in steps {
            image = match step {
                Step::Convolve(convolution) => Rc::new(self.convolve(convolution, &image)?),
                Step::Largest(window) => Rc::new(self.largest(window, &image)?),
                Step::Mean { counts_border } => {
                    let map = self.download(&image)?;
                    Rc::new(self.upload(&pool::mean(&map, *counts_border))?)
                }
                Step::RootMeanSquare => {
                    let map = self.download(&image)?;
                    Rc::new(self.upload(&pool::root_mean_square(&map))?)
                }
                Step::Beside(branches) => {
                    let outputs: Vec<_> =
                        branches.iter().map(|branch| self.steps(branch, image.clone())).collect::<Result<_, _>>()?;
                    Rc::new(self.beside(&outputs)?)
                }
                Step::Tap => {
                    let map = self.download(&image)?;
                    let tap = format!("tap {}", self.taps.len());
                    check_finite(&map.values, "looking at a picture through a metric's network", &tap)?;
                    self.taps.push(map);
                    image
                }
            };
        }
        Ok(image)
    }

    fn upload(&self, map: &Map) -> Outcome<D, Image<D>> {
        let values = self.device.upload(&map.values).map_err(MetricError::Device)?;
        Ok(Image { height: map.height as u32, width: map.width as u32, channels: map.channels as u32, values })
    }

    fn download(&self, image: &Image<D>) -> Outcome<D, Map> {
        let [height, width, channels] = [image.height, image.width, image.channels].map(|length| length as usize);
        let mut values = self.device.download(&image.values).map_err(MetricError::Device)?;
        values.truncate(height * width * channels);
        Ok(Map { height, width, channels, values })
    }

    fn zeros(&self, [height, width]: [u32; 2], channels: u32) -> Outcome<D, Image<D>> {
        let count = height as usize * width as usize * channels as usize;
        Ok(Image { height, width, channels, values: self.device.zeros(count).map_err(MetricError::Device)? })
    }

    /// How many windows lie on each side of an image.
    fn windows(&self, image: &Image<D>, window: &LargestOf) -> Outcome<D, [u32; 2]> {
        let count = |length: u32| {
            let free = (length + 2 * window.padding).checked_sub(window.side)?;
            Some(1 + if window.hangs_over { free.div_ceil(window.stride) } else { free / window.stride })
        };
        match (count(image.height), count(image.width)) {
            (Some(height), Some(width)) => Ok([height, width]),
            _ => Err(MetricError::Small { width: self.input.width, height: self.input.height }),
        }
    }

    fn convolve(&self, convolution: &Loaded<D>, image: &Image<D>) -> Outcome<D, Image<D>> {
        let Loaded { layer, channels, side, stride, padding } = convolution;
        let window = LargestOf { side: *side, stride: *stride, padding: *padding, hangs_over: false };
        let mut out = self.zeros(self.windows(image, &window)?, *channels)?;
        let block = ConvolveBlock {
            in_height: image.height,
            in_width: image.width,
            in_channels: image.channels,
            out_height: out.height,
            out_width: out.width,
            out_channels: out.channels,
            size: *side,
            stride: *stride,
            padding: *padding,
            relu_outputs: 1,
            ..ConvolveBlock::default()
        }
        .packed();
        self.device
            .convolve(&block, &image.values, &layer.weights, &layer.bias, None, &mut out.values)
            .map_err(MetricError::Device)?;
        Ok(out)
    }

    fn largest(&self, window: &LargestOf, image: &Image<D>) -> Outcome<D, Image<D>> {
        let mut out = self.zeros(self.windows(image, window)?, image.channels)?;
        let block = PoolBlock {
            in_height: image.height,
            in_width: image.width,
            out_height: out.height,
            out_width: out.width,
            channels: image.channels,
            size: window.side,
            stride: window.stride,
            padding: window.padding,
        };
        self.device.max_pool(&block, &image.values, &mut out.values).map_err(MetricError::Device)?;
        Ok(out)
    }

    /// Images of one size side by side by channels: enlarging to the own size is copying.
    fn beside(&self, images: &[Rc<Image<D>>]) -> Outcome<D, Image<D>> {
        let size = images.first().map_or([0, 0], |image| [image.height, image.width]);
        let mut out = self.zeros(size, images.iter().map(|image| image.channels).sum())?;
        let mut first_channel = 0;
        for image in images {
            let block = UpsampleBlock {
                in_height: image.height,
                in_width: image.width,
                in_channels: image.channels,
                out_height: out.height,
                out_width: out.width,
                out_channels: out.channels,
                first_channel,
            };
            self.device.upsample(&block, &image.values, &mut out.values).map_err(MetricError::Device)?;
            first_channel += image.channels;
        }
        Ok(out)
    }
}
