//! The costs of the planes in a camera's frustum, from the views that are compared on them.

use super::scratch::Scratch;
use crate::FieldError;
use crate::training_free::exposure;
use std::borrow::Borrow;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::census::REACH;
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::front::FrontBlock;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::path::{CostBlock, DIRECTIONS};
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_kernels::plane_sweep::{MAX_MATCHED, PLANES, Planes};
use viewfuse_scene::photographs::SourceImage;
use viewfuse_scene::photographs::object_box::joined;

/// Most pairs that are compared, for each view.
const PAIRS_PER_VIEW: usize = 3;
/// Rows that are compared at once on a processor, whose caches hold what they need.
const BAND_ROWS: u32 = 32;
/// Bytes of colours and evidence of the rows that are compared at once on a GPU, which rows fill.
const BAND_BYTES: usize = 256 << 20;

/// The sources at one size, on a device.
pub(super) struct Images<D: Device> {
    /// With the offset of each one's texels.
    pub(super) cameras: Vec<CameraBlock>,
    /// `[view][row][column]`.
    pub(super) texels: D::Buffer<[f32; 4]>,
}

impl<D: Device> Images<D> {
    pub(super) fn upload(device: &D, images: &[impl Borrow<SourceImage>]) -> Result<Images<D>, FieldError> {
        let (cameras, texels) = joined(images);
        Ok(Images { cameras, texels: device.upload_owned(texels)? })
    }

    /// With their texels on the host.
    pub(super) fn upload_kept(device: &D, images: &[SourceImage]) -> Result<(Images<D>, Vec<[f32; 4]>), FieldError> {
        let (cameras, texels) = joined(images);
        Ok((Images { cameras, texels: device.upload(&texels)? }, texels))
    }
}

/// A camera's planes.
#[derive(Clone, Copy)]
pub(super) struct Range {
    /// Disparity of the farthest plane.
    pub(super) far_disparity: f32,
    /// From a plane's disparity to the next one's.
    pub(super) step: f32,
    /// Groups of planes.
    pub(super) group_count: u32,
}

impl Range {
    /// At least `plane_count` planes between two disparities.
    pub(super) fn new([least, greatest]: [f32; 2], plane_count: u32) -> Range {
        let group_count = plane_count.div_ceil(PLANES as u32);
        let intervals = (group_count * PLANES as u32 - 1) as f32;
        Range { far_disparity: least, step: (greatest - least) / intervals, group_count }
    }
}

/// What is the same for every frustum.
#[derive(Clone, Copy)]
pub(super) struct Matching<'d, D: Device> {
    pub(super) device: &'d D,
    pub(super) has_silhouettes: bool,
    /// Cost of the nearest plane relative to the farthest one.
    pub(super) near_cost: f32,
    /// Cost of contradicting the views' own disparities.
    pub(super) dissent_share: f32,
    /// Cost of a plane that is transparent or hidden by the views' own disparities.
    pub(super) front_share: f32,
}

