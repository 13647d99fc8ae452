//! The family of networks: which tensors a checkpoint must have, by its sizes.
//!
//! Names and shapes are those of the official `state_dict` (ViewAttention,
//! `genvs/cars/genvs/models/{genvs,genvs_encoder, pixel_nerf_net}.py` and `training/networks.py`). It has unused
//! tensors: all batch norms of the encoder are switched off, and a segmentation head remains from the network that the
//! encoder is based on. They are part of the architecture; their values are not read.
//!
//! Sizes are read from the tensors' names and shapes. Other sizes are the same in all members ([`ASPP_RATES`],
//! [`group_count`]), except the side of the images: it is part of the denoiser's names, and a checkpoint without
//! denoiser has it in its metadata.

mod denoiser;
mod encoder;

pub(super) use denoiser::PREFIX as DENOISER;
pub use denoiser::{Block, Convolution, Denoiser, DenoiserLevel, DenoiserStep, Estimate, Resampling, group_count};
pub use encoder::{ASPP_RATES, Encoder};
pub use viewfuse_nn::resnet::Level;

use std::collections::BTreeMap;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError, Sizes, TensorShape};

/// Channels of a picture.
pub const COLOUR_CHANNELS: usize = 3;

/// The metadata key of the images' side in a network without denoiser.
pub(super) const IMAGE_SIDE: &str = "viewfuse.image_side";
/// The prefix of the tensors of a learned weighting.
const WEIGHTING: &str = "pixel_nerf_net.cam_weighter.";
/// All keys of a checkpoint's metadata that are looked at.
pub const KEYS: [&str; 2] = [denoiser::ESTIMATE, IMAGE_SIDE];
/// The sides of an image are multiples of this, the encoder's output stride.
const ENCODER_STRIDE: usize = 16;

/// The prefix of the point network's tensors; a number follows.
pub const MLP: &str = "pixel_nerf_net.mlp.layers";

/// Sizes of a member of the family.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Architecture {
    /// Side of source images and pictures, pixels; the denoiser's where there is one. Volumes are as high and wide,
    /// feature images too, of half as many rays on a side.
    pub image_side: usize,
    /// From an image to a volume of features.
    pub encoder: Encoder,
    /// Width of both hidden layers of the point network, which computes a point's density and features.
    pub mlp_width: usize,
    /// From features and noise to a picture. Without one, the first three features are the picture's colours in
    /// `[-1, 1]`.
    pub denoiser: Option<Denoiser>,
}

impl Architecture {
    /// The published network.
    pub fn published() -> Architecture {
        let encoder = Encoder::published();
        Architecture {
            image_side: 128,
            mlp_width: 64,
            denoiser: Some(Denoiser::published(COLOUR_CHANNELS + encoder.feature_count)),
            encoder,
        }
    }

    /// A small member for machines without a GPU: images of half the side, a quarter of the encoder's widths, a
    /// denoiser of three levels. It has every kind of layer of the published network.
    pub fn small() -> Architecture {
        let encoder = Encoder::small();
        Architecture {
            image_side: 64,
            mlp_width: 32,
            denoiser: Some(Denoiser::small(COLOUR_CHANNELS + encoder.feature_count)),
            encoder,
        }
    }

    /// A member that is narrow enough for training on a single core: a denoiser whose first level has `width` channels
    /// (a multiple of 4), an encoder that has twice as many behind its trunk, and volumes of half as many depths as the
    /// small one's.
    pub fn narrow(image_side: usize, width: usize) -> Architecture {
        let encoder = Encoder::narrow(2 * width);
        Architecture {
            image_side,
            mlp_width: 32,
            denoiser: Some(Denoiser::narrow(image_side, COLOUR_CHANNELS + encoder.feature_count, width)),
            encoder,
        }
    }

