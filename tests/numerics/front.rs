//! The choice front to back of degenerate input.

use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pose::Pose;
use viewfuse_kernels::bodies;
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_kernels::plane_sweep::front::{FrontBlock, plane_opacity};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};

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
    let mut costs = [[f32::NAN; PLANES]];
    bodies::front_cost(&block, &[[0.5; PLANES]][..], &[[0.0; PLANES]][..], &mut costs[..], 0);
    assert!(costs[0].iter().all(|cost| cost.is_finite()));
}
