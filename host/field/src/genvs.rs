//! GeNVS with weighted views, on any device: volumes of features, a feature image, a diffusion denoiser; the
//! mathematics is in [`viewfuse_kernels::genvs`], [`viewfuse_kernels::network`], [`viewfuse_core::schedule`] and
//! [`viewfuse_core::sampler`].
//!
//! Source: Chan et al., "Generative novel view synthesis with 3D-aware diffusion models" (2023), and the code of "Pay
//! Attention to Where You Looked". The views are combined with weights; the published network takes their mean.

mod architecture;
mod denoiser;
mod encoder;
mod feature_image;
mod memory;
mod open;
mod options;
mod parts;
mod ray_sampling;
pub mod reference;
pub mod sampling;
pub mod test_networks;
mod variants;
mod views;
mod volume;

pub use architecture::MLP;
pub use architecture::{
    ASPP_RATES, Architecture, Block, COLOUR_CHANNELS, Convolution, Denoiser, DenoiserLevel, DenoiserStep, Encoder,
    Estimate, KEYS, Level, Resampling, group_count,
};
pub use feature_image::{LAST_LENGTH, cast_block, ray_length};
pub(crate) use open::ROW;
pub use options::{GenvsOptions, Omissions, Rays};

use super::learned::{Distance, NoDepths, usual_near_far};
use super::rounding::Overflow;
use super::{About, AnyOptions, Field, FieldError, Prepared, SourceSide};
use encoder::SIDE_STEP;
use parts::Parts;
use std::sync::Arc;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::rows::Kernel;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_scene::photographs::{SourceImage, SourceImages};
use views::{Counts, SourceView, Views, padded};

/// A GeNVS with its parameters, ready for any device.
pub struct Genvs {
    architecture: Architecture,
    checkpoint: Arc<Checkpoint>,
    options: GenvsOptions,
}

impl Genvs {
    /// The network of a checkpoint. Names and shapes are checked here; each [`Field::prepare`] reads the parameters, so
    /// that they are in memory once.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family.
    pub fn new(checkpoint: Checkpoint, options: GenvsOptions) -> Result<Genvs, CheckpointError> {
        let architecture = Architecture::of(&checkpoint)?;
        Ok(Genvs { architecture, checkpoint: Arc::new(checkpoint), options: options.checked() })
    }

    /// Its sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Its settings.
    pub fn options(&self) -> GenvsOptions {
        self.options
    }

    /// The same network with other settings.
    pub fn with_options(&self, options: GenvsOptions) -> Genvs {
        let Genvs { architecture, checkpoint, .. } = self;
        let (architecture, checkpoint) = (architecture.clone(), Arc::clone(checkpoint));
        Genvs { architecture, checkpoint, options: options.checked() }
    }

    /// The most bytes that a run from sources of these widths and heights takes, beside photographs and pictures.
    pub fn memory_estimate<D: Device>(&self, device: &D, source_sizes: &[[u32; 2]]) -> u64 {
        memory::estimate(device, &self.architecture, &self.options, source_sizes)
    }

    /// Rows and columns of pictures are multiples of this, because the denoiser halves them at each level and rays are
    /// cast at half the resolution.
    fn picture_step(&self) -> u32 {
        self.architecture.denoiser.as_ref().map_or(2, |denoiser| 1 << denoiser.levels.len().saturating_sub(1).max(1))
    }

    /// Takes photographs and parameters to a device.
    fn views<'a, D: Device>(&'a self, device: &'a D, sources: &SourceImages) -> Result<Views<'a, D>, FieldError> {
        let usual_near_far = usual_near_far(Distance::of(sources).length);
        // A volume of no depth has no nodes to look up.
        NoDepths::check(self.options.rays.near_far.unwrap_or(usual_near_far)).map_err(FieldError::unsuitable)?;
        let images: Vec<SourceView> = sources.images.iter().map(padded).collect();
        let side = images.iter().map(|image| image.size.height.min(image.size.width)).min().unwrap_or(SIDE_STEP);
        let size = |image: &SourceImage| [image.camera.pinhole.width(), image.camera.pinhole.height()];
        Ok(Views {
            field: self,
            device,
            parts: Parts::load(device, &self.checkpoint, &self.architecture, side)?,
            volumes: images.iter().map(|_| None).collect(),
            images,
            usual_near_far,
            source_sizes: sources.images.iter().map(size).collect(),
            earlier: None,
            options: self.options,
            error: f32::INFINITY,
            features: None,
            counts: Counts::default(),
            overflow: Overflow::default(),
            rounding: Vec::new(),
        })
    }
}

/// Those of a picture, in the order of their first use.
const KERNELS: [Kernel; 16] = [
    Kernel::Convolve,
    Kernel::Linear,
    Kernel::MaxPool,
    Kernel::ConvolveDepthwise,
    Kernel::ChannelMeans,
    Kernel::Upsample,
    Kernel::ConvolveTransposed,
    Kernel::FindNonFinite,
    Kernel::GatherVolume,
    Kernel::WeighFeatures,
    Kernel::SumFeatures,
    Kernel::DenoiserInput,
    Kernel::GroupNormPartials,
    Kernel::GroupNorm,
    Kernel::MatrixProduct,
    Kernel::SoftmaxRows,
];

impl Field for Genvs {
    fn about(&self) -> About {
        let side = self.architecture.image_side as u32;
        About {
            source_side: SourceSide::Pixels(side),
            longest_side: side,
            kernels: &KERNELS,
            has_surfaces: false,
            ..About::new(ROW.name)
        }
    }

    fn options(&self) -> AnyOptions {
        AnyOptions::new(self.options)
    }

    fn prepare<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        self.architecture.assumptions(&self.checkpoint).iter().for_each(|assumption| progress.warn(assumption));
        if self.options.rays.near_far.is_none() {
            Distance::of(sources).warn_of_guess(progress);
        }
        if sources.background != [1.0; 3] {
            progress.warn("this network renders over white; a ground truth over another background differs by that");
        }
        let views = self.views(device, sources)?;
        let trained = self.architecture.image_side as u32;
        if views.images.iter().any(|image| image.size.height.max(image.size.width) != trained) {
            progress
                .warn(&format!("the network was trained on images of {trained} pixels on a side; these are smaller"));
        }
        Ok(Box::new(views))
    }
}
