//! PixelNeRF as a differentiable graph: the family of [`viewfuse_field::pixelnerf`], with batch norms of constant
//! statistics (mean 0, variance 1), so that training and rendering compute the same, and one point network for both
//! passes.

#[cfg(test)]
mod tests;

use super::TrainError;
use super::batch::Batch;
use super::compositing::{coarse_depths, fine_depths, merged, points, weights as sample_weights};
use super::draw::{Draw, Purpose};
use super::images::{add_enlarged, convolve, dims4, max_pool};
use super::operations::{Apply, PointNetwork, PointNetworkSizes, Points, Window};
use super::parameters::{Contents, Parameters, fan_in, random};
use candle_core::{D, DType, Device, Result, Tensor};
use std::sync::Arc;
use viewfuse_core::rays::RayPoint;
use viewfuse_field::pixelnerf::architecture::Architecture;
use viewfuse_kernels::pixelnerf::EmbedBlock;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_nn::resnet::has_shortcut;

/// Added to variances (epsilon), as in the field.
const VARIANCE_FLOOR: f64 = 1.0e-5;
/// Initial density of all space: low, so that every sample has a weight and a gradient.
const FIRST_DENSITY: f32 = 0.3;

/// Samples of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleCounts {
    pub(crate) coarse: usize,
    pub(crate) fine: usize,
}

/// The network with its parameters.
#[derive(Clone, Debug)]
pub(crate) struct PixelNerf {
    pub(crate) architecture: Architecture,
    pub(crate) parameters: Parameters,
    /// Whether only the views' weights are differentiated.
    pub(crate) is_frozen: bool,
}

/// The constant statistics of batch norms.
fn is_statistic(name: &str) -> bool {
    name.ends_with(".running_mean") || name.ends_with(".running_var")
}

impl PixelNerf {
    /// Initial parameters: He's initialisation, second layers of the blocks zero, as published.
    pub(crate) fn new(
        architecture: Architecture,
        dtype: DType,
        seed: u64,
    ) -> std::result::Result<PixelNerf, TrainError> {
        let mut tensors = architecture.tensors();
        tensors.retain(|tensor| !is_statistic(&tensor.name));
        let parameters = Parameters::new(&tensors, dtype, |tensor| {
            let name = &tensor.name;
            let is_norm = tensor.shape.len() == 1 && name.ends_with("weight");
            let count: usize = tensor.shape.iter().product();
            Ok(match () {
                () if is_norm => vec![1.0; count],
                () if name.ends_with("lin_out.bias") => vec![0.0, 0.0, 0.0, FIRST_DENSITY],
                () if name.ends_with("bias") || name.ends_with("fc_1.weight") => vec![0.0; count],
                () => random(tensor, seed, (2.0 / fan_in(tensor) as f32).sqrt() * gain(name)),
            })
        })?;
        Ok(PixelNerf { architecture, parameters, is_frozen: false })
    }

    /// A trained network, which is not changed.
    pub(crate) fn frozen(checkpoint: &Checkpoint, dtype: DType) -> std::result::Result<PixelNerf, TrainError> {
        let architecture = Architecture::of(checkpoint)?;
        let refuse = |reason: String| TrainError::Checkpoint { path: checkpoint.path().to_path_buf(), reason };
        if architecture.has_fine {
            return Err(refuse("it has a second point network, which this training does not support".to_owned()));
        }
        let mut tensors = architecture.tensors();
        for tensor in tensors.iter().filter(|tensor| is_statistic(&tensor.name)) {
            let kept = if tensor.name.ends_with("mean") { 0.0 } else { 1.0 };
            if checkpoint.tensor(&tensor.name)?.iter().any(|value| *value != kept) {
                return Err(refuse(format!(
                    "{} is not {kept} everywhere; batch-norm statistics are not supported",
                    tensor.name
                )));
            }
        }
        tensors.retain(|tensor| !is_statistic(&tensor.name));
        let parameters = Parameters::of(checkpoint, &tensors, dtype)?;
        Ok(PixelNerf { architecture, parameters, is_frozen: true })
    }

