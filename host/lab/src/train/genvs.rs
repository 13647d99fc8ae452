//! GeNVS as a differentiable graph: the family of [`viewfuse_field::genvs`]. Volumes from pictures, feature images from
//! volumes, pictures from features and noise.

mod denoiser;
mod encoder;
mod layers;
#[cfg(test)]
mod tests;
mod views;

pub(crate) use views::{ObjectViews, ViewCounts};

use super::TrainError;
use super::images::enlarge;
use super::operations::{Apply, MarchSizes, MarchVolumes, SampledRays};
use super::parameters::{Contents, Parameters, fan_in, random};
use candle_core::{DType, Device, Result, Tensor};
use layers::Layers;
use std::collections::BTreeSet;
use std::sync::Arc;
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::rays::cast_ray;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_field::genvs::{Architecture, Estimate, LAST_LENGTH, MLP, cast_block, ray_length};
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};

/// The prefix of the encoder's tensors.
const ENCODER: &str = "pixel_nerf_net.encoder.";
/// Initial density of all space: low, so that most samples have a weight and every sample a gradient.
const FIRST_DENSITY: f32 = 2.0;
/// Factor of the deviation of the density's weights: surfaces have densities of 10 and more.
const DENSITY_GAIN: f32 = 4.0;

/// The network with its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Genvs {
    pub(crate) architecture: Architecture,
    pub(crate) parameters: Parameters,
    /// Whether only the views' weights are differentiated.
    pub(crate) is_frozen: bool,
}

/// Names of unused tensors: those of switched-off batch norms, and of an unused head.
fn unused(tensors: &[TensorShape]) -> BTreeSet<String> {
    let norms: Vec<&str> = tensors.iter().filter_map(|tensor| tensor.name.strip_suffix("running_mean")).collect();
    let is_unused = |name: &str| {
        name.contains(".segmentation_head.")
            || norms.iter().any(|norm| name.strip_prefix(norm).is_some_and(|leaf| !leaf.contains('.')))
    };
    tensors.iter().map(|tensor| tensor.name.clone()).filter(|name| is_unused(name)).collect()
}

impl Genvs {
    /// Initial parameters: He's initialisation in front of rectifications, zero in the last layers of residual
    /// branches, as published for the denoiser, whose other layers without a norm in front copy their inputs.
    pub(crate) fn new(architecture: Architecture, dtype: DType, seed: u64) -> std::result::Result<Genvs, TrainError> {
        let parameters = Parameters::new(&used(&architecture), dtype, |tensor| {
            Ok(denoiser::handed_on(&architecture, tensor).unwrap_or_else(|| first_values(tensor, seed)))
        })?;
        Ok(Genvs { architecture, parameters, is_frozen: false })
    }

    /// A trained network, which is not changed.
    pub(crate) fn frozen(checkpoint: &Checkpoint, side: u32, dtype: DType) -> std::result::Result<Genvs, TrainError> {
        let architecture = Architecture::of(checkpoint)?;
        let refuse = |reason: String| Err(TrainError::Checkpoint { path: checkpoint.path().to_path_buf(), reason });
        if architecture.denoiser.is_none() {
            return refuse("it has no denoiser".to_owned());
        }
        let expected = architecture.image_side;
        if expected != side as usize {
            return refuse(format!("it is for pictures of {expected}x{expected} pixels, not of {side}x{side}"));
        }
        let parameters = Parameters::of(checkpoint, &used(&architecture), dtype)?;
        Ok(Genvs { architecture, parameters, is_frozen: true })
    }

    /// Its tensors and metadata. Unused tensors are zero.
    pub(crate) fn checkpoint(&self) -> Result<Contents> {
        let mut tensors = self.parameters.values()?;
        let all = self.architecture.tensors();
        let unused = unused(&all);
        for tensor in all.into_iter().filter(|tensor| unused.contains(&tensor.name)) {
            let values = vec![0.0; tensor.shape.iter().product()];
            tensors.push((tensor, values));
        }
        Ok((tensors, self.architecture.metadata()))
    }

