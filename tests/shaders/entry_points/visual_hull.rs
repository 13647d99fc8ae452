//! The training-free field. Arrays that may lie in pages are on one and on four.

use super::vectors::{arrays, cameras, fours};
use super::{UNTOUCHED, dispatch, numbers};
use viewfuse::check::world::World;
use viewfuse_kernels::visual_hull::hull::hull_entry;
use viewfuse_kernels::visual_hull::ray_marching::{MarchBlock, march_ray};
use viewfuse_kernels::visual_hull::sweep::{SweepBlock, match_cost, mean_column, pick_depth, sum_row};

/// Binary logarithm of the pages' length by which a map of this length takes all four.
pub(super) fn page_shift(length: usize) -> u32 {
    length.div_ceil(4).next_power_of_two().trailing_zeros()
}

/// With shift 0 everything is on the first page.
fn page_length(shift: u32) -> usize {
    if shift == 0 { usize::MAX } else { 1 << shift }
}

pub(super) fn pages<T>(all: &[T], shift: u32) -> [&[T]; 4] {
    let mut pages = all.chunks(page_length(shift));
    std::array::from_fn(|_| pages.next().unwrap_or_default())
}

pub(super) fn pages_mut<T>(all: &mut [T], shift: u32) -> [&mut [T]; 4] {
    let mut pages = all.chunks_mut(page_length(shift));
    std::array::from_fn(|_| pages.next().unwrap_or_default())
}

/// With everything on the first page, and on four.
fn shifts(world: &World) -> [u32; 2] {
    [0, page_shift(world.texels.len())]
}

#[test]
fn hull_entry_is_core_s() {
    let world = World::new(1);
    let (view, camera) = (2, world.views[2]);
    let first = camera.first_texel as usize;
    let count = camera.width * camera.height;
    for shift in shifts(&world) {
        let mut entries = vec![UNTOUCHED; world.texels.len()];
        dispatch(view, count, |id, push| {
            let [ta, tb, tc, td] = pages(&world.texels, shift);
            let [ea, eb, ec, ed] = pages_mut(&mut entries, shift);
            viewfuse_shaders::hull_entry(
                id,
                push,
                &world.object,
                &cameras(&world.views),
                ta,
                tb,
                tc,
                td,
                ea,
                eb,
                ec,
                ed,
                shift,
            );
        });
        let expected: Vec<f32> = (0..count)
            .map(|pixel| hull_entry(&world.object, &world.views[..], &world.texels[..], view, pixel))
            .collect();
        assert_eq!(entries[first..first + count as usize], expected);
        assert_eq!(entries.iter().filter(|entry| **entry == UNTOUCHED).count(), entries.len() - count as usize);
    }
}

#[test]
fn match_cost_is_core_s() {
    let world = World::new(2);
    let block = world.sweep(1);
    let count = block.width * block.row_count * block.plane_count;
    let expected: Vec<f32> = (0..count)
        .map(|at| {
            let pixel = block.first_row * block.width + at / block.plane_count;
            let plane = at % block.plane_count;
            let World { object, views, texels, entries, pair_weights, .. } = &world;
            match_cost(object, &block, &views[..], &texels[..], &entries[..], pair_weights, pixel, plane)
        })
        .collect();
    let (words, texels) = (cameras(&world.views), fours(&world.texels));
    assert!(expected.iter().any(|cost| *cost >= 0.0) && expected.iter().any(|cost| *cost < 0.0));
    for shift in shifts(&world) {
        let mut costs = vec![UNTOUCHED; count as usize];
        dispatch(block, block.width * block.row_count, |id, push| {
            let [ta, tb, tc, td] = pages(&texels, shift);
            let [ea, eb, ec, ed] = pages(&world.entries, shift);
            let World { object, pair_weights, .. } = &world;
            viewfuse_shaders::match_cost(
                id,
                push,
                object,
                &words,
                ta,
                tb,
                tc,
                td,
                ea,
                eb,
                ec,
                ed,
                pair_weights,
                &mut costs,
                shift,
            );
        });
        assert_eq!(costs, expected);
    }
}

