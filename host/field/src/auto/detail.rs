//! The detail of the photographs that coarse pictures lack.

use viewfuse_core::lookup::bilinear_from;
use viewfuse_device::parallel::map;
use viewfuse_scene::photographs::{SourceImage, reduced_size};

/// Mean square, over pixels and colours, of the change of the images when their longest side is reduced to `side`.
pub(super) fn lost_detail(images: &[SourceImage], side: u32) -> f64 {
    let squares = map(images.len(), 1, |image| squares(&images[image], side));
    let (sum, count) = squares.iter().fold((0.0, 0), |(sum, count), (square, values)| (sum + square, count + values));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// The sum of an image's squares, and how many they are; none of an image that can't be reduced.
fn squares(image: &SourceImage, side: u32) -> (f64, usize) {
    let Ok(small) = image.reduced(side) else { return (0.0, 0) };
    let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
    let (small_width, small_height) = reduced_size(&image.camera, side);
    let (to_column, to_row) = (small_width as f32 / width as f32, small_height as f32 / height as f32);
    let square = |pixel: u32| {
        let (column, row) = (pixel % width, pixel / width);
        let (x, y) = ((column as f32 + 0.5) * to_column, (row as f32 + 0.5) * to_row);
        let coarse = bilinear_from(&small.texels[..], 0, small_width, small_height, x, y);
        let whole = image.texels[pixel as usize];
        (0..3).map(|channel| f64::from(whole[channel] - coarse[channel]).powi(2)).sum::<f64>()
    };
    ((0..width * height).map(square).sum(), 3 * (width * height) as usize)
}
