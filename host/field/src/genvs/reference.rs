//! Parts of a render one at a time, on inputs given from outside: what reference values are compared with.

use super::feature_image::Views;
use super::looking::Looking;
use super::sampling::{Plan, Start};
use super::{Architecture, Genvs, Prepared};
use crate::{Field, FieldError};
use std::cell::Ref;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_job::progress::Silent;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::scratch::Scratch;
use viewfuse_scene::photographs::SourceImages;

/// Sources on a device, with the network.
pub struct Reference<'a, D: Device> {
    field: &'a Genvs,
    device: &'a D,
    prepared: Prepared<D>,
}

impl<'a, D: Device> Reference<'a, D> {
    /// Takes sources and network to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn new(field: &'a Genvs, device: &'a D, sources: &SourceImages) -> Result<Self, FieldError> {
        let prepared = field.prepare(device, sources, &Silent)?;
        Ok(Reference { field, device, prepared })
    }

    /// The network's sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.field.architecture
    }

    /// Computes a view's volume, all of its rows, unless it is there already.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn encode(&self, view: usize) -> Result<(), FieldError> {
        let Reference { field, device, prepared } = self;
        field.encode_view(*device, prepared, view)?;
        if let Some(volume) = prepared.volumes[view].borrow_mut().as_mut() {
            prepared.parts.fill(*device, volume, 0..volume.row_count(), view)?;
        }
        device.finish().map_err(FieldError::Device)
    }

    /// A view's volume, `[row][column][depth][feature]`, depth 0 the farthest.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn volume(&self, view: usize) -> Result<Vec<f32>, FieldError> {
        self.encode(view)?;
        match &*self.prepared.volumes[view].borrow() {
            Some(volume) => volume.values(self.device).map_err(FieldError::Device),
            None => Ok(Vec::new()),
        }
    }

    /// Density (rectified) and features of points, `[point][1 + feature]`, from `looked_up[point][feature]`.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn points(&self, looked_up: &[f32]) -> Result<Vec<f32>, FieldError> {
        let Reference { device, prepared, .. } = self;
        let network = prepared.parts.points();
        let features = network.features as usize;
        let count = looked_up.len() / features;
        let run = || {
            let mut raw = device.zeros(count * (features + 1))?;
            let mut hidden = network.hidden(*device, count)?;
            network.run(*device, count as u32, &device.upload(looked_up)?, &mut hidden, &mut raw)?;
            device.download(&raw)
        };
        let mut values = run().map_err(FieldError::Device)?;
        for (values, given) in values.chunks_exact_mut(features + 1).zip(looked_up.chunks_exact(features)) {
            values[0] = values[0].max(0.0);
            values[1..].iter_mut().zip(given).for_each(|(value, given)| *value += given);
        }
        Ok(values)
    }

    /// The features `[row][column][feature]` that a target of the network's size sees, with these weights of all views.
    /// Depths along principal axes; `ray_length` as [`super::Rays::length`].
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn features(
        &self,
        weights: &[f32],
        target: &CameraBlock,
        near_far: [f32; 2],
        ray_length: f32,
    ) -> Result<Vec<f32>, FieldError> {
        let Reference { field, device, prepared } = self;
        let failed = FieldError::Device;
        let rays = field.options.rays;
        let looking = Looking {
            near_far,
            sample_count: rays.sample_count,
            jitter: rays.jitter,
            seed: field.options.plan.seed,
            ray_length,
            inclusive: rays.inclusive,
        };
        let all: Vec<usize> = (0..prepared.images.len()).collect();
        for view in &all {
            field.encode_view(*device, prepared, *view)?;
        }
        field.fill_seen(*device, prepared, &all, target, &looking)?;
        let volumes: Vec<Ref<'_, _>> = prepared.volumes.iter().map(|volume| volume.borrow()).collect();
        let cameras: Vec<CameraBlock> = prepared.images.iter().map(|image| image.camera).collect();
        let views = Views {
            cameras: device.upload(&cameras).map_err(failed)?,
            weights: device.upload(weights).map_err(failed)?,
            volumes: volumes.iter().filter_map(|volume| volume.as_ref()).collect(),
        };
        let mut scratch = Scratch::new(*device);
        let image = prepared.parts.features(*device, &mut scratch, &views, target, &looking, &Silent)?;
        device.download(&image.values).map_err(failed)
    }

    /// What the denoiser believes is behind a noisy picture `[row][column][3]` of a level, given features
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
        let Reference { device, prepared, .. } = self;
        let run = || {
            let mut scratch = Scratch::new(*device);
            let features = self.condition(&mut scratch, features, size)?;
            let noisy = device.upload(noisy)?;
            let mut denoised = device.zeros(size[0] as usize * size[1] as usize * super::COLOUR_CHANNELS)?;
            prepared.parts.denoise(*device, &mut scratch, &noisy, &features, level, &mut denoised)?;
            device.download(&denoised)
        };
        run().map_err(FieldError::Device)
    }

    /// The picture `[row][column][3]` in `[-1, 1]` that a plan makes of latents of variance 1, given features.
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
        let Reference { device, prepared, .. } = self;
        let failed = FieldError::Device;
        let mut scratch = Scratch::new(*device);
        let features = self.condition(&mut scratch, features, size).map_err(failed)?;
        let latents = device.upload(latents).map_err(failed)?;
        let (start, progress) = (Start::Latents(&latents), Silent);
        let sampled = prepared.parts.picture(*device, &mut scratch, &features, plan, start, &progress)?;
        device.download(&sampled.picture).map_err(failed)
    }

    /// How many sources there are.
    pub fn view_count(&self) -> usize {
        self.prepared.images.len()
    }

    fn condition(
        &self,
        scratch: &mut Scratch<'_, D>,
        features: &[f32],
        [height, width]: [u32; 2],
    ) -> Result<Image<D>, DeviceError> {
        Image::upload(
            scratch.device(),
            Size { height, width, channels: (features.len() as u32) / (height * width) },
            features,
        )
    }
}
