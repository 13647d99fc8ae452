//! The plane sweep. Arrays that may lie in pages are on one and on four.

use super::vectors::{arrays, fours, groups, planes as planes_of, swept_views, twos};
use super::visual_hull::{page_shift, pages, pages_mut};
use super::{UNTOUCHED, dispatch};
use viewfuse::check::swept::{Swept, band, costs, opacities};
use viewfuse::check::world::Numbers;
use viewfuse_kernels::bodies;
use viewfuse_kernels::plane_sweep::blend::blend;
use viewfuse_kernels::plane_sweep::disparity::pick_disparity;
use viewfuse_kernels::plane_sweep::evidence::evidence;
use viewfuse_kernels::plane_sweep::front::{FrontBlock, plane_opacity};
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::path::{CostBlock, Line, joined_cost};
use viewfuse_kernels::plane_sweep::window::{WindowBlock, row_sums, window_cost};
use viewfuse_kernels::plane_sweep::{PLANES, Planes, census};

/// What elements hold before anything is written.
const NOTHING: Planes = [UNTOUCHED; PLANES];

/// Some hundred groups of planes, two for each pixel.
fn swept() -> Swept {
    let swept = Swept::new(4, 300);
    assert!(swept.frustum.group_count == 2 && swept.frustum.first_row == 1);
    swept
}

/// Pixels and groups, in the order of volumes.
fn elements(group_count: u32, count: usize) -> impl Iterator<Item = (u32, u32)> {
    (0..count as u32).map(move |element| (element / group_count, element % group_count))
}

fn group_count(volume: &CostBlock) -> usize {
    (volume.width * volume.height * volume.group_count) as usize
}

fn planes(seed: u64, swept: &Swept) -> (CostBlock, Vec<Planes>) {
    let volume = swept.volume();
    let costs = costs(&mut Numbers::new(seed), &volume);
    (volume, costs)
}

#[test]
fn compare_views_is_core_s() {
    let swept = swept();
    let Swept { frustum, views, pairs, texels, disparities } = &swept;
    let count = swept.band_len();
    let (mut grey, mut found) = (groups(&vec![NOTHING; views.len() * count]), groups(&vec![NOTHING; 4 * count]));
    let (words, texel_fours, maps) = (swept_views(views), fours(texels), twos(disparities));
    dispatch(*frustum, count as u32, |id, push| {
        viewfuse_shaders::compare_views(id, push, &words, pairs, &texel_fours, &maps, &mut grey, &mut found);
    });
    let (grey, found) = (planes_of(&grey), planes_of(&found));
    let first = frustum.first_row * frustum.camera.width;
    for (element, (pixel, group)) in elements(frustum.group_count, count).enumerate() {
        let expected = evidence(frustum, &views[..], pairs, &texels[..], &disparities[..], first + pixel, group);
        for (view, planes) in expected.grey[..views.len()].iter().enumerate() {
            assert_eq!(grey[view * count + element], *planes);
        }
        let evidence = [expected.difference, expected.weight, expected.dissent, expected.hull];
        assert_eq!(found[4 * element..][..4], evidence);
    }
    assert!(found.iter().any(|planes| planes.iter().any(|number| *number != found[0][0])));
}

#[test]
fn census_cost_is_core_s() {
    let swept = swept();
    let (grey, evidence) = band(&mut Numbers::new(2), &swept);
    let FrustumBlock { camera, group_count, first_row, .. } = swept.frustum;
    let count = swept.band_len();
    let above = 2 * (first_row * camera.width * group_count) as usize;
    let mut costs = vec![NOTHING; above + 2 * count];
    dispatch(swept.frustum, count as u32, |id, push| {
        viewfuse_shaders::census_cost(id, push, &swept.pairs, &grey, &evidence, &mut costs);
    });
    let cost =
        |(pixel, group)| census::census_cost(&swept.frustum, &swept.pairs, &grey[..], &evidence[..], pixel, group);
    let expected: Vec<Planes> = elements(group_count, count).flat_map(cost).collect();
    assert_eq!(costs[above..], expected);
    assert_eq!(costs[..above], vec![NOTHING; above]);
}

#[test]
fn windows_are_core_s() {
    let swept = swept();
    let block = WindowBlock { reach: [1, 2, 4], ..WindowBlock::new(&swept.frustum, 0.02) };
    let (volume, weighted) = planes(3, &swept);
    let weighted: Vec<Planes> = weighted.iter().flat_map(|cost| [*cost, cost.map(|cost| 2.0 * cost)]).collect();
    let count = group_count(&volume);
    let mut sums = vec![NOTHING; 6 * count];
    dispatch(block, count as u32, |id, push| viewfuse_shaders::row_sums(id, push, &weighted, &mut sums));
    let sum = |(pixel, group)| row_sums(&block, &weighted[..], pixel, group);
    let expected: Vec<Planes> = elements(block.group_count, count).flat_map(sum).flatten().collect();
    assert_eq!(sums, expected);

    let mut means = vec![NOTHING; count];
    dispatch(block, count as u32, |id, push| viewfuse_shaders::window_cost(id, push, &sums, &mut means));
    let mean = |(pixel, group)| window_cost(&block, &sums[..], pixel, group);
    assert_eq!(means, elements(block.group_count, count).map(mean).collect::<Vec<Planes>>());
}

