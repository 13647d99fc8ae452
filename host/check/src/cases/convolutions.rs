//! [`Kernel::Convolve`] and [`Kernel::ConvolveTransposed`]: images of awkward sizes, inputs, residuals and outputs that
//! are some of the channels of wider images, every parameter of a convolution. Behind the inputs there is NaN, and
//! beside the outputs no number may change.

use super::linear::{Counts, LayerArrays, expected};
use super::*;
use crate::network_oracle::{self, LayerInputs};

/// A layer of convolutions.
#[derive(Clone, Copy)]
struct Window {
    size: u32,
    stride: u32,
    padding: u32,
    dilation: u32,
    enlarge: u32,
    channels: [u32; 2],
    /// Whether images are channels of wider ones.
    is_part: bool,
    /// Whether the layer is for large images.
    is_wide: bool,
}

impl Window {
    const fn new([size, stride, padding]: [u32; 3], channels: [u32; 2]) -> Window {
        Window { size, stride, padding, dilation: 1, enlarge: 1, channels, is_part: false, is_wide: false }
    }

    const fn wide(padding: u32, enlarge: u32, channels: [u32; 2], is_part: bool) -> Window {
        Window { enlarge, is_part, is_wide: true, ..Window::new([3, 1, padding], channels) }
    }
}

/// The first layer of a residual network and its others, a lone pixel, more border than image; gaps, enlarged images,
/// parts of wider ones; layers for large images, which on small ones are right as well; and all of it in fours.
const WINDOWS: [Window; 16] = [
    Window::new([7, 2, 3], [3, 64]),
    Window::new([3, 1, 1], [5, 7]),
    Window::new([3, 2, 1], [16, 65]),
    Window::new([1, 2, 0], [9, 3]),
    Window::new([3, 1, 1], [1, 1]),
    Window::new([2, 1, 2], [3, 2]),
    Window::new([3, 1, 1], [64, 64]),
    Window { dilation: 6, is_part: true, ..Window::new([3, 1, 6], [4, 5]) },
    Window { enlarge: 2, is_part: true, ..Window::new([3, 1, 1], [6, 3]) },
    Window { is_part: true, ..Window::new([1, 1, 0], [33, 17]) },
    Window { dilation: 2, enlarge: 3, ..Window::new([2, 2, 1], [2, 70]) },
    Window::wide(1, 1, [3, 5], false),
    Window::wide(1, 1, [37, 33], true),
    Window::wide(0, 2, [5, 2], true),
    Window::wide(3, 1, [1, 18], false),
    Window { dilation: 2, enlarge: 2, is_part: true, ..Window::new([3, 2, 2], [12, 72]) },
];

/// Numbers between the pixels of images that are parts of wider ones, and in front of the first: fours if so are the
/// channels.
fn gap(random: &mut Random, is_part: bool, channels: &[u32]) -> u32 {
    let unit = if channels.iter().all(|count| count.is_multiple_of(4)) { 4 } else { 1 };
    if is_part { unit * (1 + random.below(5) as u32) } else { 0 }
}

/// Whether a number of an image's buffer is one of these channels: pixel and channel.
fn place(index: usize, first: u32, pitch: u32, channels: u32) -> Option<[usize; 2]> {
    let index = index.checked_sub(first as usize)?;
    let (pixel, channel) = (index / pitch as usize, index % pitch as usize);
    (channel < channels as usize).then_some([pixel, channel])
}

