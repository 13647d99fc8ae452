//! The choice front to back: which of two surfaces a ray ends at, and degenerate input.

use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pose::Pose;
use viewfuse_kernels::bodies;
use viewfuse_kernels::plane_sweep::front::{FrontBlock, plane_opacity};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

const SIDE: u32 = 8;
const STEP: f32 = 1.0 / 32.0;

/// Views from the frustum's own place, each with one surface in its whole map: its plane, in planes of the frustum.
fn looking_at(surfaces: &[f32]) -> (FrustumBlock, Vec<SweptView>, Vec<[f32; 2]>) {
    let camera = CameraBlock {
        pose: Pose::IDENTITY.block(),
        intrinsics: [32.0, 32.0, 4.0, 4.0],
        width: SIDE,
        height: SIDE,
        first_texel: 0,
        padding: 0,
    };
    let texels = SIDE * SIDE;
    let view = |index: usize| SweptView {
        camera,
        weight: 1.0,
        disparity_step: STEP,
        first_disparity: index as u32 * texels,
        map_width: SIDE,
        map_height: SIDE,
        ..SweptView::default()
    };
    let frustum = FrustumBlock {
        camera,
        disparity_step: STEP,
        group_count: 1,
        view_count: surfaces.len() as u32,
        row_count: SIDE,
        ..FrustumBlock::default()
    };
    let maps = surfaces.iter().flat_map(|plane| vec![[plane * STEP, 1.0]; texels as usize]).collect();
    (frustum, (0..surfaces.len()).map(view).collect(), maps)
}

fn opacity(surfaces: &[f32]) -> Planes {
    let (frustum, views, maps) = looking_at(surfaces);
    plane_opacity(&frustum, &views[..], &maps[..], 27, 0)
}

/// The costs of a pixel's planes with the preference, `[group]`.
fn front_cost(block: &FrontBlock, opacities: &[Planes], costs: &[Planes], pixel: u32) -> Vec<Planes> {
    let mut joined = vec![[f32::NAN; PLANES]; costs.len()];
    bodies::front_cost(block, opacities, costs, &mut joined[..], pixel);
    joined.drain((pixel * block.group_count) as usize..).take(block.group_count as usize).collect()
}

/// The plane of least cost at a pixel of costs that are all equal.
fn chosen(block: &FrontBlock, opacities: &[Planes]) -> usize {
    let equal = vec![[0.1; PLANES]; opacities.len()];
    let costs = front_cost(block, opacities, &equal[..], 27);
    let costs = costs.as_flattened();
    (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).expect("planes")
}

/// Five views see a floor, two a body before it: the floor has the greater support, and the body is chosen. Where no
/// view sees a body, the floor is.
#[test]
fn the_nearer_surface_wins() {
    let both = opacity(&[3.0, 3.0, 3.0, 3.0, 3.0, 11.0, 11.0]);
    assert!(both[3] > both[11] && both[11] > 0.35, "{both:?}");
    let block = FrontBlock { width: SIDE, height: SIDE, group_count: 1, front_share: 0.1 };
    let filled = |planes: Planes| vec![planes; (SIDE * SIDE) as usize];
    assert_eq!(chosen(&block, &filled(opacity(&[3.0; 5]))), 3);
    let hull = |plane: usize, opacity: f32| (0..PLANES).map(move |index| if index == plane { opacity } else { 0.0 });
    let two = |near: f32| -> Planes {
        let planes: Vec<f32> = hull(3, 0.9).zip(hull(11, near)).map(|(far, near)| far.max(near)).collect();
        planes.try_into().expect("planes")
    };
    assert_eq!(chosen(&block, &filled(two(0.75))), 11, "an opaque body before a more opaque floor");
    assert_eq!(chosen(&block, &filled(two(0.3))), 3, "what hides nothing before a floor");
}

/// Without depth between planes, in a single pixel, with maps of no confidence: finite, and transparent.
#[test]
fn degenerate_input_gives_finite_opacities() {
    let (mut frustum, views, mut maps) = looking_at(&[0.0, 5.0]);
    frustum.disparity_step = 0.0;
    let planes = plane_opacity(&frustum, &views[..], &maps[..], 0, 0);
    assert!(planes.iter().all(|opacity| (0.0..1.0).contains(opacity)), "{planes:?}");
    maps.iter_mut().for_each(|[_, confidence]| *confidence = 0.0);
    assert_eq!(plane_opacity(&frustum, &views[..], &maps[..], 0, 0), [0.0; PLANES]);
    let block = FrontBlock { width: 1, height: 1, group_count: 1, front_share: 0.1 };
    let costs = front_cost(&block, &[[0.5; PLANES]][..], &[[0.0; PLANES]][..], 0);
    assert!(costs[0].iter().all(|cost| cost.is_finite()));
}
