//! Reading layers from a checkpoint: weights in the order in which kernels take them.

use super::{Convolution, Depthwise, Norm, Transposed};
use crate::FieldError;
use viewfuse_device::{Device, Layer, LayerShape};
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// Rows and columns from which on an image is large for a layer's shape.
const WIDE: u32 = 32;

/// Reads layers. The tensors' shapes have been checked.
pub(in crate::genvs) struct Loader<'a, D: Device> {
    pub(in crate::genvs) device: &'a D,
    pub(in crate::genvs) checkpoint: &'a Checkpoint,
    /// What all names begin with.
    pub(in crate::genvs) prefix: &'static str,
}

type Loaded<T, D> = Result<T, FieldError<<D as viewfuse_device::Memory>::Error>>;

impl<D: Device> Loader<'_, D> {
    fn shape(&self, name: &str) -> Vec<usize> {
        self.checkpoint.shapes().get(&format!("{}{name}", self.prefix)).cloned().unwrap_or_default()
    }

    /// Whether there is a tensor of that name.
    pub(in crate::genvs) fn has(&self, name: &str) -> bool {
        self.checkpoint.shapes().contains_key(&format!("{}{name}", self.prefix))
    }

    /// The values of a tensor.
    pub(in crate::genvs) fn tensor(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        self.checkpoint.tensor(&format!("{}{name}", self.prefix))
    }

    /// Values on the device.
    pub(in crate::genvs) fn upload(&self, values: &[f32]) -> Loaded<D::Buffer<f32>, D> {
        self.device.upload(values).map_err(FieldError::Device)
    }

    /// The bias of a layer, zeros where it has none.
    fn bias(&self, name: &str, count: usize) -> Result<Vec<f32>, CheckpointError> {
        let name = format!("{name}.bias");
        if self.has(&name) { self.tensor(&name) } else { Ok(vec![0.0; count]) }
    }

    /// A convolution for images of at least `side` rows and columns, from `weight[out][in][row][column]`.
    pub(in crate::genvs) fn convolution(&self, name: &str, side: u32) -> Loaded<Convolution<D>, D> {
        self.changed_convolution(name, side, |window| window)
    }

    /// A convolution whose weights are changed on the way; see [`Window`].
    pub(in crate::genvs) fn changed_convolution(
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
    pub(in crate::genvs) fn depthwise(&self, name: &str) -> Loaded<Depthwise<D>, D> {
        let shape = self.shape(&format!("{name}.weight"));
        let [channels, _, size] = [0, 1, 2].map(|axis| shape.get(axis).copied().unwrap_or(1));
        let weights = transposed(&self.tensor(&format!("{name}.weight"))?, channels);
        Ok(Depthwise { weights: self.upload(&weights)?, size: size as u32, is_shared: false })
    }

    /// A transposed convolution, from `weight[in][out][row][column]`.
    pub(in crate::genvs) fn transposed_convolution(&self, name: &str) -> Loaded<Transposed<D>, D> {
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
    pub(in crate::genvs) fn linear(&self, name: &str) -> Loaded<Layer<D>, D> {
        let (weights, bias) = self.host_linear(name)?;
        let shape =
            LayerShape { inner_count: weights.len() / bias.len(), column_count: bias.len(), has_wide_images: false };
        Layer::new(self.device, &shape, &weights, &bias).map_err(FieldError::Device)
    }

    /// The same on the host: `weights[in][out]` and bias.
    pub(in crate::genvs) fn host_linear(&self, name: &str) -> Result<(Vec<f32>, Vec<f32>), CheckpointError> {
        let columns = self.shape(&format!("{name}.weight")).first().copied().unwrap_or(1);
        let weights = self.tensor(&format!("{name}.weight"))?;
        Ok((transposed(&weights, columns), self.bias(name, columns)?))
    }

    /// A group normalisation.
    pub(in crate::genvs) fn norm(&self, name: &str) -> Loaded<Norm<D>, D> {
        let weights = self.tensor(&format!("{name}.weight"))?;
        let bias = self.tensor(&format!("{name}.bias"))?;
        Ok(Norm { weights: self.upload(&weights)?, bias: self.upload(&bias)? })
    }
}

/// A convolution's weights `[row][column][input channel][output channel]` and bias on the host.
pub(in crate::genvs) struct Window {
    pub(in crate::genvs) size: usize,
    pub(in crate::genvs) channels: usize,
    pub(in crate::genvs) columns: usize,
    pub(in crate::genvs) values: Vec<f32>,
    pub(in crate::genvs) bias: Vec<f32>,
}

impl Window {
    /// The same convolution followed by the mean of every 2x2 outputs that touch, as one with a window larger by 1 that
    /// steps by 2. Exact up to rounding, and less than half the work.
    pub(in crate::genvs) fn then_halved(self) -> Window {
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
    pub(in crate::genvs) fn reordered(self, from: impl Fn(usize) -> usize) -> Window {
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
