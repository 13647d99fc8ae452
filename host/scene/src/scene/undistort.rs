//! Undistortion: a photograph with lens distortion becomes that of a pinhole camera with the same focal length.
//!
//! Each pixel of the result is mapped through the lens in f64, and interpolated between the four nearest pixels
//! (premultiplied by alpha if there is any). Pixels outside the photograph, where the lens's polynomials fold the image
//! over, and those of which any part does not count in the photograph are marked as not seen.

use image::{GrayImage, RgbaImage};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use viewfuse_core::camera::Pinhole;
use viewfuse_core::lens::{Coefficients, Lens, Projection, distort};

use super::Photograph;

/// The photograph of the pinhole camera, at the same size.
pub(super) fn undistorted(photograph: &Photograph, lens: &Lens, pinhole: &Pinhole) -> Photograph {
    let (width, height) = photograph.pixels.dimensions();
    let scale = [f64::from(width) / f64::from(pinhole.width()), f64::from(height) / f64::from(pinhole.height())];
    let scaled = |pair: [f32; 2]| [f64::from(pair[0]) * scale[0], f64::from(pair[1]) * scale[1]];
    let (focal, principal) = (scaled(pinhole.focal()), scaled(pinhole.principal()));
    let mut mapping =
        Mapping { focal, principal, size: [width, height], coefficients: lens.coefficients(), reach: 0.0 };
    let corners = [(0, 0), (width, 0), (0, height), (width, height)];
    let furthest = corners.map(|(x, y)| mapping.ideal(x.into(), y.into())).map(|[x, y]| x.hypot(y)).into_iter();
    mapping.reach = lens.reach(furthest.fold(0.0, f64::max));
    let is_fisheye = lens.projection() == Projection::Fisheye;

    let texels = photograph.pixels.as_raw().as_chunks::<4>().0;
    let mut pixels = RgbaImage::new(width, height);
    let mut seen = GrayImage::new(width, height);
    let lines = pixels.par_chunks_mut(4 * width as usize).zip(seen.par_chunks_mut(width as usize));
    let arch = Arch::new();
    let stored = photograph.seen.as_ref().map(|stored| stored.as_raw().as_slice());
    lines.enumerate().for_each(|(row, (line, seen))| {
        let (mapping, pixels, has_alpha) = (&mapping, line.as_chunks_mut().0, photograph.has_alpha);
        arch.dispatch(Line { texels, stored, has_alpha, mapping, is_fisheye, row: row as u32, pixels, seen });
    });
    let all_seen = seen.as_raw().iter().all(|seen| *seen > 0);
    Photograph { pixels, has_alpha: photograph.has_alpha, seen: (!all_seen).then_some(seen) }
}

/// A line of the result.
struct Line<'a> {
    texels: &'a [[u8; 4]],
    /// What counts of them; `None` for all.
    stored: Option<&'a [u8]>,
    has_alpha: bool,
    mapping: &'a Mapping,
    is_fisheye: bool,
    row: u32,
    pixels: &'a mut [[u8; 4]],
    seen: &'a mut [u8],
}

impl WithSimd for Line<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Line { texels, stored, has_alpha, mapping, is_fisheye, row, pixels, seen } = self;
        let mut corners = Corners::NONE;
        for (part, (pixels, seen)) in (0_u32..).zip(pixels.chunks_mut(PART).zip(seen.chunks_mut(PART))) {
            let first = part * PART as u32;
            let places = match is_fisheye {
                true => mapping.places::<true>(first, row, seen),
                false => mapping.places::<false>(first, row, seen),
            };
            corners.surround(&places, mapping.size);
            if let Some(stored) = stored {
                let counts =
                    |index: usize| corners.of(index, stored).into_iter().all(|(seen, share)| seen > 0 || share == 0.0);
                seen.iter_mut().enumerate().filter(|(index, _)| !counts(*index)).for_each(|(_, seen)| *seen = 0);
            }
            for (index, pixel) in pixels.iter_mut().enumerate() {
                *pixel = match has_alpha {
                    true => corners.premultiplied(index, texels),
                    false => corners.plain(index, texels),
                };
            }
        }
    }
}

/// Pixels of a line that are mapped at once, in vectors, before their texels are read one by one.
const PART: usize = 64;

/// Places in the photograph, a coordinate as by [`fixed`].
struct Places {
    x: [u32; PART],
    y: [u32; PART],
}

/// From the pixels of the result to places in the photograph.
struct Mapping {
    focal: [f64; 2],
    principal: [f64; 2],
    size: [u32; 2],
    coefficients: Coefficients<f64>,
    /// Where the lens's polynomials fold the image over, from the centre.
    reach: f64,
}

impl Mapping {
    /// The ideal point of an image coordinate, normalised.
    #[inline(always)]
    fn ideal(&self, x: f64, y: f64) -> [f64; 2] {
        [(x - self.principal[0]) / self.focal[0], (y - self.principal[1]) / self.focal[1]]
    }

