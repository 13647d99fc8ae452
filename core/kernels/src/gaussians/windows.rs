//! How far a picture of Gaussians is from a photograph, `(1 - s) mean |x - y| + s (1 - SSIM)`: the derivative by the
//! picture's pixels and by the gain of the photograph.
//!
//! SSIM (Wang et al. 2004) with Gaussian windows of standard deviation 1.5 and radius [`RADIUS`], which end at the
//! picture's edge: what lies outside counts as 0, in both pictures. Its derivative goes through the windows' means of
//! `x`, `x x` and `x y`, and these windows are symmetric, so it is again three means over windows. A pixel takes the
//! 81 pixels of its window: rows first, then their column, each from the centre outwards.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::clamp;

/// Radius of a window in pixels.
pub const RADIUS: usize = 4;
/// The window along an axis, from its centre on: with its other half its sum is 1.
pub const WINDOW: [f32; RADIUS + 1] = window();
/// SSIM's constants for colours from 0 to 1.
const CONSTANTS: [f32; 2] = [1.0e-4, 9.0e-4];
/// Differences below this count by their square: the derivative is then continuous.
pub const SMALL: f32 = 0.01;
/// Opacity below which a photograph shows nothing, where it has no silhouette.
pub const MIN_SEEN: f32 = 0.999;
/// Pixels whose shares in the derivative by a gain are summed together.
pub const SHARE_RUN: u32 = 256;

const fn window() -> [f32; RADIUS + 1] {
    let [centre, a, b, c, d] = [1.0, 0.800_737_4, 0.411_112_3, 0.135_335_28, 0.028_565_5];
    let sum: f32 = centre + 2.0 * (a + b + c + d);
    [centre / sum, a / sum, b / sum, c / sum, d / sum]
}

/// A photograph and what it counts, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct LossBlock {
    /// Columns of pixels.
    pub width: u32,
    /// Rows of pixels.
    pub height: u32,
    /// Index of the photograph's first pixel in arrays of several photographs.
    pub first: u32,
    /// Index of its gain.
    pub source: u32,
    /// Whether its opacity is a silhouette; otherwise what is not opaque does not count.
    pub has_silhouette: u32,
    /// Share of `1 - SSIM`, in `[0, 1]`.
    pub structure_share: f32,
    /// Share of the opacity's difference from the silhouette; 0 for none.
    pub silhouette_share: f32,
    /// What all derivatives are multiplied by.
    pub factor: f32,
}

const _: () = assert!(size_of::<LossBlock>() == 32);

/// A photograph's gain with the state of its optimisation, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GainBlock {
    /// How much brighter the photograph is than the Gaussians: red, green, blue.
    pub value: [f32; 3],
    /// Steps so far.
    pub step_count: u32,
    /// Moments of the derivative, `[channel]`.
    pub moments: [[f32; 2]; 3],
    /// Zero.
    pub padding: [f32; 2],
}

const _: () = assert!(size_of::<GainBlock>() == 48);

/// A number a channel.
pub type Channels = [f32; 3];

#[inline(always)]
fn channels(of: impl Fn(usize) -> f32) -> Channels {
    [of(0), of(1), of(2)]
}

/// A pixel of the picture with the photograph's gain, of the photograph, and how much it counts. What the photograph
/// does not show is the same in both: windows that hold some of it compare the rest.
#[inline(always)]
fn pair(
    block: &LossBlock,
    gain: Channels,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    pixel: u32,
) -> (Channels, Channels, f32) {
    let photograph = photographs.fetch((block.first + pixel) as usize);
    let shown = [photograph[0], photograph[1], photograph[2]];
    let colour = colours.fetch(pixel as usize);
    let x = [colour[0] * gain[0], colour[1] * gain[1], colour[2] * gain[2]];
    if block.has_silhouette == 0 && photograph[3] < MIN_SEEN { (shown, shown, 0.0) } else { (x, shown, 1.0) }
}

#[inline(always)]
fn zero() -> [Channels; 3] {
    [[0.0; 3]; 3]
}

/// `sums + weight * (a + b)`.
#[inline(always)]
fn added(sums: [Channels; 3], weight: f32, a: [Channels; 3], b: [Channels; 3]) -> [Channels; 3] {
    let part =
        |number: usize| channels(|channel| sums[number][channel] + weight * (a[number][channel] + b[number][channel]));
    [part(0), part(1), part(2)]
}

#[inline(always)]
fn scaled(values: [Channels; 3], weight: f32) -> [Channels; 3] {
    let part = |number: usize| channels(|channel| weight * values[number][channel]);
    [part(0), part(1), part(2)]
}

/// The window's weight at an offset from 1 to [`RADIUS`]: by choices, as an array that a counter indexes is memory on a
/// GPU.
#[inline(always)]
fn weight(offset: u32) -> f32 {
    let (near, far) =
        (if offset == 1 { WINDOW[1] } else { WINDOW[2] }, if offset == 3 { WINDOW[3] } else { WINDOW[4] });
    if offset < 3 { near } else { far }
}

/// The mean over a part of a row around a column, of `at(pixel)`; 0 for a row outside of the picture.
#[inline(always)]
fn row_mean(block: &LossBlock, column: u32, row: u32, at: impl Fn(u32) -> [Channels; 3]) -> [Channels; 3] {
    if row >= block.height {
        return zero();
    }
    let first = row * block.width;
    let mut sums = scaled(at(first + column), WINDOW[0]);
    let mut offset = 1;
    while offset <= RADIUS as u32 {
        let before = if column >= offset { at(first + column - offset) } else { zero() };
        let after = if column + offset < block.width { at(first + column + offset) } else { zero() };
        sums = added(sums, weight(offset), before, after);
        offset += 1;
    }
    sums
}

