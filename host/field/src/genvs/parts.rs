//! The network's parts on a device and their evaluation. NaN and infinity are reported at the part that produced them.

use super::architecture::{Architecture, COLOUR_CHANNELS, Estimate};
use super::denoiser::{Calls, Denoiser};
use super::encoder::Encoder;
use super::feature_image::{PointNetwork, Views, render};
use super::ray_sampling::RaySampling;
use super::sampling::{Accuracy, Plan, Sampled, Start, root_mean_square, sample};
use super::volume::Volume;
use crate::FieldError;
use crate::finite::{check_finite, check_finite_on, download_finite};
use std::ops::Range;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::sampler::{Mix, NoiseBlock};
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::{Device, DeviceError, Precision};
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
    denoiser: Option<(Denoiser<D>, Estimate)>,
}

/// What a denoiser is given beside the noisy picture.
pub(super) struct Condition<'a, D: Device> {
    features: &'a Image<D>,
    /// The colours that the features show, `[row][column][3]` in `[-1, 1]`, for [`Estimate::FromColours`].
    colours: Option<D::Buffer<f32>>,
}

impl<D: Device> Parts<D> {
    /// Loads them, for images of at least `side` rows and columns.
    pub(super) fn load(
        device: &D,
        checkpoint: &Checkpoint,
        architecture: &Architecture,
        side: u32,
    ) -> Result<Parts<D>, FieldError> {
        let loader = |prefix| Loader::new(device, checkpoint, prefix);
        let features = architecture.encoder.feature_count;
        let denoiser = architecture
            .denoiser
            .as_ref()
            .map(|denoiser| Denoiser::load(&loader(""), side, denoiser).map(|loaded| (loaded, denoiser.estimate)));
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
        let Some((denoiser, _)) = &self.denoiser else {
            let colours = leading_channels(scratch, features, COLOUR_CHANNELS as u32)?;
            return Ok(Sampled {
                picture: colours.values,
                levels: Vec::new(),
                left_out: 0,
                accuracy: Accuracy::default(),
            });
        };
        let condition = self.condition(device, scratch, features)?;
        let start = match (start, &condition.colours) {
            (Start::Noise, Some(picture)) if plan.from_colours => {
                Start::Picture { picture, level: plan.schedule.level(0, 2) }
            }
            (start, _) => start,
        };
        let mut calls = Calls::new(denoiser, scratch, features.size)?;
        let sampled = sample(device, plan, count, start, progress, |noisy, level, denoised| {
            Ok(denoise(device, &mut calls, noisy, &condition, level, denoised)?)
        })?;
        calls.end();
        Ok(sampled)
    }

    /// What a precision changes in the denoiser's estimate of a picture behind noise of the plan's largest level: the
    /// root mean square over the values, from -1 to 1. There the estimate is the network's output alone, and errors
    /// are largest. What it is compared with is in two parts, which is exact beside f16, or exact.
    pub(super) fn rounding(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        features: &Image<D>,
        plan: &Plan,
        precision: Precision,
    ) -> Result<f32, FieldError> {
        let Some((denoiser, _)) = &self.denoiser else { return Ok(0.0) };
        let condition = self.condition(device, scratch, features)?;
        let (level, count) = (plan.schedule.level(0, 2), features.size.pixel_count() as usize * COLOUR_CHANNELS);
        let block = NoiseBlock { seed: [plan.seed as u32, (plan.seed >> 32) as u32], stream: 0, scale: level };
        let mut noisy = device.zeros(count)?;
        device.add_noise(&block, count as u32, &device.zeros(count)?, &mut noisy)?;
        let finer = if precision == Precision::Half { Precision::TwoHalves } else { Precision::Exact };
        let mut estimates = Vec::new();
        for precision in [precision, finer] {
            scratch.precision = precision;
            let mut denoised = device.zeros(count)?;
            let mut calls = Calls::new(denoiser, scratch, features.size)?;
            denoise(device, &mut calls, &noisy, &condition, level, &mut denoised)?;
            calls.end();
            estimates.push(download_finite(device, &denoised, "trying a precision", "denoised picture")?);
        }
        let changes: Vec<f32> = estimates[0].iter().zip(&estimates[1]).map(|(a, b)| a - b).collect();
        Ok(root_mean_square(&changes))
    }

    /// The denoiser's condition for a feature image.
    pub(super) fn condition<'a>(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        features: &'a Image<D>,
    ) -> Result<Condition<'a, D>, DeviceError> {
        let mut colours = None;
        if matches!(self.denoiser, Some((_, Estimate::FromColours))) {
            let first = leading_channels(scratch, features, COLOUR_CHANNELS as u32)?;
            let count = features.size.pixel_count() as usize * COLOUR_CHANNELS;
            let white = device.upload(&vec![1.0; count])?;
            let mut shown = device.zeros(count)?;
            let mix = Mix { state: 1.0, results: [-1.0, 0.0, 0.0, 0.0] };
            device.mix_pictures(&mix, count as u32, &white, &first.values, &white, &white, &white, &mut shown)?;
            scratch.recycle(first);
            colours = Some(shown);
        }
        Ok(Condition { features, colours })
    }

    /// The denoiser's estimate of the picture behind a noisy one of a level. Without a denoiser, nothing is written.
    pub(super) fn denoise(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        noisy: &D::Buffer<f32>,
        condition: &Condition<'_, D>,
        level: f32,
        denoised: &mut D::Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let Some((denoiser, _)) = &self.denoiser else { return Ok(()) };
        let mut calls = Calls::new(denoiser, scratch, condition.features.size)?;
        denoise(device, &mut calls, noisy, condition, level, denoised)
    }
}

/// The denoiser's estimate of the picture behind a noisy one of a level; see [`Estimate`].
fn denoise<D: Device>(
    device: &D,
    calls: &mut Calls<'_, '_, D>,
    noisy: &D::Buffer<f32>,
    condition: &Condition<'_, D>,
    level: f32,
    denoised: &mut D::Buffer<f32>,
) -> Result<(), DeviceError> {
    let at = Preconditioning::at(level);
    let output = calls.run(noisy, condition.features, &at)?;
    let (count, unused) = (output.size.pixel_count() * output.size.channels, noisy);
    let (colours, of_colours) = match &condition.colours {
        // Cancels only where the share is invisible.
        Some(colours) => (colours, 1.0 - at.skip),
        None => (unused, 0.0),
    };
    let mix = Mix { state: at.skip, results: [at.output, of_colours, 0.0, 0.0] };
    device.mix_pictures(&mix, count, noisy, &output.values, colours, unused, unused, denoised)
}

/// The stage's name in errors.
fn encoding(view: usize) -> String {
    format!("encoding source {view}")
}
