//! The plane sweep where nothing can be found: numbers are finite, and of equal costs the farthest plane is taken.

use viewfuse::check::swept::Swept;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_kernels::plane_sweep::blend::{BlendBlock, Blended, blend};
use viewfuse_kernels::plane_sweep::disparity::{NEAR_PLANES, pick_disparity};
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// A frustum of one group of planes down to an infinite distance, all rows of it: of photographs, or of silhouettes.
fn frustum(has_silhouettes: bool) -> Swept {
    let mut swept = Swept::new(if has_silhouettes { 3 } else { 0 }, 1200);
    let height = swept.frustum.camera.height;
    swept.frustum = FrustumBlock { far_disparity: 0.0, first_row: 0, row_count: height, ..swept.frustum };
    swept
}

/// The costs of a frustum, before its windows and after its paths.
fn swept_costs(swept: &Swept) -> (Vec<Planes>, Vec<Planes>) {
    let Swept { frustum, views, pairs, texels, disparities } = swept;
    let (volume, count) = (swept.volume(), swept.band_len());
    let zeros = |parts: usize| vec![[0.0; PLANES]; parts * count];
    let (mut grey, mut found, mut weighted) = (zeros(views.len()), zeros(4), zeros(2));
    let (mut sums, mut means, mut paths, mut joined) = (zeros(6), zeros(1), zeros(4), zeros(1));
    let windows = WindowBlock::new(frustum, 0.02);
    let mut run = || {
        Cpu.compare_views(frustum, views, pairs, texels, disparities, &mut grey, &mut found)?;
        Cpu.census_cost(frustum, 0, frustum.row_count, pairs, &grey, &found, &mut weighted)?;
        Cpu.row_sums(&windows, &weighted, &mut sums)?;
        Cpu.window_cost(&windows, &sums, &mut means)?;
        Cpu.follow_paths(&volume, &means, &mut paths)?;
        Cpu.join_paths(&volume, &paths, &mut joined)
    };
    run().expect("a CPU");
    (weighted, joined)
}

fn numbers_of(pixel: &Blended) -> [f32; 6] {
    let [red, green, blue, opacity] = pixel.colour;
    [red, green, blue, opacity, pixel.depth, pixel.confidence]
}

fn blended(swept: &Swept, block: &BlendBlock, costs: &[Planes]) -> Vec<Blended> {
    (0..block.target.width * block.target.height)
        .map(|pixel| {
            let at = [pixel % block.target.width, pixel / block.target.width].map(|side| side as f32 + 0.5);
            blend(block, &swept.views[..], &swept.texels[..], &swept.disparities[..], costs, at)
        })
        .collect()
}

fn assert_finite(values: &[Planes]) {
    assert!(values.as_flattened().iter().all(|value| value.is_finite() && value.abs() < 10.0));
}

/// Frusta in which nothing can be found: every number is finite all the same.
#[test]
fn degenerate_frusta_give_finite_numbers() {
    let behind = |swept: &mut Swept| {
        for view in &mut swept.views {
            // Turned about the vertical axis.
            view.camera.pose.right[0] = -1.0;
            view.camera.pose.forward[2] = -1.0;
        }
    };
    let lonely = |swept: &mut Swept| {
        swept.views.truncate(1);
        swept.pairs.clear();
        (swept.frustum.view_count, swept.frustum.pair_count) = (1, 0);
    };
    let transparent = |swept: &mut Swept| swept.texels.fill([0.0; 4]);
    let worthless = |swept: &mut Swept| {
        swept.views.iter_mut().for_each(|view| view.weight = 0.0);
        swept.pairs.iter_mut().for_each(|pair| pair.weight = 0.0);
    };
    let infinite = |swept: &mut Swept| swept.frustum.disparity_step = 0.0;
    let in_one_place = |swept: &mut Swept| {
        let camera = swept.frustum.camera;
        swept.views.iter_mut().for_each(|view| view.camera.pose = camera.pose);
    };
    let changes: [fn(&mut Swept); 6] = [behind, lonely, transparent, worthless, infinite, in_one_place];
    for (number, change) in changes.into_iter().enumerate() {
        for has_silhouettes in [false, true] {
            let mut swept = frustum(has_silhouettes);
            change(&mut swept);
            let (weighted, joined) = swept_costs(&swept);
            assert_finite(&weighted);
            assert_finite(&joined);
            for pixel in 0..joined.len() as u32 {
                let [disparity, confidence] = pick_disparity(&swept.frustum, &joined, pixel);
                assert!(disparity.is_finite() && disparity >= 0.0 && (0.0..=1.0).contains(&confidence), "{number}");
            }
            let volume = swept.volume();
            let (swept, block) = swept.halved(&volume);
            for pixel in blended(&swept, &block, &joined) {
                assert!(numbers_of(&pixel).into_iter().all(f32::is_finite), "change {number}: {pixel:?}");
                assert!((0.0..=1.0).contains(&pixel.confidence), "change {number}: {pixel:?}");
            }
        }
    }
}

/// Of equal costs the farthest plane is taken, and it is not sure.
#[test]
fn equal_costs_are_far_and_unsure() {
    let swept = frustum(false);
    let costs = vec![[0.05; PLANES]; swept.band_len()];
    let [disparity, confidence] = pick_disparity(&swept.frustum, &costs, 77);
    assert_eq!(disparity, 0.0);
    assert!((confidence - (1 + NEAR_PLANES) as f32 / PLANES as f32).abs() < 0.02, "confidence {confidence}");
}
