//! The parts of a render on given inputs, for comparison with reference values.

use super::ray_sampling::RaySampling;
use super::sampling::{Plan, Start};
use super::views::Views;
use super::{Architecture, Genvs};
use crate::FieldError;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_job::progress::Progress;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::scratch::Scratch;
use viewfuse_scene::photographs::SourceImages;

/// Sources on a device, with the network.
pub struct Reference<'a, D: Device> {
    views: Views<'a, D>,
    progress: &'a dyn Progress,
}

impl<'a, D: Device> Reference<'a, D> {
    /// Takes sources and network to the device. Long work checks `progress` for cancellation.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn new(
        field: &'a Genvs,
        device: &'a D,
        sources: &SourceImages,
        progress: &'a dyn Progress,
    ) -> Result<Self, FieldError> {
        Ok(Reference { views: field.views(device, sources)?, progress })
    }

    /// The network's sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.views.field.architecture
    }

    /// Computes a view's volume with all rows, if it is not computed yet.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn encode(&mut self, view: usize) -> Result<(), FieldError> {
        self.encode_rowless(view)?;
        self.views.fill(view, |volume| 0..volume.row_count())?;
        Ok(self.views.device.finish()?)
    }

    /// A view's volume, `[row][column][depth][feature]`, depth 0 the farthest.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn volume(&mut self, view: usize) -> Result<Vec<f32>, FieldError> {
        self.encode(view)?;
        match &self.views.volumes[view] {
            Some(volume) => Ok(volume.values(self.views.device)?),
            None => Ok(Vec::new()),
        }
    }

    /// Density (rectified) and features of points, `[point][1 + feature]`, from `looked_up[point][feature]`.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn points(&self, looked_up: &[f32]) -> Result<Vec<f32>, FieldError> {
        let Views { device, parts, .. } = &self.views;
        let network = parts.points();
        let features = network.features as usize;
        let count = looked_up.len() / features;
        let mut raw = device.zeros(count * (features + 1))?;
        let mut hidden = network.hidden(*device, count)?;
        network.run(*device, count as u32, &device.upload(looked_up)?, &mut hidden, &mut raw)?;
        let mut values = device.download(&raw)?;
        for (values, given) in values.chunks_exact_mut(features + 1).zip(looked_up.chunks_exact(features)) {
            values[0] = values[0].max(0.0);
            values[1..].iter_mut().zip(given).for_each(|(value, given)| *value += given);
        }
        Ok(values)
    }

    /// The feature image `[row][column][feature]` of a target of the network's size, with these weights of all views.
    /// Depths are along principal axes; `ray_length` as [`super::Rays::length`].
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn features(
        &mut self,
        weights: &[f32],
        target: &CameraBlock,
        near_far: [f32; 2],
        ray_length: f32,
    ) -> Result<Vec<f32>, FieldError> {
        let field = self.views.field;
        let rays = field.options.rays;
        let ray_sampling = RaySampling {
            near_far,
            sample_count: rays.sample_count,
            jitter: rays.jitter,
            seed: field.options.plan.seed,
            ray_length,
            inclusive: rays.inclusive,
        };
        let all: Vec<usize> = (0..self.view_count()).collect();
        for view in &all {
            self.encode_rowless(*view)?;
        }
        self.views.fill_seen(&all, target, &ray_sampling)?;
        let Views { device, parts, .. } = &self.views;
        let views = self.views.used(&all, weights)?;
        let mut scratch = Scratch::new(*device);
        let image = parts.features(*device, &mut scratch, &views, target, &ray_sampling, self.progress)?;
        Ok(device.download(&image.values)?)
    }

    /// The denoiser's estimate of the picture behind a noisy one `[row][column][3]` of a level, given features
    /// `[row][column][feature]` of a picture of this many rows and columns.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn denoised(
        &self,
        noisy: &[f32],
        features: &[f32],
        size: [u32; 2],
        level: f32,
    ) -> Result<Vec<f32>, FieldError> {
        let Views { device, parts, .. } = &self.views;
        let mut scratch = Scratch::new(*device);
        let features = self.condition(&mut scratch, features, size)?;
        let condition = parts.condition(*device, &mut scratch, &features)?;
        let noisy = device.upload(noisy)?;
        let mut denoised = device.zeros(size[0] as usize * size[1] as usize * super::COLOUR_CHANNELS)?;
        parts.denoise(*device, &mut scratch, &noisy, &condition, level, &mut denoised)?;
        Ok(device.download(&denoised)?)
    }

    /// The picture `[row][column][3]` in `[-1, 1]` that a plan computes from latents of variance 1, given features.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn sampled(
        &self,
        latents: &[f32],
        features: &[f32],
        size: [u32; 2],
        plan: &Plan,
    ) -> Result<Vec<f32>, FieldError> {
        let Views { device, parts, .. } = &self.views;
        let mut scratch = Scratch::new(*device);
        let features = self.condition(&mut scratch, features, size)?;
        let latents = device.upload(latents)?;
        let start = Start::Latents(&latents);
        let sampled = parts.picture(*device, &mut scratch, &features, plan, start, self.progress)?;
        Ok(device.download(&sampled.picture)?)
    }

    /// The number of sources.
    pub fn view_count(&self) -> usize {
        self.views.images.len()
    }

    /// Encodes a view, without the rows of its volume, if it is not encoded yet.
    fn encode_rowless(&mut self, view: usize) -> Result<(), FieldError> {
        self.progress.check()?;
        if self.views.volumes[view].is_none() {
            self.views.encode_view(view)?;
        }
        Ok(())
    }

    fn condition(
        &self,
        scratch: &mut Scratch<'_, D>,
        features: &[f32],
        [height, width]: [u32; 2],
    ) -> Result<Image<D>, DeviceError> {
        let size = Size { height, width, channels: (features.len() as u32) / (height * width) };
        Image::upload(scratch.device(), size, features)
    }
}
