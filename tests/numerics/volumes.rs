//! From volumes to a feature image at the ends: nodes, borders and what lies outside; densities of all sizes.

use viewfuse::check::poses::Random;
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

fn volume() -> Vec<f32> {
    let mut random = Random::new(71);
    (0..4 * 5 * 6 * 2).map(|_| random.normal() as f32).collect()
}

fn node(volume: &[f32], column: usize, row: usize, depth: usize, feature: usize) -> f64 {
    f64::from(volume[((row * 5 + column) * 6 + depth) * 2 + feature])
}

fn looked_up(volume: &[f32], point: RayPoint) -> [f64; 2] {
    [0, 1].map(|feature| f64::from(volume_value(&[camera()], &[point], volume, &BLOCK, feature)))
}

#[test]
fn nodes_have_their_values_and_half_of_them_at_the_border() {
    let volume = volume();
    for (column, row, depth) in [(0, 0, 0), (4, 3, 5), (2, 1, 3), (4, 0, 2), (0, 3, 5)] {
        let at = |x: f64, y: f64, z: f64| looked_up(&volume, point_at(x, y, z))[1];
        let (x, y, z) = (column as f64, row as f64, depth as f64);
        let own = node(&volume, column, row, depth, 1);
        assert!((at(x, y, z) - own).abs() <= 1.0e-5);
        let (beside, above) = (if column == 0 { -0.5 } else { 4.5 }, if row == 0 { -0.5 } else { 3.5 });
        if column == 0 || column == 4 {
            assert!((at(beside, y, z) - own / 2.0).abs() <= 1.0e-5);
        }
        if row == 0 || row == 3 {
            assert!((at(x, above, z) - own / 2.0).abs() <= 1.0e-5);
        }
    }
    // Node 0 is the farthest.
    let far = RayPoint { position: [0.0, 0.0, 3.75], ..point_at(2.0, 1.5, 0.0) };
    let expected = (node(&volume, 2, 1, 0, 0) + node(&volume, 2, 2, 0, 0)) / 2.0;
    assert!((looked_up(&volume, far)[0] - expected).abs() <= 1.0e-5);
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
fn weights_telescope() {
    let mut random = Random::new(73);
    for case in 0..2000 {
        let count = 1 + random.below(16);
        let depth = random.log_range(1.0e-6, 1.0e6);
        let lengths: Vec<f32> = (0..count).map(|_| random.log_range(1.0e-3, 1.0) as f32).collect();
        let mut density = |index: usize| (depth * random.unit() / f64::from(lengths[index])) as f32;
        let densities: Vec<f32> = (0..count).map(&mut density).collect();
        let last_length = [1.0e10, 0.25][case % 2];
        let own = |index: usize| {
            let is_last = index + 1 == count;
            let length = if is_last { f64::from(last_length) } else { 0.5 * f64::from(lengths[index]) };
            f64::from(densities[index]) * length
        };
        let [exclusive, inclusive] =
            [0, 1].map(|inclusive| weights(&densities, &lengths, &features(count as u32, inclusive, last_length)));
        let mut passed = 0.0_f64;
        for index in 0..count {
            let stopped = (-passed).exp() * -(-own(index)).exp_m1();
            passed += own(index);
            // Each transmittance is rounded at 1, and as often as optical depths were added.
            let tolerance = (3.0 + count as f64) / 16_777_216.0;
            let off = f64::from(exclusive[index]) - stopped;
            assert!(off.abs() <= tolerance, "{densities:?} {index}: {off}");
            let off = f64::from(inclusive[index]) - stopped * (-own(index)).exp();
            assert!(off.abs() <= tolerance, "{densities:?} {index}: {off}");
        }
        // Neighbouring transmittances cancel.
        let sum: f64 = exclusive.iter().map(|weight| f64::from(*weight)).sum();
        let off = sum + (-passed).exp_m1();
        assert!(off.abs() <= (3.0 + count as f64) / 16_777_216.0, "{densities:?}: {off}");
    }
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
        assert!(
            actual.iter().zip(expected).all(|(actual, expected)| (actual - expected).abs() <= 1.0e-7),
            "{actual:?}"
        );
    };
    near(&exclusive, [0.5, 0.0, 0.5]);
    near(&inclusive, [0.25, 0.0, 0.0]);
}
