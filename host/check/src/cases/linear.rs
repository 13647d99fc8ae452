//! [`Kernel::Linear`], and what the cases of all layers with weights share: matrices of awkward sizes, with and without
//! residual and rectification. Behind the inputs there is NaN, and behind the outputs no number may change.

use super::*;
use crate::network_oracle::{self, LayerInputs};

/// Numbers behind the last.
const SLACK: usize = 5;

/// The value of unwritten outputs.
const UNTOUCHED: f32 = 3.0;

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
    /// Numbers from the first on of which some are outputs.
    pub(super) outputs: usize,
    /// Whether the layer is for large images.
    pub(super) has_wide_images: bool,
}

/// The arrays of a layer, with [`SLACK`].
pub(super) struct LayerArrays {
    pub(super) inputs: Vec<f32>,
    pub(super) weights: LayerWeights,
    pub(super) bias: Vec<f32>,
    pub(super) residual: Option<Vec<f32>>,
    pub(super) outputs: Output<f32>,
}

impl LayerArrays {
    /// A layer of random numbers of many magnitudes with outputs of about 1.
    pub(super) fn new(random: &mut Random, counts: Counts) -> LayerArrays {
        let Counts { inputs, inner, columns, bias, residual, outputs, has_wide_images } = counts;
        let scale = 1.0 / (inner as f64).sqrt();
        let magnitude = random.below(3);
        let mut number = || match magnitude {
            0 => random.normal() * random.log_range(1.0e-8, 1.0),
            _ => random.normal(),
        };
        let mut longer = |count, scale: f64| {
            let mut values = numbers(count, || scale * number());
            values.extend([f32::NAN; SLACK]);
            values
        };
        LayerArrays {
            inputs: longer(inputs, 1.0),
            weights: LayerWeights {
                shape: LayerShape { inner_count: inner, column_count: columns, has_wide_images },
                values: longer(inner * columns, scale),
            },
            bias: longer(bias, 1.0),
            residual: residual.map(|count| longer(count, 1.0)),
            outputs: Output::Filled(outputs + SLACK, UNTOUCHED),
        }
    }
}

/// The expected array of a layer: `output(index)` for each output, then the numbers behind them; `None` for numbers
/// that are not outputs.
pub(super) fn expected(
    outputs: &Output<f32>,
    output: impl Fn(usize) -> Option<Bounded> + Sync,
) -> Vec<Option<Bounded>> {
    let Output::Filled(count, _) = outputs else { return Vec::new() };
    let outputs = map(count - SLACK, 16, |index| Some(output(index).unwrap_or(UNTOUCHED.into())));
    outputs.into_iter().chain([Some(UNTOUCHED.into()); SLACK]).collect()
}

impl Case for Linear {
    // As many as give every shape every combination of residual and rectification.
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n summands, in whatever order they are summed";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("inputs", |case| increase(&mut case.inputs)),
        ("weights", |case| increase(&mut case.weights.values)),
        ("bias", |case| increase(&mut case.bias)),
        ("residual", |case| increase(case.residual.iter_mut().flatten())),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<Linear> {
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
            // In fours, within tiles and beyond them.
            [131, 68, 132],
        ];
        let dispatch = |(index, [row_count, inner_count, column_count]): (usize, [u32; 3])| {
            // Neighbouring seeds give every shape every combination.
            let flags = index as u64 + seed;
            let flag = |bit: u32| (flags >> bit) as u32 & 1;
            let (relu_inputs, relu_outputs) = (flag(0), flag(2));
            // Whether there is a residual a device sees for itself.
            let block =
                LinearBlock { row_count, inner_count, column_count, relu_inputs, relu_outputs, has_residual: 0 };
            let [rows, inner, columns] = [row_count, inner_count, column_count].map(|count| count as usize);
            let counts = Counts {
                inputs: rows * inner,
                inner,
                columns,
                bias: columns,
                residual: (flag(1) == 1).then_some(rows * columns),
                outputs: rows * columns,
                has_wide_images: false,
            };
            let LayerArrays { inputs, weights, bias, residual, outputs } = LayerArrays::new(random, counts);
            Linear { block, inputs, weights, bias, residual, outputs }
        };
        shapes.into_iter().enumerate().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let Linear { block, inputs, weights: LayerWeights { values: weights, .. }, bias, residual, outputs } = self;
        let layer = LayerInputs { inputs, weights, bias, residual: residual.as_deref() };
        expected(outputs, |index| Some(network_oracle::linear(&layer, block, index)))
    }
}
