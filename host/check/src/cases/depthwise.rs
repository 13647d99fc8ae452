//! [`Kernel::ConvolveDepthwise`]: images from one pixel on, windows with gaps and reaching over borders, weights that
//! channels share, inputs that are some of the channels of wider images.

use super::*;
use crate::network_oracle;

/// Side of the window, stride, dilation, padding; channels, numbers between the pixels' channels, whether weights are
/// shared.
const WINDOWS: [[u32; 7]; 7] = [
    [3, 1, 1, 1, 65, 0, 0],
    [3, 1, 12, 12, 4, 3, 0],
    [3, 2, 1, 1, 7, 0, 1],
    [2, 2, 1, 0, 3, 1, 1],
    [5, 1, 2, 3, 2, 0, 0],
    [1, 1, 1, 0, 17, 2, 0],
    [4, 2, 1, 2, 1, 0, 1],
];

impl Case for ConvolveDepthwise {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n summands, as many as places of the window";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("inputs", |case| increase(&mut case.inputs)), ("weights", |case| increase(&mut case.weights))];

    fn inputs(seed: u64, count: u32) -> Vec<ConvolveDepthwise> {
        let random = &mut random(22, seed, count);
        let dispatch = |[size, stride, dilation, padding, channels, gap, is_shared]: [u32; 7]| {
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
            let mut weights = numbers(weight_count, || random.normal() / f64::from(size));
            // Behind the weights lies NaN.
            weights.push(f32::NAN);
            let outputs = Output::Zeros((block.pixel_count() * channels) as usize + 1);
            ConvolveDepthwise { block, inputs, weights, outputs }
        };
        WINDOWS.map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let channels = self.block.channels as usize;
        let output = |index: usize| {
            let (pixel, channel) = (index / channels, index % channels);
            network_oracle::depthwise(&self.inputs, &self.weights, &self.block, pixel, channel)
        };
        decided(map(self.element_count(), 16, output), 1)
    }
}
