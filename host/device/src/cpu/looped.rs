//! Loops over bodies that are written by hand: what elements write is not in their order, or a row's elements share
//! work.

use crate::parallel::{Rest, for_each_piece, for_each_row};
use pulp::Arch;
use viewfuse_core::depths::{FineBlock, merged_depth};
use viewfuse_kernels::network::attend::{softmax_scale, softmax_value};
use viewfuse_kernels::rows::ListBlock;

pub(super) fn softmax_rows(column_count: &u32, row_count: u32, scores: &[f32], weights: &mut [f32]) {
    let columns = *column_count as usize;
    for_each_row(&mut weights[..row_count as usize * columns], columns, 4096, |row, weights| {
        let scores = &scores[row * columns..][..columns];
        let scale = softmax_scale(scores, 0, *column_count);
        Arch::new().dispatch(
            #[inline(always)]
            || weights.iter_mut().zip(scores).for_each(|(weight, score)| *weight = softmax_value(*score, scale)),
        );
    });
}

pub(super) fn merge_depths(block: &FineBlock, ray_count: u32, coarse: &[f32], fine: &[f32], merged: &mut [f32]) {
    let (coarse_count, fine_count) = (block.coarse_count as usize, block.fine_count() as usize);
    let count = coarse_count + fine_count;
    for_each_row(&mut merged[..ray_count as usize * count], count, 1024, |ray, merged| {
        let (coarse, fine) = (&coarse[ray * coarse_count..], &fine[ray * fine_count..]);
        for index in 0..count as u32 {
            let (depth, place) = merged_depth(coarse, fine, block.coarse_count, block.fine_count(), index);
            merged[place as usize] = depth;
        }
    });
}

/// Each tile's keys are sorted, in the order that the body's ranks have.
pub(super) fn sort_entries(block: &ListBlock, starts: &[u32], keys: &[[u32; 2]], entries: &mut [u32]) {
    let mut entries = Rest::new(entries);
    let start = |tile: u32| starts[tile as usize] as usize;
    let take = move |tiles: std::ops::Range<u32>| entries.take(start(tiles.start), start(tiles.end));
    for_each_piece(0..block.tile_count(), 8, take, |tiles, entries| {
        let (first, end) = (start(tiles.start), start(tiles.end));
        let mut sorted = keys[first..end].to_vec();
        tiles.for_each(|tile| sorted[start(tile) - first..start(tile + 1) - first].sort_unstable());
        entries.values.iter_mut().zip(sorted).for_each(|(entry, [_, index])| *entry = index);
    });
}
