//! Parameters of layers on the host, in the order in which kernels take them, and batch norms folded into them.

use super::convolution::Convolution;
use super::linear::Linear;
use viewfuse_device::parallel::for_each_rows;
use viewfuse_device::{Device, DeviceError, Layer, LayerShape};

/// The fewest rows and columns of images for which a device may use its algorithm for large images.
const LARGE_IMAGE: u32 = 32;

/// A convolution's weights and bias. Windows are square: those of other shapes lie in the middle of a square of zeros.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvolutionWeights {
    /// Rows and columns of the window.
    pub size: usize,
    /// Channels of the input.
    pub in_channels: usize,
    /// Channels of the output.
    pub out_channels: usize,
    /// `[row][column][input channel][output channel]`.
    pub values: Vec<f32>,
    /// `[output channel]`.
    pub bias: Vec<f32>,
}

impl ConvolutionWeights {
    /// From PyTorch's order: `weights[output channel][input channel][row][column]`, the shape in the same order.
    pub fn new(shape: [usize; 4], weights: &[f32], bias: Vec<f32>) -> ConvolutionWeights {
        let [out_channels, in_channels, rows, columns] = shape;
        let size = rows.max(columns);
        let [above, left] = [rows, columns].map(|length| (size - length) / 2);
        let place = |inner: usize| {
            let (row, column) = (inner / columns % rows + above, inner % columns + left);
            (row * size + column) * in_channels + inner / (rows * columns)
        };
        let values = reordered(weights, out_channels, size * size * in_channels, place);
        ConvolutionWeights { size, in_channels, out_channels, values, bias }
    }

    /// The same convolution followed by an average pool of 2x2 outputs with stride 2, as one convolution with a window
    /// larger by 1, which is to be run with stride 2. Exact up to rounding, and less than half the work.
    pub fn followed_by_average_pool(self) -> ConvolutionWeights {
        let ConvolutionWeights { size, in_channels, out_channels, values, bias } = self;
        let place_len = in_channels * out_channels;
        let mut larger = vec![0.0; (size + 1) * (size + 1) * place_len];
        for (place, weights) in values.chunks_exact(place_len).enumerate() {
            for corner in 0..4 {
                let (row, column) = (place / size + corner / 2, place % size + corner % 2);
                let sums = &mut larger[(row * (size + 1) + column) * place_len..][..place_len];
                sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += 0.25 * weight);
            }
        }
        ConvolutionWeights { size: size + 1, in_channels, out_channels, values: larger, bias }
    }

    /// The same with its output channels in another order: `old(new)` is where a channel was.
    pub fn with_outputs_reordered(self, old: impl Fn(usize) -> usize) -> ConvolutionWeights {
        let ConvolutionWeights { size, in_channels, out_channels, values, bias } = self;
        let order: Vec<usize> = (0..out_channels).map(old).collect();
        let sorted = |row: &[f32]| order.iter().map(|old| row[*old]).collect::<Vec<f32>>();
        let values = values.chunks_exact(out_channels).flat_map(sorted).collect();
        ConvolutionWeights { size, in_channels, out_channels, values, bias: sorted(&bias) }
    }

    /// Takes them to a device. It is run with stride 1 and without dilation on images of at least `least_side` rows and
    /// columns, or `least_side` is 0: a device may have another algorithm for large images, which rounds differently.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn load<D: Device>(&self, device: &D, least_side: u32) -> Result<Convolution<D>, DeviceError> {
        let shape = LayerShape {
            inner_count: self.size * self.size * self.in_channels,
            column_count: self.out_channels,
            has_wide_images: self.size == 3 && least_side >= LARGE_IMAGE,
        };
        let layer = Layer::new(device, &shape, &self.values, &self.bias)?;
        Ok(Convolution { layer, size: self.size as u32, channels: self.out_channels as u32 })
    }
}

/// A linear layer's weights and bias.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearWeights {
    /// `[input][output]`.
    pub values: Vec<f32>,
    /// `[output]`, at least one.
    pub bias: Vec<f32>,
}

impl LinearWeights {
    /// From PyTorch's order: `weights[output][input]`.
    pub fn new(weights: &[f32], bias: Vec<f32>) -> LinearWeights {
        LinearWeights { values: transposed(weights, bias.len()), bias }
    }

    /// The number of inputs.
    pub fn in_count(&self) -> usize {
        self.values.len() / self.bias.len()
    }

