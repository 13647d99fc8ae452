//! [`Kernel::MarchRays`]: every pixel of a target, in two bands; with early termination for every other seed.

use super::*;
use crate::hull_oracle::{self, Scene};
use crate::world::{World, change_depths, change_texels};

impl Case for MarchRays {
    const SEED_COUNT: u64 = 3;
    const LIMITS: Limits = Limits { tolerance: 4.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to the sum along the ray; numbers \
        whose bound is larger than a step of 8 bits are undecided";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("object", |case| case.object[0].high[0] *= 1.01),
        ("views", |case| case.views[1].intrinsics[0] *= 1.01),
        ("footprints", |case| increase(&mut case.footprints)),
        ("texels", |case| change_texels(&mut case.texels[case.views[1].first_texel as usize..])),
        ("depths", |case| change_depths(&mut case.depths)),
        ("weights", |case| case.weights[1] *= 1.01),
        ("parameters", |case| case.block.target.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<MarchRays> {
        let World { object, views, footprints, texels, depths, weights, target, .. } = World::of_size(seed, size);
        let termination = if seed.is_multiple_of(2) { 0.1 } else { 0.0 };
        let pixel_count = (target.width * target.height) as usize;
        let band = |(index, [first_row, row_count]): (usize, [u32; 2])| MarchRays {
            block: MarchBlock { target, background: [1.0, 0.5, 0.25], termination },
            first_row,
            row_count,
            object: vec![object],
            views: views.clone(),
            footprints: footprints.clone(),
            texels: texels.clone(),
            depths: depths.clone(),
            weights: weights.clone(),
            colours: part_of_output(index, pixel_count),
            pixel_depths: part_of_output(index, pixel_count),
        };
        bands(target.height).enumerate().map(band).collect()
    }

    /// The whole picture for the first band.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let MarchRays { block, object, views, footprints, texels, depths, weights, colours, .. } = self;
        let Output::Zeros(pixel_count) = *colours else { return Vec::new() };
        let scene = Scene { object: &object[0], views, texels };
        let MarchBlock { target, background, termination } = *block;
        let pixels = map(pixel_count, 1, |pixel| {
            let at = [(pixel as u32 % target.width) as f32 + 0.5, (pixel as u32 / target.width) as f32 + 0.5];
            hull_oracle::march_ray(&scene, footprints, depths, weights, &target, at, background, termination)
        });
        let mut expected = Vec::new();
        for pixel in &pixels {
            expected.extend((0..3).map(|channel| pixel.map(|pixel| pixel.colour[channel])));
            expected.push(pixel.map(|pixel| pixel.opacity));
        }
        expected.extend(pixels.iter().map(|pixel| pixel.and_then(|pixel| pixel.depth)));
        expected
    }
}
