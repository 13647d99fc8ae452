//! [`Kernel::Attend`]: softmax of products of random embeddings, from nearly equal weights to a single weight of 1.

use crate::agreement::Limits;
use crate::attention_oracle::attend;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{numbers, random};
use viewfuse_core::attention::EMBEDDING;
use viewfuse_core::weighting::MAX_WEIGHED;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job {
    source_count: u32,
    queries: Vec<f32>,
    keys: Vec<f32>,
}

/// See the module.
pub enum Attend {}

impl Case for Attend {
    const KERNEL: Kernel = Kernel::Attend;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 3.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "an error of a logit is a relative error of its weight: differences from the largest \
        logit, five roundings, then the exponential";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("queries", |jobs| jobs.iter_mut().for_each(|job| job.queries[0] *= 1.01)),
        ("keys", |jobs| jobs.iter_mut().for_each(|job| job.keys[5] *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<(D::Buffer<f32>, D::Buffer<f32>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(2, seed, size);
        let first = seed as usize * 5 + size as usize;
        let job = |(index, scale): (usize, f64)| {
            let source_count = (first + 11 * index) % MAX_WEIGHED + 1;
            Job {
                source_count: source_count as u32,
                queries: numbers(size as usize * EMBEDDING, || scale * random.normal()),
                keys: numbers(source_count * EMBEDDING, || scale * random.normal()),
            }
        };
        [0.1, 0.5, 1.0, 2.0].into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| job.queries.len() / EMBEDDING).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            let weights = device.zeros(job.queries.len() / EMBEDDING * MAX_WEIGHED)?;
            Ok((device.upload(&job.queries)?, device.upload(&job.keys)?, weights))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (queries, keys, weights))| {
            device.attend(&job.source_count, (job.queries.len() / EMBEDDING) as u32, queries, keys, weights)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let rows: Vec<Vec<f32>> =
            loaded.iter().map(|(_, _, weights)| device.download(weights)).collect::<Result<_, _>>()?;
        Ok(rows.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let row = |job: &Job, query: &[f32]| {
            let mut row = [Some(Bounded::ZERO); MAX_WEIGHED];
            row.iter_mut().zip(attend(query, &job.keys)).for_each(|(place, weight)| *place = Some(weight));
            row
        };
        jobs.iter()
            .flat_map(|job| {
                let query = |target: usize| &job.queries[target * EMBEDDING..][..EMBEDDING];
                map(job.queries.len() / EMBEDDING, 1, |target| row(job, query(target))).into_iter().flatten()
            })
            .collect()
    }
}
