//! PixelNeRF's arithmetic around its network against `f64`: features of points, weights of the views that see them,
//! latents where they appear, radiance.

use viewfuse::check::poses::{Random, looking_at_origin, ring};
use viewfuse::check::ray_inputs;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::lookup::bilinear;
use viewfuse_core::pose::Pose;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::pixelnerf::{
    EmbedBlock, GatherBlock, GridPlace, embedded_value, gathered_value, radiance, visible_weight,
};

fn camera(pose: Pose, width: u32, height: u32) -> CameraBlock {
    let middle = [width as f32 / 2.0, height as f32 / 2.0];
    let pinhole = Pinhole::new([width as f32, width as f32], middle, width, height).expect("sound intrinsics");
    Camera { pose, pinhole }.block(0)
}

fn point_at(position: Vec3) -> RayPoint {
    RayPoint { position: position.to_array(), direction: [0.6, 0.0, -0.8], ..RayPoint::default() }
}

#[test]
fn features_are_sines_of_rotated_points() {
    let mut random = Random::new(51);
    let block = EmbedBlock { point_count: 1, frequency_count: 6, frequency: 1.5 };
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..20_000 {
        let pose = random.pose(1.0);
        let position = Vec3::from_array([0, 1, 2].map(|_| random.range(-1.08, 1.08) as f32));
        let (views, points) = ([camera(pose, 8, 8)], [point_at(position)]);
        let value = |feature| f64::from(embedded_value(&views, &points, &block, feature));
        let rotated = |vector: [f32; 3]| {
            let along = |axis: Vec3| (0..3).map(|i| f64::from(axis[i]) * f64::from(vector[i])).sum::<f64>();
            [along(pose.right_world()), -along(pose.down_world()), -along(pose.forward_world())]
        };
        for axis in 0..3 {
            let coordinate = rotated(points[0].position)[axis];
            assert!((value(axis) - coordinate).abs() <= 4.0e-7);
            assert!((value(39 + axis) - rotated(points[0].direction)[axis]).abs() <= 4.0e-7);
            for octave in 0..6 {
                let angle = coordinate * 1.5 * f64::from(1 << octave);
                largest = largest.max(angle.abs());
                let first = 3 + 6 * octave + axis;
                let errors = [(value(first) - angle.sin()).abs(), (value(first + 3) - angle.cos()).abs()];
                worst = worst.max(errors[0]).max(errors[1]);
                // Three roundings of sums of at most 1.9, times the frequency; the angle's own; the sine's.
                let bound = 1.5 * f64::from(1 << octave) * 4.0e-7 + angle.abs() / 16_777_216.0 + 9.0e-8;
                assert!(errors[0] <= bound && errors[1] <= bound, "{angle}: {errors:?}");
            }
        }
    }
    println!("features: angles up to {largest:.1} rad, errors up to {worst:.2e}");
    assert!(largest > 80.0 && worst < 1.5e-5, "{largest} {worst}");
}

#[test]
fn rows_are_views_of_points() {
    let mut random = Random::new(52);
    let block = EmbedBlock { point_count: 3, frequency_count: 2, frequency: 1.5 };
    assert_eq!(block.row_len(), 18);
    let views = [0, 1].map(|_| camera(random.pose(1.0), 8, 8));
    let points = [0, 1, 2].map(|_| point_at(Vec3::new(random.normal() as f32, 0.3, random.normal() as f32)));
    let alone = EmbedBlock { point_count: 1, ..block };
    for element in 0..2 * 3 * 18 {
        let (row, feature) = (element / 18, element % 18);
        let expected = embedded_value(&[views[row / 3]], &[points[row % 3]], &alone, feature);
        assert_eq!(embedded_value(&views, &points, &block, element), expected);
    }
}

#[test]
fn visible_weights_sum_to_1() {
    let mut random = Random::new(53);
    let (mut some, mut whole) = (0, 0);
    for _ in 0..5_000 {
        let count = 1 + random.below(32);
        let views: Vec<CameraBlock> = (0..count).map(|_| ray_inputs::camera(&mut random)).collect();
        let scores: Vec<f32> = (0..count).map(|_| random.range(0.1, 1.0) as f32).collect();
        let sum: f32 = scores.iter().sum();
        let weights: Vec<f32> = scores.iter().map(|score| score / sum).collect();
        let point = ray_inputs::point(&mut random, &views);
        let visible: Vec<f32> = (0..count as u32)
            .map(|view| visible_weight(&views[..], &weights[..], count as u32, &point, view))
            .collect();
        let sees = |view: &CameraBlock| view.project(Vec3::from_array(point.position)).in_front;
        let seeing = views.iter().filter(|view| sees(view)).count();
        if seeing == 0 || seeing == count {
            assert_eq!(visible, weights, "nobody or everybody sees it");
            whole += 1;
            continue;
        }
        some += 1;
        let total: f64 = visible.iter().map(|weight| f64::from(*weight)).sum();
        assert!((total - 1.0).abs() <= 34.0 / 16_777_216.0, "{total}");
        let first = views.iter().position(sees).expect("one that sees it");
        for (view, (visible_weight, weight)) in views.iter().zip(visible.iter().zip(&weights)) {
            if sees(view) {
                // Their ratios stay.
                let crossed = [visible_weight * weights[first], visible[first] * weight].map(f64::from);
                assert!((crossed[0] - crossed[1]).abs() <= 4.0e-7 * crossed[0]);
            } else {
                assert_eq!(*visible_weight, 0.0);
            }
        }
    }
    assert!(some > 1_000 && whole > 100, "{some} {whole}");
}

