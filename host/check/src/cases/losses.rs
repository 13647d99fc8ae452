//! [`Kernel::MeasureWindows`], [`Kernel::CompareWindows`], [`Kernel::ComparePixels`] and [`Kernel::SumShares`]: pictures
//! against the second of two photographs, with holes and with silhouettes; windows end at all edges, and small pictures
//! are smaller than one.

use super::*;
use crate::bounded::roundings;
use crate::world::Numbers;
use viewfuse_kernels::gaussians::windows::{MIN_SEEN, RADIUS, SMALL};

/// A picture and photographs.
struct Compared {
    block: LossBlock,
    colours: Vec<[f32; 4]>,
    photographs: Vec<[f32; 4]>,
    gains: Vec<GainBlock>,
}

fn vectors(numbers: &mut Numbers, count: usize, low: f32, high: f32) -> Vec<[f32; 4]> {
    (0..count).map(|_| [0; 4].map(|_| numbers.between(low, high))).collect()
}

impl Compared {
    fn new(numbers: &mut Numbers, size: u32, has_silhouette: bool) -> Compared {
        let width = f64::from(size).sqrt().ceil() as u32;
        let height = size.div_ceil(width);
        let (first, count) = (7, (width * height) as usize);
        let block = LossBlock {
            width,
            height,
            first,
            source: 1,
            has_silhouette: u32::from(has_silhouette),
            structure_share: 0.25,
            silhouette_share: 0.5,
            factor: 0.5,
        };
        let colours = vectors(numbers, count, 0.0, 1.0);
        let mut photographs = vectors(numbers, first as usize + count, 0.0, 1.0);
        for pixel in &mut photographs {
            let is_hole = numbers.between(0.0, 1.0) < 0.1;
            pixel[3] = if is_hole || has_silhouette { pixel[3] } else { 1.0 };
        }
        let gain = |value: f32| GainBlock { value: [value, 1.0 - 0.1 * value, 1.05], ..GainBlock::default() };
        Compared { block, colours, photographs, gains: vec![gain(0.5), gain(1.1)] }
    }
}

/// A pixel of the picture with its gain, of the photograph, and whether it counts.
fn pair(
    (block, gains): (&LossBlock, &[GainBlock]),
    (colours, photographs): (&[[f32; 4]], &[[f32; 4]]),
    pixel: usize,
    channel: usize,
) -> (Bounded, f32, bool) {
    let photograph = photographs[block.first as usize + pixel];
    if block.has_silhouette == 0 && photograph[3] < MIN_SEEN {
        return (photograph[channel].into(), photograph[channel], false);
    }
    let gain = gains[block.source as usize].value[channel];
    (Bounded::from(colours[pixel][channel]) * gain.into(), photograph[channel], true)
}

/// The mean over a pixel's window: weights that fall off like a Gaussian of standard deviation 1.5, over their sum.
fn mean(block: &LossBlock, pixel: usize, at: impl Fn(usize) -> Bounded) -> Bounded {
    let (width, height, radius) = (block.width as usize, block.height as usize, RADIUS as isize);
    let fall = |offset: isize| (-0.5 * (offset as f64 / 1.5).powi(2)).exp();
    let all: f64 = (-radius..=radius).map(fall).sum();
    let weight = |offset: isize| fall(offset) / all;
    let (column, row) = ((pixel % width) as isize, (pixel / width) as isize);
    let (mut value, mut brought, mut magnitudes) = (0.0, 0.0, 0.0);
    for down in -radius..=radius {
        for right in -radius..=radius {
            let (x, y) = (column + right, row + down);
            if (0..width as isize).contains(&x) && (0..height as isize).contains(&y) {
                let (number, weight) = (at(y as usize * width + x as usize), weight(down) * weight(right));
                value += weight * number.value;
                brought += weight * number.error;
                magnitudes += weight * number.value.abs();
            }
        }
    }
    // A product is rounded with each of two weights, which are off by some roundings, and in nine sums at most.
    Bounded { value, error: brought + magnitudes * roundings(32) }
}

