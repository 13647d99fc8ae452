//! [`Kernel::MatrixProduct`] and [`Kernel::SoftmaxRows`]: matrices of awkward sizes, some of them columns of one wider
//! matrix, on the right as they are or transposed; rows of scores from nearly equal weights to a single weight of 1.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::matrix_oracle;
use crate::poses::{Random, numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::network::attend::MatrixBlock;
use viewfuse_vulkan::kernel::{Kernel, tile_elements};

/// Two matrices.
#[derive(Clone, Debug)]
pub struct Job {
    block: MatrixBlock,
    left: Vec<f32>,
    /// `None`: it is in the left one's buffer.
    right: Option<Vec<f32>>,
}

impl Job {
    fn len(&self) -> usize {
        (self.block.row_count * self.block.column_count) as usize
    }
}

/// The same in a device's memory, and the outputs.
pub struct LoadedJob<D: Device> {
    left: D::Buffer<f32>,
    right: Option<<D as Memory>::Buffer<f32>>,
    outputs: D::Buffer<f32>,
}

/// See the module.
pub enum MatrixProduct {}

impl Case for MatrixProduct {
    const KERNEL: Kernel = Kernel::MatrixProduct;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of magnitudes of n products, in whatever order they are summed, and one more product";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("left", |jobs| jobs.iter_mut().flat_map(|job| &mut job.left).for_each(|value| *value *= 1.01)),
        ("right", |jobs| {
            jobs.iter_mut().filter_map(|job| job.right.as_mut()).flatten().for_each(|value| *value *= 1.01)
        }),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.scale *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(27, seed, size);
        let awkward = 1 + random.below(100) as u32;
        let shapes = [
            [1, 1, 1],
            [size, awkward, 1 + awkward / 3],
            [65, 3, 7],
            [63, 600, 65],
            [64, 64, 64],
            [size.div_ceil(5), 17, 129],
            [3, 130, 70],
            [7, size, 5],
        ];
        let job = |(index, [row_count, inner_count, column_count]): (usize, [u32; 3])| {
            let flags = index as u64 + seed;
            let (is_transposed, is_one_buffer) = (flags & 1 == 1, flags >> 1 & 1 == 1);
            let left_gap = random.below(3) as u32;
            let [right_rows, right_columns] =
                if is_transposed { [column_count, inner_count] } else { [inner_count, column_count] };
            let right_gap = random.below(3) as u32;
            // In one buffer they lie side by side.
            let (left_pitch, right_pitch, right_first) = if is_one_buffer {
                let pitch = left_gap + inner_count + right_columns + right_gap;
                (pitch, pitch, left_gap + inner_count)
            } else {
                (left_gap + inner_count, right_gap + right_columns, right_gap)
            };
            let block = MatrixBlock {
                row_count,
                inner_count,
                column_count,
                left_pitch,
                left_first: left_gap,
                right_row_pitch: if is_transposed { 1 } else { right_pitch },
                right_column_pitch: if is_transposed { right_pitch } else { 1 },
                right_first,
                scale: (1.0 / f64::from(inner_count).sqrt()) as f32,
            };
            let left_len = left_gap + row_count * left_pitch;
            let right_len = right_first + right_rows * right_pitch;
            let mut matrix = |count: u32| numbers(count as usize, || random.normal());
            match is_one_buffer {
                true => Job { block, left: matrix(left_len.max(right_len)), right: None },
                false => Job { block, left: matrix(left_len), right: Some(matrix(right_len)) },
            }
        };
        shapes.into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| tile_elements(job.block.row_count, job.block.column_count) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                left: device.upload(&job.left)?,
                right: job.right.as_ref().map(|right| device.upload(right)).transpose()?,
                outputs: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { left, right, outputs })| {
            device.matrix_product(&job.block, left, right.as_ref().unwrap_or(left), outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let outputs: Vec<Vec<f32>> =
            loaded.iter().map(|job| device.download(&job.outputs)).collect::<Result<_, _>>()?;
        Ok(outputs.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job| {
            let Job { block, left, right } = job;
            let columns = block.column_count as usize;
            let right = right.as_ref().unwrap_or(left);
            let output = |index| matrix_oracle::product(left, right, block, index / columns, index % columns);
            let outputs = map(job.len(), 16, output);
            outputs.into_iter().chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}

/// Rows of scores.
#[derive(Clone, Debug)]
pub struct Scores {
    column_count: u32,
    scores: Vec<f32>,
}

impl Scores {
    fn row_count(&self) -> u32 {
        self.scores.len() as u32 / self.column_count
    }
}

/// See the module.
pub enum SoftmaxRows {}

impl Case for SoftmaxRows {
    const KERNEL: Kernel = Kernel::SoftmaxRows;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "a difference from the largest score, of up to some 10^2, is an error of the exponent; two \
        exponentials, n units (2^-24) of their sum, a division and a product";
    const SPOILERS: &'static [Spoiler<Vec<Scores>>] =
        &[("scores", |jobs| jobs.iter_mut().flat_map(|job| &mut job.scores).for_each(|score| *score *= 1.01))];

    type Inputs = Vec<Scores>;
    type Loaded<D: Device> = Vec<[<D as Memory>::Buffer<f32>; 2]>;

    fn inputs(seed: u64, size: u32) -> Vec<Scores> {
        let random = &mut random(28, seed, size);
        let job = |(column_count, deviation): (u32, f64)| {
            let count = size.div_ceil(column_count) * column_count;
            let offset = deviation * random.normal();
            // Some take no part.
            let score = |random: &mut Random| match random.below(16) {
                0 => -1.0e30,
                _ => offset + deviation * random.normal(),
            };
            let mut scores = numbers(count as usize, || score(random));
            // All of a row the same.
            scores[..column_count as usize].fill(offset as f32);
            Scores { column_count, scores }
        };
        [(1, 1.0), (7, 0.1), (64, 1.0), (65, 30.0), (400, 3.0)].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Scores>) -> usize {
        jobs.iter().map(|job| job.row_count() as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Scores>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Scores| Ok([device.upload(&job.scores)?, device.zeros(job.scores.len() + 1)?]);
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Scores>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [scores, weights])| {
            device.softmax_rows(&job.column_count, job.row_count(), scores, weights)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let weights: Vec<Vec<f32>> =
            loaded.iter().map(|[_, weights]| device.download(weights)).collect::<Result<_, _>>()?;
        Ok(weights.concat())
    }

    fn expected(jobs: &Vec<Scores>) -> Vec<Option<Bounded>> {
        let weights = |job: &Scores| {
            let columns = job.column_count as usize;
            let row = |row: usize| matrix_oracle::softmax(&job.scores[row * columns..][..columns]);
            let weights = map(job.row_count() as usize, 1, row);
            weights.into_iter().flatten().chain([Bounded::ZERO]).map(Some)
        };
        jobs.iter().flat_map(weights).collect()
    }
}
