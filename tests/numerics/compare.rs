//! The comparator can fail: each kind of wrong result is refused.

use viewfuse::check::compare::{Comparator, Mismatch, relative_units, unit_in_last_place};

const TIGHT: Comparator = Comparator { absolute: 1.0e-9, relative: 1.0e-6 };
const LOOSE: Comparator = Comparator { absolute: 1.0, relative: 0.0 };

#[test]
fn equal_numbers_pass() {
    assert!(TIGHT.compare(&[1.0, -2.0, 0.0], &[1.0, -2.0, 0.0]).is_ok());
    assert!(TIGHT.compare_varying(&[1.0, -2.0, f32::INFINITY], &[1.000_000_5, -2.0, f64::INFINITY]).is_ok());
}

#[test]
fn nan_fails_whatever_the_tolerance() {
    let infinite = Comparator { absolute: f64::INFINITY, relative: 0.0 };
    for comparator in [TIGHT, LOOSE, infinite] {
        let mismatch = comparator.compare(&[1.0, f32::NAN], &[1.0, 2.0]);
        assert!(matches!(mismatch, Err(Mismatch::Element(worst)) if worst.index == 1), "{mismatch:?}");
        assert!(comparator.compare(&[1.0], &[f64::NAN]).is_err());
        assert!(comparator.compare(&[f32::NAN], &[f64::NAN]).is_err());
    }
    assert!(LOOSE.compare(&[f32::INFINITY], &[1.0]).is_err());
    assert!(LOOSE.compare(&[f32::INFINITY], &[f64::NEG_INFINITY]).is_err());
    assert_eq!(relative_units(f32::NAN, 1.0), f64::INFINITY);
}

#[test]
fn another_length_and_nothing_fail() {
    assert_eq!(LOOSE.compare(&[1.0], &[1.0, 1.0]), Err(Mismatch::Length(1, 2)));
    assert_eq!(LOOSE.compare(&[1.0, 1.0], &[1.0]), Err(Mismatch::Length(2, 1)));
    assert_eq!(LOOSE.compare(&[], &[]), Err(Mismatch::Empty));
}

#[test]
fn a_constant_fails_where_numbers_vary() {
    assert!(LOOSE.compare(&[0.5, 0.5], &[0.2, 0.8]).is_ok());
    assert_eq!(LOOSE.compare_varying(&[0.5, 0.5], &[0.2, 0.8]), Err(Mismatch::Constant(0.5)));
}

#[test]
fn the_worst_element_is_reported() {
    let Err(mismatch) = TIGHT.compare(&[1.0, 2.1, 3.5, 4.0], &[1.0, 2.0, 3.0, 4.0]) else {
        panic!("off by far, and passed");
    };
    let Mismatch::Element(worst) = mismatch else { panic!("{mismatch}") };
    assert_eq!((worst.index, worst.actual, worst.expected), (2, 3.5, 3.0));
    assert_eq!(worst.ulps, 0.5 * 4_194_304.0);
    assert!(mismatch.to_string().contains("[2]"), "{mismatch}");
    assert!(TIGHT.compare(&[1.000_002], &[1.0]).is_err());
    assert_eq!(unit_in_last_place(1.5), 2.0_f64.powi(-23));
    assert_eq!(unit_in_last_place(0.0), 2.0_f64.powi(-149));
}
