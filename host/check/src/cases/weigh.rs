//! [`Kernel::Weigh`]: every scheme, from 1 to 32 sources, cameras anywhere.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::oracle::{Arithmetic, evaluate, schemes};
use crate::poses::{Random, looking_at_origin, random, ring};
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::weighting::{MAX_WEIGHED, Scheme, WeighBlock};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_vulkan::kernel::Kernel;

/// Weights below this may be 0: the exponential has no subnormal results, and devices may flush them.
const NEGLIGIBLE: f64 = 4.0e-38;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job {
    scheme: Scheme,
    block: WeighBlock,
    sources: Vec<PoseBlock>,
    targets: Vec<PoseBlock>,
}

/// The arrangement of cameras with this number.
fn cameras(random: &mut Random, arrangement: u32, source_count: usize, target_count: usize) -> (Vec<Pose>, Vec<Pose>) {
    let scale = [1.0, 1.0e18, 1.0e-20, 1.0, 1.2, 1.0][arrangement as usize % 6];
    let mut sources: Vec<Pose> = (0..source_count).map(|_| random.pose(scale)).collect();
    let mut targets: Vec<Pose> = (0..target_count).map(|_| random.pose(scale)).collect();
    match arrangement % 6 {
        // Every other target is at a source's centre.
        3 => targets.iter_mut().step_by(2).enumerate().for_each(|(i, target)| *target = sources[i % source_count]),
        4 => {
            sources = ring(source_count, scale, 0.5, random.range(0.0, 1.0));
            let place =
                |random: &mut Random| [random.range(0.5, 1.0), random.range(-1.0, 1.0), random.range(-0.7, 0.7)];
            targets = (0..target_count).map(|_| looking_at_origin(place(random), random.range(0.0, 3.0))).collect();
        }
        // Some sources are a hundred million times as far as others.
        5 => sources.iter_mut().for_each(|source| {
            let distance = random.log_range(1.0e-3, 1.0e5);
            *source = random.pose(distance);
        }),
        _ => {}
    }
    (sources, targets)
}

/// See the module.
pub enum Weigh {}

impl Case for Weigh {
    const KERNEL: Kernel = Kernel::Weigh;
    // As many as give every scheme every number of sources.
    const SEED_COUNT: u64 = 32;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "relative, counted for each scheme: roundings on the way to an error and its quotients, \
        divisions as 2.5 ULP, roots as 4.5 ULP";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("sources", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.sources[0]))),
        ("targets", |jobs| jobs.iter_mut().for_each(|job| job.targets.iter_mut().for_each(spoil))),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.scheme.parameter *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<(D::Buffer<PoseBlock>, D::Buffer<PoseBlock>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(0, seed, size);
        // So that neighbouring seeds give every scheme every number of sources.
        let schemes = schemes();
        let first = seed as usize * schemes.len() + size as usize;
        let job = |(index, scheme): (usize, Scheme)| {
            let source_count = (first + index) % MAX_WEIGHED + 1;
            let arrangement = (first + index + seed as usize) as u32;
            let (sources, targets) = cameras(random, arrangement, source_count, size as usize);
            Job {
                scheme,
                block: WeighBlock { scheme: scheme.block(), source_count: source_count as u32 },
                sources: sources.iter().map(Pose::block).collect(),
                targets: targets.iter().map(Pose::block).collect(),
            }
        };
        schemes.into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| job.targets.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            let weights = device.zeros(job.targets.len() * MAX_WEIGHED)?;
            Ok((device.upload(&job.sources)?, device.upload(&job.targets)?, weights))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (sources, targets, weights))| {
            device.weigh(&job.block, job.targets.len() as u32, sources, targets, weights)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let rows: Vec<Vec<f32>> =
            loaded.iter().map(|(_, _, weights)| device.download(weights)).collect::<Result<_, _>>()?;
        Ok(rows.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let rows = |job: &Job| map(job.targets.len(), 1, |target| row(job, &job.targets[target]));
        jobs.iter().flat_map(rows).flatten().collect()
    }
}

/// A target's weights, zeros beyond the sources.
fn row(job: &Job, target: &PoseBlock) -> [Option<Bounded>; MAX_WEIGHED] {
    let sources: Vec<Pose> = job.sources.iter().map(PoseBlock::pose).collect();
    let (weights, units) = evaluate(job.scheme, &sources, &target.pose(), Arithmetic::VULKAN);
    let mut row = [Some(Bounded::ZERO); MAX_WEIGHED];
    for ((bounded, value), units) in row.iter_mut().zip(weights).zip(units) {
        *bounded = Some(Bounded { value, error: value * units / 16_777_216.0 + NEGLIGIBLE });
    }
    row
}

fn spoil(pose: &mut PoseBlock) {
    pose.right[3] *= 1.01;
    pose.forward[0] *= 1.01;
}
