//! Sources that show a silhouette: a visual hull from silhouettes, depths by plane sweep, colours by weighted
//! fusion; the mathematics is in [`viewfuse_kernels::visual_hull`].

use crate::{AnyOptions, DepthMap, Encoding, FieldError, Geometry, Options, Prepared, Rendered, Request, Variant};
use std::ops::Range;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::{Device, HullScene, Pixels};
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_kernels::visual_hull::ray_marching::MarchBlock;
use viewfuse_kernels::visual_hull::sweep::{NEIGHBOUR_REACH, SweepBlock, WINDOW_REACH};
use viewfuse_kernels::visual_hull::{NO_SURFACE, ObjectBlock};
use viewfuse_scene::photographs::object_box::{bounding_box, joined};
use viewfuse_scene::photographs::{SourceImage, SourceImages, longest_side};
use viewfuse_weighting::sources::SourceWeights;

/// Rows rendered between two checks of the interrupt flag.
const BAND_ROWS: u32 = 16;
/// Rows around a band that its depths depend on: the window's and the neighbours' reach.
const HALO_ROWS: u32 = WINDOW_REACH + NEIGHBOUR_REACH;
/// Shares of the sources' side, with the error and the work that are typical of them (host/results/efforts.md).
const EFFORTS: [(f32, f32, f32); 2] = [(0.25, 0.065, 0.2), (0.5, 0.04, 0.4)];
/// Sources with a longer side than this take most of the time; smaller ones take less than the picture.
const MIN_REDUCED: u32 = 256;

/// Density from silhouettes and photo-consistency, colour by weighted fusion with visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull {
    /// Most values in each of the three buffers of a sweep. Larger pictures are swept in bands of rows, which changes
    /// memory and run time but not the result.
    pub most_band_values: usize,
    /// Side of the sources that depths are found in, as a share of their own.
    pub source_share: f32,
}

impl Default for Hull {
    /// 16 Mi values: 256 MiB in all. Whole sources.
    fn default() -> Hull {
        Hull { most_band_values: 16 << 20, source_share: 1.0 }
    }
}

impl Options for Hull {
    /// Where both find depths in sources of the same size.
    fn encodes_alike(&self, other: &Hull) -> bool {
        self.source_share == other.source_share
    }
}

pub use crate::error::NoObject;

/// A view was encoded, or a target rendered, before a weighting began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("depths are known only under a weighting, and none has begun")]
struct NotWeighed;

/// Photographs on the device, with the object's box and where each pixel's ray enters the hull.
pub(super) struct Views<'a, D: Device> {
    options: Hull,
    device: &'a D,
    /// The sources' cameras.
    cameras: Vec<Camera>,
    whole: Silhouettes<D>,
    /// Smaller sources, for less effort.
    reduced: Option<Silhouettes<D>>,
    background: [f32; 3],
    depths: Option<Depths<D>>,
}

/// Sources of one size on the device.
struct Silhouettes<D: Device> {
    scene: HullScene<D>,
    entries: D::Buffer<f32>,
    texel_count: usize,
}

/// Depth maps under a weighting, concatenated.
struct Depths<D: Device> {
    maps: D::Buffer<f32>,
    /// The inputs of further maps, until the first target.
    sweep: Option<Sweep<D>>,
}

/// The inputs of a depth map.
struct Sweep<D: Device> {
    /// `[view][other]`.
    pair_weights: D::Buffer<f32>,
    /// A map without any surface.
    nothing: D::Buffer<f32>,
    /// Depths before the second pick.
    first_guess: D::Buffer<f32>,
}

impl Hull {
    /// Uploads the photographs to a device and finds the object.
    pub(super) fn views<'a, D: Device>(
        &'a self,
        device: &'a D,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Views<'a, D>, FieldError> {
        let whole = Silhouettes::upload(device, &sources.images, progress)?;
        let cameras = sources.images.iter().map(|image| image.camera).collect();
        let background = sources.background;
        let mut views = Views { options: *self, device, cameras, whole, reduced: None, background, depths: None };
        views.reduce()?;
        Ok(views)
    }