/// The mean over a pixel's window, of `at(pixel)`.
#[inline(always)]
fn mean(block: &LossBlock, pixel: u32, at: impl Fn(u32) -> [Channels; 3] + Copy) -> [Channels; 3] {
    let (column, row) = (pixel % block.width, pixel / block.width);
    let mut sums = scaled(row_mean(block, column, row, at), WINDOW[0]);
    let mut offset = 1;
    while offset <= RADIUS as u32 {
        // Above the picture the number wraps around to a row that is not in it, either.
        let above = row_mean(block, column, row.wrapping_sub(offset), at);
        let below = row_mean(block, column, row + offset, at);
        sums = added(sums, weight(offset), above, below);
        offset += 1;
    }
    sums
}

/// Mean and variance of a photograph in a pixel's window: red, green and blue each.
#[inline(always)]
pub fn moments(block: &LossBlock, photographs: &(impl Fetch<[f32; 4]> + ?Sized), pixel: u32) -> (Channels, Channels) {
    let squared = |pixel: u32| {
        let [red, green, blue, _] = photographs.fetch((block.first + pixel) as usize);
        [[red, green, blue], [red * red, green * green, blue * blue], [0.0; 3]]
    };
    let [means, squares, _] = mean(block, pixel, squared);
    (means, channels(|channel| squares[channel] - means[channel] * means[channel]))
}

/// Of a window's structural similarity: its derivatives by the means of `x`, of `x x` and of `x y`, from those, and
/// from the photograph's mean and variance.
#[inline(always)]
pub fn similarity_gradient([mean, square, product]: [f32; 3], of_mean: f32, variance: f32) -> [f32; 3] {
    let [first, second] = CONSTANTS;
    let (x, y) = (mean, of_mean);
    let (xx, xy) = (square - x * x, product - x * y);
    let (light, contrast) = (2.0 * x * y + first, 2.0 * xy + second);
    let (lights, contrasts) = (x * x + y * y + first, xx + variance + second);
    let inverse = 1.0 / (lights * contrasts);
    let similarity = light * contrast * inverse;
    let by_square = -similarity / contrasts;
    let by_product = 2.0 * light * inverse;
    let by_mean = 2.0 * y * contrast * inverse - 2.0 * x * similarity / lights;
    [by_mean - 2.0 * x * by_square - y * by_product, by_square, by_product]
}

/// The derivatives of `1 - SSIM` by the means of a pixel's window, times its share: by that of `x`, of `x x` and of
/// `x y`, red, green and blue each. `means` and `variances` are the photographs'.
#[inline(always)]
pub fn structure(
    block: &LossBlock,
    gain: Channels,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    means: &(impl Fetch<[f32; 4]> + ?Sized),
    variances: &(impl Fetch<[f32; 4]> + ?Sized),
    pixel: u32,
) -> [Channels; 3] {
    let moments = |pixel: u32| {
        let (x, y, _) = pair(block, gain, colours, photographs, pixel);
        [x, [x[0] * x[0], x[1] * x[1], x[2] * x[2]], [x[0] * y[0], x[1] * y[1], x[2] * y[2]]]
    };
    let sums = mean(block, pixel, moments);
    let of_mean = means.fetch((block.first + pixel) as usize);
    let variance = variances.fetch((block.first + pixel) as usize);
    let share = -block.structure_share;
    let of = |channel: usize| {
        let window = [sums[0][channel], sums[1][channel], sums[2][channel]];
        let [a, b, c] = similarity_gradient(window, of_mean[channel], variance[channel]);
        [share * a, share * b, share * c]
    };
    let [red, green, blue] = [of(0), of(1), of(2)];
    [[red[0], green[0], blue[0]], [red[1], green[1], blue[1]], [red[2], green[2], blue[2]]]
}

/// The derivatives of the loss by a pixel (red, green, blue, opacity), and what it adds to that by the gain, before the
/// factor. `by_windows` are those of [`structure`], three of a pixel; they are not read where there is no share.
#[inline(always)]
pub fn pixel_gradient(
    block: &LossBlock,
    gain: Channels,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    photographs: &(impl Fetch<[f32; 4]> + ?Sized),
    by_windows: &(impl Fetch<[f32; 4]> + ?Sized),
    pixel: u32,
) -> ([f32; 4], [f32; 4]) {
    let (x, y, counts) = pair(block, gain, colours, photographs, pixel);
    let difference =
        |channel: usize| (1.0 - block.structure_share) * clamp((x[channel] - y[channel]) / SMALL, -1.0, 1.0);
    let mut by = channels(difference);
    if block.structure_share > 0.0 {
        let three = |pixel: u32| {
            let of = |number: u32| {
                let [red, green, blue, _] = by_windows.fetch((3 * pixel + number) as usize);
                [red, green, blue]
            };
            [of(0), of(1), of(2)]
        };
        let [means, squares, products] = mean(block, pixel, three);
        by = channels(|channel| {
            by[channel] + (means[channel] + 2.0 * x[channel] * squares[channel] + y[channel] * products[channel])
        });
    }
    let by = channels(|channel| by[channel] * counts);
    let colour = colours.fetch(pixel as usize);
    let mut by_opacity = 0.0;
    if block.has_silhouette != 0 && block.silhouette_share > 0.0 {
        let alpha = photographs.fetch((block.first + pixel) as usize)[3];
        by_opacity = 3.0 * block.factor * block.silhouette_share * clamp((colour[3] - alpha) / SMALL, -1.0, 1.0);
    }
    let by_colour = channels(|channel| block.factor * gain[channel] * by[channel]);
    let shares = channels(|channel| by[channel] * colour[channel]);
    ([by_colour[0], by_colour[1], by_colour[2], by_opacity], [shares[0], shares[1], shares[2], 0.0])
}
