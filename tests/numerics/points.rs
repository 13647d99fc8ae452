//! PixelNeRF's arithmetic around its network at the ends: weights of views that count for nothing, latents at and
//! beyond the borders of an image, radiance.

use viewfuse::check::poses::looking_at_origin;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::pixelnerf::{GatherBlock, GridPlace, radiance, visible_weight};

fn camera(pose: Pose, width: u32, height: u32) -> CameraBlock {
    let middle = [width as f32 / 2.0, height as f32 / 2.0];
    let pinhole = Pinhole::new([width as f32, width as f32], middle, width, height).expect("sound intrinsics");
    Camera { pose, pinhole }.block(0)
}

fn point_at(position: Vec3) -> RayPoint {
    RayPoint { position: position.to_array(), direction: [0.6, 0.0, -0.8], ..RayPoint::default() }
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