    fn layers<'a>(&'a self, prefix: &'a str) -> Layers<'a> {
        Layers { parameters: &self.parameters, prefix, is_frozen: self.is_frozen }
    }

    /// Volumes `[image][row][column][depth and feature]` of pictures `[image][row][column][3]` in `[-1, 1]`.
    pub(crate) fn volumes(&self, pictures: &Tensor) -> Result<Tensor> {
        encoder::volumes(self.layers(ENCODER), &self.architecture.encoder, pictures)
    }

    /// The feature images `[object and target][row][column][feature]` of targets with weights `[object][view]` of the
    /// views, from volumes `[object and view]`, with the samples of the block.
    pub(crate) fn features(
        &self,
        volumes: &Tensor,
        weights: &Tensor,
        views: &ObjectViews,
        samples: &CoarseBlock,
    ) -> Result<Tensor> {
        let side = self.architecture.image_side;
        let sizes = MarchSizes {
            volume: [side, side, self.architecture.encoder.volume_depth],
            features: self.architecture.encoder.feature_count,
            width: self.architecture.mlp_width,
        };
        let object_rays = |object: usize| {
            let near_far @ [near, far] = views.near_far[object];
            let cast = |target| {
                let cast = cast_block(target, near_far, samples.sample_count);
                (0..cast.camera.width * cast.camera.height).map(move |pixel| cast_ray(&cast, pixel))
            };
            SampledRays {
                cameras: views.cameras[object].clone(),
                rays: views.targets[object].iter().flat_map(cast).collect(),
                near_far,
                length_scale: ray_length(&views.targets[object][0]) / (far - near),
            }
        };
        let objects_rays: Vec<SampledRays> = (0..views.cameras.len()).map(object_rays).collect();
        let target_count = objects_rays.len() * views.targets[0].len();
        let operation = MarchVolumes {
            sizes,
            objects_rays: Arc::new(objects_rays),
            samples: *samples,
            last_length: LAST_LENGTH,
            inclusive: true,
            is_frozen: self.is_frozen,
        };
        let seen = volumes.contiguous()?.apply_op3(weights, &self.point_parameters()?, Apply(operation))?;
        enlarge(&seen.reshape((target_count, side / 2, side / 2, sizes.features))?, side, side)
    }

    /// The parameters of the point network in the order of [`MarchSizes::parameter_count`].
    fn point_parameters(&self) -> Result<Tensor> {
        let layers = self.layers(MLP);
        let mut all = Vec::new();
        for layer in 0..3 {
            for leaf in ["weight", "bias"] {
                all.push(layers.get(&format!(".{layer}.{leaf}"))?.flatten_all()?);
            }
        }
        Tensor::cat(&all, 0)
    }

    /// The denoiser's network `F` on noisy pictures `[image][row][column][3]`, each at its own level, with their
    /// features. Its estimate of the pictures is `c_skip noisy + c_out F`, see [`Preconditioning`].
    pub(crate) fn network(&self, noisy: &Tensor, features: &Tensor, at: &[Preconditioning]) -> Result<Tensor> {
        let Some(sizes) = &self.architecture.denoiser else { candle_core::bail!("the network has no denoiser") };
        let scales = each(at.iter().map(|at| at.input), noisy)?;
        let inputs = Tensor::cat(&[noisy, features], 3)?.broadcast_mul(&scales)?;
        let levels: Vec<f32> = at.iter().map(|at| at.noise).collect();
        denoiser::run(self.layers(""), sizes, &inputs, &levels)
    }

    /// What the denoiser's estimate of the pictures behind noisy ones is without its network; see [`Estimate`].
    pub(crate) fn without_network(&self, noisy: &Tensor, features: &Tensor, at: &[Preconditioning]) -> Result<Tensor> {
        let skipped = noisy.broadcast_mul(&each(at.iter().map(|at| at.skip), noisy)?)?;
        match self.architecture.denoiser.as_ref().map(|denoiser| denoiser.estimate) {
            Some(Estimate::FromColours) => {
                let share = each(at.iter().map(|at| 1.0 - at.skip), noisy)?;
                skipped + colours(features)?.broadcast_mul(&share)?
            }
            _ => Ok(skipped),
        }
    }