    /// The places of so many pixels of a row, and whether the photograph shows them: 255 or 0; some pixels behind the
    /// last one of the row are mapped as well. A loop without branches, which becomes vectors.
    #[inline(always)]
    fn places<const FISHEYE: bool>(&self, first: u32, row: u32, seen: &mut [u8]) -> Places {
        let [width, height] = self.size;
        let mut places = Places { x: [0; PART], y: [0; PART] };
        let mut are_seen = [0; PART];
        for (index, is_seen) in are_seen.iter_mut().enumerate() {
            let column = (first + index as u32) as i32;
            let ideal = self.ideal(f64::from(column) + 0.5, f64::from(row) + 0.5);
            let [x, y] = distort(FISHEYE, &self.coefficients, ideal);
            let (x, y) = (x * self.focal[0] + self.principal[0], y * self.focal[1] + self.principal[1]);
            let inside = (x >= 0.0) & (y >= 0.0) & (x <= f64::from(width)) & (y <= f64::from(height));
            let before_fold = ideal[0] * ideal[0] + ideal[1] * ideal[1] <= self.reach * self.reach;
            (places.x[index], places.y[index]) = (fixed(x, width), fixed(y, height));
            *is_seen = 0_u8.wrapping_sub(u8::from(inside & before_fold));
        }
        seen.copy_from_slice(&are_seen[..seen.len()]);
        places
    }
}

/// Bits of a place's fraction.
const FRACTION_BITS: u32 = 16;

/// The distance of an image coordinate (pixel centres at halves) from the first pixel's centre, in units of 2^-16
/// pixels, at most to the last pixel's. Outside the image, and for NaN, that of its nearest end.
#[inline(always)]
fn fixed(at: f64, side: u32) -> u32 {
    const { assert!(crate::MAX_SIDE as u64 <= 1 << (32 - FRACTION_BITS)) }
    let place = (at - 0.5).max(0.0).min(f64::from(side - 1));
    // The last bits of the sum with 2^52 are the nearest integer: a conversion that is a vector's, without saturation.
    (place * f64::from(1 << FRACTION_BITS) + 4_503_599_627_370_496.0).to_bits() as u32
}

/// The four pixels nearest to each of some places: the upper left one, steps to its neighbours, and the shares of
/// these.
struct Corners {
    upper: [u32; PART],
    right: [u32; PART],
    down: [u32; PART],
    across: [f32; PART],
    below: [f32; PART],
}

impl Corners {
    const NONE: Corners =
        Corners { upper: [0; PART], right: [0; PART], down: [0; PART], across: [0.0; PART], below: [0.0; PART] };

    #[inline(always)]
    fn surround(&mut self, places: &Places, [width, height]: [u32; 2]) {
        let share = |place: u32| (place & ((1 << FRACTION_BITS) - 1)) as i32 as f32 / (1 << FRACTION_BITS) as f32;
        for index in 0..PART {
            let (x, y) = (places.x[index], places.y[index]);
            let (column, row) = (x >> FRACTION_BITS, y >> FRACTION_BITS);
            self.upper[index] = row * width + column;
            self.right[index] = if column + 1 < width { 1 } else { 0 };
            self.down[index] = if row + 1 < height { width } else { 0 };
            (self.across[index], self.below[index]) = (share(x), share(y));
        }
    }

    /// The four pixels of a place, and their shares, which sum to 1.
    #[inline(always)]
    fn of<T: Copy>(&self, index: usize, texels: &[T]) -> [(T, f32); 4] {
        let (upper, right, down) = (self.upper[index], self.right[index], self.down[index]);
        let (across, below) = (self.across[index], self.below[index]);
        [
            (texels[upper as usize], (1.0 - across) * (1.0 - below)),
            (texels[(upper + right) as usize], across * (1.0 - below)),
            (texels[(upper + down) as usize], (1.0 - across) * below),
            (texels[(upper + down + right) as usize], across * below),
        ]
    }

    /// The mean of opaque pixels.
    #[inline(always)]
    fn plain(&self, index: usize, texels: &[[u8; 4]]) -> [u8; 4] {
        // The last bits of a sum with 2^23 are the nearest integer.
        let mut sums = [0.0_f32; 4];
        for (texel, share) in self.of(index, texels) {
            (0..4).for_each(|channel| sums[channel] += share * f32::from(texel[channel]));
        }
        sums.map(|sum| (sum + 8_388_608.0).to_bits() as u8)
    }

    /// The mean, colours weighted by alpha; where all is transparent, without it.
    #[inline(always)]
    fn premultiplied(&self, index: usize, texels: &[[u8; 4]]) -> [u8; 4] {
        let corners = self.of(index, texels);
        let alpha: f32 = corners.iter().map(|(texel, share)| share * f32::from(texel[3])).sum();
        let weights = corners.map(|(texel, share)| match alpha > 0.0 {
            true => share * f32::from(texel[3]) / alpha,
            false => share,
        });
        let level = |value: f32| (value + 0.5) as u8;
        let colour = |channel: usize| {
            level(corners.iter().zip(weights).map(|((texel, _), weight)| weight * f32::from(texel[channel])).sum())
        };
        [colour(0), colour(1), colour(2), level(alpha)]
    }
}
