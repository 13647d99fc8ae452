//! [`Kernel::GatherLatents`]: grids of any size under images of any size, with points inside, at borders, far outside
//! and behind the camera.

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
use viewfuse_kernels::pixelnerf::GatherBlock;
use viewfuse_vulkan::kernel::Kernel;

/// Views with their grids: a dispatch each.
#[derive(Clone, Debug)]
pub struct Job {
    pub(super) block: GatherBlock,
    pub(super) views: Vec<CameraBlock>,
    pub(super) points: Vec<RayPoint>,
    /// `[view]`: `[row][column][channel]`.
    pub(super) grids: Vec<Vec<f32>>,
    /// `[view][point][channel]`, or nothing.
    pub(super) residual: Vec<f32>,
}

impl Job {
    pub(super) fn len(&self) -> usize {
        self.views.len() * self.points.len() * self.block.channel_count as usize
    }

    /// Fours of channels: the elements of its dispatches.
    pub(super) fn four_count(&self) -> usize {
        self.views.len() * self.points.len() * self.block.four_count() as usize
    }
}

/// The same in a device's memory, and the gathered values.
pub struct LoadedJob<D: Device> {
    views: D::Buffer<CameraBlock>,
    points: D::Buffer<RayPoint>,
    grids: Vec<D::Buffer<f32>>,
    residual: Option<<D as Memory>::Buffer<f32>>,
    gathered: D::Buffer<f32>,
}

fn job(random: &mut Random, size: u32, index: usize, [view_count, channel_count]: [u32; 2]) -> Job {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let point_count = size.div_ceil(channel_count);
    let points = (0..point_count).map(|_| point(random, &views)).collect();
    let [height, width] = [0, 1].map(|_| [1, 2, 5, 16, 64][random.below(5)]);
    let block = GatherBlock {
        point_count,
        channel_count,
        height,
        width,
        pixel_centre: [0.5, 0.0][index % 2],
        ..GatherBlock::default()
    };
    let node_count = (height * width * channel_count) as usize;
    let grids = views.iter().map(|_| numbers(node_count, || random.normal())).collect();
    let mut job = Job { block, views, points, grids, residual: Vec::new() };
    if index % 4 < 2 {
        job.residual = numbers(job.len(), || random.normal());
    }
    job
}

/// Jobs with odd and even numbers of channels.
pub(super) fn jobs(random: &mut Random, size: u32) -> Vec<Job> {
    let kinds = [[1, 1], [2, 3], [3, 64], [1, 5], [2, 65], [1, 2], [4, 16], [2, 1]];
    kinds.into_iter().enumerate().map(|(index, kind)| job(random, size, index, kind)).collect()
}

/// The gathered values.
pub(super) fn expected(jobs: &[Job]) -> Vec<Option<Bounded>> {
    let mut expected = Vec::new();
    for Job { block, views, points, grids, residual } in jobs {
        let mut gathered = Vec::new();
        for (view, grid) in views.iter().zip(grids) {
            let row = |point: usize| match point_oracle::gather(view, grid, &points[point], block) {
                Some(values) => values.into_iter().map(Some).collect(),
                None => vec![None; block.channel_count as usize],
            };
            gathered.extend(map(points.len(), 1, row).into_iter().flatten());
        }
        for (value, residual) in gathered.iter_mut().zip(residual) {
            *value = value.map(|value| value + Bounded::from(*residual));
        }
        expected.extend(gathered);
    }
    expected
}

/// For every kernel that gathers from grids.
pub(super) const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
/// Their inputs, changed by 1 %.
pub(super) const SPOILERS: &[Spoiler<Vec<Job>>] = &[
    ("views", |jobs| jobs.iter_mut().flat_map(|job| &mut job.views).for_each(|view| view.intrinsics[0] *= 1.01)),
    ("points", |jobs| {
        jobs.iter_mut().flat_map(|job| &mut job.points).for_each(|point| point.position[1] *= 1.01);
    }),
    ("grid", |jobs| jobs.iter_mut().for_each(|job| job.grids[0].iter_mut().for_each(|node| *node *= 1.01))),
    ("residual", |jobs| jobs.iter_mut().for_each(|job| job.residual.iter_mut().for_each(|residual| *residual *= 1.01))),
    ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.pixel_centre *= 1.01)),
];

/// See the module.
pub enum GatherLatents {}

impl Case for GatherLatents {
    const KERNEL: Kernel = Kernel::GatherLatents;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = LIMITS;
    const REASON: &'static str = "errors of a projection, in pixels, times the change of the grid over a node; two mixtures; \
        undecided where a point is on the view's plane to within rounding";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = SPOILERS;

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        jobs(&mut random(16, seed, size), size)
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::four_count).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                views: device.upload(&job.views)?,
                points: device.upload(&job.points)?,
                grids: job.grids.iter().map(|grid| device.upload(grid)).collect::<Result<_, _>>()?,
                residual: if job.residual.is_empty() { None } else { Some(device.upload(&job.residual)?) },
                gathered: device.zeros(job.len())?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        for (job, LoadedJob { views, points, grids, residual, gathered }) in jobs.iter().zip(loaded) {
            for (grid, view) in grids.iter().zip(0..) {
                let block = GatherBlock { view, ..job.block };
                device.gather_latents(&block, views, points, grid, residual.as_ref(), gathered)?;
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
        expected(jobs)
    }
}
