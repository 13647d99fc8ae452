//! Source views on a device, with their volumes.

use super::encoder::SIDE_STEP;
use super::feature_image;
use super::memory;
use super::open::{CALLS, ROWS};
use super::parts::Parts;
use super::ray_sampling::RaySampling;
use super::sampling::Start;
use super::volume::Volume;
use super::{COLOUR_CHANNELS, Genvs, GenvsOptions, Omissions, Rays, variants};
use crate::enlarged::enlarged;
use crate::learned::{NoDepths, over_white};
use crate::rounding::Overflow;
use crate::variant::erased;
use crate::{AnyOptions, Check, Encoding, FieldError, LeftOut, Prepared, Record, Rendered, Request, Variant};
use std::ops::Range;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::{Device, DeviceError, Precision};
use viewfuse_job::progress::Progress;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::scratch::Scratch;
use viewfuse_scene::photographs::SourceImage;

/// Calls of the denoiser for a picture, about: what is worth it by the work of a picture.
const USUAL_CALLS: u64 = 16;

/// Photographs and parameters on a device, with the volumes of the views that are encoded.
pub(super) struct Views<'a, D: Device> {
    pub(super) field: &'a Genvs,
    pub(super) device: &'a D,
    pub(super) parts: Parts<D>,
    pub(super) images: Vec<SourceView>,
    /// `[view]`: none before it is encoded.
    pub(super) volumes: Vec<Option<Volume<D>>>,
    /// The bounds where the options state none.
    pub(super) usual_near_far: [f32; 2],
    /// Widths and heights of the sources.
    pub(super) source_sizes: Vec<[u32; 2]>,
    /// The last frame's picture, and its size.
    pub(super) earlier: Option<(Size, D::Buffer<f32>)>,
    pub(super) options: GenvsOptions,
    /// The estimated error of the last picture.
    pub(super) error: f32,
    /// The last frame's feature image: another run of the denoiser for the same frame uses it again.
    pub(super) features: Option<(FeatureKey, Image<D>)>,
    pub(super) counts: Counts,
    pub(super) overflow: Overflow,
    /// What precisions of the denoiser change in a picture, as far as it was measured.
    pub(super) rounding: Vec<(Precision, f32)>,
}

/// What a feature image depends on, for encoded views.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FeatureKey {
    camera: CameraBlock,
    views: Vec<usize>,
    weights: Vec<f32>,
    ray_sampling: RaySampling,
}

/// A source as the encoder's input: over white, padded to multiples of the encoder's output stride.
pub(super) struct SourceView {
    pub(super) size: Size,
    values: Vec<f32>,
    pub(super) camera: CameraBlock,
}

/// Counts of computed and omitted work so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    volume_rows: u64,
    filled_rows: u64,
    /// As computed.
    volume_bytes: u64,
    /// As kept.
    kept_bytes: u64,
    planned_calls: u64,
    calls: u64,
}

