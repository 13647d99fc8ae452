//! GeNVS with weighted views, on any device: volumes of features, a feature image, a diffusion denoiser; the mathematics is
//! in [`viewfuse_core::genvs`], [`viewfuse_core::network`], [`viewfuse_core::schedule`] and [`viewfuse_core::sampler`].
//!
//! Source: Chan et al., "Generative novel view synthesis with 3D-aware diffusion models" (2023), and the code of "Pay
//! Attention to Where You Looked". The views are combined by weights where the published network takes their mean.

mod architecture;
mod denoiser;
mod encoder;
mod feature_image;
mod looking;
mod memory;
mod options;
mod parts;
pub mod reference;
pub mod sampling;
pub mod test_networks;
mod volume;

pub use architecture::MLP;
pub use architecture::{
    ASPP_RATES, Architecture, Block, COLOUR_CHANNELS, Convolution, Denoiser, DenoiserLevel, DenoiserStep, Encoder,
    Level, Resampling, group_count,
};
pub use feature_image::{LAST_LENGTH, cast_block, ray_length};
pub use options::{GenvsOptions, Omissions, Rays};

use super::learned::{default_near_far, over_white};
use super::{Denoising, Field, FieldError, LeftOut, Rendered};
use encoder::SIDE_STEP;
use feature_image::Views;
use looking::Looking;
use parts::Parts;
use sampling::Start;
use std::cell::{Ref, RefCell};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_nn::image::Size;
use viewfuse_nn::scratch::Scratch;
use viewfuse_scene::photographs::{SourceImage, SourceImages};
use viewfuse_weighting::sources::SourceWeights;
use volume::Volume;

/// A GeNVS with its parameters, ready for any device.
pub struct Genvs {
    architecture: Architecture,
    checkpoint: Arc<Checkpoint>,
    options: GenvsOptions,
    counts: Mutex<Counts>,
}

/// What was done and what was left out so far.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    views: u64,
    encoded_views: u64,
    volume_rows: u64,
    filled_rows: u64,
    /// As they are computed.
    volume_bytes: u64,
    /// As they are kept.
    kept_bytes: u64,
    planned_calls: u64,
    calls: u64,
}

/// Photographs and parameters on a device.
pub struct Prepared<D: Device> {
    parts: Parts<D>,
    images: Vec<SourceView>,
    /// `[view]`: encoded when a target first uses the view.
    volumes: Vec<RefCell<Option<Volume<D>>>>,
    near_far: [f32; 2],
    /// The last frame's picture, and its size.
    earlier: RefCell<Option<(Size, D::Buffer<f32>)>>,
}

/// A source as the encoder is shown it: over white, with rows and columns added until it can be halved often enough.
struct SourceView {
    size: Size,
    values: Vec<f32>,
    camera: CameraBlock,
}

impl Genvs {
    /// The network of a checkpoint: its names and shapes are checked here, its parameters are read by every
    /// [`Field::prepare`], so that they are in memory once.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not of this family.
    pub fn new(checkpoint: Checkpoint, options: GenvsOptions) -> Result<Genvs, CheckpointError> {
        let architecture = Architecture::of(&checkpoint)?;
        let checkpoint = Arc::new(checkpoint);
        Ok(Genvs { architecture, checkpoint, options: options.checked(), counts: Mutex::default() })
    }

    /// Its sizes.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Its settings.
    pub fn options(&self) -> GenvsOptions {
        self.options
    }

    /// The same network with other settings, and nothing counted yet.
    pub fn with_options(&self, options: GenvsOptions) -> Genvs {
        Genvs {
            architecture: self.architecture.clone(),
            checkpoint: Arc::clone(&self.checkpoint),
            options: options.checked(),
            counts: Mutex::default(),
        }
    }

    /// Rows and columns of pictures are multiples of this: so often the denoiser halves them, and rays are cast at half
    /// the resolution.
    fn picture_step(&self) -> u32 {
        self.architecture.denoiser.as_ref().map_or(2, |denoiser| 1 << denoiser.levels.len().saturating_sub(1).max(1))
    }

    /// The views that a target with these weights asks about.
    fn used_views<D: Device>(&self, prepared: &Prepared<D>, weights: &SourceWeights) -> Vec<usize> {
        let all = !self.options.omissions.unused_views;
        (0..prepared.images.len()).filter(|view| all || weights.get(*view as u32) > 0.0).collect()
    }

    fn encode_view<D: Device>(&self, device: &D, prepared: &Prepared<D>, view: usize) -> Result<(), FieldError> {
        let mut volume = prepared.volumes[view].borrow_mut();
        if volume.is_none() {
            let SourceView { size, values, .. } = &prepared.images[view];
            let mut encoded = prepared.parts.encode(device, values, *size, view)?;
            let (row_count, whole_bytes) = (encoded.row_count(), encoded.byte_count());
            let mut filled_rows = 0;
            if self.options.omissions.half_volumes {
                // One view after the other: never is more than one there in full.
                filled_rows = prepared.parts.fill(device, &mut encoded, 0..row_count, view)?;
                encoded.pack(device).map_err(FieldError::Device)?;
            }
            let mut counts = self.counts();
            counts.encoded_views += 1;
            counts.volume_rows += u64::from(row_count);
            counts.filled_rows += u64::from(filled_rows);
            counts.volume_bytes += whole_bytes;
            counts.kept_bytes += encoded.byte_count();
            *volume = Some(encoded);
        }
        Ok(())
    }

