//! What networks' functions give at their ends.

use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::network::linear::rectified;
use viewfuse_kernels::network::resample::{PoolBlock, pooled_element};
use viewfuse_kernels::pixelnerf::radiance;

#[test]
fn rectification_at_its_ends() {
    for (x, expected) in
        [(2.0, 2.0), (-2.0, 0.0), (0.0, 0.0), (-0.0, 0.0), (f32::NEG_INFINITY, 0.0), (f32::INFINITY, f32::INFINITY)]
    {
        assert_eq!(rectified(x, 1), expected);
    }
    assert_eq!(rectified(-2.0, 0), -2.0);
    for relu in [0, 1] {
        assert!(rectified(f32::NAN, relu).is_nan() && rectified(-f32::NAN, relu).is_nan());
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

/// NaN stays in a window, wherever it lies: what comes after it is no larger.
#[test]
fn the_largest_of_a_window_with_nan_is_nan() {
    let block = PoolBlock {
        in_height: 2,
        in_width: 2,
        channels: 1,
        size: 2,
        stride: 2,
        out_height: 1,
        out_width: 1,
        padding: 0,
    };
    assert_eq!(pooled_element(&[1.0, -2.0, 3.0, 2.0][..], &block, 0), 3.0);
    for place in 0..4 {
        let mut window = [1.0, -2.0, 3.0, f32::INFINITY];
        window[place] = f32::NAN;
        assert!(pooled_element(&window[..], &block, 0).is_nan(), "place {place}");
    }
    assert_eq!(pooled_element(&[f32::NEG_INFINITY; 4][..], &block, 0), -f32::MAX);
}
