//! Comparison of computed with expected numbers.
//!
//! A check must be able to fail: NaN, a missing element, an empty result and a constant where the expectation varies
//! are failures, for any tolerance.

use std::fmt;

/// Tolerances: an element passes if `|actual - expected| <= absolute + relative * |expected|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparator {
    /// The absolute part of the tolerance.
    pub absolute: f64,
    /// The relative part of the tolerance.
    pub relative: f64,
}

/// An element and its difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    /// Its place in the compared slices.
    pub index: usize,
    /// The computed number.
    pub actual: f32,
    /// The expected number.
    pub expected: f64,
    /// Distance in units in the last place of the expected number as `f32`.
    pub ulps: f64,
}

/// Why two results do not agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mismatch {
    /// The lengths differ: actual, expected.
    Length(usize, usize),
    /// There are no elements.
    Empty,
    /// All computed numbers are the same, but the expected ones vary.
    Constant(f32),
    /// This element, the worst one, is out of tolerance.
    Element(Worst),
}

impl fmt::Display for Mismatch {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mismatch::Length(actual, expected) => write!(formatter, "{actual} numbers instead of {expected}"),
            Mismatch::Empty => write!(formatter, "nothing to compare"),
            Mismatch::Constant(value) => write!(formatter, "every number is {value}"),
            Mismatch::Element(Worst { index, actual, expected, ulps }) => {
                write!(formatter, "[{index}] is {actual:e} instead of {expected:e}, {ulps:.1} ULP off")
            }
        }
    }
}

impl Comparator {
    /// Compares element by element; on success returns the element with the largest difference in units of its
    /// tolerance.
    ///
    /// # Errors
    /// The [`Mismatch`]; of several elements out of tolerance, the worst.
    pub fn compare(&self, actual: &[f32], expected: &[f64]) -> Result<Worst, Mismatch> {
        if actual.len() != expected.len() {
            return Err(Mismatch::Length(actual.len(), expected.len()));
        }
        let mut worst: Option<(f64, Worst)> = None;
        let mut passed = true;
        for (index, (&a, &e)) in actual.iter().zip(expected).enumerate() {
            let difference = (f64::from(a) - e).abs();
            // Equal infinities differ by NaN, but are the same.
            let difference = if f64::from(a) == e { 0.0 } else { difference };
            let allowed = self.absolute + self.relative * e.abs();
            let within = difference <= allowed;
            passed &= within;
            let share = match (within, difference.is_nan()) {
                (_, true) => f64::INFINITY,
                (true, _) if allowed == 0.0 => 0.0,
                _ => difference / allowed,
            };
            if worst.is_none_or(|(largest, _)| share > largest) {
                worst =
                    Some((share, Worst { index, actual: a, expected: e, ulps: difference / unit_in_last_place(e) }));
            }
        }
        let Some((_, worst)) = worst else { return Err(Mismatch::Empty) };
        if !passed {
            return Err(Mismatch::Element(worst));
        }
        Ok(worst)
    }

    /// As [`Comparator::compare`], for results that must vary: a constant is refused even if the tolerance would let
    /// it pass.
    ///
    /// # Errors
    /// As [`Comparator::compare`].
    pub fn compare_varying(&self, actual: &[f32], expected: &[f64]) -> Result<Worst, Mismatch> {
        let worst = self.compare(actual, expected)?;
        if actual.iter().all(|a| *a == actual[0]) { Err(Mismatch::Constant(actual[0])) } else { Ok(worst) }
    }
}

/// Distance between `f32` numbers at the size of `x`; the smallest normal binade's below it.
pub fn unit_in_last_place(x: f64) -> f64 {
    let exponent = x.abs().max(f64::from(f32::MIN_POSITIVE)).log2().floor();
    (exponent - 23.0).exp2()
}

/// Relative error in units of `2^-24`; 0 for equal numbers, infinite for NaN.
pub fn relative_units(actual: f32, expected: f64) -> f64 {
    if f64::from(actual) == expected {
        return 0.0;
    }
    let units = (f64::from(actual) - expected).abs() / expected.abs() * 16_777_216.0;
    if units.is_nan() { f64::INFINITY } else { units }
}
