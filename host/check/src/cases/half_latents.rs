//! [`Kernel::GatherLatentsF16`]: grids as in [`super::gather_latents`], of odd and even numbers of channels, in half
//! precision. An independent implementation packs them here.

use super::gather_latents::{self, Job, jobs};
use super::half_precision::{nearest, packed};
use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::random;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::pixelnerf::GatherBlock;
use viewfuse_vulkan::kernel::Kernel;

/// Jobs in a device's memory, and the gathered values with a number behind them.
pub struct LoadedJob<D: Device> {
    views: D::Buffer<CameraBlock>,
    points: D::Buffer<RayPoint>,
    grids: Vec<D::Buffer<u32>>,
    residual: Option<<D as Memory>::Buffer<f32>>,
    gathered: D::Buffer<f32>,
}

/// See the module. The nodes are exact in half precision, before one is changed by 1 %.
pub enum GatherLatentsF16 {}

impl Case for GatherLatentsF16 {
    const KERNEL: Kernel = Kernel::GatherLatentsF16;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = gather_latents::LIMITS;
    const REASON: &'static str = "as gather_latents: numbers in half precision are read exactly";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = gather_latents::SPOILERS;

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let mut jobs = jobs(&mut random(43, seed, size), size);
        let nodes = jobs.iter_mut().flat_map(|job| &mut job.grids).flatten();
        nodes.for_each(|node| *node = nearest(*node).to_f32());
        jobs
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::four_count).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                views: device.upload(&job.views)?,
                points: device.upload(&job.points)?,
                grids: job.grids.iter().map(|grid| device.upload(&packed(grid))).collect::<Result<_, _>>()?,
                residual: if job.residual.is_empty() { None } else { Some(device.upload(&job.residual)?) },
                gathered: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        for (job, LoadedJob { views, points, grids, residual, gathered }) in jobs.iter().zip(loaded) {
            for (grid, view) in grids.iter().zip(0..) {
                let block = GatherBlock { view, ..job.block };
                device.gather_latents_f16(&block, views, points, grid, residual.as_ref(), gathered)?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let gathered: Vec<Vec<f32>> =
            loaded.iter().map(|job| device.download(&job.gathered)).collect::<Result<_, _>>()?;
        Ok(gathered.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let each = jobs.iter().flat_map(|job| {
            let mut gathered = gather_latents::expected(std::slice::from_ref(job));
            gathered.push(Some(Bounded::ZERO));
            gathered
        });
        each.collect()
    }
}
