//! [`Kernel::CastRays`] and [`Kernel::PlacePoints`]: rays of any camera with depths along them or along its axis,
//! points of some samples on some rays.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::random;
use crate::ray_oracle;
use crate::sights::{camera, load_rays, ray};
use viewfuse_core::rays::{CastBlock, PlaceBlock, RayPoint, TargetRay};
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Rays};
use viewfuse_vulkan::kernel::Kernel;

/// Some pixels of a target.
#[derive(Clone, Debug)]
pub struct Cast {
    block: CastBlock,
    pixels: Vec<u32>,
}

/// See the module.
pub enum CastRays {}

impl Case for CastRays {
    const KERNEL: Kernel = Kernel::CastRays;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "quotients of image coordinates by the focal length, three products with the axes, a norm \
        (1 where depths are along the axis) and a division by it";
    const SPOILERS: &'static [Spoiler<Vec<Cast>>] = &[
        ("pixels", |jobs| {
            jobs.iter_mut().for_each(|job| job.pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 101 / 100))
        }),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.camera.intrinsics[0] *= 1.01)),
    ];

    type Inputs = Vec<Cast>;
    type Loaded<D: Device> = Vec<Rays<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Cast> {
        let random = &mut random(5, seed, size);
        let job = |(pixel_centre, along_axis)| {
            let camera = camera(random);
            let (near, far) = (random.range(0.1, 1.0) as f32, random.range(1.0, 9.0) as f32);
            let pixel_count = (camera.width * camera.height) as usize;
            let pixels = (0..size).map(|_| random.below(pixel_count) as u32).collect();
            Cast { block: CastBlock { camera, near, far, pixel_centre, along_axis }, pixels }
        };
        [(0.5, 0), (0.0, 0), (0.5, 1), (0.25, 1)].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Cast>) -> usize {
        jobs.iter().map(|job| job.pixels.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Cast>) -> Result<Self::Loaded<D>, DeviceError> {
        // One more than requested.
        let load = |job: &Cast| {
            let pixels = device.upload(&[&job.pixels[..], &[0]].concat())?;
            Ok(Rays { count: job.pixels.len() as u32, pixels, rays: device.zeros(job.pixels.len() + 1)? })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Cast>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter()
            .zip(loaded)
            .try_for_each(|(job, Rays { count, pixels, rays })| device.cast_rays(&job.block, *count, pixels, rays))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for rays in loaded {
            for TargetRay { origin, near, direction, far } in device.download(&rays.rays)? {
                values.extend([&origin[..], &[near], &direction, &[far]].concat());
            }
        }
        Ok(values)
    }

    fn expected(jobs: &Vec<Cast>) -> Vec<Option<Bounded>> {
        let rays = |job: &Cast| {
            let rays = job.pixels.iter().map(|pixel| ray_oracle::cast_ray(&job.block, *pixel));
            rays.chain([[Bounded::ZERO; 8]]).flatten().map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(rays).collect()
    }
}

/// Samples on rays, and which of them become points.
#[derive(Clone, Debug)]
pub struct Placed {
    block: PlaceBlock,
    rays: Vec<TargetRay>,
    depths: Vec<f32>,
    samples: Vec<u32>,
}

impl Placed {
    fn point_count(&self) -> u32 {
        self.samples.len() as u32 - self.block.first
    }
}

/// Rays, depths, the list of samples, points.
pub type LoadedPlaced<D> = (Rays<D>, Buffer<D, f32>, Buffer<D, u32>, Buffer<D, RayPoint>);

type Buffer<D, T> = <D as viewfuse_device::Memory>::Buffer<T>;

/// See the module.
pub enum PlacePoints {}

impl Case for PlacePoints {
    const KERNEL: Kernel = Kernel::PlacePoints;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition a coordinate, a difference of depths";
    const SPOILERS: &'static [Spoiler<Vec<Placed>>] = &[
        ("samples", |jobs| {
            jobs.iter_mut().for_each(|job| job.samples.iter_mut().for_each(|sample| *sample = *sample * 99 / 100))
        }),
        ("rays", |jobs| jobs.iter_mut().for_each(|job| job.rays.iter_mut().for_each(|ray| ray.direction[0] *= 1.01))),
        ("depths", |jobs| {
            jobs.iter_mut().for_each(|job| job.depths.iter_mut().step_by(2).for_each(|depth| *depth *= 1.01))
        }),
    ];

    type Inputs = Vec<Placed>;
    type Loaded<D: Device> = Vec<LoadedPlaced<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Placed> {
        let random = &mut random(6, seed, size);
        let job = |(sample_count, has_samples): (u32, u32)| {
            let ray_count = size.div_ceil(sample_count) + 1;
            let rays: Vec<TargetRay> = (0..ray_count).map(|_| ray(random)).collect();
            let mut depths = Vec::new();
            for ray in &rays {
                let (near, far) = (f64::from(ray.near), f64::from(ray.far));
                // Two passes may have the same depth.
                let mut own: Vec<f32> = (0..sample_count)
                    .map(|_| if random.below(8) == 0 { ray.far } else { random.range(near, far) as f32 })
                    .collect();
                own.sort_by(f32::total_cmp);
                depths.extend(own);
            }
            let samples = (0..size).map(|_| random.below(depths.len()) as u32).collect();
            let first = (size / 3).min(size - 1);
            Placed { block: PlaceBlock { sample_count, first, has_samples }, rays, depths, samples }
        };
        // The last ones without a list.
        [(1, 1), (5, 1), (96, 1), (1, 0), (96, 0)].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Placed>) -> usize {
        jobs.iter().map(|job| job.point_count() as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Placed>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Placed| {
            // Which pixels these are does not matter here.
            let rays = load_rays(device, &vec![0; job.rays.len()], &job.rays)?;
            let points = device.zeros(job.point_count() as usize + 1)?;
            Ok((rays, device.upload(&job.depths)?, device.upload(&job.samples)?, points))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Placed>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (rays, depths, samples, points))| {
            let samples = (job.block.has_samples != 0).then_some(&*samples);
            device.place_points(&job.block, job.point_count(), samples, &rays.rays, depths, points)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for (.., points) in loaded {
            // Numbers of samples are small enough to be exact.
            for RayPoint { position, length, direction, sample } in device.download(points)? {
                values.extend([&position[..], &[length], &direction, &[sample as f32]].concat());
            }
        }
        Ok(values)
    }

    fn expected(jobs: &Vec<Placed>) -> Vec<Option<Bounded>> {
        let points = |job: &Placed| {
            let PlaceBlock { sample_count, first, has_samples } = job.block;
            let list: Vec<u32> =
                if has_samples != 0 { job.samples.clone() } else { (0..job.samples.len() as u32).collect() };
            let place = |sample: &u32| ray_oracle::place_point(&job.rays, &job.depths, sample_count, *sample);
            list[first as usize..].iter().map(place).chain([[Bounded::ZERO; 8]]).flatten().map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(points).collect()
    }
}
