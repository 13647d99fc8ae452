//! The plane sweep as a whole and its parts: what must hold whatever the numbers are.

use viewfuse::check::swept::{Swept, costs};
use viewfuse::check::world::Numbers;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pose::Pose;
use viewfuse_kernels::plane_sweep::blend::{BlendBlock, Blended, blend};
use viewfuse_kernels::plane_sweep::disparity::{NEAR_PLANES, pick_disparity};
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::path::CostBlock;
use viewfuse_kernels::plane_sweep::window::WindowBlock;
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

const WIDTH: u32 = 40;
const HEIGHT: u32 = 30;

/// A camera that looks ahead from a place in the plane of all of them; a unit to the side is 32 pixels at disparity 1.
fn ahead(centre: [f32; 2], first_texel: u32) -> CameraBlock {
    let mut pose = Pose::IDENTITY.block();
    (pose.right[3], pose.down[3]) = (centre[0], centre[1]);
    CameraBlock { pose, intrinsics: [32.0, 32.0, 20.0, 15.0], width: WIDTH, height: HEIGHT, first_texel, padding: 0 }
}

/// Four cameras around the frustum's, each a unit away, which see a random pattern on one plane: every plane is a pixel
/// further.
fn facing(plane: u32) -> Swept {
    let offsets = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0_f32]];
    let mut swept = Swept::new(2, 10);
    let numbers = &mut Numbers::new(1);
    let (columns, rows) = (WIDTH + 2 * PLANES as u32, HEIGHT + 2 * PLANES as u32);
    let mut draw = || [0; 3].map(|_| numbers.between(0.0, 1.0));
    let pattern: Vec<[f32; 3]> = (0..columns * rows).map(|_| draw()).collect();
    swept.texels.clear();
    swept.views.clear();
    for centre in offsets {
        let camera = ahead(centre, swept.texels.len() as u32);
        swept.views.push(SweptView { camera, gain: [1.0; 4], weight: 0.25, ..SweptView::default() });
        for pixel in 0..WIDTH * HEIGHT {
            let shown = |at: u32, offset: f32| (at + PLANES as u32).wrapping_add_signed(offset as i32 * plane as i32);
            let [red, green, blue] =
                pattern[(shown(pixel / WIDTH, centre[1]) * columns + shown(pixel % WIDTH, centre[0])) as usize];
            swept.texels.push([red, green, blue, 1.0]);
        }
    }
    swept.pairs = (0..4)
        .flat_map(|b| (0..b).map(move |a| ViewPair { first: a, second: b, weight: 1.0 / 6.0, padding: 0 }))
        .collect();
    swept.frustum = FrustumBlock {
        camera: ahead([0.0; 2], 0),
        far_disparity: 0.0,
        disparity_step: 1.0 / 32.0,
        group_count: 1,
        view_count: 4,
        pair_count: 6,
        has_silhouettes: 0,
        dissent_share: 0.0,
        first_row: 0,
        row_count: HEIGHT,
    };
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

/// The least cost is at the plane, before any window 0 but for its weight, and a picture shows the pattern.
#[test]
fn a_plane_that_faces_the_cameras_is_found() {
    for plane in [3, 7] {
        let swept = facing(plane);
        let (weighted, joined) = swept_costs(&swept);
        let (frustum, number) = (&swept.frustum, plane as usize);
        for pixel in 0..WIDTH * HEIGHT {
            let (column, row) = (pixel % WIDTH, pixel / WIDTH);
            let sees_all = |at: u32, side: u32| at >= plane && at + plane < side;
            if !(sees_all(column, WIDTH) && sees_all(row, HEIGHT)) {
                continue;
            }
            let [cost, weight] = [0, 1].map(|part| weighted[2 * pixel as usize + part][number]);
            assert!(cost == 0.0 && weight > 0.5, "({column}, {row}): {cost} of weight {weight}");
            let [disparity, confidence] = pick_disparity(frustum, &joined, pixel);
            let planes = disparity / frustum.disparity_step;
            assert!((planes - plane as f32).abs() < 0.05, "({column}, {row}): plane {planes}, not {plane}");
            assert!(confidence > 0.9, "({column}, {row}): confidence {confidence}");
        }
        let (swept, block) = swept.clone().halved(&swept.volume());
        let pixels = blended(&swept, &block, &joined);
        // The first camera stands a unit to the right: what it shows is further to the left.
        let (row, column) = (15, 20);
        let shown = swept.texels[(row * WIDTH + column - plane) as usize];
        let pixel = &pixels[(row * WIDTH + column) as usize];
        for (found, shown) in pixel.colour.into_iter().zip(shown) {
            assert!((found - shown).abs() < 0.02, "{:?} has {found}, not {shown}", pixel.colour);
        }
        assert!((pixel.depth - 32.0 / plane as f32).abs() < 0.1, "depth {}", pixel.depth);
    }
}

fn joined(volume: &CostBlock, means: &[Planes]) -> Vec<Planes> {
    let mut paths = vec![[0.0; PLANES]; 4 * means.len()];
    let mut joined = vec![[0.0; PLANES]; means.len()];
    Cpu.follow_paths(volume, &means.to_vec(), &mut paths).expect("a CPU");
    Cpu.join_paths(volume, &paths, &mut joined).expect("a CPU");
    joined
}

#[test]
fn equal_costs_stay_on_paths() {
    let volume = CostBlock { width: 300, height: 5, group_count: 2, padding: 0 };
    let means = vec![[0.17; PLANES]; 300 * 5 * 2];
    assert_eq!(joined(&volume, &means), means);
}

/// What a line has met does not add up: a cost grows by no more than that of a jump.
#[test]
fn costs_do_not_grow_along_paths() {
    let volume = CostBlock { width: 500, height: 3, group_count: 2, padding: 0 };
    let means = costs(&mut Numbers::new(1), &volume);
    for (own, joined) in means.as_flattened().iter().zip(joined(&volume, &means).as_flattened()) {
        assert!(*joined >= own - 1.0e-5 && *joined <= own + 0.030_01, "{own} became {joined}");
    }
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
        for has_silhouettes in [0, 1] {
            let mut swept = facing(4);
            swept.frustum.has_silhouettes = has_silhouettes;
            for view in &mut swept.views {
                (view.disparity_step, view.map_width, view.map_height) = (0.02, WIDTH, HEIGHT);
            }
            swept.disparities = vec![[0.0, 1.0]; (WIDTH * HEIGHT) as usize];
            change(&mut swept);
            let (weighted, joined) = swept_costs(&swept);
            assert_finite(&weighted);
            assert_finite(&joined);
            for pixel in 0..WIDTH * HEIGHT {
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
    let swept = facing(4);
    let costs = vec![[0.05; PLANES]; (WIDTH * HEIGHT) as usize];
    let [disparity, confidence] = pick_disparity(&swept.frustum, &costs, 77);
    assert_eq!(disparity, 0.0);
    assert!((confidence - (1 + NEAR_PLANES) as f32 / PLANES as f32).abs() < 0.02, "confidence {confidence}");
}
