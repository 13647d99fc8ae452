//! Layers from the tensors of a checkpoint, by the names that PyTorch gives them.

use super::checkpoint::{Checkpoint, CheckpointError};
use super::convolution::{Convolution, DepthwiseConvolution, TransposedConvolution};
use super::linear::Linear;
use super::norm::GroupNorm;
use super::weights::{BatchNorm, ConvolutionWeights, LinearWeights, transposed};
use viewfuse_device::{Device, DeviceError, Layer, LayerShape};

/// Why layers could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The parameters could not be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The device failed.
    #[error("the device failed")]
    Device(#[from] DeviceError),
}

/// Tensors of a checkpoint whose names have a common prefix. Their shapes have been checked.
#[derive(Clone, Copy, Debug)]
pub struct Tensors<'a> {
    /// The checkpoint.
    pub checkpoint: &'a Checkpoint,
    /// The prefix of the names.
    pub prefix: &'a str,
}

impl Tensors<'_> {
    /// Whether there is a tensor of that name.
    pub fn has(&self, name: &str) -> bool {
        self.checkpoint.shapes().contains_key(&format!("{}{name}", self.prefix))
    }

    /// The values of a tensor, flat and row-major.
    ///
    /// # Errors
    /// [`CheckpointError`] if it cannot be read.
    pub fn values(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        self.checkpoint.tensor(&format!("{}{name}", self.prefix))
    }

    /// A convolution, from `weight[out][in][row][column]` and, where there is one, `bias[out]`.
    ///
    /// # Errors
    /// [`CheckpointError`] if a tensor cannot be read.
    pub fn convolution(&self, name: &str) -> Result<ConvolutionWeights, CheckpointError> {
        let shape = self.shape(name);
        let weights = self.values(&format!("{name}.weight"))?;
        Ok(ConvolutionWeights::new(shape, &weights, self.bias(name, shape[0])?))
    }

    /// A convolution with the batch norm behind it folded in (see [`BatchNorm::fold`]): `norm` is the norm's name,
    /// `epsilon` the number that it adds to variances.
    ///
    /// # Errors
    /// [`CheckpointError`] if a tensor cannot be read.
    pub fn convolution_with_norm(
        &self,
        name: &str,
        norm: &str,
        epsilon: f64,
    ) -> Result<ConvolutionWeights, CheckpointError> {
        let shape = self.shape(name);
        let mut weights = self.values(&format!("{name}.weight"))?;
        let bias = self.batch_norm(norm, epsilon)?.fold(&mut weights, &self.bias(name, shape[0])?);
        Ok(ConvolutionWeights::new(shape, &weights, bias))
    }

    /// A batch norm that adds `epsilon` to variances.
    ///
    /// # Errors
    /// [`CheckpointError`] if a tensor cannot be read, or a variance is negative.
    pub fn batch_norm(&self, name: &str, epsilon: f64) -> Result<BatchNorm, CheckpointError> {
        let [weight, bias, mean, variance] =
            ["weight", "bias", "running_mean", "running_var"].map(|leaf| self.values(&format!("{name}.{leaf}")));
        let variance = variance?;
        if let Some(channel) = variance.iter().position(|variance| *variance < 0.0) {
            let (prefix, value) = (self.prefix, variance[channel]);
            let detail = format!("tensor '{prefix}{name}.running_var': the variance of channel {channel} is {value}");
            return Err(CheckpointError::Tensors(self.checkpoint.path().to_path_buf(), detail));
        }
        Ok(BatchNorm::new(&weight?, bias?, mean?, &variance, epsilon))
    }

    /// A linear layer, from `weight[out][in]` and, where there is one, `bias[out]`.
    ///
    /// # Errors
    /// [`CheckpointError`] if a tensor cannot be read.
    pub fn linear(&self, name: &str) -> Result<LinearWeights, CheckpointError> {
        let [out_count, ..] = self.shape(name);
        Ok(LinearWeights::new(&self.values(&format!("{name}.weight"))?, self.bias(name, out_count)?))
    }

    /// The shape of a layer's weights, with 1 for axes that they do not have.
    fn shape(&self, name: &str) -> [usize; 4] {
        let shape = self.checkpoint.shapes().get(&format!("{}{name}.weight", self.prefix));
        [0, 1, 2, 3].map(|axis| shape.and_then(|shape| shape.get(axis)).copied().unwrap_or(1))
    }

    /// The bias of a layer, zeros where it has none.
    fn bias(&self, name: &str, count: usize) -> Result<Vec<f32>, CheckpointError> {
        let name = format!("{name}.bias");
        if self.has(&name) { self.values(&name) } else { Ok(vec![0.0; count]) }
    }
}

