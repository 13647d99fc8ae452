//! The detail of the photographs that coarse pictures lack.

use viewfuse_core::lookup::bilinear_from;
use viewfuse_scene::photographs::{SourceImage, reduced_size};

/// Mean square, over pixels and colours, of the change of the images when their longest side is reduced to `side`.
pub(super) fn lost_detail(images: &[SourceImage], side: u32) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for image in images {
        let Ok(small) = image.reduced(side) else { continue };
        let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
        let (small_width, small_height) = reduced_size(&image.camera, side);
        let (to_column, to_row) = (small_width as f32 / width as f32, small_height as f32 / height as f32);
        for row in 0..height {
            for column in 0..width {
                let whole = image.texels[(row * width + column) as usize];
                let (x, y) = ((column as f32 + 0.5) * to_column, (row as f32 + 0.5) * to_row);
                let coarse = bilinear_from(&small.texels[..], 0, small_width, small_height, x, y);
                let squares = (0..3).map(|channel| f64::from(whole[channel] - coarse[channel]).powi(2));
                sum += squares.sum::<f64>();
            }
        }
        count += 3 * (width * height) as usize;
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}
