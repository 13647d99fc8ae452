//! Agreement of numbers with expected ones, each within its own bound.
//!
//! A check must be able to fail: NaN, another length, no elements, the same number everywhere and too many undecided
//! elements (those that depend on rounding) are disagreements, for any bounds.

use super::bounded::Bounded;
use std::fmt;

/// The largest share of undecided elements: those that depend on rounding.
pub const MAX_UNDECIDED: f64 = 0.02;

/// Why numbers do not agree with the expected ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disagreement {
    /// There are more or fewer of them, or none at all.
    Length,
    /// They are all the same, so nothing was tested.
    Constant,
    /// More than [`MAX_UNDECIDED`] of the elements are undecided.
    Undecided {
        /// Their share.
        share: f64,
    },
    /// An element is NaN or exceeds its bound; of several, the worst in units of its bound.
    Mismatch {
        /// Which.
        index: usize,
        /// The result.
        actual: f32,
        /// The expectation.
        expected: Bounded,
    },
}

impl fmt::Display for Disagreement {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Disagreement::Length => write!(formatter, "not as many numbers as expected"),
            Disagreement::Constant => write!(formatter, "every number is the same"),
            Disagreement::Undecided { share } => {
                write!(formatter, "{:.1} % of the elements depend on rounding", 100.0 * share)
            }
            Disagreement::Mismatch { index, actual, expected: Bounded { value, error } } => {
                write!(formatter, "[{index}] is {actual:e} instead of {value:e}, which may be off by {error:.1e}")
            }
        }
    }
}

/// When an element is undecided, and the smallest size for relative errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Elements whose own bound is larger than this are undecided.
    pub tolerance: f64,
    /// Relative differences and those in ULP are computed for elements of at least this size.
    pub least: f64,
}

/// Differences of numbers, the largest of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differences {
    /// `|a - e|`.
    pub absolute: f64,
    /// `|a - e| / |e|`.
    pub relative: f64,
    /// `|a - e|` in units of the last place of `e` as `f32`.
    pub ulps: f64,
}

impl Differences {
    /// Adds a pair of numbers; the difference to NaN is infinite.
    pub fn add(&mut self, actual: f32, expected: f64, least: f64) {
        let difference = difference(actual, expected);
        self.absolute = self.absolute.max(difference);
        if expected.abs() >= least {
            self.relative = self.relative.max(difference / expected.abs());
            self.ulps = self.ulps.max(difference / unit_in_last_place(expected));
        }
    }
}

/// Distance between `f32` numbers at the size of `x`; the smallest normal binade's below it.
pub fn unit_in_last_place(x: f64) -> f64 {
    let exponent = x.abs().max(f64::from(f32::MIN_POSITIVE)).log2().floor();
    (exponent - 23.0).exp2()
}

/// `|actual - expected|`; infinite if either is NaN.
fn difference(actual: f32, expected: f64) -> f64 {
    let difference = (f64::from(actual) - expected).abs();
    if difference.is_nan() { f64::INFINITY } else { difference }
}

/// The agreement of numbers with expected ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// The number of compared elements.
    pub compared: usize,
    /// Share of the undecided elements, which were not compared.
    pub undecided: f64,
    /// Largest differences of those compared.
    pub worst: Differences,
    /// Largest quotient of a difference and its bound.
    pub worst_of_bound: f64,
    /// Largest bound of those compared.
    pub largest_bound: f64,
    /// The disagreement, if any: a mismatch takes precedence over all others but the length.
    pub disagreement: Option<Disagreement>,
}

/// Whether an element is compared: it has an expectation whose bound is at most `tolerance`.
pub fn is_decided(expected: &Option<Bounded>, tolerance: f64) -> Option<Bounded> {
    expected.filter(|expected| expected.error <= tolerance)
}

/// Compares results with their expectations, each within its own bound. Elements without an expectation, or with a
/// bound above the tolerance, are undecided and must be few; NaN is a mismatch also there.
pub fn measure(actual: &[f32], expected: &[Option<Bounded>], limits: Limits) -> Agreement {
    let mut agreement = Agreement::default();
    if actual.len() != expected.len() || actual.is_empty() {
        return Agreement { disagreement: Some(Disagreement::Length), ..agreement };
    }
    let mut worst_mismatch = 0.0;
    for (index, (&actual, expected)) in actual.iter().zip(expected).enumerate() {
        let expected = match is_decided(expected, limits.tolerance) {
            Some(expected) => {
                agreement.compared += 1;
                agreement.worst.add(actual, expected.value, limits.least);
                agreement.largest_bound = agreement.largest_bound.max(expected.error);
                expected
            }
            None if !actual.is_finite() => Bounded::ZERO,
            None => continue,
        };
        let difference = difference(actual, expected.value);
        let of_bound = if difference > 0.0 { difference / expected.error } else { 0.0 };
        agreement.worst_of_bound = agreement.worst_of_bound.max(of_bound);
        if !(difference <= expected.error) && of_bound > worst_mismatch {
            worst_mismatch = of_bound;
            agreement.disagreement = Some(Disagreement::Mismatch { index, actual, expected });
        }
    }
    agreement.undecided = 1.0 - agreement.compared as f64 / actual.len() as f64;
    agreement.disagreement = agreement.disagreement.or_else(|| {
        if agreement.undecided > MAX_UNDECIDED {
            Some(Disagreement::Undecided { share: agreement.undecided })
        } else if actual.iter().all(|value| *value == actual[0]) {
            Some(Disagreement::Constant)
        } else {
            None
        }
    });
    agreement
}

/// Differences between the results of two devices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Versus {
    /// Largest differences of the decided elements.
    pub worst: Differences,
    /// Share of all elements that are the same bit for bit.
    pub equal: f64,
}

/// Compares results with those of another device, of the same length. `expected` tells which elements are undecided.
pub fn versus(actual: &[f32], other: &[f32], expected: &[Option<Bounded>], limits: Limits) -> Versus {
    let mut worst = Differences::default();
    let mut equal = 0;
    for ((&actual, &other), expected) in actual.iter().zip(other).zip(expected) {
        equal += usize::from(actual.to_bits() == other.to_bits());
        if is_decided(expected, limits.tolerance).is_some() {
            worst.add(actual, f64::from(other), limits.least);
        }
    }
    Versus { worst, equal: equal as f64 / actual.len().max(1) as f64 }
}