impl Case for Convolve {
    // As many as give every shape every combination of residual and rectification.
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 1.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of magnitudes of n summands, in whatever order; of layers \
        for large images channels + 14 units of the magnitudes in Winograd's transforms, whose factors come to about \
        10^2";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("inputs", |case| increase(&mut case.inputs)),
        ("weights", |case| increase(&mut case.weights.values)),
        ("bias", |case| increase(&mut case.bias)),
        ("residual", |case| increase(case.residual.iter_mut().flatten())),
        ("parameters", |case| case.block.scale *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<Convolve> {
        let random = &mut random(18, seed, size);
        let dispatch = |(index, window): (usize, Window)| {
            let Window { size: side, stride, padding, dilation, enlarge, channels, is_part, is_wide } = window;
            let [in_channels, out_channels] = channels;
            // About as many output numbers as requested; the window is never larger than image and border.
            let pixel_count = f64::from(size * stride * stride) / f64::from(out_channels * enlarge * enlarge);
            let reach = (side - 1) * dilation + 1;
            let least = reach.saturating_sub(2 * padding).max(1).div_ceil(enlarge);
            let in_width = (pixel_count.sqrt() as u32 + random.below(3) as u32).max(least);
            let in_height = ((pixel_count / f64::from(in_width)) as u32 + random.below(3) as u32).max(least);
            let out = |inner: u32| (inner * enlarge + 2 * padding - reach) / stride + 1;
            let flags = index as u64 + seed;
            let [in_gap, out_gap, residual_gap] = [0, 1, 2].map(|_| gap(random, is_part, &channels));
            // Of some layers all pixels have the same residual.
            let is_shared = flags.is_multiple_of(3);
            let block = ConvolveBlock {
                in_height,
                in_width,
                in_channels,
                in_pitch: in_channels + 2 * in_gap,
                in_first: in_gap,
                enlarge,
                out_height: out(in_height),
                out_width: out(in_width),
                out_channels,
                out_pitch: out_channels + 2 * out_gap,
                out_first: out_gap,
                size: side,
                stride,
                dilation,
                padding,
                scale: if flags.is_multiple_of(5) { 0.7 } else { 1.0 },
                relu_outputs: flags as u32 & 1,
                // Whether there is one a device sees for itself.
                has_residual: 0,
                residual_pitch: if is_shared { 0 } else { out_channels + 2 * residual_gap },
                residual_first: residual_gap,
            };
            let residual_pixels = if is_shared { 0 } else { block.pixel_count() - 1 };
            let residual_count = residual_gap + residual_pixels * block.residual_pitch + out_channels;
            let counts = Counts {
                inputs: (in_height * in_width * block.in_pitch) as usize,
                inner: block.patch_len() as usize,
                columns: out_channels as usize,
                bias: out_channels as usize,
                residual: (flags >> 1 & 1 == 1).then_some(residual_count as usize),
                outputs: (block.pixel_count() * block.out_pitch) as usize,
                has_wide_images: is_wide,
            };
            let LayerArrays { inputs, weights, bias, residual, outputs } = LayerArrays::new(random, counts);
            Convolve { block, inputs, weights, bias, residual, outputs }
        };
        WINDOWS.into_iter().enumerate().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let Convolve { block, inputs, weights: LayerWeights { shape, values: weights }, bias, residual, outputs } =
            self;
        let layer = LayerInputs { inputs, weights, bias, residual: residual.as_deref() };
        expected(outputs, |index| {
            let [pixel, channel] = place(index, block.out_first, block.out_pitch, block.out_channels)?;
            Some(match shape.has_wide_images {
                true => network_oracle::convolve_wide(&layer, block, pixel, channel),
                false => network_oracle::convolve(&layer, block, pixel, channel),
            })
        })
    }
}

impl Case for ConvolveTransposed {
    // As many as give every shape every combination of residual and rectification.
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str = Linear::REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("inputs", |case| increase(&mut case.inputs)),
        ("weights", |case| increase(&mut case.weights.values)),
        ("bias", |case| increase(&mut case.bias)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ConvolveTransposed> {
        let random = &mut random(21, seed, size);
        let dispatch = |(index, [size_of_square, in_channels, out_channels, part]): (usize, [u32; 4])| {
            let pixel_count = f64::from(size) / f64::from(size_of_square * size_of_square * out_channels);
            let in_width = pixel_count.sqrt() as u32 + 1 + random.below(3) as u32;
            let in_height = (pixel_count / f64::from(in_width)) as u32 + 1 + random.below(3) as u32;
            let [in_gap, out_gap] = [0, 1].map(|_| gap(random, part == 1, &[in_channels, out_channels]));
            let block = TransposedBlock {
                in_height,
                in_width,
                in_channels,
                in_pitch: in_channels + 2 * in_gap,
                in_first: in_gap,
                out_channels,
                out_pitch: out_channels + 2 * out_gap,
                out_first: out_gap,
                size: size_of_square,
                relu_outputs: (index as u64 + seed) as u32 & 1,
            };
            let out_pixels = block.pixel_count() * size_of_square * size_of_square;
            let counts = Counts {
                inputs: (block.pixel_count() * block.in_pitch) as usize,
                inner: in_channels as usize,
                columns: block.column_count() as usize,
                bias: out_channels as usize,
                residual: None,
                outputs: (out_pixels * block.out_pitch) as usize,
                has_wide_images: false,
            };
            let LayerArrays { inputs, weights, bias, outputs, .. } = LayerArrays::new(random, counts);
            ConvolveTransposed { block, inputs, weights, bias, outputs }
        };
        // Side of the square, channels, whether images are parts of wider ones.
        [[2, 5, 3, 0], [2, 64, 17, 1], [1, 3, 70, 0], [3, 130, 8, 1], [2, 1, 1, 0]]
            .into_iter()
            .enumerate()
            .map(dispatch)
            .collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ConvolveTransposed { block, inputs, weights, bias, outputs } = self;
        let layer = LayerInputs { inputs, weights: &weights.values, bias, residual: None };
        let out_width = (block.in_width * block.size) as usize;
        expected(outputs, |index| {
            let [pixel, channel] = place(index, block.out_first, block.out_pitch, block.out_channels)?;
            Some(network_oracle::transposed(&layer, block, [pixel / out_width, pixel % out_width], channel))
        })
    }
}
