//! The field that needs no weights file, on any device; the mathematics is in [`viewfuse_core::photo`].

mod bounds;

use super::{Field, FieldError, Rendered};
use std::ops::Range;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::{NEIGHBOUR_REACH, SweepBlock, WINDOW_REACH};
use viewfuse_core::photo::{NO_SURFACE, ObjectBlock};
use viewfuse_device::{Device, PhotoScene, Pixels};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::sources::SourceWeights;

/// Rows rendered between two looks at the interrupt flag.
const BAND_ROWS: u32 = 16;
/// Rows around a band that its depths depend on: the window's and the neighbours' reach.
const HALO_ROWS: u32 = WINDOW_REACH + NEIGHBOUR_REACH;

/// Density from silhouettes and photo-consistency, colour by weighted fusion with visibility.
#[derive(Clone, Copy, Debug)]
pub struct PhotoField {
    /// Most values in each of the three buffers of a sweep. Larger pictures are swept in bands of rows, which changes
    /// the memory and the time but not the result.
    pub most_band_values: usize,
    /// Side of the sources as a share of the pictures', above 0: matching sources costs less and less as they shrink.
    pub source_share: f32,
}

impl Default for PhotoField {
    /// 16 Mi values: 256 MiB in all. Sources as large as the pictures.
    fn default() -> PhotoField {
        PhotoField { most_band_values: 16 << 20, source_share: 1.0 }
    }
}

/// Photographs on the device, with the object's box and where each pixel's ray enters the hull.
pub struct Prepared<D: Device> {
    scene: PhotoScene<D>,
    entries: D::Buffer<f32>,
    texel_count: usize,
    background: [f32; 3],
}

impl<D: Device> Field<D> for PhotoField {
    type Prepared = Prepared<D>;
    type Latents = D::Buffer<f32>;

    fn name(&self) -> &'static str {
        "photo"
    }

    fn least_sources(&self) -> usize {
        // One view shows no depth.
        2
    }

    fn source_side(&self, picture_side: u32) -> u32 {
        ((picture_side as f32 * self.source_share).round() as u32).max(1)
    }

    fn prepare(&self, device: &D, sources: &SourceImages, progress: &dyn Progress) -> Result<Prepared<D>, FieldError> {
        let (cameras, texels) = joined(sources);
        let object = bounds::find(&cameras, &texels).ok_or(FieldError::NoObject)?;
        let footprints: Vec<f32> = cameras.iter().map(|camera| footprint(&object, camera)).collect();
        let failed = FieldError::Device;
        let scene = PhotoScene {
            object,
            object_buffer: device.upload(&[object]).map_err(failed)?,
            views: device.upload(&cameras).map_err(failed)?,
            footprints: device.upload(&footprints).map_err(failed)?,
            texels: device.upload(&texels).map_err(failed)?,
            cameras,
        };
        let mut entries = device.zeros(texels.len()).map_err(failed)?;
        progress.expect(scene.cameras.len());
        for view in 0..object.view_count {
            progress.check()?;
            let PhotoScene { object_buffer, views, texels, cameras, .. } = &scene;
            let camera = &cameras[view as usize];
            let pixel_count = camera.width * camera.height;
            device.hull_entry(&view, pixel_count, object_buffer, views, texels, &mut entries).map_err(failed)?;
            progress.step();
        }
        device.finish().map_err(failed)?;
        Ok(Prepared { scene, entries, texel_count: texels.len(), background: sources.background })
    }

    fn encode(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        relevance: &[SourceWeights],
        progress: &dyn Progress,
    ) -> Result<D::Buffer<f32>, FieldError> {
        let scene = &prepared.scene;
        let PhotoScene { object_buffer: object, views, texels, .. } = scene;
        let view_count = scene.object.view_count;
        let failed = FieldError::Device;
        let pair_weights: Vec<f32> =
            relevance.iter().flat_map(|weights| weights.values()[..view_count as usize].iter().copied()).collect();
        let pair_weights = device.upload(&pair_weights).map_err(failed)?;
        // The widest of a sweep's three buffers is bound as a whole.
        let most_values = self.most_band_values.min(device.most_elements::<[f32; 2]>());
        let nothing = device.upload(&vec![NO_SURFACE; prepared.texel_count]).map_err(failed)?;
        let mut first_guess = device.zeros(prepared.texel_count).map_err(failed)?;
        let mut depths = device.zeros(prepared.texel_count).map_err(failed)?;
        progress.expect(view_count as usize);
        for view in 0..view_count {
            let camera = &scene.cameras[view as usize];
            let whole = SweepBlock::new(&scene.object, camera, view);
            for (sweep, kept_rows) in bands(whole, most_values) {
                progress.check()?;
                let count = (sweep.row_count * camera.width * sweep.plane_count) as usize;
                let mut costs = device.zeros(count).map_err(failed)?;
                let mut row_sums = device.zeros(count).map_err(failed)?;
                let mut means = device.zeros(count).map_err(failed)?;
                let entries = &prepared.entries;
                device.match_cost(&sweep, object, views, texels, entries, &pair_weights, &mut costs).map_err(failed)?;
                device.sum_row(&sweep, &costs, &mut row_sums).map_err(failed)?;
                device.mean_column(&sweep, &costs, &row_sums, &mut means).map_err(failed)?;
                device
                    .pick_depth(&sweep, 0, sweep.row_count, object, views, &means, entries, &nothing, &mut first_guess)
                    .map_err(failed)?;
                let (first, count) = (kept_rows.start, kept_rows.len() as u32);
                device
                    .pick_depth(&sweep, first, count, object, views, &means, entries, &first_guess, &mut depths)
                    .map_err(failed)?;
            }
            progress.step();
        }
        device.finish().map_err(failed)?;
        Ok(depths)
    }

    fn render(
        &self,
        device: &D,
        prepared: &Prepared<D>,
        depths: &D::Buffer<f32>,
        weights: &SourceWeights,
        target: &Camera,
        settled: f32,
        progress: &dyn Progress,
    ) -> Result<Rendered, FieldError> {
        let failed = FieldError::Device;
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        let count = (width * height) as usize;
        let view_count = prepared.scene.object.view_count as usize;
        let weights = device.upload(&weights.values()[..view_count]).map_err(failed)?;
        let target = MarchBlock { target: target.block(0), background: prepared.background, settled };
        let mut pixels: Pixels<D> =
            Pixels { colours: device.zeros(count).map_err(failed)?, depths: device.zeros(count).map_err(failed)? };
        let band_rows = BAND_ROWS.max(u32::try_from(device.busy_elements() / width as usize).unwrap_or(u32::MAX));
        progress.expect(height.div_ceil(band_rows) as usize);
        for first_row in (0..height).step_by(band_rows as usize) {
            progress.check()?;
            let row_count = band_rows.min(height - first_row);
            let PhotoScene { object_buffer, views, footprints, texels, .. } = &prepared.scene;
            let Pixels { colours, depths: pixel_depths } = &mut pixels;
            device
                .march(
                    &target,
                    first_row,
                    row_count,
                    object_buffer,
                    views,
                    footprints,
                    texels,
                    depths,
                    &weights,
                    colours,
                    pixel_depths,
                )
                .map_err(failed)?;
            progress.step();
        }
        Ok(Rendered {
            colours: device.download(&pixels.colours).map_err(failed)?,
            depths: device.download(&pixels.depths).map_err(failed)?,
            width,
            height,
        })
    }
}

