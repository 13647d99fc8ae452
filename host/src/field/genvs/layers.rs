//! Layers with their parameters, as both networks use them: read from a checkpoint, taken to a device, run.

use super::super::FieldError;
use super::architecture::group_count;
use super::image::{Image, Scratch, Size};
use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::device::{Device, Layer, LayerShape};
use std::ops::Range;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::normalise::NormaliseBlock;
use viewfuse_core::network::transpose::TransposedBlock;

/// Rows and columns from which on an image is large for a layer's shape.
const WIDE: u32 = 32;

/// Reads layers. The tensors' shapes have been checked.
pub(super) struct Loader<'a, D: Device> {
    pub(super) device: &'a D,
    pub(super) checkpoint: &'a Checkpoint,
    /// What all names begin with.
    pub(super) prefix: &'static str,
}

type Loaded<T, D> = Result<T, FieldError<<D as crate::device::Memory>::Error>>;

impl<D: Device> Loader<'_, D> {
    fn shape(&self, name: &str) -> Vec<usize> {
        self.checkpoint.shapes().get(&format!("{}{name}", self.prefix)).cloned().unwrap_or_default()
    }

    /// Whether there is a tensor of that name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.checkpoint.shapes().contains_key(&format!("{}{name}", self.prefix))
    }

    /// The values of a tensor.
    pub(super) fn tensor(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        self.checkpoint.tensor(&format!("{}{name}", self.prefix))
    }

    /// Values on the device.
    pub(super) fn upload(&self, values: &[f32]) -> Loaded<D::Buffer<f32>, D> {
        self.device.upload(values).map_err(FieldError::Device)
    }

    /// The bias of a layer, zeros where it has none.
    fn bias(&self, name: &str, count: usize) -> Result<Vec<f32>, CheckpointError> {
        let name = format!("{name}.bias");
        if self.has(&name) { self.tensor(&name) } else { Ok(vec![0.0; count]) }
    }

    /// A convolution for images of at least `side` rows and columns, from `weight[out][in][row][column]`.
    pub(super) fn convolution(&self, name: &str, side: u32) -> Loaded<Convolution<D>, D> {
        self.changed_convolution(name, side, |window| window)
    }

    /// A convolution whose weights are changed on the way; see [`Window`].
    pub(super) fn changed_convolution(
        &self,
        name: &str,
        side: u32,
        change: impl FnOnce(Window) -> Window,
    ) -> Loaded<Convolution<D>, D> {
        let shape = self.shape(&format!("{name}.weight"));
        let [columns, channels, size] = [0, 1, 2].map(|axis| shape.get(axis).copied().unwrap_or(1));
        let given = self.tensor(&format!("{name}.weight"))?;
        let mut values = vec![0.0; given.len()];
        for (index, value) in given.into_iter().enumerate() {
            let (place, channel) = (index % (size * size), index / (size * size) % channels);
            let column = index / (size * size * channels);
            values[(place * channels + channel) * columns + column] = value;
        }
        let bias = self.bias(name, columns)?;
        let Window { size, channels, columns, values, bias } = change(Window { size, channels, columns, values, bias });
        let shape = LayerShape {
            inner_count: size * size * channels,
            column_count: columns,
            has_wide_images: size == 3 && side >= WIDE,
        };
        let layer = Layer::new(self.device, &shape, &values, &bias).map_err(FieldError::Device)?;
        Ok(Convolution { layer, size: size as u32, channels: columns as u32 })
    }

    /// A convolution of every channel by itself, from `weight[channel][1][row][column]`.
    pub(super) fn depthwise(&self, name: &str) -> Loaded<Depthwise<D>, D> {
        let shape = self.shape(&format!("{name}.weight"));
        let [channels, _, size] = [0, 1, 2].map(|axis| shape.get(axis).copied().unwrap_or(1));
        let weights = transposed(&self.tensor(&format!("{name}.weight"))?, channels);
        Ok(Depthwise { weights: self.upload(&weights)?, size: size as u32, is_shared: false })
    }

    /// A transposed convolution, from `weight[in][out][row][column]`.
    pub(super) fn transposed_convolution(&self, name: &str) -> Loaded<Transposed<D>, D> {
        let shape = self.shape(&format!("{name}.weight"));
        let [channels, columns, size] = [0, 1, 2].map(|axis| shape.get(axis).copied().unwrap_or(1));
        let given = self.tensor(&format!("{name}.weight"))?;
        let weights: Vec<f32> =
            given.chunks_exact(columns * size * size).flat_map(|weights| transposed(weights, columns)).collect();
        let shape = LayerShape { inner_count: channels, column_count: columns * size * size, has_wide_images: false };
        let layer =
            Layer::new(self.device, &shape, &weights, &self.bias(name, columns)?).map_err(FieldError::Device)?;
        Ok(Transposed { layer, size: size as u32, channels: columns as u32 })
    }

    /// A fully connected layer, from `weight[out][in]`.
    pub(super) fn linear(&self, name: &str) -> Loaded<Layer<D>, D> {
        let (weights, bias) = self.host_linear(name)?;
        let shape =
            LayerShape { inner_count: weights.len() / bias.len(), column_count: bias.len(), has_wide_images: false };
        Layer::new(self.device, &shape, &weights, &bias).map_err(FieldError::Device)
    }

    /// The same on the host: `weights[in][out]` and bias.
    pub(super) fn host_linear(&self, name: &str) -> Result<(Vec<f32>, Vec<f32>), CheckpointError> {
        let columns = self.shape(&format!("{name}.weight")).first().copied().unwrap_or(1);
        let weights = self.tensor(&format!("{name}.weight"))?;
        Ok((transposed(&weights, columns), self.bias(name, columns)?))
    }

    /// A group normalisation.
    pub(super) fn norm(&self, name: &str) -> Loaded<Norm<D>, D> {
        let weights = self.tensor(&format!("{name}.weight"))?;
        let bias = self.tensor(&format!("{name}.bias"))?;
        Ok(Norm { weights: self.upload(&weights)?, bias: self.upload(&bias)? })
    }
}