    /// The network of a checkpoint, to be trained further, with `levels` levels of the trunk if it has fewer. New
    /// levels are as in a new network, and the point network's weights for them are zero: what it says is the same at
    /// first.
    pub(crate) fn continued(
        checkpoint: &Checkpoint,
        levels: usize,
        dtype: DType,
        seed: u64,
    ) -> std::result::Result<PixelNerf, TrainError> {
        let old = PixelNerf { is_frozen: false, ..PixelNerf::frozen(checkpoint, dtype)? };
        if levels <= old.architecture.levels.len() {
            return Ok(old);
        }
        let new = PixelNerf::new(old.architecture.clone().with_levels(levels), dtype, seed)?;
        for (name, variable) in new.parameters.iter() {
            let Ok(values) = old.parameters.get(name) else { continue };
            // Only the layers for latents have other shapes: more columns.
            let more = variable.dim(D::Minus1)? - values.dim(D::Minus1)?;
            variable.set(&values.pad_with_zeros(D::Minus1, 0, more)?)?;
        }
        Ok(new)
    }

    /// Its tensors and metadata.
    pub(crate) fn checkpoint(&self) -> Result<Contents> {
        let mut tensors = self.parameters.values()?;
        for tensor in self.architecture.tensors().into_iter().filter(|tensor| is_statistic(&tensor.name)) {
            let kept = if tensor.name.ends_with("mean") { 0.0 } else { 1.0 };
            let values = vec![kept; tensor.shape.iter().product()];
            tensors.push((tensor, values));
        }
        Ok((tensors, self.architecture.metadata()))
    }

    fn sizes(&self) -> PointNetworkSizes {
        let Architecture { width, block_count, injected_count, .. } = self.architecture;
        PointNetworkSizes { embedded_len: self.architecture.embedded_len(), width, block_count, injected_count }
    }

    /// A convolution with its batch norm.
    fn normalised(
        &self,
        images: &Tensor,
        convolution: &str,
        norm: &str,
        window: Window,
        is_first: bool,
    ) -> Result<Tensor> {
        let get = |name: &str, leaf: &str| self.parameters.get(&format!("encoder.model.{name}.{leaf}"));
        let scale = (get(norm, "weight")? / (1.0 + VARIANCE_FLOOR).sqrt())?;
        let weights = get(convolution, "weight")?.broadcast_mul(&scale.reshape((scale.dim(0)?, 1, 1, 1))?)?;
        convolve(images, &weights, window, !is_first)?.broadcast_add(get(norm, "bias")?)
    }

