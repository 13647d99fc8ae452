//! The plane sweep as a whole and its parts: what must hold whatever the numbers are.

use viewfuse::check::swept::{Swept, band, costs};
use viewfuse::check::world::Numbers;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::lookup::bilinear_from;
use viewfuse_core::pose::Pose;
use viewfuse_kernels::plane_sweep::blend::{BlendBlock, Blended, blend};
use viewfuse_kernels::plane_sweep::census::{GREY_STEPS, census_cost};
use viewfuse_kernels::plane_sweep::disparity::{NEAR_PLANES, pick_disparity};
use viewfuse_kernels::plane_sweep::evidence::{UNSEEN, ViewPair, evidence};
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

/// Their order changes that of sums only.
#[test]
fn the_order_of_views_does_not_matter() {
    for seed in 1..5 {
        let swept = Swept::new(seed, 60);
        let count = swept.views.len() as u32;
        let mut turned = swept.clone();
        turned.views.rotate_left(1);
        // The view of number n is now n - 1.
        let number = |view: u32| (view + count - 1) % count;
        for pair in &mut turned.pairs {
            (pair.first, pair.second) = (number(pair.second), number(pair.first));
        }
        turned.pairs.reverse();
        let found = |swept: &Swept, pixel| {
            let Swept { frustum, views, pairs, texels, disparities } = swept;
            evidence(frustum, &views[..], pairs, &texels[..], &disparities[..], pixel, 0)
        };
        let mut compared = 0;
        for pixel in 0..swept.frustum.camera.width * swept.frustum.camera.height {
            let (a, b) = (found(&swept, pixel), found(&turned, pixel));
            for view in 0..count {
                assert_eq!(a.grey[view as usize], b.grey[number(view) as usize]);
            }
            let parts = [[a.difference, b.difference], [a.weight, b.weight], [a.dissent, b.dissent], [a.hull, b.hull]];
            for [a, b] in parts {
                for (a, b) in a.into_iter().zip(b) {
                    assert!((a - b).abs() <= 1.0e-6, "{a} and {b}");
                    compared += usize::from(a > 0.0);
                }
            }
        }
        assert!(compared > 100);

        let volume = swept.volume();
        let costs = costs(&mut Numbers::new(seed), &volume);
        let [a, b] = [swept, turned].map(|swept| {
            let (swept, block) = swept.halved(&volume);
            blended(&swept, &block, &costs)
        });
        for (a, b) in a.iter().zip(&b) {
            for (a, b) in numbers_of(a).into_iter().zip(numbers_of(b)) {
                assert!((a - b).abs() <= 1.0e-5 * a.abs().max(1.0), "{a} and {b}");
            }
        }
    }
}

/// The greys of a view in a small band: distinct for all pixels, each at least 0.05 from all others.
fn stairs(swept: &mut Swept) -> (Vec<Planes>, Vec<Planes>) {
    swept.frustum.camera.width = 4;
    swept.frustum.row_count = 4;
    swept.frustum.group_count = 1;
    let (mut grey, evidence) = band(&mut Numbers::new(3), swept);
    for (at, planes) in grey.iter_mut().enumerate() {
        *planes = [0.05 * ((at % 16 * 7 + at / 16 * 3) % 16) as f32; PLANES];
    }
    (grey, evidence)
}