    /// The efforts for sources of this longest side, the exact one last; none for small ones.
    pub(super) fn efforts(&self, side: u32) -> Vec<Variant<Hull>> {
        if side < MIN_REDUCED {
            return Vec::new();
        }
        let reduced = EFFORTS.map(|(share, error, work)| {
            let label = format!("sources at {} pixels", (share * side as f32).round());
            Variant::new(label, Hull { source_share: share, ..*self }, error, work)
        });
        reduced.into_iter().chain([Variant::exact(*self)]).collect()
    }
}

impl<D: Device> Silhouettes<D> {
    /// Uploads images and finds the object.
    fn upload(device: &D, images: &[SourceImage], progress: &dyn Progress) -> Result<Silhouettes<D>, FieldError> {
        if images.len() < 2 {
            return Err(FieldError::unsuitable(format!(
                "{} silhouettes bound no object: two are needed",
                images.len()
            )));
        }
        let (cameras, texels) = joined(images);
        let object = bounding_box(&cameras, &texels).ok_or_else(|| FieldError::unsuitable(NoObject))?;
        let footprints: Vec<f32> = cameras.iter().map(|camera| footprint(&object, camera)).collect();
        let scene = HullScene {
            object,
            object_buffer: device.upload(&[object])?,
            views: device.upload(&cameras)?,
            footprints: device.upload(&footprints)?,
            texels: device.upload(&texels)?,
            cameras,
        };
        let mut entries = device.zeros(texels.len())?;
        progress.expect(scene.cameras.len());
        for view in 0..object.view_count {
            progress.check()?;
            let HullScene { object_buffer, views, texels, cameras, .. } = &scene;
            let camera = &cameras[view as usize];
            let pixel_count = camera.width * camera.height;
            device.hull_entry(&view, pixel_count, object_buffer, views, texels, &mut entries)?;
            progress.step();
        }
        device.finish()?;
        Ok(Silhouettes { scene, entries, texel_count: texels.len() })
    }
}

impl<D: Device> Views<'_, D> {
    /// The sources of the current effort.
    fn silhouettes(&self) -> &Silhouettes<D> {
        self.reduced.as_ref().unwrap_or(&self.whole)
    }

    /// Makes the smaller sources that the options ask for.
    fn reduce(&mut self) -> Result<(), FieldError> {
        let (device, share) = (self.device, self.options.source_share);
        self.reduced = None;
        if share < 1.0 {
            let HullScene { texels, cameras, .. } = &self.whole.scene;
            let texels = device.download(texels)?;
            let reduced = |(camera, block): (&Camera, &CameraBlock)| {
                let whole = texels[block.first_texel as usize..].iter().take((block.width * block.height) as usize);
                let side = (share * longest_side(camera) as f32).round().max(1.0) as u32;
                SourceImage { camera: *camera, texels: whole.copied().collect() }.reduced(side)
            };
            let images: Result<Vec<SourceImage>, _> = self.cameras.iter().zip(cameras).map(reduced).collect();
            self.reduced = Some(Silhouettes::upload(device, &images.map_err(FieldError::unsuitable)?, &Silent)?);
        }
        Ok(())
    }
}