    /// Computes the rows of volumes that a target looks at.
    fn fill_seen<D: Device>(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        used: &[usize],
        target: &CameraBlock,
        looking: &Looking,
    ) -> Result<(), FieldError> {
        for view in used {
            let mut volume = prepared.volumes[*view].borrow_mut();
            let Some(volume) = volume.as_mut() else { continue };
            let rows = match self.options.omissions.unseen_rows {
                true => volume.rows_seen(&prepared.images[*view].camera, target, looking),
                false => 0..volume.row_count(),
            };
            let new_rows = prepared.parts.fill(device, volume, rows, *view)?;
            self.counts().filled_rows += u64::from(new_rows);
        }
        Ok(())
    }

    /// How rays go through volumes, for a target.
    ///
    /// # Errors
    /// [`FieldError::NoDepths`] if there is nothing between their ends: a volume of no depth has no nodes to look up.
    fn looking<D: Device>(&self, near_far: [f32; 2], target: &Camera) -> Result<Looking, FieldError> {
        let [near, far] = near_far;
        // Not the other way round: NaN is no depth either.
        if !(near < far && (far - near).is_finite()) {
            return Err(FieldError::NoDepths { near, far });
        }
        let Rays { sample_count, jitter, length, inclusive, .. } = self.options.rays;
        let focal = 2.0 * target.pinhole.focal()[1] / target.pinhole.height() as f32;
        let ray_length = length.unwrap_or(1.0 / focal);
        Ok(Looking { near_far, sample_count, jitter, seed: self.options.plan.seed, ray_length, inclusive })
    }

    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<D: Device> Field<D> for Genvs {
    type Prepared = Prepared<D>;
    type Latents = ();

    fn name(&self) -> &'static str {
        "genvs"
    }

    fn least_sources(&self) -> usize {
        1
    }

    fn source_side(&self, _picture_side: u32) -> u32 {
        self.architecture.image_side as u32
    }

    fn longest_side(&self) -> u32 {
        self.architecture.image_side as u32
    }

    fn denoising(&self) -> Option<Denoising> {
        let Counts { planned_calls, calls, .. } = *self.counts();
        let has_denoiser = self.architecture.denoiser.is_some();
        has_denoiser.then(|| self.options.denoising(calls, planned_calls.saturating_sub(calls)))
    }

    fn memory_estimate(&self, device: &D, source_sizes: &[[u32; 2]]) -> Option<u64> {
        Some(memory::estimate(device, &self.architecture, &self.options, source_sizes))
    }

    fn prepare(&self, device: &D, sources: &SourceImages, progress: &dyn Progress) -> Result<Prepared<D>, FieldError> {
        let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
        let near_far = self.options.rays.near_far.unwrap_or_else(|| default_near_far(&cameras));
        let images: Vec<SourceView> = sources.images.iter().map(padded).collect();
        let side = images.iter().map(|image| image.size.height.min(image.size.width)).min().unwrap_or(SIDE_STEP);
        self.counts().views += images.len() as u64;
        if sources.background != [1.0; 3] {
            progress.warn("this network's pictures are over white; truths over another background differ by that");
        }
        let trained = self.architecture.image_side as u32;
        if images.iter().any(|image| image.size.height.max(image.size.width) != trained) {
            progress
                .warn(&format!("the network was trained on images of {trained} pixels on a side; these are smaller"));
        }
        Ok(Prepared {
            parts: Parts::load(device, &self.checkpoint, &self.architecture, side)?,
            volumes: images.iter().map(|_| RefCell::new(None)).collect(),
            images,
            near_far,
            earlier: RefCell::new(None),
        })
    }

    fn encode(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        _relevance: &[SourceWeights],
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        if self.options.omissions.unused_views {
            return Ok(());
        }
        progress.expect(prepared.images.len());
        for view in 0..prepared.images.len() {
            progress.check()?;
            self.encode_view(device, prepared, view)?;
            progress.step();
        }
        device.finish().map_err(FieldError::Device)
    }

    fn encode_used(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        (): &(),
        weights: &SourceWeights,
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        let encoded_views = self.counts().encoded_views;
        for view in self.used_views(prepared, weights) {
            progress.check()?;
            self.encode_view(device, prepared, view)?;
        }
        if self.counts().encoded_views > encoded_views {
            device.finish().map_err(FieldError::Device)?;
        }
        Ok(())
    }