#[test]
fn census_does_not_mind_exposure() {
    let mut swept = Swept::new(2, 60);
    let (grey, evidence) = stairs(&mut swept);
    let cost = |grey: &[Planes]| -> Vec<[Planes; 2]> {
        (0..16).map(|pixel| census_cost(&swept.frustum, &swept.pairs, grey, &evidence[..], pixel, 0)).collect()
    };
    let before = cost(&grey);
    let with = |change: fn(f32) -> f32| {
        let mut changed = grey.clone();
        changed[16..32].iter_mut().flatten().for_each(|grey| *grey = change(*grey));
        cost(&changed)
    };
    // Every difference is saturated, and stays so.
    assert_eq!(with(|grey| 1.2 * grey + 0.05), before);
    // And the other way about: the census sees what is lighter.
    assert_ne!(with(|grey| 0.75 - grey), before);
    // What is not saturated stays the same with an offset alone, of whole steps.
    let small: Vec<Planes> =
        grey.iter().map(|planes| planes.map(|grey| (grey / 0.05).round() * 10.0 / GREY_STEPS)).collect();
    let mut offset = small.clone();
    offset[16..32].iter_mut().flatten().for_each(|grey| *grey += 300.0 / GREY_STEPS);
    assert_eq!(cost(&offset), cost(&small));
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

#[test]
fn a_single_outlier_is_smoothed() {
    let volume = CostBlock { width: 9, height: 7, group_count: 2, padding: 0 };
    let mut means = vec![[0.2; PLANES]; 9 * 7 * 2];
    means.iter_mut().step_by(2).for_each(|planes| planes[6] = 0.1);
    let middle = 2 * (3 * 9 + 4);
    means[middle][6] = 0.115;
    means[middle + 1][9] = 0.1;
    let joined = joined(&volume, &means);
    let least = |pixel: usize, costs: &[Planes]| {
        let costs = costs[2 * pixel..][..2].as_flattened();
        (0..2 * PLANES).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
    };
    assert_eq!(least(middle / 2, &means), Some(PLANES + 9));
    for pixel in 0..9 * 7 {
        assert_eq!(least(pixel, &joined), Some(6), "pixel {pixel}");
    }
}

/// With one plane and one view a pixel is that view's, where the plane lies.
#[test]
fn one_plane_of_one_view_is_a_look_up() {
    let mut swept = facing(5);
    swept.views.truncate(1);
    swept.views[0].camera = ahead([0.4, -0.3], 0);
    let volume = swept.volume();
    let (swept, block) = swept.halved(&volume);
    let block = BlendBlock { view_count: 1, ..block };
    let plane = 5;
    let mut costs = vec![[1.0; PLANES]; (WIDTH * HEIGHT) as usize];
    costs.iter_mut().for_each(|costs| costs[plane] = 0.01);
    let shift = [0.4, -0.3].map(|offset| offset * plane as f32);
    for (pixel, seen) in blended(&swept, &block, &costs).iter().enumerate() {
        let (x, y) = (pixel as f32 % WIDTH as f32, (pixel / WIDTH as usize) as f32);
        let (x, y) = (x.floor() + 0.5 - shift[0], y + 0.5 - shift[1]);
        let expected: [f32; 4] = bilinear_from(&swept.texels[..], 0, WIDTH, HEIGHT, x, y);
        for (found, expected) in seen.colour.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1.0e-4, "{:?} has {found}, not {expected}", seen.colour);
        }
        assert!((seen.depth - 32.0 / plane as f32).abs() < 1.0e-4, "depth {}", seen.depth);
    }
}

#[test]
fn pixels_are_in_range() {
    for seed in 1..9 {
        let swept = Swept::new(seed, 200);
        let volume = swept.volume();
        let costs = costs(&mut Numbers::new(seed), &volume);
        let (swept, block) = swept.halved(&volume);
        for pixel in blended(&swept, &block, &costs) {
            let in_range = |value: f32| (0.0..=1.000_001).contains(&value);
            assert!(pixel.colour.into_iter().all(in_range) && in_range(pixel.confidence), "{pixel:?}");
            assert!(pixel.depth >= 0.0 && pixel.depth.is_finite(), "{pixel:?}");
        }
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

/// A view that does not see a pixel takes no part in its comparison.
#[test]
fn what_is_not_seen_is_not_compared() {
    let swept = facing(4);
    let Swept { frustum, views, pairs, texels, disparities } = &swept;
    let found = evidence(frustum, &views[..], pairs, &texels[..], &disparities[..], 0, 0);
    let last = PLANES - 1;
    // The corner lies beyond the images of the cameras to the right and below on every plane but the first.
    assert_eq!([0, 1, 2, 3].map(|view| found.grey[view][last] == UNSEEN), [true, false, true, false]);
    assert!((found.weight[last] - 1.0 / 6.0).abs() < 1.0e-6, "weight {}", found.weight[last]);
    assert!((found.weight[0] - 1.0).abs() < 1.0e-6, "weight {}", found.weight[0]);
}