/// Tensors of a checkpoint, and the device that layers are loaded to.
#[derive(Debug)]
pub struct Loader<'a, D> {
    /// The device.
    pub device: &'a D,
    /// The tensors.
    pub tensors: Tensors<'a>,
}

impl<'a, D: Device> Loader<'a, D> {
    /// Of the checkpoint's tensors whose names begin with `prefix`.
    pub fn new(device: &'a D, checkpoint: &'a Checkpoint, prefix: &'a str) -> Loader<'a, D> {
        Loader { device, tensors: Tensors { checkpoint, prefix } }
    }

    /// [`Tensors::convolution`] for images of at least `least_side` rows and columns; see [`ConvolutionWeights::load`].
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn convolution(&self, name: &str, least_side: u32) -> Result<Convolution<D>, LoadError> {
        self.changed_convolution(name, least_side, |weights| weights)
    }

    /// The same with weights that `change` modifies.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn changed_convolution(
        &self,
        name: &str,
        least_side: u32,
        change: impl FnOnce(ConvolutionWeights) -> ConvolutionWeights,
    ) -> Result<Convolution<D>, LoadError> {
        Ok(change(self.tensors.convolution(name)?).load(self.device, least_side)?)
    }

    /// A depthwise convolution, from `weight[channel][1][row][column]`. A bias is not read.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn depthwise_convolution(&self, name: &str) -> Result<DepthwiseConvolution<D>, LoadError> {
        let [channels, _, size, _] = self.tensors.shape(name);
        let weights = transposed(&self.tensors.values(&format!("{name}.weight"))?, channels);
        Ok(DepthwiseConvolution { weights: self.upload(&weights)?, size: size as u32, is_shared: false })
    }

    /// A transposed convolution whose stride is its window's size, from `weight[in][out][row][column]` and, where there
    /// is one, `bias[out]`.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn transposed_convolution(&self, name: &str) -> Result<TransposedConvolution<D>, LoadError> {
        let [in_channels, out_channels, size, _] = self.tensors.shape(name);
        let given = self.tensors.values(&format!("{name}.weight"))?;
        let column_count = out_channels * size * size;
        let weights: Vec<f32> =
            given.chunks_exact(column_count).flat_map(|weights| transposed(weights, out_channels)).collect();
        let shape = LayerShape { inner_count: in_channels, column_count, has_wide_images: false };
        let bias = self.tensors.bias(name, out_channels)?;
        let layer = Layer::new(self.device, &shape, &weights, &bias)?;
        Ok(TransposedConvolution { layer, size: size as u32, channels: out_channels as u32 })
    }

    /// [`Tensors::linear`] on the device.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn linear(&self, name: &str) -> Result<Linear<D>, LoadError> {
        Ok(self.tensors.linear(name)?.load(self.device)?)
    }

    /// A group norm, from `weight[channel]` and `bias[channel]`: `group_count(channels)` groups, `epsilon` added to
    /// variances.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn group_norm(
        &self,
        name: &str,
        group_count: impl FnOnce(usize) -> usize,
        epsilon: f32,
    ) -> Result<GroupNorm<D>, LoadError> {
        let weights = self.tensors.values(&format!("{name}.weight"))?;
        let bias = self.tensors.values(&format!("{name}.bias"))?;
        let (channels, group_count) = (weights.len() as u32, group_count(weights.len()) as u32);
        Ok(GroupNorm { weights: self.upload(&weights)?, bias: self.upload(&bias)?, channels, group_count, epsilon })
    }

    fn upload(&self, values: &[f32]) -> Result<D::Buffer<f32>, DeviceError> {
        self.device.upload(values)
    }
}
