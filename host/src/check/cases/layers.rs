//! [`Kernel::Product`] and [`Kernel::Convolve`]: matrices and images of awkward sizes, with and without addend and
//! rectification. Behind what is read lies NaN, behind what is written nothing may change.

use crate::check::agreement::Limits;
use crate::check::bounded::Bounded;
use crate::check::case::{Case, Spoiler};
use crate::check::network_oracle::{self, LayerInputs};
use crate::check::poses::{Random, numbers, random};
use crate::device::{Device, Layer, LayerShape, Memory};
use rayon::prelude::*;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_vulkan::kernel::{Kernel, tile_elements};

/// Numbers behind the last.
const SLACK: usize = 5;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job<B> {
    block: B,
    inputs: Vec<f32>,
    weights: Vec<f32>,
    bias: Vec<f32>,
    addend: Option<Vec<f32>>,
    output_count: usize,
}

/// The same in a device's memory, and the outputs.
pub struct LoadedJob<D: Device> {
    inputs: D::Buffer<f32>,
    layer: Layer<D>,
    addend: Option<<D as Memory>::Buffer<f32>>,
    outputs: D::Buffer<f32>,
}

impl<B> Job<B> {
    /// A layer of random numbers of many magnitudes with outputs of about 1: `input_count` of them, weights
    /// `[inner][columns]`, `rows` outputs a column.
    fn new(
        random: &mut Random,
        block: B,
        input_count: usize,
        [inner, columns, rows]: [usize; 3],
        addend: bool,
    ) -> Job<B> {
        let scale = 1.0 / (inner as f64).sqrt();
        let magnitude = random.below(3);
        let mut number = || match magnitude {
            0 => random.normal() * random.log_range(1.0e-8, 1.0),
            _ => random.normal(),
        };
        Job {
            block,
            inputs: numbers(input_count, &mut number),
            weights: numbers(inner * columns, || scale * number()),
            bias: numbers(columns, &mut number),
            addend: addend.then(|| numbers(rows * columns, &mut number)),
            output_count: rows * columns,
        }
    }

    fn load<D: Device>(&self, device: &D) -> Result<LoadedJob<D>, D::Error> {
        let longer = |values: &[f32]| [values, &[f32::NAN; SLACK]].concat();
        let column_count = self.bias.len();
        let shape = LayerShape { inner_count: self.weights.len() / column_count, column_count, has_wide_images: false };
        Ok(LoadedJob {
            inputs: device.upload(&longer(&self.inputs))?,
            layer: Layer::new(device, &shape, &longer(&self.weights), &longer(&self.bias))?,
            addend: self.addend.as_deref().map(|addend| device.upload(&longer(addend))).transpose()?,
            outputs: device.zeros(self.output_count + SLACK)?,
        })
    }

    fn expected(&self, element: impl Fn(&LayerInputs, usize) -> Bounded + Sync) -> Vec<Option<Bounded>> {
        let Job { inputs, weights, bias, addend, .. } = self;
        let layer = LayerInputs { inputs, weights, bias, addend: addend.as_deref() };
        let outputs = (0..self.output_count).into_par_iter().map(|index| Some(element(&layer, index)));
        outputs.chain([Some(Bounded::ZERO); SLACK]).collect()
    }

    fn spoil(values: &mut [f32]) {
        values.iter_mut().for_each(|value| *value *= 1.01);
    }
}

fn read<D: Device>(device: &D, loaded: &[LoadedJob<D>]) -> Result<Vec<f32>, D::Error> {
    let outputs: Vec<Vec<f32>> = loaded.iter().map(|job| device.download(&job.outputs)).collect::<Result<_, _>>()?;
    Ok(outputs.concat())
}

/// See the module.
pub enum Product {}

