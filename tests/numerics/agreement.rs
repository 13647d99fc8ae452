//! Comparing with bounds can fail: each kind of wrong result is refused.

use viewfuse::check::agreement::{Disagreement, Limits, measure, versus};
use viewfuse::check::bounded::Bounded;
use viewfuse::check::picture;

const LIMITS: Limits = Limits { tolerance: 1.0, least: 1.0e-2 };

fn outcome(actual: &[f32], expected: &[Option<Bounded>]) -> Option<Disagreement> {
    measure(actual, expected, LIMITS).disagreement
}

#[test]
fn what_agrees_passes() {
    let near = Bounded { value: 2.0, error: 1.0e-6 };
    let agreement = measure(&[1.0, 2.000_000_5], &[Some(Bounded::ONE), Some(near)], LIMITS);
    assert_eq!((agreement.disagreement, agreement.compared, agreement.undecided), (None, 2, 0.0));
    assert_eq!(agreement.worst.ulps, 2.0);
    assert!((agreement.worst_of_bound - 0.477).abs() < 1.0e-3, "{agreement:?}");
}

#[test]
fn what_does_not_is_refused() {
    let expected = [Some(Bounded::ONE), Some(Bounded::ZERO)];
    assert_eq!(outcome(&[1.0, 0.0], &expected), None);
    assert_eq!(outcome(&[1.0], &expected), Some(Disagreement::Length));
    assert_eq!(outcome(&[], &[]), Some(Disagreement::Length));
    assert!(matches!(outcome(&[1.0, f32::NAN], &expected), Some(Disagreement::Mismatch { index: 1, .. })));
    assert!(matches!(outcome(&[f32::NAN, 1.0], &[None, None]), Some(Disagreement::Mismatch { index: 0, .. })));
    assert!(matches!(outcome(&[1.0, 1.0e-6], &expected), Some(Disagreement::Mismatch { index: 1, .. })));
    assert!(matches!(outcome(&[1.0, f32::INFINITY], &expected), Some(Disagreement::Mismatch { index: 1, .. })));
    assert!(matches!(outcome(&[1.0, 0.0], &[None, None]), Some(Disagreement::Undecided { .. })));
    assert_eq!(outcome(&[1.0, 1.0], &[Some(Bounded::ONE); 2]), Some(Disagreement::Constant));
    let vague = Some(Bounded { value: 0.0, error: 2.0 });
    assert!(matches!(outcome(&[1.0, 0.0], &[vague; 2]), Some(Disagreement::Undecided { .. })));
    let unbounded = Some(Bounded { value: 0.0, error: f64::NAN });
    assert!(matches!(outcome(&[1.0, 0.0], &[unbounded; 2]), Some(Disagreement::Undecided { .. })));
}

#[test]
fn the_worst_mismatch_is_named() {
    let expected = [1.0, 2.0, 3.0].map(|value| Some(Bounded { value, error: 1.0e-3 }));
    let Some(Disagreement::Mismatch { index, actual, .. }) = outcome(&[1.01, 2.5, 3.1], &expected) else {
        panic!("off by far, and passed");
    };
    assert_eq!((index, actual), (1, 2.5));
}

#[test]
fn devices_are_compared_bit_by_bit() {
    let expected = [Some(Bounded::ONE), Some(Bounded::ONE), None, Some(Bounded::ZERO)];
    let found = versus(&[1.0, 1.0 + f32::EPSILON, 5.0, 0.0], &[1.0, 1.0, 7.0, -0.0], &expected, LIMITS);
    assert_eq!((found.worst.ulps, found.equal), (1.0, 0.25));
    assert_eq!(versus(&[f32::NAN], &[1.0], &expected[..1], LIMITS).worst.absolute, f64::INFINITY);
}

#[test]
fn pictures_may_differ_by_one_step() {
    let picture = |values: [u8; 6]| image::RgbImage::from_raw(2, 1, values.to_vec()).expect("two pixels");
    let reference = picture([10, 20, 30, 40, 50, 60]);
    let (equal, breach) = picture::compare(&reference, &reference);
    assert_eq!((equal.map(|versus| (versus.worst, versus.differing, versus.psnr)), breach), (Some((0, 0, None)), None));
    let (near, breach) = picture::compare(&picture([10, 21, 30, 40, 50, 60]), &reference);
    assert_eq!((near.map(|versus| (versus.worst, versus.differing)), breach), (Some((1, 1)), None));
    let (far, breach) = picture::compare(&picture([10, 20, 30, 40, 52, 60]), &reference);
    assert_eq!((far.map(|versus| versus.worst), breach.is_some()), (Some(2), true));
    let wide = image::RgbImage::new(3, 1);
    assert!(picture::compare(&wide, &reference).1.is_some() && picture::compare(&reference, &wide).1.is_some());
    assert!(picture::compare(&picture([7; 6]), &picture([7; 6])).1.is_some(), "a constant shows nothing");
}