    /// Layers with the same inputs as one layer, their outputs concatenated. Each has `in_count` inputs.
    pub fn concatenated(layers: &[LinearWeights], in_count: usize) -> LinearWeights {
        let row = |input: usize| {
            layers.iter().flat_map(move |LinearWeights { values, bias }| {
                values[input * bias.len()..(input + 1) * bias.len()].iter().copied()
            })
        };
        LinearWeights {
            values: (0..in_count).flat_map(row).collect(),
            bias: layers.iter().flat_map(|layer| layer.bias.iter().copied()).collect(),
        }
    }

    /// Its outputs, computed on the host: the bias, then the products added input by input.
    pub fn run(&self, inputs: &[f32]) -> Vec<f32> {
        let mut sums = self.bias.clone();
        for (input, weights) in inputs.iter().zip(self.values.chunks_exact(self.bias.len())) {
            sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += input * weight);
        }
        sums
    }

    /// Takes them to a device.
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn load<D: Device>(&self, device: &D) -> Result<Linear<D>, DeviceError> {
        let (in_count, out_count) = (self.in_count(), self.bias.len());
        let shape = LayerShape { inner_count: in_count, column_count: out_count, has_wide_images: false };
        let layer = Layer::new(device, &shape, &self.values, &self.bias)?;
        Ok(Linear { layer, in_count: in_count as u32, out_count: out_count as u32 })
    }
}

/// A batch norm with the statistics of training: a factor and a shift for each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchNorm {
    /// `[channel]`: factors of the outputs.
    factors: Vec<f64>,
    mean: Vec<f32>,
    shift: Vec<f32>,
}

impl BatchNorm {
    /// From PyTorch's `weight`, `bias`, `running_mean` and `running_var`; `epsilon` is added to variances. Negative
    /// variances count as 0.
    pub fn new(weight: &[f32], bias: Vec<f32>, mean: Vec<f32>, variance: &[f32], epsilon: f64) -> BatchNorm {
        let factor =
            |(weight, variance): (&f32, &f32)| f64::from(*weight) / (f64::from(*variance).max(0.0) + epsilon).sqrt();
        BatchNorm { factors: weight.iter().zip(variance).map(factor).collect(), mean, shift: bias }
    }

    /// Folds it into the convolution before it, in `f64`: multiplies `weights[output channel][...]` and returns the
    /// bias, from the convolution's own.
    pub fn fold(&self, weights: &mut [f32], bias: &[f32]) -> Vec<f32> {
        let per_channel = (weights.len() / self.factors.len().max(1)).max(1);
        for (weights, factor) in weights.chunks_exact_mut(per_channel).zip(&self.factors) {
            weights.iter_mut().for_each(|weight| *weight = (f64::from(*weight) * factor) as f32);
        }
        let channels = self.factors.iter().zip(&self.mean).zip(&self.shift).zip(bias);
        let folded = |(((factor, mean), shift), bias): (((&f64, &f32), &f32), &f32)| {
            (f64::from(*shift) - (f64::from(*mean) - f64::from(*bias)) * factor) as f32
        };
        channels.map(folded).collect()
    }
}

/// Rows and columns of the squares in which [`reordered`] goes through a matrix: as many numbers as a line of a cache
/// has.
const SQUARE: usize = 16;
/// Numbers that are enough work for a core.
const LEAST: usize = 1 << 14;

/// `values[row][column]` of so many rows, as `[place(column)][row]`; what has no place in it is 0. Columns have
/// different places.
fn reordered(values: &[f32], row_count: usize, place_count: usize, place: impl Fn(usize) -> usize) -> Vec<f32> {
    let row_count = row_count.max(1);
    let mut placed = vec![0.0; place_count * row_count];
    let columns = values.len() / row_count;
    let mut places: Vec<Option<&mut [f32]>> = placed.chunks_exact_mut(row_count).map(Some).collect();
    let mut targets: Vec<Option<&mut [f32]>> =
        (0..columns).map(|column| places.get_mut(place(column))?.take()).collect();
    for_each_rows(&mut targets, SQUARE, LEAST / row_count, &|first, targets| {
        for (square, targets) in targets.chunks_mut(SQUARE).enumerate() {
            for first_row in (0..row_count).step_by(SQUARE) {
                let rows = first_row..row_count.min(first_row + SQUARE);
                for (column, target) in (first * SQUARE + square * SQUARE..).zip(&mut *targets) {
                    let placed = target.as_deref_mut().map_or(&mut [][..], |target| &mut target[rows.clone()]);
                    rows.clone().zip(placed).for_each(|(row, placed)| *placed = values[row * columns + column]);
                }
            }
        }
    });
    placed
}

/// `values[row][column]` of so many rows, as `[column][row]`.
pub(crate) fn transposed(values: &[f32], row_count: usize) -> Vec<f32> {
    reordered(values, row_count, values.len() / row_count.max(1), |column| column)
}