    /// The outputs of `lin_z` for pictures `[image][row][column][3]` in `[-1, 1]`:
    /// `[image][row][column][block][width]`, half as many rows and columns.
    pub(crate) fn grids(&self, pictures: &Tensor) -> Result<Tensor> {
        let stem = Window { size: 7, stride: 2, padding: 3, dilation: 1 };
        let first = self.normalised(pictures, "conv1", "bn1", stem, true)?.relu()?;
        let [count, height, width, mut channels] = dims4(&first)?;
        let mut levels = vec![first.clone()];
        let mut image = max_pool(&first)?;
        for (level, sizes) in (1..).zip(&self.architecture.levels) {
            for block in 0..sizes.block_count {
                let name = format!("layer{level}.{block}");
                let stride = if level > 1 && block == 0 { 2 } else { 1 };
                let window = Window { stride, ..Window::same(3) };
                let inside =
                    self.normalised(&image, &format!("{name}.conv1"), &format!("{name}.bn1"), window, false)?;
                let inside = inside.relu()?;
                let (conv2, bn2) = (format!("{name}.conv2"), format!("{name}.bn2"));
                let inside = self.normalised(&inside, &conv2, &bn2, Window::same(3), false)?;
                let beside = match block == 0 && has_shortcut(level, channels, sizes.channels) {
                    true => {
                        let window = Window { size: 1, stride, padding: 0, dilation: 1 };
                        let (name, norm) = (format!("{name}.downsample.0"), format!("{name}.downsample.1"));
                        self.normalised(&image, &name, &norm, window, false)?
                    }
                    false => image,
                };
                image = (inside + beside)?.relu()?;
                channels = sizes.channels;
            }
            levels.push(image.clone());
        }
        let layers = |leaf: &str| -> Result<Tensor> {
            let names = (0..self.architecture.injected_count).map(|block| format!("mlp_coarse.lin_z.{block}.{leaf}"));
            Tensor::cat(&names.map(|name| self.parameters.get(&name)).collect::<Result<Vec<_>>>()?, 0)
        };
        // Layers and enlargement are linear: each level goes through its columns while it is small.
        let (weights, mut first_channel) = (layers("weight")?, 0);
        let mut added = None;
        for level in &levels {
            let [_, rows, columns, channels] = dims4(level)?;
            let part = weights.narrow(1, first_channel, channels)?.t()?.contiguous()?;
            let mapped = level.contiguous()?.reshape((count * rows * columns, channels))?.matmul(&part)?;
            added = Some(match added {
                None => mapped.broadcast_add(&layers("bias")?)?.reshape((count, height, width, ()))?,
                Some(added) => add_enlarged(&added, &mapped.reshape((count, rows, columns, ()))?)?,
            });
            first_channel += channels;
        }
        Ok(added.unwrap_or_else(|| unreachable!("the stem is the first level")))
    }

    /// The point network's parameters in the order of [`PointNetworkSizes::parameter_count`].
    fn point_parameters(&self) -> Result<Tensor> {
        let mut names = vec!["lin_in".to_owned()];
        for block in 0..self.architecture.block_count {
            names.extend([0, 1].map(|layer| format!("blocks.{block}.fc_{layer}")));
        }
        names.push("lin_out".to_owned());
        let mut all = Vec::new();
        for name in names {
            for leaf in ["weight", "bias"] {
                all.push(self.parameters.get(&format!("mlp_coarse.{name}.{leaf}"))?.flatten_all()?);
            }
        }
        Tensor::cat(&all, 0)
    }

    /// Densities and colours at points `[object][point]`: `[object and point][4]`, without rectification and logistic
    /// function.
    fn raw(&self, network: &PointInputs<'_>, points: &[Vec<RayPoint>]) -> Result<Tensor> {
        let [_, height, width, _] = dims4(network.grids)?;
        let Architecture { frequency_count, frequency, pixel_centre, .. } = self.architecture;
        let embed = EmbedBlock { point_count: 0, frequency_count: frequency_count as u32, frequency };
        let points = Arc::new(Points::new(network.cameras, points, &embed, [height, width], pixel_centre));
        let operation =
            PointNetwork { sizes: self.sizes(), points, node_count: height * width, is_frozen: self.is_frozen };
        network.grids.apply_op3(network.weights, network.parameters, Apply(operation))
    }