/// A convolution's weights `[row][column][input channel][output channel]` and bias on the host.
pub(super) struct Window {
    pub(super) size: usize,
    pub(super) channels: usize,
    pub(super) columns: usize,
    pub(super) values: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

impl Window {
    /// The same convolution followed by the mean of every 2x2 outputs that touch, as one with a window larger by 1 that
    /// steps by 2. Exact up to rounding, and less than half the work.
    pub(super) fn then_halved(self) -> Window {
        let Window { size, channels, columns, values, bias } = self;
        let row = channels * columns;
        let mut larger = vec![0.0; (size + 1) * (size + 1) * row];
        for (place, weights) in values.chunks_exact(row).enumerate() {
            for corner in 0..4 {
                let (down, across) = (place / size + corner / 2, place % size + corner % 2);
                let sums = &mut larger[(down * (size + 1) + across) * row..][..row];
                sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += 0.25 * weight);
            }
        }
        Window { size: size + 1, channels, columns, values: larger, bias }
    }

    /// The same with its output channels in another order: `from(new)` is the old place.
    pub(super) fn reordered(self, from: impl Fn(usize) -> usize) -> Window {
        let Window { size, channels, columns, values, bias } = self;
        let order: Vec<usize> = (0..columns).map(from).collect();
        let sorted = |row: &[f32]| order.iter().map(|old| row[*old]).collect::<Vec<f32>>();
        let values = values.chunks_exact(columns).flat_map(sorted).collect();
        Window { size, channels, columns, values, bias: sorted(&bias) }
    }
}

/// `values[row][column]` of so many rows, as `[column][row]`.
fn transposed(values: &[f32], row_count: usize) -> Vec<f32> {
    let columns = values.len() / row_count;
    (0..values.len()).map(|index| values[index % row_count * columns + index / row_count]).collect()
}

