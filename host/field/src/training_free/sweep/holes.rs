//! Holes of a picture: surfaces that no source shows. What the planes run on with there, a streak of a source's border
//! or a second copy of what hides the surface, is replaced by the smooth colours around it.
//!
//! Hole filling by a pyramid ("push-pull", Gortler et al., The Lumigraph, 1996): colours are averaged over what is
//! known, two by two pixels at a time, until all is known, and taken back from there, bilinear, where nothing was.

use crate::{DepthMap, Rendered};
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::parallel::map;

/// Pixels that are enough work for a thread.
const MIN_PIXELS: usize = 256;

/// Colours times their weights, and weights in `[0, 1]`; row-major.
struct Level {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 4]>,
}

/// Fills the pixels whose surface none of the views with these maps shows, and takes their confidence away. `target` is
/// the picture's camera. Without any pixel that a view shows nothing changes.
pub(super) fn fill(picture: &mut Rendered, target: &CameraBlock, maps: &[DepthMap]) {
    let width = picture.width as usize;
    let shown = |pixel: usize| {
        let depth = picture.depths[pixel];
        let [x, y] = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
        let point = target.centre_world() + target.towards(x, y) * depth;
        depth <= 0.0 || maps.iter().any(|map| map.shows(point))
    };
    let shown: Vec<bool> = map(picture.depths.len(), MIN_PIXELS, shown);
    if shown.iter().all(|shown| *shown) || !shown.iter().any(|shown| *shown) {
        return;
    }
    let known = |(colour, shown): (&[f32; 4], &bool)| {
        if *shown { [colour[0], colour[1], colour[2], 1.0] } else { [0.0; 4] }
    };
    let pixels = picture.colours.iter().zip(&shown).map(known).collect();
    let filled = Level { width, height: picture.height as usize, pixels }.filled();
    for (pixel, colour) in filled.pixels.iter().enumerate().filter(|(pixel, _)| !shown[*pixel]) {
        picture.colours[pixel][..3].copy_from_slice(&colour[..3]);
        if let Some(confidence) = picture.confidences.get_mut(pixel) {
            *confidence = 0.0;
        }
    }
}

impl Level {
    /// With all weights 1.
    fn filled(mut self) -> Level {
        if self.pixels.len() > 1 && self.pixels.iter().any(|pixel| pixel[3] < 1.0) {
            let coarse = self.halved().filled();
            let width = self.width;
            for (index, pixel) in self.pixels.iter_mut().enumerate().filter(|(_, pixel)| pixel[3] < 1.0) {
                let behind = coarse.at((index % width) as f32 * 0.5 + 0.25, (index / width) as f32 * 0.5 + 0.25);
                let rest = 1.0 - pixel[3];
                *pixel = [0, 1, 2, 3].map(|channel| pixel[channel] + rest * behind[channel]);
            }
        }
        self
    }

    /// Sums over two by two pixels, those at odd borders over fewer; weights are at most 1.
    fn halved(&self) -> Level {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut pixels = vec![[0.0; 4]; width * height];
        for (index, pixel) in self.pixels.iter().enumerate() {
            let (column, row) = (index % self.width, index / self.width);
            let sum = &mut pixels[row / 2 * width + column / 2];
            (0..4).for_each(|channel| sum[channel] += pixel[channel]);
        }
        for pixel in pixels.iter_mut().filter(|pixel| pixel[3] > 1.0) {
            *pixel = pixel.map(|value| value / pixel[3]);
        }
        Level { width, height, pixels }
    }

    /// Bilinear between pixels' centres, image coordinates.
    fn at(&self, x: f32, y: f32) -> [f32; 4] {
        let split = |at: f32, size: usize| {
            let at = (at - 0.5).clamp(0.0, (size - 1) as f32);
            (at as usize, (at as usize + 1).min(size - 1), at.fract())
        };
        let ((left, right, x), (top, bottom, y)) = (split(x, self.width), split(y, self.height));
        let mix = |a: [f32; 4], b: [f32; 4], share: f32| -> [f32; 4] {
            std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * share)
        };
        let along = |row: usize| mix(self.pixels[row * self.width + left], self.pixels[row * self.width + right], x);
        mix(along(top), along(bottom), y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;
    use viewfuse_core::camera::{Camera, Pinhole};
    use viewfuse_core::pose::Pose;

    fn camera(x: f32) -> CameraBlock {
        let pose = Pose::look_at(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 1.0), -Vec3::Y).expect("a pose");
        Camera { pose, pinhole: Pinhole::new([16.0; 2], [8.0; 2], 16, 16).expect("a pinhole") }.block(0)
    }

    /// A wall at depth 2 that becomes brighter to the right, with a wrong colour in the right half.
    fn wall() -> Rendered {
        let colour = |index: usize| match index % 16 {
            column @ 0..8 => [column as f32 / 8.0, 0.5, 0.25, 1.0],
            _ => [0.0, 0.0, 0.0, 1.0],
        };
        Rendered {
            colours: (0..256).map(colour).collect(),
            depths: vec![2.0; 256],
            confidences: vec![0.75; 256],
            width: 16,
            height: 16,
        }
    }

    fn map(x: f32) -> DepthMap {
        DepthMap { camera: camera(x), depths: vec![2.0; 256], confidences: vec![1.0; 256] }
    }

    #[test]
    fn what_no_view_shows_has_the_colours_around_it() {
        let mut picture = wall();
        // The map's camera is one unit to the left: it shows the left half.
        fill(&mut picture, &camera(0.0), &[map(-1.0)]);
        for (index, (colour, confidence)) in picture.colours.iter().zip(&picture.confidences).enumerate() {
            let column = index % 16;
            if column < 8 {
                assert_eq!((colour, *confidence), (&wall().colours[index], 0.75));
            } else {
                assert!(colour[0] > 0.4 && colour[0] <= 0.875, "{column}: {colour:?}");
                assert!((colour[1] - 0.5).abs() < 1.0e-6 && (colour[2] - 0.25).abs() < 1.0e-6, "{colour:?}");
                assert_eq!((colour[3], *confidence), (1.0, 0.0));
            }
        }
    }

    #[test]
    fn nothing_changes_where_all_or_nothing_is_shown() {
        for maps in [vec![map(0.0)], vec![map(100.0)], Vec::new()] {
            let mut picture = wall();
            fill(&mut picture, &camera(0.0), &maps);
            assert_eq!(picture, wall());
        }
    }
}