#[test]
fn plane_opacity_is_core_s() {
    let swept = swept();
    let Swept { frustum, views, disparities, .. } = &swept;
    let count = group_count(&swept.volume());
    let (words, maps, mut found) = (swept_views(views), twos(disparities), groups(&vec![NOTHING; count]));
    dispatch(*frustum, count as u32, |id, push| {
        viewfuse_shaders::plane_opacity(id, push, &words, &maps, &mut found);
    });
    let opacity = |(pixel, group)| plane_opacity(frustum, &views[..], &disparities[..], pixel, group);
    let expected: Vec<Planes> = elements(frustum.group_count, count).map(opacity).collect();
    assert_eq!(planes_of(&found), expected);
    assert!(expected.as_flattened().iter().any(|opacity| *opacity > 0.5));
}

#[test]
fn front_cost_is_core_s() {
    let (volume, means) = planes(7, &swept());
    let CostBlock { width, height, group_count, .. } = volume;
    let block = FrontBlock { width, height, group_count, front_share: 0.1 };
    let opacities = opacities(&mut Numbers::new(8), &volume);
    let (given, costs, mut joined) = (groups(&opacities), groups(&means), groups(&vec![NOTHING; means.len()]));
    dispatch(block, width * height, |id, push| viewfuse_shaders::front_cost(id, push, &given, &costs, &mut joined));
    let mut expected = vec![NOTHING; means.len()];
    (0..width * height)
        .for_each(|pixel| bodies::front_cost(&block, &opacities[..], &means[..], &mut expected[..], pixel));
    assert_eq!(planes_of(&joined), expected);
}

#[test]
fn paths_are_core_s() {
    let (block, means) = planes(4, &swept());
    let count = group_count(&block);
    let (given, mut paths) = (groups(&means), groups(&vec![NOTHING; 4 * count]));
    dispatch(block, block.line_count(), |id, push| viewfuse_shaders::follow_paths(id, push, &given, &mut paths));
    let mut expected = Vec::new();
    for line in 0..block.line_count() {
        let (direction, number, step_count) = block.line(line);
        let mut state = Line::START;
        for step in 0..step_count {
            let pixel = block.pixel(direction, number, step);
            state.advance(&means[..], (pixel * block.group_count) as usize, block.group_count as usize);
            expected.extend((0..block.group_count as usize).map(|group| state.costs(group)));
        }
    }
    let paths = planes_of(&paths);
    assert_eq!(paths, expected);

    let mut costs = vec![NOTHING; count];
    dispatch(block, count as u32, |id, push| viewfuse_shaders::join_paths(id, push, &paths, &mut costs));
    let joined = |(pixel, group)| joined_cost(&block, &paths[..], pixel, group);
    assert_eq!(costs, elements(block.group_count, count).map(joined).collect::<Vec<Planes>>());
}

#[test]
fn pick_disparity_is_core_s() {
    let swept = swept();
    let (volume, costs) = planes(5, &swept);
    let mut frustum = swept.frustum;
    frustum.camera.first_texel = 3;
    let count = volume.width * volume.height;
    let mut picked = vec![[UNTOUCHED; 2]; 3 + count as usize];
    dispatch(frustum, count, |id, push| viewfuse_shaders::pick_disparity(id, push, &costs, &mut picked));
    let expected: Vec<[f32; 2]> = (0..count).map(|pixel| pick_disparity(&frustum, &costs, pixel)).collect();
    assert_eq!(picked[3..], expected);
    assert_eq!(picked[..3], [[UNTOUCHED; 2]; 3]);
}

#[test]
fn blend_planes_is_core_s() {
    let swept = swept();
    let (volume, costs) = planes(6, &swept);
    let (Swept { views, texels, disparities, .. }, block) = swept.halved(&volume);
    let count = block.target.width * block.target.height;
    let expected: Vec<([f32; 4], f32, f32)> = (0..count)
        .map(|pixel| {
            let at = [pixel % block.target.width, pixel / block.target.width].map(|side| side as f32 + 0.5);
            let seen = blend(&block, &views[..], &texels[..], &disparities[..], &costs[..], at);
            (seen.colour, seen.depth, seen.confidence)
        })
        .collect();
    assert!(expected.iter().any(|(_, _, confidence)| *confidence > 0.0));
    let (words, texel_fours, maps, cost_groups) =
        (swept_views(&views), fours(&texels), twos(&disparities), groups(&costs));
    for shift in [0, page_shift(texels.len())] {
        let mut colours = fours(&vec![[UNTOUCHED; 4]; count as usize]);
        let (mut depths, mut confidences) = (vec![UNTOUCHED; count as usize], vec![UNTOUCHED; count as usize]);
        dispatch(block, count, |id, push| {
            let [ta, tb, tc, td] = pages(&texel_fours, shift);
            let [ca, cb, cc, cd] = pages_mut(&mut colours, shift);
            viewfuse_shaders::blend_planes(
                id,
                push,
                &words,
                ta,
                tb,
                tc,
                td,
                &maps,
                &cost_groups,
                ca,
                cb,
                cc,
                cd,
                &mut depths,
                &mut confidences,
                shift,
            );
        });
        let seen: Vec<([f32; 4], f32, f32)> =
            arrays(&colours).into_iter().zip(depths).zip(confidences).map(|((colour, d), c)| (colour, d, c)).collect();
        assert_eq!(seen, expected);
    }
}