impl<D: Device> Matching<'_, D> {
    /// The frustum of a camera whose planes `swept` are compared on; only the first [`MAX_MATCHED`] of them are.
    pub(super) fn frustum(&self, camera: CameraBlock, range: Range, swept: &[SweptView]) -> FrustumBlock {
        FrustumBlock {
            camera,
            far_disparity: range.far_disparity,
            disparity_step: range.step,
            group_count: range.group_count,
            view_count: swept.len().min(MAX_MATCHED) as u32,
            pair_count: pairs(swept).len() as u32,
            has_silhouettes: u32::from(self.has_silhouettes),
            dissent_share: self.dissent_share,
            first_row: 0,
            row_count: camera.height,
        }
    }

    /// Compares `swept` on all planes of a frustum: costs and how far the silhouettes contain the points,
    /// `[row][column][group][2]`. `texels` are those of the views' cameras, `maps` their disparities and confidences.
    pub(super) fn compared(
        &self,
        whole: &FrustumBlock,
        swept: &[SweptView],
        texels: &D::Buffer<[f32; 4]>,
        maps: &D::Buffer<[f32; 2]>,
        scratch: &mut Scratch<D>,
        progress: &dyn Progress,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let mut costs = self.device.zeros(2 * volume(whole))?;
        self.compare(whole, swept, texels, maps, &mut costs, scratch, progress)?;
        Ok(costs)
    }

    /// As [`Matching::compared`], into a buffer.
    #[expect(clippy::too_many_arguments, reason = "what is compared, and where")]
    fn compare(
        &self,
        whole: &FrustumBlock,
        swept: &[SweptView],
        texels: &D::Buffer<[f32; 4]>,
        maps: &D::Buffer<[f32; 2]>,
        costs: &mut D::Buffer<Planes>,
        scratch: &mut Scratch<D>,
        progress: &dyn Progress,
    ) -> Result<(), FieldError> {
        let device = self.device;
        let FrustumBlock { camera: CameraBlock { width, height, .. }, group_count, .. } = *whole;
        let matched = &swept[..whole.view_count as usize];
        let row_len = (width * group_count) as usize;
        let (views, pairs) = (&device.table(matched)?, &device.table(&pairs(swept))?);
        let band_rows = self.band_rows(row_len * matched.len().max(4)).min(height);
        let rows = (band_rows + REACH).min(height) as usize;
        let grey = scratch.grey.of_len(device, rows * row_len * matched.len())?;
        let evidence = scratch.evidence.of_len(device, 4 * rows * row_len)?;
        for first in (0..height).step_by(band_rows as usize) {
            progress.check()?;
            let halo = first.min(REACH);
            let kept = band_rows.min(height - first);
            let band = FrustumBlock { first_row: first - halo, row_count: halo + kept, ..*whole };
            device.compare_views(&band, views, pairs, texels, maps, grey, evidence)?;
            device.census_cost(&band, halo, kept, pairs, grey, evidence, costs)?;
        }
        Ok(())
    }

    /// Rows that are compared at once, of which each takes so many numbers of planes for colours.
    fn band_rows(&self, row_len: usize) -> u32 {
        if self.device.is_software() {
            return BAND_ROWS;
        }
        // Evidence takes at most as much again.
        let most = (BAND_BYTES / size_of::<Planes>() / 2).min(self.device.most_elements::<Planes>());
        (most / row_len.max(1)).saturating_sub(REACH as usize).max(BAND_ROWS as usize) as u32
    }

    /// The means over windows of what [`Matching::compared`] finds, which is not kept: `means[row][column][group]`.
    pub(super) fn compared_means(
        &self,
        whole: &FrustumBlock,
        swept: &[SweptView],
        texels: &D::Buffer<[f32; 4]>,
        maps: &D::Buffer<[f32; 2]>,
        scratch: &mut Scratch<D>,
        progress: &dyn Progress,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let mut slot = std::mem::take(&mut scratch.compared);
        let compared = slot.of_len(self.device, 2 * volume(whole))?;
        self.compare(whole, swept, texels, maps, compared, scratch, progress)?;
        let means = self.means(whole, compared, scratch)?;
        scratch.compared = slot;
        Ok(means)
    }

    /// The means over windows of what [`Matching::compared`] found: `means[row][column][group]`.
    pub(super) fn means(
        &self,
        whole: &FrustumBlock,
        compared: &D::Buffer<Planes>,
        scratch: &mut Scratch<D>,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let window = WindowBlock::new(whole, self.near_cost);
        let volume = volume(whole);
        let sums = scratch.sums.of_len(self.device, 6 * volume)?;
        self.device.row_sums(&window, compared, sums)?;
        let mut means = self.device.zeros::<Planes>(volume)?;
        self.device.window_cost(&window, sums, &mut means)?;
        Ok(means)
    }

    /// The costs of all planes in a frustum: `costs[row][column][group]`, from [`Matching::means`]. `maps` are the
    /// disparities and confidences of the views; those of `voters`, of which the first [`MAX_MATCHED`] count, say which
    /// planes are opaque.
    pub(super) fn costs(
        &self,
        whole: FrustumBlock,
        means: &D::Buffer<Planes>,
        voters: &[SweptView],
        maps: &D::Buffer<[f32; 2]>,
        scratch: &mut Scratch<D>,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let device = self.device;
        let FrustumBlock { camera: CameraBlock { width, height, .. }, group_count, .. } = whole;
        let volume = volume(&whole);
        let mut preferred = None;
        let voters = &voters[..voters.len().min(MAX_MATCHED)];
        if self.front_share > 0.0 && voters.iter().any(|view| view.disparity_step > 0.0) {
            let opacities = scratch.opacities.of_len(device, volume)?;
            let frustum = FrustumBlock { view_count: voters.len() as u32, ..whole };
            device.plane_opacity(&frustum, &device.table(voters)?, maps, opacities)?;
            let block = FrontBlock { width, height, group_count, front_share: self.front_share };
            let costs = scratch.costs.of_len(device, volume)?;
            device.front_cost(&block, opacities, means, costs)?;
            preferred = Some(&*costs);
        }
        let block = CostBlock { width, height, group_count, padding: 0 };
        let paths = scratch.paths.of_len(device, DIRECTIONS as usize * volume)?;
        device.follow_paths(&block, preferred.unwrap_or(means), paths)?;
        let mut costs = device.zeros::<Planes>(volume)?;
        device.join_paths(&block, paths, &mut costs)?;
        Ok(costs)
    }
}

