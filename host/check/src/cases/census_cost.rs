//! [`Kernel::CensusCost`]: a band of random greys, in two dispatches.

use super::*;
use crate::sweep_oracle;
use crate::swept::{Swept, band};
use crate::world::Numbers;
use viewfuse_kernels::plane_sweep::PLANES;

impl Case for CensusCost {
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "differences of grey in units of 0.04, each rounded; sums over twelve neighbours of \
        all pairs; three quotients";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("pairs", |case| case.pairs[0].weight *= 1.01),
        ("grey", |case| increase(case.grey.iter_mut().step_by(2).map(|grey| &mut grey[0]))),
        ("evidence", |case| increase(case.evidence.as_flattened_mut())),
        ("parameters", |case| case.block.dissent_share *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CensusCost> {
        let swept = Swept::new(seed, size);
        let (grey, evidence) = band(&mut Numbers::new(seed), &swept);
        let volume = swept.volume();
        let count = 2 * (volume.width * volume.height * volume.group_count) as usize;
        let rows = |(index, [first_row, row_count]): (usize, [u32; 2])| CensusCost {
            block: swept.frustum,
            first_row,
            row_count,
            pairs: swept.pairs.clone(),
            grey: grey.clone(),
            evidence: evidence.clone(),
            costs: part_of_output(index, count),
        };
        bands(swept.frustum.row_count).enumerate().map(rows).collect()
    }

    /// The rows' costs, and for the first dispatch what stays above the band.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let CensusCost { block, first_row, pairs, grey, evidence, costs, .. } = self;
        let row_len = (block.camera.width * block.group_count) as usize;
        let first = *first_row as usize * row_len;
        let rows = map(self.element_count(), 8, |element| {
            let element = (first + element) as u32;
            let (pixel, group) = (element / block.group_count, element % block.group_count);
            sweep_oracle::census_cost(block, pairs, grey, evidence, pixel, group)
        });
        let above = if let Output::Continued = costs { 0 } else { 2 * PLANES * block.first_row as usize * row_len };
        let before = vec![Bounded::ZERO; above];
        decided(before.into_iter().chain(rows.iter().flat_map(|costs| costs.as_flattened()).copied()), 0)
    }
}
