//! [`Kernel::EmbedPoints`], [`Kernel::VisibleWeights`] and [`Kernel::Radiance`]: points around the origin and beyond,
//! seen by 1 to 32 views, some of which have them behind.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::point_oracle;
use crate::poses::{Random, numbers, random};
use crate::sights::{camera, point};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::pixelnerf::EmbedBlock;
use viewfuse_vulkan::kernel::Kernel;

type Buffer<D, T> = <D as Memory>::Buffer<T>;

/// The numbers of views and points.
fn views_and_points(random: &mut Random, view_count: u32, point_count: u32) -> (Vec<CameraBlock>, Vec<RayPoint>) {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let points = (0..point_count).map(|_| point(random, &views)).collect();
    (views, points)
}

fn spoil_points(points: &mut [RayPoint]) {
    points.iter_mut().for_each(|point| point.position[0] *= 1.01);
}

/// Points to embed.
#[derive(Clone, Debug)]
pub struct Embed {
    block: EmbedBlock,
    views: Vec<CameraBlock>,
    points: Vec<RayPoint>,
}

/// See the module.
pub enum EmbedPoints {}

impl Case for EmbedPoints {
    const KERNEL: Kernel = Kernel::EmbedPoints;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "a rotation: three products and their sum; an angle is its product with up to 48, a sine \
        adds 9e-8";
    const SPOILERS: &'static [Spoiler<Vec<Embed>>] = &[
        ("views", |jobs| jobs.iter_mut().for_each(|job| job.views[0].pose.right[0] *= 1.01)),
        ("points", |jobs| jobs.iter_mut().for_each(|job| spoil_points(&mut job.points))),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.frequency *= 1.01)),
    ];

    type Inputs = Vec<Embed>;
    type Loaded<D: Device> = Vec<(Buffer<D, CameraBlock>, Buffer<D, RayPoint>, Buffer<D, f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Embed> {
        let random = &mut random(13, seed, size);
        let job = |(view_count, frequency_count): (u32, u32)| {
            let point_count = size.div_ceil(4 * view_count);
            let (views, mut points) = views_and_points(random, view_count, point_count);
            // Angles stay below 8192, and their errors say something.
            for point in &mut points {
                point.position = point.position.map(|coordinate| coordinate.clamp(-4.0, 4.0));
            }
            Embed { block: EmbedBlock { point_count, frequency_count, frequency: 1.5 }, views, points }
        };
        [(1, 6), (2, 1), (3, 0), (32, 6)].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Embed>) -> usize {
        jobs.iter().map(|job| job.views.len() * job.points.len() * job.block.row_len() as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Embed>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Embed| {
            let embedded = device.zeros(job.views.len() * job.points.len() * job.block.row_len() as usize + 1)?;
            Ok((device.upload(&job.views)?, device.upload(&job.points)?, embedded))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Embed>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (views, points, embedded))| {
            device.embed_points(&job.block, job.views.len() as u32, views, points, embedded)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let embedded: Vec<Vec<f32>> =
            loaded.iter().map(|(.., embedded)| device.download(embedded)).collect::<Result<_, _>>()?;
        Ok(embedded.concat())
    }

    fn expected(jobs: &Vec<Embed>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Embed { block, views, points } in jobs {
            for view in views {
                let rows: Vec<_> = map(points.len(), 1, |point| point_oracle::embed(view, &points[point], block));
                expected.extend(rows.into_iter().flatten().map(Some));
            }
            // What is beyond the rows stays as it was.
            expected.push(Some(Bounded::ZERO));
        }
        expected
    }
}

/// Points, views and their weights.
#[derive(Clone, Debug)]
pub struct Visible {
    views: Vec<CameraBlock>,
    points: Vec<RayPoint>,
    weights: Vec<f32>,
}

/// Views, weights, points, and the outputs.
pub type LoadedVisible<D> = (Buffer<D, CameraBlock>, Buffer<D, f32>, Buffer<D, RayPoint>, Buffer<D, f32>);

/// See the module.
pub enum VisibleWeights {}

impl Case for VisibleWeights {
    const KERNEL: Kernel = Kernel::VisibleWeights;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-3 };
    const REASON: &'static str = "a sum over views and a division by it; undecided where a point is on a view's plane to \
        within a rotation's rounding";
    const SPOILERS: &'static [Spoiler<Vec<Visible>>] = &[
        ("views", |jobs| {
            let views = jobs.iter_mut().flat_map(|job| &mut job.views);
            views.for_each(|view| view.pose.right[3] *= 1.01);
        }),
        ("weights", |jobs| jobs.iter_mut().for_each(|job| job.weights[0] *= 1.01)),
        ("points", |jobs| jobs.iter_mut().for_each(|job| spoil_points(&mut job.points))),
    ];

    type Inputs = Vec<Visible>;
    type Loaded<D: Device> = Vec<LoadedVisible<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Visible> {
        let random = &mut random(14, seed, size);
        let job = |view_count: u32| {
            let (views, points) = views_and_points(random, view_count, size);
            // Some views count for nothing: where only they see a point, the weights stay as they are.
            let mut weights = numbers(views.len(), || random.range(0.1, 1.0));
            weights.iter_mut().step_by(3).skip(1).for_each(|weight| *weight = 0.0);
            let sum: f32 = weights.iter().sum();
            Visible { views, points, weights: weights.iter().map(|weight| weight / sum).collect() }
        };
        [1, 2, 5, 32].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Visible>) -> usize {
        jobs.iter().map(|job| job.views.len() * job.points.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Visible>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Visible| {
            let visible = device.zeros(job.views.len() * job.points.len())?;
            Ok((device.upload(&job.views)?, device.upload(&job.weights)?, device.upload(&job.points)?, visible))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Visible>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (views, weights, points, visible))| {
            let (view_count, point_count) = (job.views.len() as u32, job.points.len() as u32);
            device.visible_weights(&view_count, point_count, views, weights, points, visible)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let visible: Vec<Vec<f32>> =
            loaded.iter().map(|(.., visible)| device.download(visible)).collect::<Result<_, _>>()?;
        Ok(visible.concat())
    }

    fn expected(jobs: &Vec<Visible>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Visible { views, points, weights } in jobs {
            let row = |point: usize| point_oracle::visible_weights(views, weights, &points[point]);
            expected.extend(map(points.len(), 16, row).into_iter().flatten());
        }
        expected
    }
}

/// A network's outputs at points.
#[derive(Clone, Debug)]
pub struct Said {
    raw: Vec<f32>,
    points: Vec<RayPoint>,
    sample_count: usize,
}

/// See the module.
pub enum Radiance {}

impl Case for Radiance {
    const KERNEL: Kernel = Kernel::Radiance;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "2 ULP of the exponential, an addition and a division; a product";
    const SPOILERS: &'static [Spoiler<Said>] = &[
        ("raw", |said| said.raw.iter_mut().for_each(|raw| *raw *= 1.01)),
        ("points", |said| said.points.iter_mut().for_each(|point| point.length *= 1.01)),
    ];

    type Inputs = Said;
    type Loaded<D: Device> = (Buffer<D, f32>, Buffer<D, RayPoint>, Buffer<D, [f32; 4]>);

    fn inputs(seed: u64, size: u32) -> Said {
        let random = &mut random(15, seed, size);
        let mut said = Said { raw: Vec::new(), points: Vec::new(), sample_count: 2 * size as usize + 1 };
        let view = camera(random);
        for index in 0..size {
            let scale = [1.0, 5.0, 100.0, 1.0e30][random.below(4)];
            said.raw.extend(numbers(4, || scale * random.normal()));
            // So that the largest densities stay within what can be compared.
            let length = random.log_range(1.0e-3, 1.0) / scale;
            // Some samples have no point, and the others come in another order.
            let sample = 2 * (size - 1 - index) + random.below(2) as u32;
            said.points.push(RayPoint { length: length as f32, sample, ..point(random, &[view]) });
        }
        said
    }

    fn element_count(said: &Said) -> usize {
        said.points.len()
    }

    fn load<D: Device>(device: &D, said: &Said) -> Result<Self::Loaded<D>, DeviceError> {
        Ok((device.upload(&said.raw)?, device.upload(&said.points)?, device.zeros(said.sample_count)?))
    }

    fn run<D: Device>(device: &D, said: &Said, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.radiance(said.points.len() as u32, &loaded.0, &loaded.1, &mut loaded.2)
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(&loaded.2)?.into_flattened())
    }

    fn expected(said: &Said) -> Vec<Option<Bounded>> {
        let mut samples = vec![[Bounded::ZERO; 4]; said.sample_count];
        for (raw, point) in said.raw.chunks_exact(4).zip(&said.points) {
            samples[point.sample as usize] = point_oracle::radiance(raw, point.length);
        }
        samples.into_iter().flatten().map(Some).collect()
    }
}