    /// What is assumed of a network whose tensors and metadata leave something open, as warnings: what its denoiser starts
    /// from, but of the published sizes, and without a denoiser the side of its images. And what of it is not used: a
    /// learned weighting.
    pub fn assumptions(&self, checkpoint: &Checkpoint) -> Vec<String> {
        let (path, says) = (checkpoint.path().display(), |key: &str| checkpoint.metadata().contains_key(key));
        let mut assumptions = Vec::new();
        if self.denoiser.is_some() && !says(denoiser::ESTIMATE) && *self != Architecture::published() {
            assumptions.push(format!(
                "{path}: what its tensors do not tell is assumed to be as in the published GeNVS, whose denoiser does \
                 not begin with the features' colours; have `viewfuse convert` write {} = published into it, or \
                 colours, as the laboratory's networks have it",
                denoiser::ESTIMATE
            ));
        }
        if self.denoiser.is_none() && !says(IMAGE_SIDE) {
            assumptions.push(format!(
                "{path}: what its tensors do not tell is assumed to be as in the published GeNVS, which has images of {} \
                 pixels on a side; have `viewfuse convert` write {IMAGE_SIDE} into it",
                self.image_side
            ));
        }
        if checkpoint.shapes().keys().any(|name| name.starts_with(WEIGHTING)) {
            assumptions.push(format!("{path}: the weighting of views that it learned, {WEIGHTING}*, is not used"));
        }
        assumptions
    }

    /// Reads the sizes from a checkpoint's tensors, and checks that it has every tensor of the architecture and no
    /// other.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family.
    pub fn of(checkpoint: &Checkpoint) -> Result<Architecture, CheckpointError> {
        let sizes = Sizes::new(checkpoint, "GeNVS");
        let feature_count = sizes.size(&format!("{MLP}.0.weight"), 2, 1)?;
        let mlp_width = sizes.size(&format!("{MLP}.0.weight"), 2, 0)?;
        let encoder = Encoder::of(&sizes, feature_count)?;
        let has_colours = feature_count >= COLOUR_CHANNELS;
        let has_denoiser = checkpoint.shapes().keys().any(|name| name.starts_with("denoiser."));
        let denoiser = if has_denoiser { Some(Denoiser::of(&sizes)?) } else { None };
        match &denoiser {
            Some(denoiser) if denoiser.in_channels != COLOUR_CHANNELS + feature_count => {
                return Err(sizes.refuse(format!(
                    "the denoiser takes {} channels, not {COLOUR_CHANNELS} colours and the {feature_count} features of \
                        a point",
                    denoiser.in_channels
                )));
            }
            Some(denoiser) if denoiser.estimate == Estimate::FromColours && !has_colours => {
                return Err(sizes.refuse(format!(
                    "the denoiser starts from colours, and the {feature_count} features of a point cannot be a colour"
                )));
            }
            None if !has_colours => {
                return Err(sizes.refuse(format!(
                    "it has no denoiser, and the {feature_count} features of a point cannot be a colour"
                )));
            }
            _ => {}
        }
        let told = image_side(&sizes)?;
        let image_side = match &denoiser {
            Some(Denoiser { image_side, .. }) if told.is_some_and(|told| told != *image_side) => {
                return Err(sizes.refuse(format!(
                    "its metadata says {IMAGE_SIDE} = {}, and its denoiser has images of {image_side} pixels",
                    told.unwrap_or_default()
                )));
            }
            Some(denoiser) => denoiser.image_side,
            None => told.unwrap_or(Architecture::published().image_side),
        };
        if image_side % ENCODER_STRIDE != 0 {
            return Err(sizes.refuse(format!(
                "images of {image_side} pixels on a side; the encoder takes multiples of {ENCODER_STRIDE}"
            )));
        }
        // Numbers of a volume are counted in 32 bits.
        let numbers = image_side as u64 * image_side as u64 * (encoder.feature_count * encoder.volume_depth) as u64;
        if numbers > u64::from(u32::MAX) {
            return Err(sizes.refuse(format!("a volume of {numbers} numbers; the limit is {}", u32::MAX)));
        }
        let architecture = Architecture { image_side, encoder, mlp_width, denoiser };
        checkpoint.check(&architecture.tensors(), |name| architecture.is_optional(name))?;
        architecture.check_filters(&sizes)?;
        Ok(architecture)
    }