impl<'a, D: Device> Prepared<'a> for Views<'a, D> {
    fn encoding(&self) -> Encoding {
        Encoding::All
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        let Views { options, device, whole, reduced, depths, .. } = self;
        let Silhouettes { scene, entries, .. } = reduced.as_ref().unwrap_or(whole);
        let Some(Depths { maps, sweep: Some(Sweep { pair_weights, nothing, first_guess }) }) = depths else {
            return Err(FieldError::unsuitable(NotWeighed));
        };
        let HullScene { object_buffer: object, views, texels, .. } = scene;
        // The widest of a sweep's three buffers is bound as a whole.
        let most_values = options.most_band_values.min(device.most_elements::<[f32; 2]>());
        let camera = &scene.cameras[view];
        let whole = SweepBlock::new(&scene.object, camera, view as u32);
        for (sweep, kept_rows) in bands(whole, most_values) {
            progress.check()?;
            let count = (sweep.row_count * camera.width * sweep.plane_count) as usize;
            let mut costs = device.zeros(count)?;
            let mut row_sums = device.zeros(count)?;
            let mut means = device.zeros(count)?;
            device.match_cost(&sweep, object, views, texels, entries, pair_weights, &mut costs)?;
            device.sum_row(&sweep, &costs, &mut row_sums)?;
            device.mean_column(&sweep, &costs, &row_sums, &mut means)?;
            let all = sweep.row_count;
            device.pick_depth(&sweep, 0, all, object, views, &means, entries, nothing, first_guess)?;
            let (first, kept) = (kept_rows.start, kept_rows.len() as u32);
            device.pick_depth(&sweep, first, kept, object, views, &means, entries, first_guess, maps)?;
        }
        Ok(())
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        let Views { device, whole, reduced, background, depths, .. } = self;
        let scene = &reduced.as_ref().unwrap_or(whole).scene;
        let depths = depths.as_mut().ok_or_else(|| FieldError::unsuitable(NotWeighed))?;
        depths.sweep = None;
        let &Request { camera: target, early_termination, .. } = request;
        let (width, height) = (target.pinhole.width(), target.pinhole.height());
        let count = (width * height) as usize;
        let weights = device.table(&request.view_weights())?;
        let target = MarchBlock { target: target.block(0), background: *background, termination: early_termination };
        let mut pixels: Pixels<D> = Pixels { colours: device.zeros(count)?, depths: device.zeros(count)? };
        let band_rows = BAND_ROWS.max(u32::try_from(device.busy_elements() / width as usize).unwrap_or(u32::MAX));
        progress.expect(height.div_ceil(band_rows) as usize);
        for first_row in (0..height).step_by(band_rows as usize) {
            progress.check()?;
            let row_count = band_rows.min(height - first_row);
            let HullScene { object_buffer: object, views, footprints, texels, .. } = scene;
            let Pixels { colours, depths: pixel_depths } = &mut pixels;
            device.march_rays(
                &target, first_row, row_count, object, views, footprints, texels, &depths.maps, &weights, colours,
                pixel_depths,
            )?;
            progress.step();
        }
        let (colours, depths) = (device.download_later(&pixels.colours)?, device.download_later(&pixels.depths)?);
        let (colours, depths) = (colours.get()?, depths.get()?);
        Ok(Rendered { colours, depths, confidences: Vec::new(), width, height })
    }

    fn is_weighted(&self) -> bool {
        true
    }

    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        let Silhouettes { scene, texel_count, .. } = self.silhouettes();
        let (device, texel_count, view_count) = (self.device, *texel_count, scene.object.view_count as usize);
        // The last weighting's buffers are freed before new ones are allocated.
        self.depths = None;
        let pair_weights: Vec<f32> =
            relevance.iter().flat_map(|weights| weights.values()[..view_count].iter().copied()).collect();
        let sweep = Sweep {
            pair_weights: device.upload(&pair_weights)?,
            nothing: device.upload(&vec![NO_SURFACE; texel_count])?,
            first_guess: device.zeros(texel_count)?,
        };
        self.depths = Some(Depths { maps: device.zeros(texel_count)?, sweep: Some(sweep) });
        Ok(())
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        let Some(options) = options.of::<Hull>() else { return Ok(()) };
        let is_alike = options.encodes_alike(&self.options);
        self.options = *options;
        if is_alike {
            return Ok(());
        }
        self.depths = None;
        self.reduce()
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(self)
    }
}

impl<D: Device> Geometry for Views<'_, D> {
    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        let depths = self.depths.as_ref().ok_or_else(|| FieldError::unsuitable(NotWeighed))?;
        let maps = self.device.download(&depths.maps)?;
        let map = |camera: &CameraBlock| {
            let depths = maps[camera.first_texel as usize..].iter().take((camera.width * camera.height) as usize);
            let depths = depths.map(|depth| if *depth < NO_SURFACE { *depth } else { 0.0 }).collect();
            DepthMap { camera: CameraBlock { first_texel: 0, ..*camera }, depths, confidences: Vec::new() }
        };
        Ok(self.silhouettes().scene.cameras.iter().map(map).collect())
    }
}

/// A pixel's side at the middle of the object.
fn footprint(object: &ObjectBlock, camera: &CameraBlock) -> f32 {
    // A camera with the object behind it does not see it; any positive length is valid.
    let depth = camera.project(object.middle()).depth.max(0.01 * object.radius);
    depth / camera.intrinsics[0]
}

/// Cuts a sweep over all rows into bands of bounded memory. Each band has the rows, counted from its first, whose
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
