//! [`Kernel::FuseViews`]: sums over 1 to 32 views, also where the next view's latents lie further on than there are
//! elements, with the same weights everywhere or each point's own.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::compositing_oracle::fuse_element;
use crate::poses::{numbers, random};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job {
    block: FuseBlock,
    element_count: usize,
    weights: Vec<f32>,
    latents: Vec<f32>,
}

/// See the module.
pub enum FuseViews {}

impl Case for FuseViews {
    const KERNEL: Kernel = Kernel::FuseViews;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition a view, two roundings each";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("weights", |jobs| jobs.iter_mut().for_each(|job| job.weights[0] *= 1.01)),
        ("latents", |jobs| jobs.iter_mut().for_each(|job| job.latents[0] *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<(D::Buffer<f32>, D::Buffer<f32>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(3, seed, size);
        // Views, channels of a point, whether points have their own weights and how far these are apart beyond need.
        let job = |(view_count, channel_count, own): (usize, u32, Option<usize>)| {
            let stride = size + random.below(3) as u32;
            let point_count = size.div_ceil(channel_count.max(1)) as usize;
            let weight_stride = own.map_or(0, |beyond| view_count + beyond);
            let mut weights = numbers(view_count.max(point_count * weight_stride), || random.unit());
            for weights in weights.chunks_mut(weight_stride.max(view_count)) {
                let sum: f32 = weights[..view_count].iter().sum();
                weights.iter_mut().for_each(|weight| *weight /= sum);
            }
            Job {
                block: FuseBlock {
                    view_count: view_count as u32,
                    stride,
                    channel_count,
                    weight_stride: weight_stride as u32,
                },
                element_count: size as usize,
                weights,
                latents: numbers(stride as usize * view_count, || random.normal()),
            }
        };
        let shared = [1, 2, 3, 8, 15, 32].map(|view_count| (view_count, 0, None));
        let own = [(1, 1, Some(0)), (3, 64, Some(0)), (2, 7, Some(3)), (32, 5, Some(0)), (4, 512, None)];
        shared.into_iter().chain(own).map(job).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| job.element_count).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok((device.upload(&job.weights)?, device.upload(&job.latents)?, device.zeros(job.element_count)?))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (weights, latents, fused))| {
            device.fuse_views(&job.block, job.element_count as u32, weights, latents, fused)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let fused: Vec<Vec<f32>> =
            loaded.iter().map(|(_, _, fused)| device.download(fused)).collect::<Result<_, _>>()?;
        Ok(fused.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let element = |job: &Job, element: usize| Some(fuse_element(&job.weights, &job.latents, &job.block, element));
        jobs.iter().flat_map(|job| (0..job.element_count).map(move |index| element(job, index))).collect()
    }
}
