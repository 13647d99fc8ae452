//! Undistortion: a photograph with lens distortion becomes that of a pinhole camera with the same focal length.
//!
//! Each pixel of the result is mapped through the lens in f64, and interpolated between the four nearest pixels
//! (premultiplied by alpha if there is any). Pixels outside the photograph, or where the lens's polynomials fold the image over, are
//! marked as not seen.

use image::{GrayImage, RgbaImage};
use rayon::prelude::*;
use viewfuse_core::camera::Pinhole;
use viewfuse_core::lens::{Lens, Projection, distort};

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
    let between = |corners: &Corners| match photograph.has_alpha {
        true => corners.premultiplied(texels),
        false => corners.plain(texels),
    };
    let mut pixels = RgbaImage::new(width, height);
    let mut seen = GrayImage::new(width, height);
    let lines = pixels.par_chunks_mut(4 * width as usize).zip(seen.par_chunks_mut(width as usize));
    let new_places = || vec![[0; 2]; width as usize];
    lines.enumerate().for_each_init(new_places, |places, (row, (line, seen))| {
        match is_fisheye {
            true => mapping.row::<true>(row as u32, places, seen),
            false => mapping.row::<false>(row as u32, places, seen),
        }
        for (pixel, place) in line.as_chunks_mut::<4>().0.iter_mut().zip(places) {
            *pixel = between(&Corners::around(*place, [width, height]));
        }
    });
    let all_seen = seen.as_raw().iter().all(|seen| *seen > 0);
    Photograph { pixels, has_alpha: photograph.has_alpha, seen: (!all_seen).then_some(seen) }
}

/// From the pixels of the result to places in the photograph.
struct Mapping {
    focal: [f64; 2],
    principal: [f64; 2],
    size: [u32; 2],
    coefficients: [f64; 8],
    /// Where the lens's polynomials fold the image over, from the centre.
    reach: f64,
}

impl Mapping {
    /// The ideal point of an image coordinate, normalised.
    #[inline(always)]
    fn ideal(&self, x: f64, y: f64) -> [f64; 2] {
        [(x - self.principal[0]) / self.focal[0], (y - self.principal[1]) / self.focal[1]]
    }

    /// The places of a row's pixels, and whether the photograph shows them: 255 or 0. A loop without branches, which becomes vectors.
    fn row<const FISHEYE: bool>(&self, row: u32, places: &mut [[u32; 2]], seen: &mut [u8]) {
        let [width, height] = self.size;
        for (column, (place, seen)) in (0_u32..).zip(places.iter_mut().zip(seen)) {
            let ideal = self.ideal(f64::from(column) + 0.5, f64::from(row) + 0.5);
            let [x, y] = distort(FISHEYE, &self.coefficients, ideal);
            let (x, y) = (x * self.focal[0] + self.principal[0], y * self.focal[1] + self.principal[1]);
            let inside = (x >= 0.0) & (y >= 0.0) & (x <= f64::from(width)) & (y <= f64::from(height));
            let is_seen = inside & (ideal[0] * ideal[0] + ideal[1] * ideal[1] <= self.reach * self.reach);
            *place = [fixed(x, width), fixed(y, height)];
            *seen = 0_u8.wrapping_sub(u8::from(is_seen));
        }
    }
}

/// Bits of a place's fraction.
const FRACTION_BITS: u32 = 16;

/// The distance of an image coordinate (pixel centres at halves) from the first pixel's centre, in units of 2^-16 pixels, at most to
/// the last pixel's. Outside the image, and for NaN, that of its nearest end.
#[inline(always)]
fn fixed(at: f64, side: u32) -> u32 {
    const { assert!(crate::MAX_SIDE as u64 <= 1 << (32 - FRACTION_BITS)) }
    let place = (at - 0.5).max(0.0).min(f64::from(side - 1));
    // The last bits of the sum with 2^52 are the nearest integer: a conversion that is a vector's, without saturation.
    (place * f64::from(1 << FRACTION_BITS) + 4_503_599_627_370_496.0).to_bits() as u32
}

/// The four pixels nearest to a point, and their shares, which sum to 1.
struct Corners {
    places: [usize; 4],
    shares: [f32; 4],
}

impl Corners {
    /// Of a place as by [`fixed`].
    #[inline(always)]
    fn around(place: [u32; 2], [width, height]: [u32; 2]) -> Corners {
        let split = |place: u32, side: u32| {
            let (first, rest) = (place >> FRACTION_BITS, place & ((1 << FRACTION_BITS) - 1));
            (first as usize, (first + 1).min(side - 1) as usize, rest as i32 as f32 / (1 << FRACTION_BITS) as f32)
        };
        let ((left, right, across), (top, bottom, below)) = (split(place[0], width), split(place[1], height));
        let (top, bottom) = (top * width as usize, bottom * width as usize);
        Corners {
            places: [top + left, top + right, bottom + left, bottom + right],
            shares: [(1.0 - across) * (1.0 - below), across * (1.0 - below), (1.0 - across) * below, across * below],
        }
    }

    /// The mean of opaque pixels.
    #[inline(always)]
    fn plain(&self, texels: &[[u8; 4]]) -> [u8; 4] {
        // The last bits of a sum with 2^23 are the nearest integer.
        let mut sums = [0.0_f32; 4];
        for (place, share) in self.places.iter().zip(self.shares) {
            let texel = texels[*place];
            (0..4).for_each(|channel| sums[channel] += share * f32::from(texel[channel]));
        }
        sums.map(|sum| (sum + 8_388_608.0).to_bits() as u8)
    }

    /// The mean, colours weighted by alpha; where all is transparent, without it.
    fn premultiplied(&self, texels: &[[u8; 4]]) -> [u8; 4] {
        let corners: [_; 4] = std::array::from_fn(|corner| (texels[self.places[corner]], self.shares[corner]));
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
