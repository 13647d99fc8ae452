//! The two passes along a target's rays, some rays at a time: the first finds surfaces, the second adds samples there.

use super::network::{Network, Views, Workspace};
use super::options::{MIN_OPACITY, MIN_SHARE, Omissions, Sampling};
use crate::FieldError;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::rays::{CastBlock, PlaceBlock};
use viewfuse_device::{Device, Pixels, Rays};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::compact::RUN;
use viewfuse_kernels::sample_mask::{RaysBlock, SampleMaskBlock};

/// The most rays at a time.
pub(super) const MAX_RAYS: usize = 4096;

/// Rays at a time: as many as a buffer of the device holds the samples of.
pub(super) fn rays_at_once<D: Device>(device: &D, sampling: &Sampling) -> usize {
    let samples = sampling.coarse_count as usize + sampling.importance_count as usize + sampling.depth_count as usize;
    MAX_RAYS.min(device.most_elements::<[f32; 4]>() / samples).max(1)
}

/// Bytes of a ray in both passes.
pub(super) fn ray_bytes(coarse_count: u32, fine_count: u32) -> usize {
    // Depth, colour with optical depth, mark and place in the list, of both passes' samples; weights and transmittances
    // of the first's; random numbers and depth of the second's.
    let sample = size_of::<f32>() + size_of::<[f32; 4]>() + 3 * size_of::<u32>();
    let (coarse, fine) = (coarse_count as usize, fine_count as usize);
    (2 * coarse + fine) * sample + (coarse + fine) * size_of::<[f32; 2]>() + fine * size_of::<f32>() + 64
}

/// The samples of a pass, and those at which the network was evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Evaluated {
    pub(super) samples: u64,
    pub(super) evaluated: u64,
    /// Views of these that were left out because their weight is 0.
    pub(super) unseen: u64,
}

/// The weights of a first pass along some rays.
pub(super) struct Probes<D: Device> {
    /// `[ray][part]` of weight and transmittance in front.
    pub(super) values: D::Buffer<[f32; 2]>,
    pub(super) part_count: u32,
    pub(super) columns: u32,
    pub(super) rows: u32,
    /// Pixels from a probe to the next.
    pub(super) step: u32,
    /// A part is empty if its opacity is below this.
    pub(super) least_share: f32,
}

/// The common data of a target's rays.
pub(super) struct Renderer<'a, D: Device> {
    pub(super) device: &'a D,
    pub(super) coarse: Network<'a, D>,
    pub(super) fine: Network<'a, D>,
    pub(super) views: &'a Views<'a, D>,
    pub(super) sampling: Sampling,
    pub(super) omissions: Omissions,
    /// Transmittance of early termination.
    pub(super) early_termination: f32,
    pub(super) cast: CastBlock,
    pub(super) background: [f32; 3],
    pub(super) progress: &'a dyn Progress,
}

/// Samples of some rays.
pub(super) struct Samples<D: Device> {
    depths: D::Buffer<f32>,
    /// Colour and optical depth.
    pub(super) values: D::Buffer<[f32; 4]>,
    count: u32,
}

impl<D: Device> Samples<D> {
    /// These rays among others, whose first results are those of ray `first_ray`.
    pub(super) fn block(&self, first_ray: u32) -> RaysBlock {
        RaysBlock { sample_count: self.count, first_ray }
    }
}

/// Some samples of some rays, flat in `[ray][sample]`.
struct List<D: Device> {
    /// In order; longer than the count says. `None`: all samples.
    samples: Option<D::Buffer<u32>>,
    count: u32,
}

