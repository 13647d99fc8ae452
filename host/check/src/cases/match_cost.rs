//! [`Kernel::MatchCost`]: a band of one view's sweep through a small world.

use super::*;
use crate::hull_oracle::{self, Scene};
use crate::world::{World, change_depths, change_texels};

impl Case for MatchCost {
    const LIMITS: Limits = Limits { tolerance: 2.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "colours as a look-up (ten roundings of an image coordinate, times the image's slope) \
        over an alpha of at least 0.3, times shares of at most 1 / NO_WITNESS";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("object", |case| case.object[0].radius *= 1.01),
        ("views", |case| case.views[1].intrinsics[0] *= 1.01),
        ("texels", |case| change_texels(&mut case.texels[case.views[1].first_texel as usize..])),
        ("entries", |case| change_depths(&mut case.entries)),
        ("pair_weights", |case| increase(case.pair_weights.iter_mut().step_by(2))),
        ("parameters", |case| case.block.near *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<MatchCost> {
        let world = World::of_size(seed, size);
        let block = world.sweep((seed % u64::from(world.object.view_count)) as u32);
        let World { object, views, texels, entries, pair_weights, .. } = world;
        let costs = Output::Zeros((block.row_count * block.width * block.plane_count) as usize);
        vec![MatchCost { block, object: vec![object], views, texels, entries, pair_weights, costs }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let MatchCost { block, object, views, texels, entries, pair_weights, .. } = self;
        let scene = Scene { object: &object[0], views, texels };
        let first = block.first_row * block.width;
        let costs = |index: usize| -> Vec<_> {
            let pixel = first + index as u32;
            let cost = |plane| hull_oracle::match_cost(&scene, block, entries, pair_weights, pixel, plane);
            (0..block.plane_count).map(cost).collect()
        };
        map(self.element_count(), 1, costs).concat()
    }
}
