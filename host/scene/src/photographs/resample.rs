//! Resampling by area: every output pixel is the mean of the area that it covers, so a silhouette gets a fractional
//! alpha.

use crate::Photograph;
use image::{GrayImage, Luma, Rgba, RgbaImage};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Weight of a transparent pixel's colour beside opaque ones' 255. What a mask hides is kept: a scene can be used
/// without its masks.
const TRANSPARENT_WEIGHT: f32 = 1.0 / 64.0;

/// A photograph at a smaller size, its colours weighted by their alpha; where all is transparent, their mean. Output
/// pixels that are partly outside the seen area count as not seen.
pub(super) fn reduced(photograph: &Photograph, (width, height): (u32, u32)) -> Photograph {
    let (width_before, height_before) = photograph.pixels.dimensions();
    let (columns, rows) = (spans(width_before, width), spans(height_before, height));
    let stride = 4 * width_before as usize;
    let bytes = photograph.pixels.as_raw();
    let mut averaged = vec![[0_u8; 4]; width as usize * height as usize];
    let (arch, new_line) = (Arch::new(), || vec![0.0_f32; stride]);
    averaged.par_chunks_mut(width as usize).zip(&rows).for_each_init(new_line, |line, (output, row)| {
        arch.dispatch(Reduced { bytes, has_alpha: photograph.has_alpha, row, columns: &columns, line, output });
    });
    let at = |x: u32, y: u32| averaged[(y * width + x) as usize];
    let pixels = RgbaImage::from_fn(width, height, |x, y| Rgba(at(x, y)));
    let seen = photograph.seen.as_ref().map(|before| seen(before, (width, height)));
    Photograph { pixels, has_alpha: photograph.has_alpha, seen }
}

/// What is seen at another size: output pixels that are partly outside the seen area count as not seen.
pub(super) fn seen(before: &GrayImage, (width, height): (u32, u32)) -> GrayImage {
    let (columns, rows) = (spans(before.width(), width), spans(before.height(), height));
    let is_seen = |x: u32, y: u32| {
        let mut covered =
            rows[y as usize].iter().flat_map(|(y, _)| columns[x as usize].iter().map(move |(x, _)| (*x, *y)));
        covered.all(|(x, y)| before.get_pixel(x as u32, y as u32)[0] > 0)
    };
    GrayImage::from_fn(width, height, |x, y| Luma([if is_seen(x, y) { u8::MAX } else { 0 }]))
}

/// A line of a photograph at a smaller size.
struct Reduced<'a> {
    bytes: &'a [u8],
    has_alpha: bool,
    row: &'a [(usize, f32)],
    columns: &'a [Vec<(usize, f32)>],
    /// The mean of the lines that it covers, at full width.
    line: &'a mut [f32],
    output: &'a mut [[u8; 4]],
}

impl WithSimd for Reduced<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Reduced { bytes, has_alpha, row, columns, line, output } = self;
        let stride = line.len();
        // Vertically first, in whole lines, then horizontally: most of the work is one loop over bytes.
        line.fill(0.0);
        for (y, share) in row {
            let source = &bytes[y * stride..(y + 1) * stride];
            if has_alpha {
                add_weighted(line, source, *share);
            } else {
                line.iter_mut().zip(source).for_each(|(sum, byte)| *sum += share * f32::from(*byte));
            }
        }
        for (pixel, column) in output.iter_mut().zip(columns) {
            *pixel = mean(line, column, has_alpha);
        }
    }
}

/// The pixel whose column covers these parts of a line: the line's colours, or with alpha their sums and weights.
#[inline(always)]
fn mean(line: &[f32], column: &[(usize, f32)], has_alpha: bool) -> [u8; 4] {
    let mut sums = [0.0_f32; 4];
    for (x, share) in column {
        sums.iter_mut().zip(&line[4 * x..]).for_each(|(sum, value)| *sum += share * value);
    }
    let level = |value: f32| (value + 0.5) as u8;
    let [r, g, b, weight] = sums;
    match has_alpha {
        false => [level(r), level(g), level(b), u8::MAX],
        true => {
            let alpha = level(weight - TRANSPARENT_WEIGHT);
            [level(r / weight), level(g / weight), level(b / weight), alpha]
        }
    }
}