/// A convolution on a device.
pub(super) struct Convolution<D: Device> {
    layer: Layer<D>,
    size: u32,
    /// Of the output.
    pub(super) channels: u32,
}

/// How a convolution is run.
#[derive(Clone, Copy)]
pub(super) struct Way {
    /// Pixels from one window to the next.
    pub(super) stride: u32,
    /// Pixels from one place of the window to the next.
    pub(super) dilation: u32,
    /// Rows and columns of zeros around the image; `None`: as many as keep its size at stride 1.
    pub(super) padding: Option<u32>,
    /// How many times each input pixel is repeated in both directions.
    pub(super) enlarge: u32,
    /// Factor of the result.
    pub(super) scale: f32,
    /// Whether negative outputs become 0.
    pub(super) relu: bool,
}

impl Way {
    /// Image to image of the same size.
    pub(super) const PLAIN: Way = Way { stride: 1, dilation: 1, padding: None, enlarge: 1, scale: 1.0, relu: false };
    /// The same, rectified.
    pub(super) const RELU: Way = Way { relu: true, ..Way::PLAIN };

    /// Size of the output for an input and a window.
    fn out(&self, size: Size, window: u32, channels: u32) -> (Size, u32) {
        let reach = (window - 1) * self.dilation;
        let padding = self.padding.unwrap_or(reach / 2);
        let out = |side: u32| (side * self.enlarge + 2 * padding).saturating_sub(reach + 1) / self.stride + 1;
        (Size { height: out(size.height), width: out(size.width), channels }, padding)
    }
}

/// What is added to a convolution's result.
pub(super) enum Addend<'a, D: Device> {
    /// Nothing.
    None,
    /// An image of its output's size.
    Image(&'a Image<D>),
    /// The same numbers at every pixel, from a place of a buffer on.
    Shared(&'a D::Buffer<f32>, u32),
}

impl<D: Device> Convolution<D> {
    /// Runs it into a new image.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        way: Way,
        image: &Image<D>,
        addend: Addend<'_, D>,
    ) -> Result<Image<D>, D::Error> {
        let (size, _) = way.out(image.size, self.size, self.channels);
        let mut output = scratch.image(size)?;
        self.run_into(device, way, image, addend, &mut output)?;
        Ok(output)
    }

    /// Runs it into an image of the right size.
    pub(super) fn run_into(
        &self,
        device: &D,
        way: Way,
        image: &Image<D>,
        addend: Addend<'_, D>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let block = self.block(way, image, output);
        debug_assert_eq!([block.out_height, block.out_width], [output.size.height, output.size.width]);
        let (addend, addend_pitch, addend_first) = match addend {
            Addend::None => (None, 0, 0),
            Addend::Image(image) => (Some(&image.values), image.pitch, image.first),
            Addend::Shared(values, first) => (Some(values), 0, first),
        };
        let block = ConvolveBlock { addend_pitch, addend_first, ..block };
        device.convolve(&block, &image.values, &self.layer, addend, &mut output.values)
    }

    /// The same for some rows alone; its windows are single pixels.
    pub(super) fn run_rows(
        &self,
        device: &D,
        way: Way,
        image: &Image<D>,
        rows: Range<u32>,
        output: &mut Image<D>,
    ) -> Result<(), D::Error> {
        let block = self.block(way, image, output);
        debug_assert_eq!([block.size, block.stride], [1, 1]);
        let (height, before) = (rows.len() as u32, rows.start * block.in_width);
        let block = ConvolveBlock {
            in_height: height,
            in_first: block.in_first + before * block.in_pitch,
            out_height: height,
            out_first: block.out_first + before * block.out_pitch,
            ..block
        };
        device.convolve(&block, &image.values, &self.layer, None, &mut output.values)
    }

    /// The dispatch for an input and an output, without addend.
    fn block(&self, way: Way, image: &Image<D>, output: &Image<D>) -> ConvolveBlock {
        let (size, padding) = way.out(image.size, self.size, self.channels);
        ConvolveBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            enlarge: way.enlarge,
            out_height: size.height,
            out_width: size.width,
            out_channels: size.channels,
            out_pitch: output.pitch,
            out_first: output.first,
            size: self.size,
            stride: way.stride,
            dilation: way.dilation,
            padding,
            scale: way.scale,
            relu_outputs: u32::from(way.relu),
            ..ConvolveBlock::default()
        }
    }
}

