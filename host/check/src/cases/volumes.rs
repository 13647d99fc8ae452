//! [`Kernel::GatherVolume`]: volumes of any size over images of any size, with points inside, between the last nodes
//! and the zeros around them, far outside and behind the camera.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{Random, numbers, random};
use crate::sights::{camera, point};
use crate::volume_oracle;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_kernels::genvs::VolumeBlock;
use viewfuse_vulkan::kernel::Kernel;

/// Views with their volumes: a dispatch each.
#[derive(Clone, Debug)]
pub struct Job {
    pub(super) block: VolumeBlock,
    pub(super) views: Vec<CameraBlock>,
    pub(super) points: Vec<RayPoint>,
    /// `[view]`: `[row][column][depth][feature]`.
    pub(super) volumes: Vec<Vec<f32>>,
}

impl Job {
    pub(super) fn len(&self) -> usize {
        self.views.len() * self.points.len() * self.block.feature_count as usize
    }
}

/// The same in a device's memory, and the gathered values.
pub struct LoadedJob<D: Device> {
    views: D::Buffer<CameraBlock>,
    points: D::Buffer<RayPoint>,
    volumes: Vec<D::Buffer<f32>>,
    gathered: D::Buffer<f32>,
}

fn job(random: &mut Random, size: u32, [view_count, feature_count]: [u32; 2]) -> Job {
    let views: Vec<CameraBlock> = (0..view_count).map(|_| camera(random)).collect();
    let point_count = size.div_ceil(feature_count);
    let points = (0..point_count).map(|_| point(random, &views)).collect();
    let [height, width, depth_count] = [0, 1, 2].map(|_| [1, 2, 5, 16, 24][random.below(5)]);
    let near = random.range(0.5, 2.5);
    let block = VolumeBlock {
        view: 0,
        point_count,
        feature_count,
        height,
        width,
        depth_count,
        near: near as f32,
        far: (near + random.range(0.5, 2.0)) as f32,
    };
    let node_count = (height * width * depth_count * feature_count) as usize;
    let volumes = views.iter().map(|_| numbers(node_count, || random.normal())).collect();
    Job { block, views, points, volumes }
}

/// Jobs with odd and even numbers of features.
pub(super) fn jobs(random: &mut Random, size: u32) -> Vec<Job> {
    let kinds = [[1, 1], [2, 3], [3, 16], [1, 5], [2, 33], [1, 2]];
    kinds.map(|kind| job(random, size, kind)).to_vec()
}

/// The gathered values, and unchanged numbers behind them.
pub(super) fn expected(jobs: &[Job]) -> Vec<Option<Bounded>> {
    let mut expected = Vec::new();
    for Job { block, views, points, volumes } in jobs {
        for (view, volume) in views.iter().zip(volumes) {
            let row = |point: usize| match volume_oracle::gather(view, volume, &points[point], block) {
                Some(values) => values.into_iter().map(Some).collect(),
                None => vec![None; block.feature_count as usize],
            };
            expected.extend(map(points.len(), 1, row).into_iter().flatten());
        }
        expected.push(Some(Bounded::ZERO));
    }
    expected
}

/// For every kernel that gathers from volumes.
pub(super) const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
/// Their inputs, changed by 1 %.
pub(super) const SPOILERS: &[Spoiler<Vec<Job>>] = &[
    ("views", |jobs| jobs.iter_mut().flat_map(|job| &mut job.views).for_each(|view| view.intrinsics[0] *= 1.01)),
    ("points", |jobs| jobs.iter_mut().flat_map(|job| &mut job.points).for_each(|point| point.position[1] *= 1.01)),
    ("volume", |jobs| jobs.iter_mut().for_each(|job| job.volumes[0].iter_mut().for_each(|node| *node *= 1.01))),
    ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.near *= 1.01)),
];

/// See the module.
pub enum GatherVolume {}

impl Case for GatherVolume {
    const KERNEL: Kernel = Kernel::GatherVolume;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = LIMITS;
    const REASON: &'static str = "errors of a projection and of the depth, in nodes, times the change of the volume over a \
        node; eight products; undecided where a point is on the view's plane to within rounding";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = SPOILERS;

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        jobs(&mut random(33, seed, size), size)
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                views: device.upload(&job.views)?,
                points: device.upload(&job.points)?,
                volumes: job.volumes.iter().map(|volume| device.upload(volume)).collect::<Result<_, _>>()?,
                gathered: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        for (job, LoadedJob { views, points, volumes, gathered }) in jobs.iter().zip(loaded) {
            for (volume, view) in volumes.iter().zip(0..) {
                device.gather_volume(&VolumeBlock { view, ..job.block }, views, points, volume, gathered)?;
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