impl<D: Device> Renderer<'_, D> {
    /// The colours and depths (along the rays) of some pixels.
    pub(super) fn render(
        &self,
        workspace: &mut Workspace<D>,
        pixels: &[u32],
        probes: Option<&Probes<D>>,
        evaluated: &mut [Evaluated; 2],
    ) -> Result<Pixels<D>, FieldError> {
        let device = self.device;
        let rays = self.rays(pixels)?;
        let count = self.sampling.coarse_count;
        let coarse = self.first_pass(workspace, &rays, count, probes, &mut evaluated[0])?;
        let mut found = self.pixels(pixels.len())?;
        self.composite(&coarse, rays.count, &mut found)?;
        let block = self.fine_block();
        if block.fine_count() == 0 {
            return Ok(found);
        }
        let (ray_count, fine_count) = (pixels.len(), block.fine_count() as usize);
        let mut parts = self.zeros(ray_count * coarse.count as usize)?;
        device.weigh_samples(&coarse.block(0), rays.count, &coarse.values, &mut parts)?;
        let mut draws = self.zeros(ray_count * fine_count)?;
        device.random_draws(&block, rays.count, &rays.pixels, &mut draws)?;
        let mut added = self.zeros(ray_count * fine_count)?;
        let Pixels { colours, depths } = &found;
        device.fine_depths(&block, rays.count, &parts, &rays.rays, colours, depths, &draws, &mut added)?;
        let count = coarse.count + block.fine_count();
        let mut fine = self.samples(ray_count, count)?;
        device.merge_depths(&block, rays.count, &coarse.depths, &added, &mut fine.depths)?;
        let Omissions { empty_rays, empty_parts, hidden_samples, .. } = self.omissions;
        let mask = (empty_rays || empty_parts || hidden_samples).then_some(SampleMaskBlock {
            sample_count: count,
            part_count: coarse.count,
            least_share: if empty_parts { probes.map_or(MIN_SHARE, |probes| probes.least_share) } else { 0.0 },
            termination: if hidden_samples { self.early_termination } else { -1.0 },
            least_opacity: if empty_rays { MIN_OPACITY } else { 0.0 },
            width: self.cast.camera.width,
            ..SampleMaskBlock::default()
        });
        let list = self.list(&rays, &fine, mask.as_ref().map(|block| (block, &parts)))?;
        self.evaluate(&self.fine, workspace, &rays, &mut fine, &list, &mut evaluated[1])?;
        self.composite(&fine, rays.count, &mut found)?;
        Ok(found)
    }

    /// This many evenly spaced samples; with probes, only those in the sample mask of the probes around a ray.
    pub(super) fn first_pass(
        &self,
        workspace: &mut Workspace<D>,
        rays: &Rays<D>,
        sample_count: u32,
        probes: Option<&Probes<D>>,
        evaluated: &mut Evaluated,
    ) -> Result<Samples<D>, FieldError> {
        let Sampling { seed, jitter, .. } = self.sampling;
        let block = CoarseBlock { seed: words(seed), sample_count, jitter };
        let mut samples = self.samples(rays.count as usize, block.sample_count)?;
        self.device.coarse_depths(&block, rays.count, &rays.rays, &rays.pixels, &mut samples.depths)?;
        let mask = probes.map(|probes| {
            let block = SampleMaskBlock {
                sample_count: block.sample_count,
                part_count: probes.part_count,
                least_share: probes.least_share,
                // Samples that are hidden on the probes' rays may be visible on a ray beside their surfaces.
                termination: -1.0,
                least_opacity: 0.0,
                step: probes.step,
                seen_columns: probes.columns,
                seen_rows: probes.rows,
                width: self.cast.camera.width,
            };
            (block, &probes.values)
        });
        let list = self.list(rays, &samples, mask.as_ref().map(|(block, probes)| (block, *probes)))?;
        self.evaluate(&self.coarse, workspace, rays, &mut samples, &list, evaluated)?;
        Ok(samples)
    }

    /// The samples in the mask, as a list that stays on the device. Only its length is downloaded, for the sizes of the
    /// dispatches.
    fn list(
        &self,
        rays: &Rays<D>,
        samples: &Samples<D>,
        mask: Option<(&SampleMaskBlock, &D::Buffer<[f32; 2]>)>,
    ) -> Result<List<D>, FieldError> {
        let (device, all) = (self.device, rays.count * samples.count);
        let Some((block, probes)) = mask else { return Ok(List { samples: None, count: all }) };
        let mut mask = self.zeros(all as usize)?;
        device.sample_mask(block, rays.count, probes, &rays.rays, &rays.pixels, &samples.depths, &mut mask)?;
        let run_count = all.div_ceil(RUN);
        let (mut counts, mut offsets) = (self.zeros(run_count as usize)?, self.zeros(run_count as usize + 1)?);
        let (mut total, mut list) = (self.zeros(1)?, self.zeros(all as usize)?);
        device.count_marked(&all, &mask, &mut counts)?;
        device.sum_counts(&run_count, &counts, &mut offsets, &mut total)?;
        device.list_marked(&all, &mask, &offsets, &mut list)?;
        let count = device.download(&total)?.first().copied().unwrap_or(0);
        Ok(List { samples: Some(list), count })
    }

    /// Evaluates a network at samples, as many at a time as the workspace holds. The others stay empty.
    fn evaluate(
        &self,
        network: &Network<'_, D>,
        workspace: &mut Workspace<D>,
        rays: &Rays<D>,
        samples: &mut Samples<D>,
        list: &List<D>,
        evaluated: &mut Evaluated,
    ) -> Result<(), FieldError> {
        let device = self.device;
        evaluated.samples += u64::from(rays.count * samples.count);
        evaluated.evaluated += u64::from(list.count);
        for first in (0..list.count).step_by(workspace.point_count as usize) {
            self.progress.check()?;
            let count = workspace.point_count.min(list.count - first);
            let block = PlaceBlock { sample_count: samples.count, first, ..PlaceBlock::default() };
            let all = list.samples.as_ref();
            device.place_points(&block, count, all, &rays.rays, &samples.depths, &mut workspace.points)?;
            evaluated.unseen += network.evaluate_visible(workspace, self.views, count)?;
            device.radiance(count, &workspace.raw, &workspace.points, &mut samples.values)?;
            self.progress.step();
        }
        // What is omitted is done, too.
        let omitted = pieces(workspace, rays.count * samples.count) - pieces(workspace, list.count);
        (0..omitted).for_each(|_| self.progress.step());
        Ok(())
    }

    fn composite(&self, samples: &Samples<D>, ray_count: u32, pixels: &mut Pixels<D>) -> Result<(), FieldError> {
        // The depth of an empty ray is its far bound.
        let CastBlock { far, .. } = self.cast;
        let block = CompositeBlock { background: self.background, empty_depth: far, sample_count: samples.count };
        let Pixels { colours, depths } = pixels;
        Ok(self.device.composite(&block, ray_count, &samples.values, &samples.depths, colours, depths)?)
    }

    pub(super) fn rays(&self, pixels: &[u32]) -> Result<Rays<D>, FieldError> {
        let (count, pixel_buffer) = (pixels.len() as u32, self.device.upload(pixels)?);
        let mut rays = Rays { count, pixels: pixel_buffer, rays: self.zeros(pixels.len())? };
        self.device.cast_rays(&self.cast, count, &rays.pixels, &mut rays.rays)?;
        Ok(rays)
    }

    fn samples(&self, ray_count: usize, count: u32) -> Result<Samples<D>, FieldError> {
        let all = ray_count * count as usize;
        Ok(Samples { depths: self.zeros(all)?, values: self.zeros(all)?, count })
    }

    fn pixels(&self, count: usize) -> Result<Pixels<D>, FieldError> {
        Ok(Pixels { colours: self.zeros(count)?, depths: self.zeros(count)? })
    }

    pub(super) fn zeros<T: viewfuse_device::Element>(&self, count: usize) -> Result<D::Buffer<T>, FieldError> {
        Ok(self.device.zeros(count)?)
    }

    fn fine_block(&self) -> FineBlock {
        let Sampling { seed, coarse_count, importance_count, depth_count, depth_deviation, published_depth, .. } =
            self.sampling;
        FineBlock {
            seed: words(seed),
            coarse_count,
            importance_count,
            depth_count,
            depth_deviation,
            depth_times_opacity: u32::from(published_depth),
        }
    }
}

/// Pieces of the evaluation of so many samples, for progress.
pub(super) fn pieces<D: Device>(workspace: &Workspace<D>, sample_count: u32) -> usize {
    sample_count.div_ceil(workspace.point_count) as usize
}

/// Low and high word.
fn words(seed: u64) -> [u32; 2] {
    [seed as u32, (seed >> 32) as u32]
}