/// A convolution of every channel by itself, on a device.
pub(super) struct Depthwise<D: Device> {
    weights: D::Buffer<f32>,
    size: u32,
    is_shared: bool,
}

impl<D: Device> Depthwise<D> {
    /// The mean of every 2x2 pixels: the published filter `[1, 1]` in both directions.
    pub(super) fn halving(device: &D) -> Result<Depthwise<D>, D::Error> {
        Ok(Depthwise { weights: device.upload(&[0.25; 4])?, size: 2, is_shared: true })
    }

    /// Runs it into a new image. The way's scale, enlargement and rectification are not for it.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        way: Way,
        image: &Image<D>,
    ) -> Result<Image<D>, D::Error> {
        let (size, padding) = way.out(image.size, self.size, image.size.channels);
        let mut output = scratch.image(size)?;
        let block = DepthwiseBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_pitch: image.pitch,
            in_first: image.first,
            out_height: size.height,
            out_width: size.width,
            channels: size.channels,
            size: self.size,
            stride: way.stride,
            dilation: way.dilation,
            padding,
            is_shared: u32::from(self.is_shared),
        };
        device.convolve_depthwise(&block, &image.values, &self.weights, &mut output.values)?;
        Ok(output)
    }
}

/// A transposed convolution on a device.
pub(super) struct Transposed<D: Device> {
    layer: Layer<D>,
    size: u32,
    /// Of the output.
    pub(super) channels: u32,
}

impl<D: Device> Transposed<D> {
    /// Runs it, rectified, into an image of the right size.
    pub(super) fn run_into(&self, device: &D, image: &Image<D>, output: &mut Image<D>) -> Result<(), D::Error> {
        let block = TransposedBlock {
            in_height: image.size.height,
            in_width: image.size.width,
            in_channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            out_channels: self.channels,
            out_pitch: output.pitch,
            out_first: output.first,
            size: self.size,
            relu_outputs: 1,
        };
        device.convolve_transposed(&block, &image.values, &self.layer, &mut output.values)
    }
}

/// A group normalisation on a device.
pub(super) struct Norm<D: Device> {
    weights: D::Buffer<f32>,
    bias: D::Buffer<f32>,
}

/// What is added to variances (`networks.py`).
const VARIANCE_FLOOR: f32 = 1.0e-6;

impl<D: Device> Norm<D> {
    /// Normalises an image into a new one.
    pub(super) fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        device: &D,
        image: &Image<D>,
        silu: bool,
    ) -> Result<Image<D>, D::Error> {
        let channels = image.size.channels;
        let block = NormaliseBlock {
            pixel_count: image.size.pixel_count(),
            channels,
            in_pitch: image.pitch,
            in_first: image.first,
            group_count: group_count(channels as usize) as u32,
            variance_floor: VARIANCE_FLOOR,
            silu_outputs: u32::from(silu),
        };
        let mut parts = device.zeros((block.part_count() * block.group_count) as usize)?;
        let mut moments = device.zeros(block.group_count as usize)?;
        device.part_moments(&block, &image.values, &mut parts)?;
        device.merge_moments(&block, &parts, &mut moments)?;
        let mut output = scratch.image(image.size)?;
        device.normalise(&block, &image.values, &moments, &self.weights, &self.bias, &mut output.values)?;
        Ok(output)
    }
}
