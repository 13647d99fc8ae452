//! Undistortion: a photograph with lens distortion becomes that of a pinhole camera with the same focal length.
//!
//! Each pixel of the result is mapped through the lens in f64, and interpolated between the four nearest pixels
//! (premultiplied by alpha). Pixels outside the photograph, or where the lens's polynomials fold the image over, are
//! marked as not seen.

use image::{GrayImage, Rgba, RgbaImage};
use rayon::prelude::*;
use viewfuse_core::camera::Pinhole;
use viewfuse_core::lens::Lens;

use super::Photograph;

/// The photograph of the pinhole camera, at the same size.
pub(super) fn undistorted(photograph: &Photograph, lens: &Lens, pinhole: &Pinhole) -> Photograph {
    let (width, height) = photograph.pixels.dimensions();
    let scale = [f64::from(width) / f64::from(pinhole.width()), f64::from(height) / f64::from(pinhole.height())];
    let scaled = |pair: [f32; 2]| [f64::from(pair[0]) * scale[0], f64::from(pair[1]) * scale[1]];
    let (focal, principal) = (scaled(pinhole.focal()), scaled(pinhole.principal()));
    let to_ideal = |x: f64, y: f64| [(x - principal[0]) / focal[0], (y - principal[1]) / focal[1]];
    let corners = [(0, 0), (width, 0), (0, height), (width, height)];
    let furthest = corners.map(|(x, y)| to_ideal(x.into(), y.into())).map(|[x, y]| x.hypot(y)).into_iter();
    let reach = lens.reach(furthest.fold(0.0, f64::max));

    let look = |column: u32, row: u32| {
        let ideal = to_ideal(f64::from(column) + 0.5, f64::from(row) + 0.5);
        let [x, y] = lens.distort(ideal);
        let (x, y) = (x * focal[0] + principal[0], y * focal[1] + principal[1]);
        let inside = x >= 0.0 && y >= 0.0 && x <= f64::from(width) && y <= f64::from(height);
        let seen = inside && ideal[0].hypot(ideal[1]) <= reach;
        (interpolated(&photograph.pixels, x, y), seen)
    };
    let mut pixels = RgbaImage::new(width, height);
    let mut seen = GrayImage::new(width, height);
    let lines = pixels.par_chunks_mut(4 * width as usize).zip(seen.par_chunks_mut(width as usize));
    lines.enumerate().for_each(|(row, (line, seen_line))| {
        let places = line.as_chunks_mut::<4>().0.iter_mut().zip(seen_line);
        for (column, (pixel, seen)) in places.enumerate() {
            let (Rgba(levels), is_seen) = look(column as u32, row as u32);
            *pixel = levels;
            *seen = if is_seen { u8::MAX } else { 0 };
        }
    });
    let all_seen = seen.as_raw().iter().all(|seen| *seen > 0);
    Photograph { pixels, has_alpha: photograph.has_alpha, seen: (!all_seen).then_some(seen) }
}

/// The value at a continuous image coordinate (pixel centres at halves), from the four nearest pixels; outside, that of the
/// nearest pixel. A coordinate that is NaN gives the first pixel.
fn interpolated(image: &RgbaImage, x: f64, y: f64) -> Rgba<u8> {
    let (width, height) = image.dimensions();
    let split = |at: f64, side: u32| {
        let place = (at - 0.5).max(0.0).min(f64::from(side - 1));
        let first = place as u32;
        (first, (first + 1).min(side - 1), (place - f64::from(first)) as f32)
    };
    let ((left, right, across), (top, bottom, below)) = (split(x, width), split(y, height));
    let corners = [
        (image.get_pixel(left, top), (1.0 - across) * (1.0 - below)),
        (image.get_pixel(right, top), across * (1.0 - below)),
        (image.get_pixel(left, bottom), (1.0 - across) * below),
        (image.get_pixel(right, bottom), across * below),
    ];
    let alpha: f32 = corners.iter().map(|(pixel, share)| share * f32::from(pixel[3])).sum();
    // With zero alpha everywhere the colours are interpolated without it.
    let inverse = if alpha > 0.0 { 1.0 / alpha } else { 0.0 };
    let weights = corners.map(|(pixel, share)| match alpha > 0.0 {
        true => share * f32::from(pixel[3]) * inverse,
        false => share,
    });
    let level = |value: f32| (value + 0.5) as u8;
    let colour = |channel: usize| {
        level(corners.iter().zip(weights).map(|((pixel, _), weight)| weight * f32::from(pixel[channel])).sum())
    };
    Rgba([colour(0), colour(1), colour(2), level(alpha)])
}
