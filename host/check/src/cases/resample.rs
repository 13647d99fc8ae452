//! [`Kernel::MaxPool`] and [`Kernel::Upsample`]: images from one pixel on, windows that reach over borders or hold no
//! pixel, enlargements that hit nodes and others, some of the channels of a wider image.

use super::*;
use crate::network_oracle;

impl Case for MaxPool {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-2 };
    const REASON: &'static str = "one of the inputs: exact";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("inputs", |case| increase(&mut case.inputs))];

    fn inputs(seed: u64, size: u32) -> Vec<MaxPool> {
        let random = &mut random(19, seed, size);
        let dispatch = |[side, stride, padding, channels]: [u32; 4]| {
            let pixel_count = f64::from(size * stride * stride) / f64::from(channels);
            let in_width = side.max(pixel_count.sqrt() as u32 + random.below(3) as u32);
            let in_height = side.max((pixel_count / f64::from(in_width)) as u32 + random.below(3) as u32);
            let out = |inner: u32| (inner + 2 * padding - side) / stride + 1;
            let (out_height, out_width) = (out(in_height), out(in_width));
            let block = PoolBlock { in_height, in_width, out_height, out_width, channels, size: side, stride, padding };
            // Mostly negative: what lies beyond the border is no 0.
            let inputs = numbers((in_height * in_width * channels) as usize, || random.normal() - 1.0);
            let outputs = Output::Zeros((out_height * out_width * channels) as usize + 1);
            MaxPool { block, inputs, outputs }
        };
        // The last one's corner windows hold nothing.
        [[3, 2, 1, 64], [1, 1, 0, 1], [2, 2, 0, 3], [5, 1, 2, 7], [1, 1, 2, 5]].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        decided(map(self.element_count(), 64, |index| network_oracle::max_pool(&self.inputs, &self.block, index)), 1)
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

impl Case for Upsample {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a place among the inputs: a division, a product and a sum, times the change between \
        neighbours; two mixtures";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("inputs", |case| increase(&mut case.inputs))];

    fn inputs(seed: u64, size: u32) -> Vec<Upsample> {
        let random = &mut random(20, seed, size);
        let dispatch =
            |[in_height, in_width, out_height, out_width, in_channels, first_channel, out_channels]: [u32; 7]| {
                let side = f64::from(size / in_channels).sqrt() as u32 + 1 + random.below(4) as u32;
                let [out_height, out_width] =
                    [out_height, out_width].map(|count| if count == 0 { side } else { count });
                let block = UpsampleBlock {
                    in_height,
                    in_width,
                    in_channels,
                    out_height,
                    out_width,
                    out_channels,
                    first_channel,
                };
                let inputs = numbers((in_height * in_width * in_channels) as usize, || random.normal());
                let outputs = Output::Zeros((out_height * out_width * out_channels) as usize + 1);
                Upsample { block, inputs, outputs }
            };
        SHAPES.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let Upsample { block, inputs, .. } = self;
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
        decided(map((block.out_height * block.out_width * block.out_channels) as usize, 64, output), 1)
    }
}