    /// The denoiser's estimate of the pictures behind noisy ones.
    pub(crate) fn denoised(&self, noisy: &Tensor, features: &Tensor, at: &[Preconditioning]) -> Result<Tensor> {
        let output = self.network(noisy, features, at)?.broadcast_mul(&each(at.iter().map(|at| at.output), noisy)?)?;
        output + self.without_network(noisy, features, at)?
    }

    /// The network of a checkpoint, to be trained further: with a new denoiser of this kind, or with its own.
    pub(crate) fn continued(
        checkpoint: &Checkpoint,
        side: u32,
        new_denoiser: Option<Estimate>,
        dtype: DType,
        seed: u64,
    ) -> std::result::Result<Genvs, TrainError> {
        let old = Genvs { is_frozen: false, ..Genvs::frozen(checkpoint, side, dtype)? };
        let Some(estimate) = new_denoiser else { return Ok(old) };
        let mut architecture = old.architecture.clone();
        if let Some(denoiser) = &mut architecture.denoiser {
            denoiser.estimate = estimate;
        }
        let new = Genvs::new(architecture, dtype, seed)?;
        for (name, variable) in new.parameters.iter().filter(|(name, _)| !name.starts_with("denoiser.")) {
            variable.set(old.parameters.get(name)?)?;
        }
        Ok(new)
    }
}

/// The picture `[image][row][column][3]` in `[-1, 1]` of the first features: they are its difference from white.
pub(crate) fn colours(features: &Tensor) -> Result<Tensor> {
    1.0 - features.narrow(3, 0, 3)?
}

/// A number for each image, in a shape for products with images.
pub(crate) fn each(values: impl Iterator<Item = f32>, images: &Tensor) -> Result<Tensor> {
    let values: Vec<f32> = values.collect();
    let count = values.len();
    Tensor::from_vec(values, (count, 1, 1, 1), &Device::Cpu)?.to_dtype(images.dtype())
}

/// The used tensors.
fn used(architecture: &Architecture) -> Vec<TensorShape> {
    let mut tensors = architecture.tensors();
    let unused = unused(&tensors);
    tensors.retain(|tensor| !unused.contains(&tensor.name));
    tensors
}

fn first_values(tensor: &TensorShape, seed: u64) -> Vec<f32> {
    let TensorShape { name, shape } = tensor;
    let count: usize = shape.iter().product();
    let is_denoiser = name.starts_with("denoiser.");
    let is_last_of_points = name.starts_with(&format!("{MLP}.2."));
    // The last layers of residual blocks, of attention and of the denoiser: zero at first.
    let zero = if is_denoiser {
        [".conv1.weight", ".proj.weight", "_aux_conv.weight"].iter().any(|end| name.ends_with(end))
    } else {
        name.ends_with(".conv2.weight")
    };
    if name.ends_with(".bias") && is_last_of_points {
        return (0..count).map(|index| if index == 0 { FIRST_DENSITY } else { 0.0 }).collect();
    }
    if name.ends_with(".bias") || zero {
        return vec![0.0; count];
    }
    if shape.len() == 1 {
        // A norm.
        return vec![1.0; count];
    }
    // An output pixel of a transposed convolution depends on a single place of every input channel.
    let inputs = if name.contains("upconv") { shape[0] } else { fan_in(tensor) };
    let gain = match () {
        () if name.ends_with(".qkv.weight") => 0.2,
        () if is_denoiser || is_last_of_points => 1.0,
        () => 2.0,
    };
    let mut values = random(tensor, seed, (gain / inputs as f32).sqrt());
    if is_last_of_points {
        // The density's outputs come first.
        values[..shape[1]].iter_mut().for_each(|value| *value *= DENSITY_GAIN);
        values[shape[1]..].iter_mut().for_each(|value| *value *= 0.1);
    }
    values
}
