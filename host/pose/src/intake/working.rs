//! The size at which solvers look for features.

use image::GrayImage;
use image::imageops::{self, FilterType};

/// Longest side in pixels at which solvers look for features. Smaller photographs are enlarged: the finest features of
/// detectors that begin at a photograph's own pixels are several pixels wide.
pub(super) const WORKING_SIDE: u32 = 1200;

/// The same for attempts where some photographs are not accepted that match others.
pub(super) const FINE_SIDE: u32 = 1600;

/// Most that a photograph is enlarged: beyond that there is nothing finer to find.
pub(super) const MAX_ENLARGEMENT: f64 = 4.0;

/// A picture at a size; the places in it are in proportion, from outer corner to outer corner.
pub(super) fn resized(picture: &GrayImage, size: [u32; 2]) -> GrayImage {
    let [width, height] = size;
    match picture.dimensions() {
        found if found == (width, height) => picture.clone(),
        found if found < (width, height) => imageops::resize(picture, width, height, FilterType::CatmullRom),
        _ => imageops::resize(picture, width, height, FilterType::Triangle),
    }
}

/// The size with a longest side of `side`, as far as that enlarges it at most by a factor.
pub(super) fn scaled([width, height]: [u32; 2], side: u32, max_enlargement: f64) -> [u32; 2] {
    let scale = (f64::from(side) / f64::from(width.max(height))).min(max_enlargement);
    [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1))
}