impl Case for Product {
    const KERNEL: Kernel = Kernel::Product;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n summands, in whatever order they are summed";
    const SPOILERS: &'static [Spoiler<Vec<Job<ProductBlock>>>] = &[
        ("inputs", |jobs| jobs.iter_mut().for_each(|job| Job::<ProductBlock>::spoil(&mut job.inputs))),
        ("weights", |jobs| jobs.iter_mut().for_each(|job| Job::<ProductBlock>::spoil(&mut job.weights))),
        ("bias", |jobs| jobs.iter_mut().for_each(|job| Job::<ProductBlock>::spoil(&mut job.bias))),
        ("addend", |jobs| {
            jobs.iter_mut().filter_map(|job| job.addend.as_deref_mut()).for_each(Job::<ProductBlock>::spoil)
        }),
    ];

    type Inputs = Vec<Job<ProductBlock>>;
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
            // Whether there is an addend a device sees for itself.
            let block = ProductBlock { row_count, inner_count, column_count, relu_inputs, relu_outputs, has_addend: 0 };
            let [rows, inner, columns] = [row_count, inner_count, column_count].map(|count| count as usize);
            Job::new(random, block, rows * inner, [inner, columns, rows], flag(1) == 1)
        };
        shapes.into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| tile_elements(job.block.row_count, job.block.column_count) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, D::Error> {
        jobs.iter().map(|job| job.load(device)).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), D::Error> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { inputs, layer, addend, outputs })| {
            device.product(&job.block, inputs, layer, addend.as_ref(), outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, D::Error> {
        read(device, loaded)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let outputs =
            |job: &Job<ProductBlock>| job.expected(|layer, index| network_oracle::product(layer, &job.block, index));
        jobs.iter().flat_map(outputs).collect()
    }
}

/// Window, stride, padding and channels of layers: the first of a residual network and its others, a lone pixel, more
/// border than image.
const WINDOWS: [[u32; 5]; 7] = [
    [7, 2, 3, 3, 64],
    [3, 1, 1, 5, 7],
    [3, 2, 1, 16, 65],
    [1, 2, 0, 9, 3],
    [3, 1, 1, 1, 1],
    [2, 1, 2, 3, 2],
    [3, 1, 1, 64, 64],
];

/// See the module.
pub enum Convolve {}

impl Case for Convolve {
    const KERNEL: Kernel = Kernel::Convolve;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = Product::REASON;
    const SPOILERS: &'static [Spoiler<Vec<Job<ConvolveBlock>>>] = &[
        ("inputs", |jobs| jobs.iter_mut().for_each(|job| Job::<ConvolveBlock>::spoil(&mut job.inputs))),
        ("weights", |jobs| jobs.iter_mut().for_each(|job| Job::<ConvolveBlock>::spoil(&mut job.weights))),
        ("bias", |jobs| jobs.iter_mut().for_each(|job| Job::<ConvolveBlock>::spoil(&mut job.bias))),
        ("addend", |jobs| {
            jobs.iter_mut().filter_map(|job| job.addend.as_deref_mut()).for_each(Job::<ConvolveBlock>::spoil)
        }),
    ];

    type Inputs = Vec<Job<ConvolveBlock>>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(18, seed, size);
        let job = |(index, [side, stride, padding, in_channels, out_channels]): (usize, [u32; 5])| {
            // About as many output numbers as asked for; the window is never larger than image and border.
            let pixel_count = f64::from(size * stride * stride) / f64::from(out_channels);
            let least = side.saturating_sub(2 * padding).max(1);
            let in_width = (pixel_count.sqrt() as u32 + random.below(3) as u32).max(least);
            let in_height = ((pixel_count / f64::from(in_width)) as u32 + random.below(3) as u32).max(least);
            let out = |inner: u32| (inner + 2 * padding - side) / stride + 1;
            let flags = index as u64 + seed;
            let block = ConvolveBlock {
                in_height,
                in_width,
                in_channels,
                out_height: out(in_height),
                out_width: out(in_width),
                out_channels,
                size: side,
                stride,
                padding,
                relu_outputs: flags as u32 & 1,
                ..ConvolveBlock::default()
            }
            .packed();
            let shape = [block.patch_len(), out_channels, block.pixel_count()].map(|count| count as usize);
            Job::new(random, block, (in_height * in_width * in_channels) as usize, shape, flags >> 1 & 1 == 1)
        };
        WINDOWS.into_iter().enumerate().map(job).collect()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| tile_elements(job.block.pixel_count(), job.block.out_channels) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, D::Error> {
        jobs.iter().map(|job| job.load(device)).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), D::Error> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { inputs, layer, addend, outputs })| {
            device.convolve(&job.block, inputs, layer, addend.as_ref(), outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, D::Error> {
        read(device, loaded)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let outputs =
            |job: &Job<ConvolveBlock>| job.expected(|layer, index| network_oracle::convolve(layer, &job.block, index));
        jobs.iter().flat_map(outputs).collect()
    }
}
