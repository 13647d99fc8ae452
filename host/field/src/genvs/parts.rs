//! The network's parts on a device and their evaluation. NaN and infinity are reported at the part that produced them.

use super::architecture::{Architecture, COLOUR_CHANNELS};
use super::denoiser::Denoiser;
use super::encoder::Encoder;
use super::feature_image::{PointNetwork, Views, render};
use super::ray_sampling::RaySampling;
use super::sampling::{Plan, Sampled, Start, sample};
use super::volume::Volume;
use crate::FieldError;
use crate::finite::{check_finite, check_finite_on};
use std::ops::Range;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::sampler::Mix;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_nn::convolution::leading_channels;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::scratch::Scratch;

/// The parts of a network.
pub(super) struct Parts<D: Device> {
    encoder: Encoder<D>,
    points: PointNetwork<D>,
    /// Without a denoiser, the first features are the picture.
    denoiser: Option<Denoiser<D>>,
}

impl<D: Device> Parts<D> {
    /// Loads them, for images of at least `side` rows and columns.
    ///
    /// # Errors
    /// If the checkpoint cannot be read, or the device has no memory left.
    pub(super) fn load(
        device: &D,
        checkpoint: &Checkpoint,
        architecture: &Architecture,
        side: u32,
    ) -> Result<Parts<D>, FieldError> {
        let loader = |prefix| Loader::new(device, checkpoint, prefix);
        let features = architecture.encoder.feature_count;
        let denoiser = architecture.denoiser.as_ref().map(|denoiser| {
            let sides: Vec<u32> =
                (0..denoiser.levels.len()).map(|level| (denoiser.image_side >> level) as u32).collect();
            Denoiser::load(&loader("denoiser.model."), side, &sides)
        });
        Ok(Parts {
            encoder: Encoder::load(&loader("pixel_nerf_net.encoder."), &architecture.encoder, side)?,
            points: PointNetwork::load(&loader("pixel_nerf_net."), features as u32, architecture.mlp_width as u32)?,
            denoiser: denoiser.transpose()?,
        })
    }

    /// A view's encoding, without the rows of its volume.
    pub(super) fn encode(&self, device: &D, values: &[f32], size: Size, view: usize) -> Result<Volume<D>, FieldError> {
        check_finite(values, &encoding(view), "image [row][column][3]")?;
        Ok(Volume::encode(device, &self.encoder, values, size)?)
    }

    /// Computes missing rows of a volume. Returns how many.
    pub(super) fn fill(
        &self,
        device: &D,
        volume: &mut Volume<D>,
        rows: Range<u32>,
        view: usize,
    ) -> Result<u32, FieldError> {
        let new_rows = volume.fill(device, &self.encoder, rows)?;
        if new_rows == 0 {
            return Ok(0);
        }
        let Some(image) = volume.image() else { return Ok(new_rows) };
        let count = image.size.pixel_count() * image.size.channels;
        check_finite_on(device, &image.values, count, &encoding(view), "volume [row][column][depth][feature]")?;
        Ok(new_rows)
    }

    /// A target's feature image.
    pub(super) fn features(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        views: &Views<'_, D>,
        target: &CameraBlock,
        ray_sampling: &RaySampling,
        progress: &dyn Progress,
    ) -> Result<Image<D>, FieldError> {
        render(device, scratch, &self.points, views, target, ray_sampling, progress)
    }

    /// The point network.
    pub(super) fn points(&self) -> &PointNetwork<D> {
        &self.points
    }

    /// The picture `[row][column][3]` in `[-1, 1]` for a feature image, with the calls of the denoiser that were made
    /// and left out.
    pub(super) fn picture(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        features: &Image<D>,
        plan: &Plan,
        start: Start<'_, D>,
        progress: &dyn Progress,
    ) -> Result<Sampled<D>, FieldError> {
        let count = features.size.pixel_count() as usize * COLOUR_CHANNELS;
        if self.denoiser.is_none() {
            let colours = leading_channels(scratch, features, COLOUR_CHANNELS as u32)?;
            return Ok(Sampled { picture: colours.values, levels: Vec::new(), left_out: 0 });
        }
        sample(device, plan, count, start, progress, |noisy, level, denoised| {
            Ok(self.denoise(device, scratch, noisy, features, level, denoised)?)
        })
    }

    /// The denoiser's estimate of the picture behind a noisy one of a level, given the features:
    /// `c_skip x + c_out F(c_in x)`. Without a denoiser, nothing is written.
    pub(super) fn denoise(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        noisy: &D::Buffer<f32>,
        features: &Image<D>,
        level: f32,
        denoised: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let Some(denoiser) = &self.denoiser else { return Ok(()) };
        let at = Preconditioning::at(level);
        let output = denoiser.run(scratch, noisy, features, &at)?;
        let mix = Mix { state: at.skip, results: [at.output, 0.0, 0.0, 0.0] };
        let (count, unused) = (output.size.pixel_count() * output.size.channels, noisy);
        device.mix_pictures(&mix, count, noisy, &output.values, unused, unused, unused, denoised)?;
        scratch.recycle(output);
        Ok(())
    }
}

/// The stage's name in errors.
fn encoding(view: usize) -> String {
    format!("encoding source {view}")
}