/// The box around the object that the silhouettes of the sources show, or `None` if they show none.
pub fn find_object(sources: &SourceImages) -> Option<ObjectBlock> {
    let (cameras, texels) = joined(sources);
    bounds::find(&cameras, &texels)
}

/// All sources' texels behind one another, and the cameras that know where theirs are.
fn joined(sources: &SourceImages) -> (Vec<CameraBlock>, Vec<[f32; 4]>) {
    let mut cameras = Vec::with_capacity(sources.images.len());
    let mut texels = Vec::new();
    for image in &sources.images {
        cameras.push(image.camera.block(texels.len() as u32));
        texels.extend_from_slice(&image.texels);
    }
    (cameras, texels)
}

/// A pixel's side at the middle of the object.
fn footprint(object: &ObjectBlock, camera: &CameraBlock) -> f32 {
    // A camera that has the object behind it sees nothing of it; any positive length will do.
    let depth = camera.project(object.middle()).depth.max(0.01 * object.radius);
    depth / camera.intrinsics[0]
}

/// Cuts a sweep over all rows into bands of bounded memory. With each band come the rows, counted from its first, whose
/// depths are final; the others are its halo.
fn bands(whole: SweepBlock, most_values: usize) -> Vec<(SweepBlock, Range<u32>)> {
    let row_values = whole.width as usize * whole.plane_count as usize;
    let affordable = u32::try_from(most_values / row_values).unwrap_or(u32::MAX);
    if affordable >= whole.row_count {
        return vec![(whole, 0..whole.row_count)];
    }
    let kept = affordable.saturating_sub(2 * HALO_ROWS).max(1);
    (0..whole.row_count)
        .step_by(kept as usize)
        .map(|first_kept| {
            let first_row = first_kept.saturating_sub(HALO_ROWS);
            let end_kept = (first_kept + kept).min(whole.row_count);
            let end_row = (end_kept + HALO_ROWS).min(whole.row_count);
            let band = SweepBlock { first_row, row_count: end_row - first_row, ..whole };
            (band, first_kept - first_row..end_kept - first_row)
        })
        .collect()
}