/// Costs of a band, their sums and means.
fn costs_and_means(block: &SweepBlock) -> [Vec<f32>; 2] {
    let count = block.width * block.row_count * block.plane_count;
    let costs: Vec<f32> = numbers(11, count as usize).iter().map(|cost| cost + 0.5).collect();
    let mut row_sums = vec![[UNTOUCHED; 2]; count as usize];
    dispatch(*block, count, |id, push| viewfuse_shaders::sum_row(id, push, &costs, &mut row_sums));
    let place = |at: u32| (at / block.plane_count, at % block.plane_count);
    let expected: Vec<[f32; 2]> =
        (0..count).map(place).map(|(pixel, plane)| sum_row(block, &costs, pixel, plane)).collect();
    assert_eq!(row_sums, expected);
    let mut means = vec![UNTOUCHED; count as usize];
    dispatch(*block, count, |id, push| viewfuse_shaders::mean_column(id, push, &costs, &row_sums, &mut means));
    let expected: Vec<f32> =
        (0..count).map(place).map(|(pixel, plane)| mean_column(block, &costs, &row_sums, pixel, plane)).collect();
    assert_eq!(means, expected);
    [costs, means]
}

#[test]
fn windows_and_depths_are_core_s() {
    let world = World::new(3);
    let block = world.sweep(1);
    let [_, means] = costs_and_means(&block);
    let count = block.width * block.row_count;
    let first = (world.views[1].first_texel + block.first_row * block.width) as usize;
    let band = first..first + count as usize;
    let (entries, guess) = (&world.entries[band.clone()], &world.depths[band.clone()]);
    let expected: Vec<f32> =
        (0..count).map(|pixel| pick_depth(&world.object, &block, &means, entries, guess, pixel)).collect();
    let words = cameras(&world.views);
    for shift in shifts(&world) {
        let mut picked = vec![UNTOUCHED; world.texels.len()];
        dispatch(block, count, |id, push| {
            let [ea, eb, ec, ed] = pages(&world.entries, shift);
            let [ga, gb, gc, gd] = pages(&world.depths, shift);
            let [pa, pb, pc, pd] = pages_mut(&mut picked, shift);
            viewfuse_shaders::pick_depth(
                id,
                push,
                &world.object,
                &words,
                &means,
                ea,
                eb,
                ec,
                ed,
                ga,
                gb,
                gc,
                gd,
                pa,
                pb,
                pc,
                pd,
                shift,
            );
        });
        assert_eq!(picked[band.clone()], expected);
        assert_eq!(picked.iter().filter(|depth| **depth == UNTOUCHED).count(), picked.len() - count as usize);
    }
}

#[test]
fn march_is_core_s() {
    let world = World::new(1);
    let block = MarchBlock { target: world.target, background: [0.2, 0.4, 0.6], termination: 0.01 };
    let count = block.target.width * block.target.height;
    let World { object, views, footprints, texels, depths, weights, .. } = &world;
    let expected: Vec<([f32; 4], f32)> = (0..count)
        .map(|pixel| {
            let at = [pixel % block.target.width, pixel / block.target.width].map(|side| side as f32 + 0.5);
            let seen = march_ray(object, &views[..], footprints, &texels[..], &depths[..], weights, &block, at);
            ([seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity], seen.depth)
        })
        .collect();
    assert!(expected.iter().any(|(_, depth)| *depth > 0.0));
    let (words, texel_fours) = (cameras(views), fours(texels));
    for shift in shifts(&world) {
        let mut colours = fours(&vec![[UNTOUCHED; 4]; count as usize]);
        let mut seen_depths = vec![UNTOUCHED; count as usize];
        dispatch(block, count, |id, push| {
            let [ta, tb, tc, td] = pages(&texel_fours, shift);
            let [da, db, dc, dd] = pages(depths, shift);
            let [ca, cb, cc, cd] = pages_mut(&mut colours, shift);
            let [pa, pb, pc, pd] = pages_mut(&mut seen_depths, shift);
            viewfuse_shaders::march_rays(
                id, push, object, &words, footprints, ta, tb, tc, td, da, db, dc, dd, weights, ca, cb, cc, cd, pa, pb,
                pc, pd, shift,
            );
        });
        let seen: Vec<([f32; 4], f32)> = arrays(&colours).into_iter().zip(seen_depths).collect();
        assert_eq!(seen, expected);
    }
}