    /// The colours of a batch's rays, `[object and ray][3]` in `[0, 1]`, over white, with weights `[object][view]` of
    /// the views. The samples of both passes are differentiated, the depths of the second are not.
    pub(crate) fn render(&self, batch: &Batch, weights: &Tensor, draw: &Draw, counts: SampleCounts) -> Result<Tensor> {
        let (mut grids, mut parameters) = (self.grids(&batch.pictures)?, self.point_parameters()?);
        if self.is_frozen {
            (grids, parameters) = (grids.detach(), parameters.detach());
        }
        let seen = PointInputs { cameras: &batch.cameras, grids: &grids, weights, parameters: &parameters };
        let rays = batch.rays[0].len();
        let share = |object: usize, purpose: Purpose| {
            move |ray: usize, sample: usize| draw.uniform(purpose, ((object * rays + ray) << 7) + sample)
        };
        let coarse: Vec<Vec<f32>> = batch
            .rays
            .iter()
            .enumerate()
            .map(|(object, rays)| coarse_depths(rays, counts.coarse, share(object, Purpose::Samples)))
            .collect();
        let (mut raw, mut lengths) = self.sampled(&seen, batch, &coarse)?;
        if counts.fine > 0 {
            let weights = sample_weights(&density(&raw.detach(), &lengths)?, &lengths)?.to_dtype(DType::F32)?;
            let weights = weights.flatten_all()?.to_vec1::<f32>()?;
            let fine: Vec<Vec<f32>> = (0..coarse.len())
                .map(|object| {
                    let weights = &weights[object * rays * counts.coarse..][..rays * counts.coarse];
                    let share = share(object, Purpose::FineSamples);
                    fine_depths(&batch.rays[object], counts.coarse, weights, counts.fine, share)
                })
                .collect();
            // The first pass's samples are the second's too: what the network says there is known.
            let (more, _) = self.sampled(&seen, batch, &fine)?;
            let (order, depths) = merged(&coarse, &fine, rays);
            let order = Tensor::from_vec(order, raw.dim(0)? + more.dim(0)?, &Device::Cpu)?;
            raw = Tensor::cat(&[&raw, &more], 0)?.index_select(&order, 0)?;
            lengths = sample_lengths(batch, &depths, raw.dtype())?;
        }
        let weights = sample_weights(&density(&raw, &lengths)?, &lengths)?;
        let colours = logistic(&raw.narrow(1, 0, 3)?)?.reshape((lengths.dim(0)?, lengths.dim(1)?, 3))?;
        let sum = weights.unsqueeze(1)?.matmul(&colours)?.squeeze(1)?;
        // The remaining transmittance is white.
        sum.broadcast_add(&(1.0 - weights.sum_keepdim(1)?)?)
    }

    /// The network's outputs at samples `[object and ray and sample][4]`, and their lengths `[object and ray][sample]`.
    fn sampled(&self, seen: &PointInputs<'_>, batch: &Batch, depths: &[Vec<f32>]) -> Result<(Tensor, Tensor)> {
        let points: Vec<Vec<RayPoint>> =
            batch.rays.iter().zip(depths).map(|(rays, depths)| points(rays, depths)).collect();
        let raw = self.raw(seen, &points)?;
        let lengths = sample_lengths(batch, depths, raw.dtype())?;
        Ok((raw, lengths))
    }
}

/// The lengths `[object and ray][sample]` of samples at depths `[object][ray][sample]`.
fn sample_lengths(batch: &Batch, depths: &[Vec<f32>], dtype: DType) -> Result<Tensor> {
    let all = batch.rays.iter().zip(depths).flat_map(|(rays, depths)| points(rays, depths));
    let lengths: Vec<f32> = all.map(|point| point.length).collect();
    let rays = batch.rays.len() * batch.rays[0].len();
    let count = lengths.len() / rays;
    Tensor::from_vec(lengths, (rays, count), &Device::Cpu)?.to_dtype(dtype)
}

/// The point network's inputs.
struct PointInputs<'a> {
    cameras: &'a [Vec<viewfuse_core::camera::CameraBlock>],
    grids: &'a Tensor,
    weights: &'a Tensor,
    parameters: &'a Tensor,
}

fn density(raw: &Tensor, lengths: &Tensor) -> Result<Tensor> {
    raw.narrow(1, 3, 1)?.reshape(lengths.shape())
}

/// `1 / (1 + e^-x)`.
fn logistic(values: &Tensor) -> Result<Tensor> {
    (values.neg()?.exp()? + 1.0)?.recip()
}

/// Factor of He's deviation: the last layer starts with small outputs.
fn gain(name: &str) -> f32 {
    if name.ends_with("lin_out.weight") { 0.1 } else { 1.0 }
}