    /// All of its tensors, in the order of the data.
    pub fn tensors(&self) -> Vec<TensorShape> {
        let mut tensors = self.encoder.tensors();
        let features = self.encoder.feature_count;
        let mlp = [(features, self.mlp_width), (self.mlp_width, self.mlp_width), (self.mlp_width, 1 + features)];
        for (layer, (in_count, out_count)) in mlp.into_iter().enumerate() {
            with_bias(&mut tensors, &format!("{MLP}.{layer}"), &[out_count, in_count]);
        }
        tensors.extend(self.denoiser.iter().flat_map(|denoiser| denoiser.tensors()));
        tensors
    }

    /// Sizes in a checkpoint's metadata that its tensors do not determine.
    pub fn metadata(&self) -> BTreeMap<String, String> {
        match &self.denoiser {
            Some(denoiser) => denoiser.metadata(),
            None => BTreeMap::from([(IMAGE_SIDE.to_owned(), self.image_side.to_string())]),
        }
    }

    /// Optional tensors of official checkpoints: counters, the filters with which the denoiser halves and
    /// doubles images (all means of four pixels, see [`Architecture::check_filters`]), its input for augmented training
    /// images, and parameters of a learned weighting.
    fn is_optional(&self, name: &str) -> bool {
        name.ends_with(".num_batches_tracked")
            || self.is_filter(name)
            || self.denoiser.is_some() && name == "denoiser.model.map_augment.weight"
            || name.starts_with(WEIGHTING)
    }

    fn is_filter(&self, name: &str) -> bool {
        self.denoiser.is_some() && name.starts_with(denoiser::PREFIX) && name.ends_with(".resample_filter")
    }

    /// Rejects a denoiser whose resampling filter is not the mean of 2x2 pixels.
    fn check_filters(&self, sizes: &Sizes<'_>) -> Result<(), CheckpointError> {
        const MEAN: [f32; 4] = [0.25; 4];
        for (name, shape) in sizes.checkpoint().shapes().iter().filter(|(name, _)| self.is_filter(name)) {
            // The shape first: it says how much there is to read.
            if *shape != [1, 1, 2, 2] || sizes.checkpoint().tensor(name)? != MEAN {
                return Err(sizes.refuse(format!(
                    "{name}, of shape {shape:?}, is not the mean of 2x2 pixels; denoisers with other filters are not \
                        supported"
                )));
            }
        }
        Ok(())
    }

    /// Numbers in all its tensors, unused ones included.
    pub fn parameter_count(&self) -> usize {
        self.tensors().iter().map(|tensor| tensor.shape.iter().product::<usize>()).sum()
    }
}

/// The side of the images that the metadata says.
fn image_side(sizes: &Sizes<'_>) -> Result<Option<usize>, CheckpointError> {
    let Some(text) = sizes.checkpoint().metadata().get(IMAGE_SIDE) else { return Ok(None) };
    match text.parse() {
        Ok(side @ 1..=4096) => Ok(Some(side)),
        _ => {
            Err(sizes
                .refuse(format!("its metadata says {IMAGE_SIDE} = '{text}', which is not a number from 1 to 4096")))
        }
    }
}

/// A layer: its weight, and a bias for each of its outputs, the weight's first axis.
fn with_bias(tensors: &mut Vec<TensorShape>, name: &str, shape: &[usize]) {
    tensors.push(TensorShape { name: format!("{name}.weight"), shape: shape.to_vec() });
    tensors.push(TensorShape { name: format!("{name}.bias"), shape: shape[..1].to_vec() });
}
