//! [`Kernel::BlendPlanes`]: every pixel of a target, in two bands, from a volume of half its size.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, costs};
use crate::world::{Numbers, change_texels};

impl Case for BlendPlanes {
    const LIMITS: Limits = Limits { tolerance: 4.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis from the image coordinates to the sum over planes; numbers \
        whose bound is larger than a step of 8 bits are undecided";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("views", |case| case.views[1].camera.intrinsics[0] *= 1.01),
        ("texels", |case| change_texels(&mut case.texels[case.views[1].camera.first_texel as usize..])),
        ("disparities", |case| increase(case.disparities.iter_mut().map(|[disparity, _]| disparity))),
        ("costs", |case| increase(case.costs.as_flattened_mut().iter_mut().step_by(2))),
        ("parameters", |case| case.block.target.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<BlendPlanes> {
        let swept = Swept::new(seed, size);
        let CostBlock { width, height, group_count, .. } = swept.volume();
        let half = CostBlock { width: width.div_ceil(2), height: height.div_ceil(2), group_count, padding: 0 };
        let (Swept { views, texels, disparities, .. }, block) = swept.halved(&half);
        let costs = costs(&mut Numbers::new(seed), &half);
        let pixel_count = (block.target.width * block.target.height) as usize;
        let band = |(index, [first_row, row_count]): (usize, [u32; 2])| BlendPlanes {
            block,
            first_row,
            row_count,
            views: views.clone(),
            texels: texels.clone(),
            disparities: disparities.clone(),
            costs: costs.clone(),
            colours: part_of_output(index, pixel_count),
            pixel_depths: part_of_output(index, pixel_count),
            confidences: part_of_output(index, pixel_count),
        };
        bands(block.target.height).enumerate().map(band).collect()
    }

    /// The whole picture for the first band.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let BlendPlanes { block, views, texels, disparities, costs, colours, .. } = self;
        let Output::Zeros(pixel_count) = *colours else { return Vec::new() };
        let pixels = map(pixel_count, 1, |pixel| {
            let (column, row) = (pixel as u32 % block.target.width, pixel as u32 / block.target.width);
            let at = [column as f32 + 0.5, row as f32 + 0.5];
            sweep_oracle::blend(block, views, texels, disparities, costs, at)
        });
        let mut expected = Vec::new();
        for pixel in &pixels {
            expected.extend((0..4).map(|channel| pixel.map(|pixel| pixel.colour[channel])));
        }
        expected.extend(pixels.iter().map(|pixel| pixel.and_then(|pixel| pixel.depth)));
        expected.extend(pixels.iter().map(|pixel| pixel.map(|pixel| pixel.confidence)));
        expected
    }
}
