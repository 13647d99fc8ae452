//! [`Kernel::PickDepth`]: some rows of a band of every view, with and without depths from an earlier pass. A dispatch
//! for each view picks its part.

use super::*;
use crate::hull_oracle;
use crate::world::{Numbers, World, change_depths, costs};
use viewfuse_kernels::visual_hull::NO_SURFACE;

impl Case for PickDepth {
    // Of the cameras it takes only where their pixels are.
    const SHAPES_ONLY: &'static [&'static str] = &["views"];
    const LIMITS: Limits = Limits { tolerance: 2.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of costs, of the parabola through the least three and its \
        quotient; undecided where two planes cost the same to within it";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("object", |case| case.object[0].radius *= 1.01),
        ("means", |case| increase(case.means.iter_mut().step_by(2).filter(|cost| **cost > 0.0))),
        ("entries", |case| change_depths(&mut case.entries)),
        ("guess", |case| change_depths(&mut case.guess)),
        ("parameters", |case| case.block.near *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<PickDepth> {
        let world = World::of_size(seed, size);
        let numbers = &mut Numbers::new(seed);
        let band = |view| {
            let sweep = world.sweep(view);
            (sweep, costs(numbers, sweep.row_count * sweep.width, sweep.plane_count))
        };
        let bands: Vec<_> = (0..world.object.view_count).map(band).collect();
        let count = world.depths.len();
        let with_guess = |guess: Vec<f32>| {
            let of_view = |(view, (block, means)): (usize, &(SweepBlock, Vec<f32>))| {
                // All but the first.
                let first_row = (block.row_count - 1).min(1);
                PickDepth {
                    block: *block,
                    first_row,
                    row_count: block.row_count - first_row,
                    object: vec![world.object],
                    views: world.views.clone(),
                    means: means.clone(),
                    entries: world.entries.clone(),
                    guess: guess.clone(),
                    picked: part_of_output(view, count),
                }
            };
            bands.iter().enumerate().map(of_view).collect::<Vec<_>>()
        };
        [vec![NO_SURFACE; count], world.depths.clone()].map(with_guess).concat()
    }

    /// The view's depths; what no row covers stays as it was.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let PickDepth { block, first_row, row_count, object, views, means, entries, guess, .. } = self;
        let view = &views[block.view as usize];
        let above = block.first_row * block.width;
        let first = (view.first_texel + above) as usize;
        let (entries, guess) = (&entries[first..], &guess[first..]);
        let pixels = first_row * block.width..(first_row + row_count) * block.width;
        let picked = map(pixels.len(), 1, |index| {
            let pixel = pixels.start + index as u32;
            hull_oracle::pick_depth(&object[0], block, block.width, means, entries, guess, pixel)
        });
        let mut depths = vec![Some(Bounded::ZERO); (view.width * view.height) as usize];
        depths[(above + pixels.start) as usize..][..pixels.len()].copy_from_slice(&picked);
        depths
    }
}
