//! From volumes to a feature image at the ends: what lies outside, and densities that are none.

use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::genvs::{FeatureBlock, VolumeBlock, VolumePlace, volume_value, weigh_features};

/// At the origin, looks along z; an image of 8x8 pixels and a focal length of 8.
fn camera() -> CameraBlock {
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let pose = Pose::from_opencv(&identity).expect("the identity is a pose");
    let pinhole = Pinhole::new([8.0; 2], [4.0; 2], 8, 8).expect("sound intrinsics");
    Camera { pose, pinhole }.block(0)
}

/// Rows, columns and depth nodes: differently many, so that exchanged ones show.
const BLOCK: VolumeBlock =
    VolumeBlock { view: 0, point_count: 1, feature_count: 2, height: 4, width: 5, depth_count: 6, near: 1.0, far: 4.0 };

/// The point at a column, row and depth node of [`BLOCK`] as [`camera`] sees them, whole numbers at nodes.
fn point_at(column: f64, row: f64, node: f64) -> RayPoint {
    let depth = 4.0 - 3.0 * (node + 0.5) / 6.0;
    let x = ((column + 0.5) * 8.0 / 5.0 - 4.0) / 8.0 * depth;
    let y = ((row + 0.5) * 8.0 / 4.0 - 4.0) / 8.0 * depth;
    RayPoint { position: [x, y, depth].map(|coordinate| coordinate as f32), ..RayPoint::default() }
}

fn looked_up(volume: &[f32], point: RayPoint) -> [f64; 2] {
    [0, 1].map(|feature| f64::from(volume_value(&[camera()], &[point], volume, &BLOCK, feature)))
}

#[test]
fn outside_there_is_nothing() {
    let volume = vec![1.0; 4 * 5 * 6 * 2];
    let outside = [[-1.001, 1.0, 1.0], [5.001, 1.0, 1.0], [1.0, -1.001, 1.0], [1.0, 4.001, 1.0], [1.0, 1.0, -1.001]];
    let outside = outside.into_iter().chain([[1.0, 1.0, 6.001], [1.0e5, 1.0, 1.0], [1.0, 1.0, -1.0e6]]);
    for [x, y, z] in outside {
        assert_eq!(looked_up(&volume, point_at(x, y, z)), [0.0; 2], "{x} {y} {z}");
    }
    let positions = [
        [0.0, 0.0, -2.0],
        [0.0; 3],
        [f32::NAN, 0.0, 2.0],
        [0.0, f32::NAN, 2.0],
        [0.0, 0.0, f32::NAN],
        [f32::INFINITY, 0.0, 2.0],
        [0.0, 0.0, f32::INFINITY],
        [f32::MAX, f32::MAX, 2.0],
        [0.0, 0.0, 1.0e-25],
    ];
    for position in positions {
        let point = RayPoint { position, ..RayPoint::default() };
        assert_eq!(looked_up(&volume, point), [0.0; 2], "{position:?}");
        assert!(VolumePlace::of(&camera(), &point, &BLOCK).is_outside());
    }
}

fn features(sample_count: u32, inclusive: u32, last_length: f32) -> FeatureBlock {
    FeatureBlock { sample_count, feature_count: 1, length_scale: 0.5, last_length, inclusive, first_ray: 0 }
}

/// Weights of a ray with these densities and lengths; the second ray of two.
fn weights(densities: &[f32], lengths: &[f32], block: &FeatureBlock) -> Vec<f32> {
    let count = densities.len();
    let mut raw = vec![1.0; 2 * count];
    raw.extend(densities.iter().flat_map(|density| [*density, f32::NAN]));
    let mut points = vec![RayPoint { length: 1.0, ..RayPoint::default() }; count];
    points.extend(lengths.iter().map(|length| RayPoint { length: *length, ..RayPoint::default() }));
    let mut weights = Vec::new();
    weigh_features(&raw[..], &points[..], block, 1, |sample, weight| {
        assert_eq!(sample, count + weights.len());
        weights.push(weight);
    });
    assert_eq!(weights.len(), count);
    weights
}

#[test]
fn densities_at_their_ends() {
    let lengths = [1.0, 1.0, 1.0];
    let both =
        |densities: [f32; 3]| [0, 1].map(|inclusive| weights(&densities, &lengths, &features(3, inclusive, 1.0e10)));
    // Infinity is opaque, and what shades itself is then not seen at all.
    assert_eq!(both([0.0, f32::INFINITY, 1.0]), [vec![0.0, 1.0, 0.0], vec![0.0; 3]]);
    let short = weights(&[f32::INFINITY, 1.0, 1.0], &[0.0, 1.0, 1.0], &features(3, 0, 1.0e10));
    assert!(short.iter().all(|weight| weight.is_nan()), "{short:?}");
    // The last length makes anything opaque, nothing remains nothing.
    assert_eq!(both([0.0, 0.0, 1.0e-3]), [vec![0.0, 0.0, 1.0], vec![0.0; 3]]);
    // What is no number is not hidden.
    let hidden = both([0.0, f32::NAN, 1.0]);
    assert!(hidden.iter().all(|weights| weights[0] == 0.0 && weights[1].is_nan() && weights[2].is_nan()), "{hidden:?}");
    for nothing in [0.0, -1.0, f32::NEG_INFINITY] {
        assert_eq!(both([nothing; 3]), [vec![0.0; 3], vec![0.0; 3]], "{nothing}");
    }
    let [exclusive, inclusive] = both([2.0 * std::f32::consts::LN_2, 0.0, 1.0]);
    let near = |actual: &[f32], expected: [f32; 3]| {
        let is_near = |(actual, expected): (&f32, f32)| (actual - expected).abs() <= 1.0e-7;
        assert!(actual.iter().zip(expected).all(is_near), "{actual:?}");
    };
    near(&exclusive, [0.5, 0.0, 0.5]);
    near(&inclusive, [0.25, 0.0, 0.0]);
}