/// The views with a weight above 0, the greatest weights first. `cameras` are those of the texels, `maps` those of the
/// disparity maps, whose steps are used if given; without gains all are 1.
pub(super) fn swept(
    cameras: &[CameraBlock],
    maps: &[CameraBlock],
    weights: &[(usize, f32)],
    steps: Option<&[f32]>,
    gains: Option<&[[f32; 4]]>,
) -> Vec<SweptView> {
    let mut order: Vec<(usize, f32)> = weights.iter().copied().filter(|(_, weight)| *weight > 0.0).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // The picture gets the exposure of the sources that count.
    let common = gains.map_or([1.0; 4], |gains| exposure::common(gains, &order));
    let gain = |view: usize| {
        gains.map_or([1.0; 4], |gains| [0, 1, 2, 3].map(|channel| gains[view][channel] / common[channel]))
    };
    let view = |(view, weight): (usize, f32)| {
        let map = &maps[view];
        SweptView {
            camera: cameras[view],
            gain: gain(view),
            weight,
            disparity_step: steps.map_or(0.0, |steps| steps[view]),
            first_disparity: map.first_texel,
            map_width: map.width,
            map_height: map.height,
            padding: [0; 3],
        }
    };
    order.into_iter().map(view).collect()
}

/// Groups of planes of all pixels.
fn volume(whole: &FrustumBlock) -> usize {
    (whole.camera.width * whole.camera.height * whole.group_count) as usize
}

/// The pairs that are compared, of the greatest products of weights.
fn pairs(swept: &[SweptView]) -> Vec<ViewPair> {
    let count = swept.len().min(MAX_MATCHED);
    let mut pairs: Vec<ViewPair> = (0..count)
        .flat_map(|first| (first + 1..count).map(move |second| (first, second)))
        .map(|(first, second)| ViewPair {
            first: first as u32,
            second: second as u32,
            weight: swept[first].weight * swept[second].weight,
            padding: 0,
        })
        .collect();
    pairs.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    pairs.truncate((PAIRS_PER_VIEW * count).max(1));
    let sum: f32 = pairs.iter().map(|pair| pair.weight).sum();
    pairs.iter_mut().for_each(|pair| pair.weight /= sum.max(1.0e-30));
    pairs
}