impl Case for MeasureWindows {
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a mean over 81 numbers up to 1, and its square less that of their squares";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("photographs", |case| increase(case.photographs.as_flattened_mut().iter_mut().step_by(2))),
        ("parameters", |case| case.block.first -= 1),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<MeasureWindows> {
        let Compared { block, photographs, .. } = Compared::new(&mut Numbers::new(seed), size, false);
        let [means, variances] = [0; 2].map(|_| Output::Zeros(photographs.len()));
        vec![MeasureWindows { block, photographs, means, variances }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let MeasureWindows { block, photographs, .. } = self;
        let pixel = |pixel: usize| {
            let at = |pixel: usize, channel: usize| Bounded::from(photographs[block.first as usize + pixel][channel]);
            let means = [0, 1, 2].map(|channel| mean(block, pixel, |pixel| at(pixel, channel)));
            let variance =
                |channel: usize| mean(block, pixel, |pixel| at(pixel, channel).squared()) - means[channel].squared();
            (means, [0, 1, 2].map(variance))
        };
        let (means, variances): (Vec<_>, Vec<_>) = map(self.element_count(), 16, pixel).into_iter().unzip();
        let before = || vec![[Bounded::ZERO; 4]; block.first as usize].into_iter();
        let with_rest = |[red, green, blue]: [Bounded; 3]| [red, green, blue, Bounded::ZERO];
        let all = |channels: Vec<[Bounded; 3]>| before().chain(channels.into_iter().map(with_rest)).flatten();
        all(means).chain(all(variances)).map(Some).collect()
    }
}

impl Case for CompareWindows {
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the means over windows through variances, which are \
        differences of them, to the derivatives of a quotient of products";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("colours", |case| increase(case.colours.as_flattened_mut())),
        ("photographs", |case| increase(case.photographs.as_flattened_mut())),
        ("means", |case| increase(case.means.as_flattened_mut())),
        ("variances", |case| increase(case.variances.as_flattened_mut())),
        ("gains", |case| increase(case.gains.iter_mut().flat_map(|gain| &mut gain.value))),
        ("parameters", |case| case.block.structure_share *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CompareWindows> {
        let numbers = &mut Numbers::new(seed);
        let mut dispatch = |has_silhouette: bool| {
            let Compared { block, colours, photographs, gains } = Compared::new(numbers, size, has_silhouette);
            let means = vectors(numbers, photographs.len(), 0.1, 0.9);
            let variances = vectors(numbers, photographs.len(), 0.05, 0.2);
            let by_windows = Output::Zeros(3 * colours.len());
            CompareWindows { block, colours, photographs, means, variances, gains, by_windows }
        };
        [true, false].map(&mut dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let CompareWindows { block, colours, photographs, means, variances, gains, .. } = self;
        let pixel = |pixel: usize| {
            let channel = |channel: usize| {
                let pair = |pixel: usize| pair((block, gains), (colours, photographs), pixel, channel);
                let x = mean(block, pixel, |pixel| pair(pixel).0);
                let square = mean(block, pixel, |pixel| pair(pixel).0.squared());
                let product = mean(block, pixel, |pixel| pair(pixel).0 * pair(pixel).1.into());
                let y = Bounded::from(means[block.first as usize + pixel][channel]);
                let variance = Bounded::from(variances[block.first as usize + pixel][channel]);
                let [two, first, second] = [2.0_f32, 1.0e-4, 9.0e-4].map(Bounded::from);
                let (light, contrast) = (two * x * y + first, two * (product - x * y) + second);
                let (lights, contrasts) = (x * x + y * y + first, square - x * x + variance + second);
                let similarity = light * contrast / (lights * contrasts);
                let (by_square, by_product) = (-similarity / contrasts, two * light / (lights * contrasts));
                let by_mean = two * y * contrast / (lights * contrasts) - two * x * similarity / lights;
                let by_x = by_mean - two * x * by_square - y * by_product;
                [by_x, by_square, by_product].map(|by| -by * block.structure_share.into())
            };
            let derivatives = [channel(0), channel(1), channel(2)];
            [0, 1, 2]
                .map(|number| [derivatives[0][number], derivatives[1][number], derivatives[2][number], Bounded::ZERO])
        };
        decided(map(self.colours.len(), 1, pixel).into_iter().flatten().flatten(), 0)
    }
}

impl Case for ComparePixels {
    const LIMITS: Limits = Limits { tolerance: 1.0e-2, least: 1.0e-2 };
    const REASON: &'static str =
        "running error analysis of means over windows and of a difference, divided by the least that counts";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("colours", |case| increase(case.colours.as_flattened_mut())),
        ("photographs", |case| increase(case.photographs.as_flattened_mut())),
        ("by_windows", |case| increase(case.by_windows.as_flattened_mut())),
        ("gains", |case| increase(case.gains.iter_mut().flat_map(|gain| &mut gain.value))),
        ("parameters", |case| case.block.factor *= 1.01),
    ];

    /// With windows, without, and the two kinds of opacity.
    fn inputs(seed: u64, size: u32) -> Vec<ComparePixels> {
        let numbers = &mut Numbers::new(seed);
        let mut dispatch = |(has_silhouette, structure_share): (bool, f32)| {
            let Compared { block, mut colours, photographs, gains } = Compared::new(numbers, size, has_silhouette);
            // Some differences are small.
            for (colour, photograph) in colours.iter_mut().zip(&photographs[block.first as usize..]).step_by(3) {
                let value = gains[1].value;
                (0..3).for_each(|channel| {
                    colour[channel] = photograph[channel] / value[channel] + numbers.between(-0.01, 0.01);
                });
                colour[3] = photograph[3] + numbers.between(-0.01, 0.01);
            }
            let by_windows = vectors(numbers, 3 * colours.len(), -1.0, 1.0);
            let (by_pixels, shares) = (Output::Zeros(colours.len()), Output::Zeros(colours.len()));
            let block = LossBlock { structure_share, ..block };
            ComparePixels { block, colours, photographs, by_windows, gains, by_pixels, shares }
        };
        [(true, 0.25), (false, 0.25), (false, 0.0)].map(&mut dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ComparePixels { block, colours, photographs, by_windows, gains, .. } = self;
        let factor = Bounded::from(block.factor);
        let over = |a: Bounded, b: f32| ((a - b.into()) / SMALL.into()).clamped(-1.0, 1.0);
        let pixel = |pixel: usize| {
            let by = |channel: usize| {
                let (x, y, counts) = pair((block, gains), (colours, photographs), pixel, channel);
                if !counts {
                    return Bounded::ZERO;
                }
                let window =
                    |number: usize| mean(block, pixel, |pixel| Bounded::from(by_windows[3 * pixel + number][channel]));
                let mut by = (Bounded::ONE - block.structure_share.into()) * over(x, y);
                if block.structure_share > 0.0 {
                    let two = Bounded::from(2.0_f32);
                    by = by + window(0) + two * x * window(1) + Bounded::from(y) * window(2);
                }
                by
            };
            let by = [by(0), by(1), by(2)];
            let gain = gains[block.source as usize].value.map(Bounded::from);
            let by_colour = [0, 1, 2].map(|channel| factor * gain[channel] * by[channel]);
            let opacity = match block.has_silhouette {
                0 => Bounded::ZERO,
                _ => {
                    let share = Bounded::from(3.0 * block.silhouette_share) * factor;
                    share * over(colours[pixel][3].into(), photographs[block.first as usize + pixel][3])
                }
            };
            let shares = [0, 1, 2].map(|channel| by[channel] * colours[pixel][channel].into());
            let four = |[a, b, c]: [Bounded; 3], last: Bounded| [a, b, c, last];
            (four(by_colour, opacity), four(shares, Bounded::ZERO))
        };
        let (by_pixels, shares): (Vec<_>, Vec<_>) = map(colours.len(), 1, pixel).into_iter().unzip();
        decided(by_pixels.into_iter().chain(shares).flatten(), 0)
    }
}

impl Case for SumShares {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-2, least: 1.0e-1 };
    const REASON: &'static str = "a sum in any order";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("shares", |case| increase(case.shares.as_flattened_mut()))];

    fn inputs(seed: u64, size: u32) -> Vec<SumShares> {
        let numbers = &mut Numbers::new(seed);
        let pixel_count = size.min(200) * SHARE_RUN / 2 + 3;
        // One more than there are: it is not summed.
        let shares = vectors(numbers, pixel_count as usize + 1, -1.0, 1.0);
        vec![SumShares { pixel_count, shares, sums: Output::Zeros(pixel_count.div_ceil(SHARE_RUN) as usize) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let runs = self.shares[..self.pixel_count as usize].chunks(SHARE_RUN as usize);
        let sum = |run: &[[f32; 4]], channel: usize| Bounded::sum(run.iter().map(|share| f64::from(share[channel])));
        decided(runs.flat_map(|run| [sum(run, 0), sum(run, 1), sum(run, 2), Bounded::ZERO]), 0)
    }
}