/// Adds a line of pixels, their colours multiplied by alpha (of 255) and [`TRANSPARENT_WEIGHT`], and these weights.
#[inline(always)]
fn add_weighted(line: &mut [f32], source: &[u8], share: f32) {
    for (sum, pixel) in line.as_chunks_mut::<4>().0.iter_mut().zip(source.as_chunks::<4>().0) {
        let weight = share * (f32::from(pixel[3]) + TRANSPARENT_WEIGHT);
        for channel in 0..3 {
            sum[channel] += weight * f32::from(pixel[channel]);
        }
        sum[3] += weight;
    }
}

/// `[row][column]` of `size` = `[width, height]` from an image of `size_before`. Enlarging repeats the nearest pixels.
pub(super) fn area_average(texels: &[[f32; 4]], size_before: [u32; 2], size: [u32; 2]) -> Vec<[f32; 4]> {
    area_average_of(|texel| texels[texel], size_before, size)
}

/// As [`area_average`], of texels that are made when they are needed: by their index, row by row.
pub(super) fn area_average_of(
    texel: impl Fn(usize) -> [f32; 4] + Sync,
    size_before: [u32; 2],
    size: [u32; 2],
) -> Vec<[f32; 4]> {
    if size_before == size {
        return (0..(size[0] * size[1]) as usize).map(texel).collect();
    }
    let columns = spans(size_before[0], size[0]);
    let rows = spans(size_before[1], size[1]);
    let width_before = size_before[0] as usize;
    let mut averaged = vec![[0.0; 4]; (size[0] * size[1]) as usize];
    let (arch, new_line) = (Arch::new(), || vec![[0.0; 4]; width_before]);
    averaged.par_chunks_mut(size[0] as usize).zip(&rows).for_each_init(new_line, |line, (output, row)| {
        arch.dispatch(Averaged { texel: &texel, row, columns: &columns, line, output });
    });
    averaged
}

/// A line of averaged texels.
struct Averaged<'a, F: Fn(usize) -> [f32; 4]> {
    texel: &'a F,
    row: &'a [(usize, f32)],
    columns: &'a [Vec<(usize, f32)>],
    /// The mean of the lines that it covers, at full width.
    line: &'a mut [[f32; 4]],
    output: &'a mut [[f32; 4]],
}

impl<F: Fn(usize) -> [f32; 4]> WithSimd for Averaged<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Averaged { texel, row, columns, line, output } = self;
        // Vertically first, in whole lines, then horizontally.
        line.fill([0.0; 4]);
        for (y, share) in row {
            let first = y * line.len();
            for (x, sums) in line.iter_mut().enumerate() {
                add(sums, *share, texel(first + x));
            }
        }
        for (mean, column) in output.iter_mut().zip(columns) {
            for (x, share) in column {
                add(mean, *share, line[*x]);
            }
        }
    }
}

#[inline(always)]
fn add(sums: &mut [f32; 4], share: f32, texel: [f32; 4]) {
    sums.iter_mut().zip(texel).for_each(|(sum, value)| *sum += share * value);
}

/// For each output pixel along an axis, the input pixels that it covers with their shares, which sum to 1.
fn spans(before: u32, after: u32) -> Vec<Vec<(usize, f32)>> {
    let step = f64::from(before) / f64::from(after);
    (0..after)
        .map(|output| {
            let (start, end) = (f64::from(output) * step, f64::from(output + 1) * step);
            // Rounding must not make a span touch another pixel.
            let first = (start + 1e-9).floor() as usize;
            let last = ((end - 1e-9).ceil() as usize).clamp(first + 1, before as usize);
            (first..last)
                .map(|input| {
                    let covered = (end.min(input as f64 + 1.0) - start.max(input as f64)).max(0.0);
                    (input, (covered / step) as f32)
                })
                .collect()
        })
        .collect()
}