    fn render(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        (): &(),
        weights: &SourceWeights,
        target: &Camera,
        _settled: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let failed = FieldError::Device;
        let looking = self.looking::<D>(prepared.near_far, target)?;
        self.encode_used(device, prepared, &(), weights, progress)?;
        let used = self.used_views(prepared, weights);
        let cameras: Vec<CameraBlock> = used.iter().map(|view| prepared.images[*view].camera).collect();
        let view_weights: Vec<f32> = used.iter().map(|view| weights.get(*view as u32)).collect();
        let size = Size {
            height: target.pinhole.height().next_multiple_of(self.picture_step()),
            width: target.pinhole.width().next_multiple_of(self.picture_step()),
            channels: COLOUR_CHANNELS as u32,
        };
        let camera = CameraBlock { height: size.height, width: size.width, ..target.block(0) };
        self.fill_seen(device, prepared, &used, &camera, &looking)?;
        let volumes: Vec<Ref<'_, Option<Volume<D>>>> =
            used.iter().map(|view| prepared.volumes[*view].borrow()).collect();
        let views = Views {
            cameras: device.upload(&cameras).map_err(failed)?,
            weights: device.upload(&view_weights).map_err(failed)?,
            volumes: volumes.iter().filter_map(|volume| volume.as_ref()).collect(),
        };
        let mut scratch = Scratch::new(device);
        let features = prepared.parts.features(device, &mut scratch, &views, &camera, &looking, progress)?;
        let sampled = {
            let earlier = prepared.earlier.borrow();
            let start = match (&*earlier, self.options.omissions.reuse) {
                (Some((of_size, picture)), Some(level)) if *of_size == size => Start::Picture { picture, level },
                _ => Start::Noise,
            };
            prepared.parts.picture(device, &mut scratch, &features, &self.options.plan, start, progress)?
        };
        let mut counts = self.counts();
        counts.calls += u64::from(sampled.call_count());
        counts.planned_calls += u64::from(sampled.call_count() + sampled.left_out);
        drop(counts);
        let values = device.download(&sampled.picture).map_err(failed)?;
        if self.options.omissions.reuse.is_some() {
            *prepared.earlier.borrow_mut() = Some((size, sampled.picture));
        }
        Ok(cropped(&values, size, target))
    }

    fn left_out(&self) -> Vec<LeftOut> {
        let Counts { views, encoded_views, volume_rows, filled_rows, volume_bytes, kept_bytes, planned_calls, calls } =
            *self.counts();
        let Omissions { unused_views, unseen_rows, reuse, half_volumes } = self.options.omissions;
        let line = |what, switch, left_out, of, cost| LeftOut { what, switch, left_out, of, cost };
        let ends = self.options.plan.settled.is_some();
        vec![
            line("encoded views", unused_views, views - encoded_views.min(views), views, "nothing"),
            line(
                "volume rows",
                unseen_rows && !half_volumes,
                volume_rows - filled_rows.min(volume_rows),
                volume_rows,
                "nothing",
            ),
            line(
                "volume bytes",
                half_volumes,
                volume_bytes - kept_bytes.min(volume_bytes),
                volume_bytes,
                "2^-11 of a feature",
            ),
            line(
                "denoiser calls",
                ends || reuse.is_some(),
                planned_calls - calls,
                planned_calls,
                "changes of a pixel that cannot be seen; what starting from the frame before costs, only a measurement tells",
            ),
        ]
    }
}

/// A source as the encoder is shown it, with white around its right and lower border.
fn padded(image: &SourceImage) -> SourceView {
    let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
    let size = Size {
        height: height.next_multiple_of(SIDE_STEP),
        width: width.next_multiple_of(SIDE_STEP),
        channels: COLOUR_CHANNELS as u32,
    };
    let mut values = vec![1.0; size.pixel_count() as usize * COLOUR_CHANNELS];
    let rows = values.chunks_exact_mut(size.width as usize * COLOUR_CHANNELS);
    for (row, texels) in rows.zip(image.texels.chunks_exact(width as usize)) {
        for (value, texel) in row.chunks_exact_mut(COLOUR_CHANNELS).zip(texels) {
            value.copy_from_slice(&over_white(*texel));
        }
    }
    // Nothing moves: the image's pixels are where they were.
    SourceView { size, values, camera: CameraBlock { height: size.height, width: size.width, ..image.camera.block(0) } }
}

/// The target's part of a picture `[row][column][3]` in `[-1, 1]`; opaque, and without depth.
fn cropped(values: &[f32], size: Size, target: &Camera) -> Rendered {
    let (width, height) = (target.pinhole.width(), target.pinhole.height());
    let rows = values.chunks_exact(size.width as usize * COLOUR_CHANNELS).take(height as usize);
    let pixels = rows.flat_map(|row| row.chunks_exact(COLOUR_CHANNELS).take(width as usize));
    let colour = |pixel: &[f32]| {
        let [red, green, blue] = [0, 1, 2].map(|channel| (0.5 * (pixel[channel] + 1.0)).clamp(0.0, 1.0));
        [red, green, blue, 1.0]
    };
    let colours: Vec<[f32; 4]> = pixels.map(colour).collect();
    Rendered { depths: Vec::new(), colours, width, height }
}