impl<D: Device> Views<'_, D> {
    /// Encodes a view.
    pub(super) fn encode_view(&mut self, view: usize) -> Result<(), FieldError> {
        let Views { device, parts, .. } = self;
        let SourceView { size, values, .. } = &self.images[view];
        let mut encoded = parts.encode(*device, values, *size, view)?;
        let (row_count, whole_bytes) = (encoded.row_count(), encoded.byte_count());
        let mut filled_rows = 0;
        if self.options.omissions.half_volumes {
            // One view after the other: at most one is in memory at full precision.
            filled_rows = parts.fill(*device, &mut encoded, 0..row_count, view)?;
            encoded.pack(*device)?;
        }
        self.features = None;
        self.counts.volume_rows += u64::from(row_count);
        self.counts.filled_rows += u64::from(filled_rows);
        self.counts.volume_bytes += whole_bytes;
        self.counts.kept_bytes += encoded.byte_count();
        self.volumes[view] = Some(encoded);
        Ok(())
    }

    /// Computes missing rows of a view's volume; nothing if it is not encoded.
    pub(super) fn fill(&mut self, view: usize, rows: impl FnOnce(&Volume<D>) -> Range<u32>) -> Result<(), FieldError> {
        let Some(volume) = &mut self.volumes[view] else { return Ok(()) };
        let rows = rows(volume);
        self.counts.filled_rows += u64::from(self.parts.fill(self.device, volume, rows, view)?);
        Ok(())
    }

    /// Computes the rows of volumes that a target's rays reach.
    pub(super) fn fill_seen(
        &mut self,
        views: &[usize],
        target: &CameraBlock,
        ray_sampling: &RaySampling,
    ) -> Result<(), FieldError> {
        let unseen_rows = self.options.omissions.unseen_rows;
        for &view in views {
            let camera = self.images[view].camera;
            self.fill(view, |volume| match unseen_rows {
                true => volume.rows_seen(&camera, target, ray_sampling),
                false => 0..volume.row_count(),
            })?;
        }
        Ok(())
    }

    /// Some of the views, with these weights.
    pub(super) fn used(&self, views: &[usize], weights: &[f32]) -> Result<feature_image::Views<'_, D>, DeviceError> {
        let cameras: Vec<CameraBlock> = views.iter().map(|view| self.images[*view].camera).collect();
        Ok(feature_image::Views {
            cameras: self.device.upload(&cameras)?,
            weights: self.device.upload(weights)?,
            volumes: views.iter().filter_map(|view| self.volumes[*view].as_ref()).collect(),
        })
    }

    /// What the denoiser's precision changes in a picture, root mean square of colours from 0 to 1: an estimate, made
    /// once. The run's own steps do not tell it.
    fn rounding(
        &mut self,
        precision: Precision,
        scratch: &mut Scratch<'_, D>,
        features: &Image<D>,
    ) -> Result<f32, FieldError> {
        if !self.device.rounds(precision) {
            return Ok(0.0);
        }
        if let Some((_, known)) = self.rounding.iter().find(|(of, _)| *of == precision) {
            return Ok(*known);
        }
        let error = match self.parts.rounding(self.device, scratch, features, &self.options.plan, precision) {
            Ok(change) => variants::rounding_error(change),
            // The picture itself is finite; what cannot be told is not promised.
            Err(FieldError::NotFinite(_)) => f32::INFINITY,
            Err(error) => return Err(error),
        };
        self.rounding.push((precision, error));
        Ok(error)
    }

    /// Near and far bounds.
    fn near_far(&self) -> [f32; 2] {
        self.options.rays.near_far.unwrap_or(self.usual_near_far)
    }

    /// The sampling of rays for a target.
    fn ray_sampling(&self, target: &Camera) -> RaySampling {
        let Rays { sample_count, jitter, length, inclusive, .. } = self.options.rays;
        let focal = 2.0 * target.pinhole.focal()[1] / target.pinhole.height() as f32;
        let ray_length = length.unwrap_or(1.0 / focal);
        let (near_far, seed) = (self.near_far(), self.options.plan.seed);
        RaySampling { near_far, sample_count, jitter, seed, ray_length, inclusive }
    }
}

