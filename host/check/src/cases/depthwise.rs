//! [`Kernel::ConvolveDepthwise`]: images from one pixel on, windows with gaps and reaching over borders, weights that channels
//! share, inputs that are some of the channels of wider images.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::network_oracle;
use crate::poses::{numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::network::depthwise::DepthwiseBlock;
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job {
    block: DepthwiseBlock,
    inputs: Vec<f32>,
    weights: Vec<f32>,
}

impl Job {
    fn len(&self) -> usize {
        (self.block.pixel_count() * self.block.channels) as usize
    }
}

/// Inputs, weights and, one number longer than needed, outputs.
pub type Loaded<D> = [<D as Memory>::Buffer<f32>; 3];

/// Side of the window, stride, dilation, padding; channels, numbers between the pixels' channels, whether weights are shared.
const WINDOWS: [[u32; 7]; 7] = [
    [3, 1, 1, 1, 65, 0, 0],
    [3, 1, 12, 12, 4, 3, 0],
    [3, 2, 1, 1, 7, 0, 1],
    [2, 2, 1, 0, 3, 1, 1],
    [5, 1, 2, 3, 2, 0, 0],
    [1, 1, 1, 0, 17, 2, 0],
    [4, 2, 1, 2, 1, 0, 1],
];

/// See the module.
pub enum ConvolveDepthwise {}

impl Case for ConvolveDepthwise {
    const KERNEL: Kernel = Kernel::ConvolveDepthwise;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n summands, as many as places of the window";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("inputs", |jobs| jobs.iter_mut().flat_map(|job| &mut job.inputs).for_each(|input| *input *= 1.01)),
        ("weights", |jobs| jobs.iter_mut().flat_map(|job| &mut job.weights).for_each(|weight| *weight *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<Loaded<D>>;

    fn inputs(seed: u64, count: u32) -> Vec<Job> {
        let random = &mut random(22, seed, count);
        let job = |[size, stride, dilation, padding, channels, gap, is_shared]: [u32; 7]| {
            let pixel_count = f64::from(count * stride * stride) / f64::from(channels);
            let reach = (size - 1) * dilation + 1;
            let least = reach.saturating_sub(2 * padding).max(1);
            let in_width = (pixel_count.sqrt() as u32 + random.below(3) as u32).max(least);
            let in_height = ((pixel_count / f64::from(in_width)) as u32 + random.below(3) as u32).max(least);
            let out = |inner: u32| (inner + 2 * padding - reach) / stride + 1;
            let block = DepthwiseBlock {
                in_height,
                in_width,
                in_pitch: channels + gap,
                in_first: gap,
                out_height: out(in_height),
                out_width: out(in_width),
                channels,
                size,
                stride,
                dilation,
                padding,
                is_shared,
            };
            let input_count = (gap + in_height * in_width * block.in_pitch) as usize;
            let weight_count = (size * size * if is_shared == 1 { 1 } else { channels }) as usize;
            let inputs = numbers(input_count, || random.normal());
            Job { block, inputs, weights: numbers(weight_count, || random.normal() / f64::from(size)) }
        };
        WINDOWS.map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            // Behind the weights lies NaN.
            let weights = [&job.weights[..], &[f32::NAN]].concat();
            Ok([device.upload(&job.inputs)?, device.upload(&weights)?, device.zeros(job.len() + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [inputs, weights, outputs])| {
            device.convolve_depthwise(&job.block, inputs, weights, outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let outputs: Vec<Vec<f32>> =
            loaded.iter().map(|[.., outputs]| device.download(outputs)).collect::<Result<_, _>>()?;
        Ok(outputs.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job| {
            let channels = job.block.channels as usize;
            let output = |index: usize| {
                let (pixel, channel) = (index / channels, index % channels);
                network_oracle::depthwise(&job.inputs, &job.weights, &job.block, pixel, channel)
            };
            let outputs = map(job.len(), 16, output);
            outputs.into_iter().chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}
