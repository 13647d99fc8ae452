//! [`Kernel::MaxPool`] and [`Kernel::Upsample`]: images from one pixel on, windows that reach over borders or hold no
//! pixel, enlargements that hit nodes and others, some of the channels of a wider image.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::network_oracle;
use crate::poses::{numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job<B> {
    block: B,
    inputs: Vec<f32>,
    output_count: usize,
}

/// Inputs and outputs in a device's memory.
pub type Images<D> = (<D as Memory>::Buffer<f32>, <D as Memory>::Buffer<f32>);

impl<B> Job<B> {
    fn spoil(&mut self) {
        self.inputs.iter_mut().for_each(|input| *input *= 1.01);
    }

    /// Inputs and, one number longer than needed, outputs.
    fn load<D: Device>(&self, device: &D) -> Result<Images<D>, DeviceError> {
        Ok((device.upload(&self.inputs)?, device.zeros(self.output_count + 1)?))
    }
}

fn read<D: Device>(device: &D, loaded: &[Images<D>]) -> Result<Vec<f32>, DeviceError> {
    let outputs: Vec<Vec<f32>> =
        loaded.iter().map(|(_, outputs)| device.download(outputs)).collect::<Result<_, _>>()?;
    Ok(outputs.concat())
}

/// See the module.
pub enum MaxPool {}

impl Case for MaxPool {
    const KERNEL: Kernel = Kernel::MaxPool;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-2 };
    const REASON: &'static str = "one of the inputs: exact";
    const SPOILERS: &'static [Spoiler<Vec<Job<PoolBlock>>>] =
        &[("inputs", |jobs| jobs.iter_mut().for_each(Job::spoil))];

    type Inputs = Vec<Job<PoolBlock>>;
    type Loaded<D: Device> = Vec<Images<D>>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(19, seed, size);
        let job = |[side, stride, padding, channels]: [u32; 4]| {
            let pixel_count = f64::from(size * stride * stride) / f64::from(channels);
            let in_width = side.max(pixel_count.sqrt() as u32 + random.below(3) as u32);
            let in_height = side.max((pixel_count / f64::from(in_width)) as u32 + random.below(3) as u32);
            let out = |inner: u32| (inner + 2 * padding - side) / stride + 1;
            let (out_height, out_width) = (out(in_height), out(in_width));
            let block = PoolBlock { in_height, in_width, out_height, out_width, channels, size: side, stride, padding };
            // Mostly negative: what lies beyond the border is no 0.
            let inputs = numbers((in_height * in_width * channels) as usize, || random.normal() - 1.0);
            Job { block, inputs, output_count: (out_height * out_width * channels) as usize }
        };
        // The last one's corner windows hold nothing.
        [[3, 2, 1, 64], [1, 1, 0, 1], [2, 2, 0, 3], [5, 1, 2, 7], [1, 1, 2, 5]].map(job).to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| job.output_count).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        jobs.iter().map(|job| job.load(device)).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (inputs, outputs))| device.max_pool(&job.block, inputs, outputs))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        read(device, loaded)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job<PoolBlock>| {
            let output = |index| Some(network_oracle::max_pool(&job.inputs, &job.block, index));
            let outputs = map(job.output_count, 64, output);
            outputs.into_iter().chain([Some(Bounded::ZERO)]).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}

/// Rows and columns of inputs; rows and columns of outputs, 0 for as many as requested; channels of the inputs, the
/// first of the outputs' that are theirs, those of the outputs.
const SHAPES: [[u32; 7]; 6] = [
    [1, 1, 3, 5, 4, 0, 4],
    [4, 4, 7, 7, 3, 2, 9],
    [8, 3, 0, 0, 1, 0, 1],
    [32, 32, 64, 64, 1, 1, 2],
    [5, 6, 1, 1, 7, 3, 10],
    [16, 2, 0, 0, 5, 60, 65],
];

/// See the module.
pub enum Upsample {}

impl Case for Upsample {
    const KERNEL: Kernel = Kernel::Upsample;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a place among the inputs: a division, a product and a sum, times the change between \
        neighbours; two mixtures";
    const SPOILERS: &'static [Spoiler<Vec<Job<UpsampleBlock>>>] =
        &[("inputs", |jobs| jobs.iter_mut().for_each(Job::spoil))];

    type Inputs = Vec<Job<UpsampleBlock>>;
    type Loaded<D: Device> = Vec<Images<D>>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(20, seed, size);
        let job = |[in_height, in_width, out_height, out_width, in_channels, first_channel, out_channels]: [u32; 7]| {
            let side = f64::from(size / in_channels).sqrt() as u32 + 1 + random.below(4) as u32;
            let [out_height, out_width] = [out_height, out_width].map(|count| if count == 0 { side } else { count });
            let block =
                UpsampleBlock { in_height, in_width, in_channels, out_height, out_width, out_channels, first_channel };
            let inputs = numbers((in_height * in_width * in_channels) as usize, || random.normal());
            Job { block, inputs, output_count: (out_height * out_width * out_channels) as usize }
        };
        SHAPES.map(job).to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        let count = |UpsampleBlock { out_height, out_width, in_channels, .. }| out_height * out_width * in_channels;
        jobs.iter().map(|job| count(job.block) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        jobs.iter().map(|job| job.load(device)).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (inputs, outputs))| device.upsample(&job.block, inputs, outputs))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        read(device, loaded)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let outputs = |Job { block, inputs, output_count }: &Job<UpsampleBlock>| {
            let output = |index: usize| {
                let (pixel, channel) = (index as u32 / block.out_channels, index as u32 % block.out_channels);
                let (row, column) = (pixel / block.out_width, pixel % block.out_width);
                // The other channels stay as they were.
                match channel.checked_sub(block.first_channel) {
                    Some(channel) if channel < block.in_channels => {
                        network_oracle::upsample(inputs, block, row, column, channel as usize)
                    }
                    _ => Bounded::ZERO,
                }
            };
            let outputs = map(*output_count, 64, output);
            outputs.into_iter().chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}