impl<'a, D: Device> Prepared<'a> for Views<'a, D> {
    fn encoding(&self) -> Encoding {
        if self.options.omissions.unused_views { Encoding::Used } else { Encoding::All }
    }

    fn encode(&mut self, view: usize, _progress: &dyn Progress) -> Result<(), FieldError> {
        self.encode_view(view)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let (device, GenvsOptions { plan, omissions, divisor, .. }) = (self.device, self.options);
        let [width, height] = [request.camera.pinhole.width(), request.camera.pinhole.height()];
        // A camera that cannot be made so small is not changed.
        let small = request.camera.pinhole.resized(width.div_ceil(divisor), height.div_ceil(divisor));
        let target = &Camera { pinhole: small.unwrap_or(request.camera.pinhole), ..*request.camera };
        let ray_sampling = self.ray_sampling(target);
        let step = self.field.picture_step();
        let size = Size {
            height: target.pinhole.height().next_multiple_of(step),
            width: target.pinhole.width().next_multiple_of(step),
            channels: COLOUR_CHANNELS as u32,
        };
        let camera = CameraBlock { height: size.height, width: size.width, ..target.block(0) };
        let mut scratch = Scratch::new(device);
        let key = FeatureKey { camera, views: request.views.to_vec(), weights: request.view_weights(), ray_sampling };
        let features = match self.features.take() {
            Some((of, features)) if of == key => features,
            _ => {
                self.fill_seen(request.views, &camera, &ray_sampling)?;
                let views = self.used(request.views, &key.weights)?;
                self.parts.features(device, &mut scratch, &views, &camera, &ray_sampling, progress)?
            }
        };
        let start = || match (&self.earlier, omissions.reuse) {
            (Some((of_size, picture)), Some(level)) if *of_size == size => Start::Picture { picture, level },
            _ => Start::Noise,
        };
        let mut precision = self.overflow.limit(self.options.precision);
        scratch.precision = precision;
        let mut sampled = self.parts.picture(device, &mut scratch, &features, &plan, start(), progress);
        if Overflow::is_repeated(&sampled, precision) {
            precision = Precision::Exact;
            scratch.precision = precision;
            sampled = self.parts.picture(device, &mut scratch, &features, &plan, start(), progress);
            if sampled.is_ok() {
                self.overflow.tell(progress);
            }
        }
        let sampled = sampled?;
        let share = size.width.max(size.height) as f32 / self.field.architecture.image_side as f32;
        let of_steps = variants::error_of(&plan, sampled.accuracy, share);
        self.error = of_steps + self.rounding(precision, &mut scratch, &features)?;
        self.features = Some((key, features));
        self.counts.calls += u64::from(sampled.call_count());
        self.counts.planned_calls += u64::from(sampled.call_count() + sampled.left_out);
        let values = device.download(&sampled.picture)?;
        if omissions.reuse.is_some() {
            self.earlier = Some((size, sampled.picture));
        }
        Ok(enlarged(cropped(&values, size, target), [width, height]))
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        if let Some(options) = options.of::<GenvsOptions>().copied().map(GenvsOptions::checked) {
            self.options = options;
            NoDepths::check(self.near_far()).map_err(FieldError::unsuitable)?;
        }
        Ok(())
    }

    fn efforts(&self, options: &AnyOptions, pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        // They differ in the calls of the denoiser.
        let Some((options, denoiser)) = options.of().zip(self.field.architecture.denoiser.as_ref()) else {
            return Vec::new();
        };
        let precisions = self.device.precisions_for(USUAL_CALLS * denoiser.multiply_adds(pixel_count));
        erased(variants::efforts(options, denoiser.estimate, &precisions))
    }

    fn check(&self) -> Check {
        if self.field.architecture.denoiser.is_some() { Check::Steps } else { Check::Comparison }
    }

    fn error(&self) -> f32 {
        self.error
    }

    fn record(&self) -> Record {
        let Counts { volume_rows, filled_rows, volume_bytes, kept_bytes, planned_calls, calls } = self.counts;
        let Genvs { architecture, .. } = self.field;
        let Omissions { unseen_rows, reuse, half_volumes, .. } = self.options.omissions;
        let ends = self.options.plan.early_termination.is_some();
        let halves = LeftOut {
            what: "volume bytes",
            switch: half_volumes,
            left_out: volume_bytes - kept_bytes.min(volume_bytes),
            of: volume_bytes,
            typical_error: "2^-11 of a feature",
        };
        let left_out = vec![
            ROWS.left_out(unseen_rows && !half_volumes, volume_rows - filled_rows.min(volume_rows), volume_rows),
            halves,
            CALLS.left_out(ends || reuse.is_some(), planned_calls - calls, planned_calls),
        ];
        let has_denoiser = architecture.denoiser.is_some();
        let denoising = has_denoiser.then(|| self.options.denoising(calls, planned_calls.saturating_sub(calls)));
        let estimate = memory::estimate(self.device, architecture, &self.options, &self.source_sizes);
        let (memory_estimate, near_far) = (Some(estimate), Some(self.near_far()));
        Record { left_out, denoising, memory_estimate, near_far, notes: self.overflow.notes() }
    }
}

/// A source as the encoder's input, padded with white at its right and lower border.
pub(super) fn padded(image: &SourceImage) -> SourceView {
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
    // The padding does not move the image's pixels.
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
    Rendered { depths: Vec::new(), confidences: Vec::new(), colours, width, height }
}