#[test]
fn weights_of_views_that_count_for_nothing() {
    // The only view that sees the point has no weight.
    let views =
        [camera(looking_at_origin([2.0, 0.0, 0.0], 0.0), 8, 8), camera(looking_at_origin([-2.0, 0.0, 0.0], 0.0), 8, 8)];
    let behind_the_second = point_at(Vec3::new(-3.0, 0.0, 0.0));
    for (weights, expected) in [([0.0, 1.0], [0.0, 1.0]), ([0.25, 0.75], [1.0, 0.0])] {
        assert_eq!([0, 1].map(|view| visible_weight(&views, &weights, 2, &behind_the_second, view)), expected);
    }
}

#[test]
fn gathering_is_a_look_up_where_the_point_appears() {
    let mut random = Random::new(54);
    let block = GatherBlock { point_count: 1, channel_count: 3, height: 5, width: 4, ..GatherBlock::default() };
    let nodes: Vec<[f32; 3]> = (0..20).map(|_| [0; 3].map(|_| random.normal() as f32)).collect();
    let grid = nodes.as_flattened();
    for (index, pose) in ring(40, 2.5, 0.7, 0.2).into_iter().enumerate() {
        // Half the columns and half the rows of the image.
        let views = [camera(pose, 8, 10)];
        let pixel_centre = [0.5, 0.0][index % 2];
        let block = GatherBlock { pixel_centre, ..block };
        for _ in 0..200 {
            let point = ray_inputs::point(&mut random, &views);
            let seen = views[0].project(Vec3::from_array(point.position));
            let (x, y) = ((seen.x - pixel_centre) * 0.5 + 0.5, (seen.y - pixel_centre) * 0.5 + 0.5);
            let expected = if seen.in_front { bilinear(&nodes[..], 4, 5, x, y) } else { nodes[0] };
            for (channel, expected) in expected.into_iter().enumerate() {
                assert_eq!(gathered_value(&views, &[point], grid, &[0.0; 0], &block, channel), expected);
            }
        }
        let added = GatherBlock { has_residual: 1, ..block };
        let point = ray_inputs::point(&mut random, &views);
        let plain = gathered_value(&views, &[point], grid, &[0.0; 0], &block, 2);
        assert_eq!(gathered_value(&views, &[point], grid, &[0.0, 0.0, 3.0], &added, 2), 3.0 + plain);
    }
}

#[test]
fn nodes_lie_over_their_columns_and_borders_continue() {
    let view = camera(looking_at_origin([0.0, -2.0, 0.0], 0.0), 8, 8);
    let nodes: Vec<f32> = (0..16).map(|node| node as f32).collect();
    let block = GatherBlock { point_count: 1, channel_count: 1, height: 4, width: 4, ..GatherBlock::default() };
    let value = |x: f32, y: f32| {
        let point = point_at(view.centre_world() + view.towards(x, y) * 2.0);
        GridPlace::of(&view, &point, &block).value(&nodes[..], 0)
    };
    // Node i over image column 2 i, as published.
    for row in 0..4 {
        for column in 0..4 {
            let expected = nodes[row * 4 + column];
            assert!((value(2.0 * column as f32, 2.0 * row as f32) - expected).abs() <= 1.0e-4);
        }
    }
    for far in [7.0, 8.0, 100.0, 1.0e6] {
        assert!((value(far, 4.0) - nodes[11]).abs() <= 1.0e-4, "right of the last node");
        assert!((value(-far, 4.0) - nodes[8]).abs() <= 1.0e-4, "left of the image");
        assert!((value(4.0, far) - nodes[14]).abs() <= 1.0e-4, "below the last node");
        assert!((value(4.0, -far) - nodes[2]).abs() <= 1.0e-4, "above the image");
    }
    for nowhere in [view.centre_world(), Vec3::new(0.0, -3.0, 0.0), Vec3::splat(f32::NAN)] {
        let place = GridPlace::of(&view, &point_at(nowhere), &block);
        assert_eq!(place.value(&nodes[..], 0), nodes[0], "{nowhere}");
    }
}

#[test]
fn radiance_is_logistic_and_rectified() {
    let mut random = Random::new(55);
    for _ in 0..20_000 {
        let raw = [0; 4].map(|_| (20.0 * random.normal()) as f32);
        let point = RayPoint { length: random.log_range(1.0e-4, 1.0) as f32, ..RayPoint::default() };
        let actual = radiance(&raw, &point);
        for channel in 0..3 {
            let expected = 1.0 / (1.0 + (-f64::from(raw[channel])).exp());
            assert!((f64::from(actual[channel]) - expected).abs() <= 3.0e-7 * expected, "{raw:?}");
        }
        let expected = f64::from(raw[3]).max(0.0) * f64::from(point.length);
        assert!((f64::from(actual[3]) - expected).abs() <= expected / 16_777_216.0);
    }
}

#[test]
fn radiance_at_its_ends() {
    let point = RayPoint { length: 0.5, ..RayPoint::default() };
    let at = |value: f32| radiance(&[value; 4], &point);
    assert_eq!(at(0.0), [0.5, 0.5, 0.5, 0.0]);
    assert_eq!(at(1.0e30), [1.0, 1.0, 1.0, 5.0e29]);
    for low in [-1.0e30, f32::MIN, f32::NEG_INFINITY] {
        let [red, green, blue, optical_depth] = at(low);
        assert!(red == green && green == blue && (0.0..1.0e-37).contains(&red) && optical_depth == 0.0, "{low}");
    }
    // No colour is outside [0, 1], whatever the network says; and nothing is where it says nothing.
    assert_eq!(at(f32::INFINITY), [1.0, 1.0, 1.0, f32::INFINITY]);
    assert_eq!(at(f32::NAN), [1.0, 1.0, 1.0, 0.0]);
}
