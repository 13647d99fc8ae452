//! [`Kernel::Linear`], and what the cases of all layers with weights share: matrices of awkward sizes, with and without
//! residual and rectification. Behind the inputs there is NaN, and behind the outputs no number may change.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::network_oracle::{self, LayerInputs};
use crate::poses::{Random, numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Layer, LayerShape, Memory};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_vulkan::kernel::{Kernel, tile_elements};

/// Numbers behind the last.
const SLACK: usize = 5;

/// The value of unwritten outputs.
pub(super) const UNTOUCHED: f32 = 3.0;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job<B> {
    pub(super) block: B,
    pub(super) inputs: Vec<f32>,
    pub(super) weights: Vec<f32>,
    pub(super) bias: Vec<f32>,
    pub(super) residual: Option<Vec<f32>>,
    pub(super) has_wide_images: bool,
    /// Numbers from the first on of which some are outputs.
    pub(super) output_count: usize,
}

/// The same in a device's memory, and the outputs.
pub struct LoadedJob<D: Device> {
    pub(super) inputs: D::Buffer<f32>,
    pub(super) layer: Layer<D>,
    pub(super) residual: Option<<D as Memory>::Buffer<f32>>,
    pub(super) outputs: D::Buffer<f32>,
}

/// How many numbers a layer has of each kind.
pub(super) struct Counts {
    pub(super) inputs: usize,
    /// Products of an output's sum.
    pub(super) inner: usize,
    /// Columns of the weights.
    pub(super) columns: usize,
    /// Numbers of the bias.
    pub(super) bias: usize,
    /// Numbers of the residual, if there is one.
    pub(super) residual: Option<usize>,
    pub(super) outputs: usize,
}

impl<B> Job<B> {
    /// A layer of random numbers of many magnitudes with outputs of about 1.
    pub(super) fn new(random: &mut Random, block: B, counts: Counts) -> Job<B> {
        let scale = 1.0 / (counts.inner as f64).sqrt();
        let magnitude = random.below(3);
        let mut number = || match magnitude {
            0 => random.normal() * random.log_range(1.0e-8, 1.0),
            _ => random.normal(),
        };
        Job {
            block,
            inputs: numbers(counts.inputs, &mut number),
            weights: numbers(counts.inner * counts.columns, || scale * number()),
            bias: numbers(counts.bias, &mut number),
            residual: counts.residual.map(|count| numbers(count, &mut number)),
            has_wide_images: false,
            output_count: counts.outputs,
        }
    }

    pub(super) fn load<D: Device>(&self, device: &D, columns: u32) -> Result<LoadedJob<D>, DeviceError> {
        let longer = |values: &[f32]| [values, &[f32::NAN; SLACK]].concat();
        let column_count = columns as usize;
        let shape = LayerShape {
            inner_count: self.weights.len() / column_count,
            column_count,
            has_wide_images: self.has_wide_images,
        };
        Ok(LoadedJob {
            inputs: device.upload(&longer(&self.inputs))?,
            layer: Layer::new(device, &shape, &longer(&self.weights), &longer(&self.bias))?,
            residual: self.residual.as_deref().map(|residual| device.upload(&longer(residual))).transpose()?,
            outputs: device.upload(&vec![UNTOUCHED; self.output_count + SLACK])?,
        })
    }

    /// The expected buffer: `output(index)` for each output, then the numbers behind them; `None` for numbers that are not
    /// outputs.
    pub(super) fn expected(
        &self,
        output: impl Fn(&LayerInputs, usize) -> Option<Bounded> + Sync,
    ) -> Vec<Option<Bounded>> {
        let Job { inputs, weights, bias, residual, .. } = self;
        let layer = LayerInputs { inputs, weights, bias, residual: residual.as_deref() };
        let output = |index| Some(output(&layer, index).unwrap_or(UNTOUCHED.into()));
        let outputs = map(self.output_count, 16, output);
        outputs.into_iter().chain([Some(UNTOUCHED.into()); SLACK]).collect()
    }
}

/// Changes an input of every dispatch by 1 %.
pub(super) fn spoil<B>(jobs: &mut [Job<B>], input: impl Fn(&mut Job<B>) -> &mut [f32]) {
    jobs.iter_mut().for_each(|job| input(job).iter_mut().for_each(|value| *value *= 1.01));
}

pub(super) fn read<D: Device>(device: &D, loaded: &[LoadedJob<D>]) -> Result<Vec<f32>, DeviceError> {
    let outputs: Vec<Vec<f32>> = loaded.iter().map(|job| device.download(&job.outputs)).collect::<Result<_, _>>()?;
    Ok(outputs.concat())
}

/// See the module.
pub enum Linear {}

impl Case for Linear {
    const KERNEL: Kernel = Kernel::Linear;
    // As many as give every shape every combination of residual and rectification.
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n summands, in whatever order they are summed";
    const SPOILERS: &'static [Spoiler<Vec<Job<LinearBlock>>>] = &[
        ("inputs", |jobs| spoil(jobs, |job| &mut job.inputs)),
        ("weights", |jobs| spoil(jobs, |job| &mut job.weights)),
        ("bias", |jobs| spoil(jobs, |job| &mut job.bias)),
        ("residual", |jobs| spoil(jobs, |job| job.residual.as_deref_mut().unwrap_or_default())),
    ];

    type Inputs = Vec<Job<LinearBlock>>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(17, seed, size);
        let awkward = 1 + random.below(100) as u32;
        let shapes = [
            [1, 1, 1],
            [size, awkward, 1 + awkward / 3],
            [65, 3, 7],
            [130, 64, 64],
            [64, 512, 4],
            [63, 17, 129],
            [size.div_ceil(7), 42, 512],
            [3, 512, 70],
        ];
        let job = |(index, [row_count, inner_count, column_count]): (usize, [u32; 3])| {
            // Neighbouring seeds give every shape every combination.
            let flags = index as u64 + seed;
            let flag = |bit: u32| (flags >> bit) as u32 & 1;
            let (relu_inputs, relu_outputs) = (flag(0), flag(2));
            // Whether there is a residual a device sees for itself.
            let block =
                LinearBlock { row_count, inner_count, column_count, relu_inputs, relu_outputs, has_residual: 0 };
            let [rows, inner, columns] = [row_count, inner_count, column_count].map(|count| count as usize);
            let outputs = rows * columns;
            let residual = (flag(1) == 1).then_some(outputs);
            let counts = Counts { inputs: rows * inner, inner, columns, bias: columns, residual, outputs };
            Job::new(random, block, counts)
        };
        shapes.into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| tile_elements(job.block.row_count, job.block.column_count) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        jobs.iter().map(|job| job.load(device, job.block.column_count)).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { inputs, layer, residual, outputs })| {
            device.linear(&job.block, inputs, &layer.weights, &layer.bias, residual.as_ref(), outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        read(device, loaded)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job<LinearBlock>| {
            job.expected(|layer, index| Some(network_oracle::linear(layer, &job.block, index)))
        };
        jobs.iter().flat_map(outputs).collect()
    }
}
