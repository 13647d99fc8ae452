//! Numbers in `f64` that know how far the same calculation in `f32` may stray from them (running error analysis,
//! Wilkinson 1963).
//!
//! Every operation carries the errors of its operands on and adds its own rounding, counted twice because the code under
//! test may take its operations in another order. A comparison that the errors leave open has no answer.

use std::ops::{Add, Div, Mul, Sub};

/// Twice the unit roundoff of `f32`, relative.
pub const ROUNDING: f64 = 2.0 / 16_777_216.0;

/// A value and a bound on the error of its `f32` counterpart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// The value as `f64` knows it.
    pub value: f64,
    /// How far `f32` may be from it.
    pub error: f64,
}

impl Bounded {
    /// Zero, exactly.
    pub const ZERO: Bounded = Bounded { value: 0.0, error: 0.0 };
    /// One, exactly.
    pub const ONE: Bounded = Bounded { value: 1.0, error: 0.0 };

    /// The outcome of an operation: its own rounding is added to what its operands brought.
    fn rounded(value: f64, brought: f64) -> Bounded {
        Bounded { value, error: brought + ROUNDING * value.abs() }
    }

    /// Whether this is below another number; `None` where rounding decides.
    pub fn below(self, other: Bounded) -> Option<bool> {
        let margin = other.value - self.value;
        // Exactly known operands compare exactly.
        if margin.abs() > self.error + other.error || self.error + other.error == 0.0 {
            Some(margin > 0.0)
        } else {
            None
        }
    }

    /// The lesser of two.
    pub fn lesser(self, other: Bounded) -> Bounded {
        match self.below(other) {
            Some(true) => self,
            Some(false) => other,
            None => Bounded { value: self.value.min(other.value), error: self.error.max(other.error) },
        }
    }

    /// The greater of two.
    pub fn greater(self, other: Bounded) -> Bounded {
        match self.below(other) {
            Some(false) => self,
            Some(true) => other,
            None => Bounded { value: self.value.max(other.value), error: self.error.max(other.error) },
        }
    }

    /// Limited to an interval.
    pub fn clamped(self, low: f32, high: f32) -> Bounded {
        self.greater(low.into()).lesser(high.into())
    }

    /// Without its sign.
    pub fn magnitude(self) -> Bounded {
        Bounded { value: self.value.abs(), ..self }
    }

    /// Its square.
    pub fn squared(self) -> Bounded {
        self * self
    }

    /// `e^x`; the function under test is off by at most 2 ULP and has no subnormal results.
    pub fn exp(self) -> Bounded {
        let value = self.value.exp();
        Bounded { value, error: value * self.error.exp_m1() + 2.0 * ROUNDING * value + 2.0e-38 }
    }
}

impl From<f32> for Bounded {
    fn from(value: f32) -> Bounded {
        Bounded { value: f64::from(value), error: 0.0 }
    }
}

impl From<u32> for Bounded {
    fn from(value: u32) -> Bounded {
        Bounded { value: f64::from(value), error: 0.0 }
    }
}

impl Add for Bounded {
    type Output = Bounded;
    fn add(self, other: Bounded) -> Bounded {
        Bounded::rounded(self.value + other.value, self.error + other.error)
    }
}

impl Sub for Bounded {
    type Output = Bounded;
    fn sub(self, other: Bounded) -> Bounded {
        Bounded::rounded(self.value - other.value, self.error + other.error)
    }
}

impl Mul for Bounded {
    type Output = Bounded;
    fn mul(self, other: Bounded) -> Bounded {
        let brought = self.error * other.value.abs() + other.error * (self.value.abs() + self.error);
        Bounded::rounded(self.value * other.value, brought)
    }
}

impl Div for Bounded {
    type Output = Bounded;
    fn div(self, other: Bounded) -> Bounded {
        let least_divisor = (other.value.abs() - other.error).max(0.0);
        let value = self.value / other.value;
        Bounded::rounded(value, (self.error + value.abs() * other.error) / least_divisor)
    }
}

/// Why numbers are not those expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disagreement {
    /// There are more or fewer of them.
    Length,
    /// They are all the same: nothing was tested.
    Constant,
    /// More than [`MOST_UNDECIDED`] of the elements hang on rounding.
    Undecided {
        /// Their share.
        share: f64,
    },
    /// One is NaN or further off than its bound.
    Mismatch {
        /// Which.
        index: usize,
        /// What came out.
        actual: f32,
        /// What should have.
        expected: Bounded,
    },
}

/// How well numbers agree with those expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// How many were compared.
    pub compared: usize,
    /// Share of those that hang on rounding and were not.
    pub undecided: f64,
    /// Largest difference.
    pub worst: f64,
    /// Largest quotient of a difference and its bound.
    pub worst_of_bound: f64,
}

/// Largest share of elements that may hang on rounding.
pub const MOST_UNDECIDED: f64 = 0.02;

/// Compares results with what was expected of them, each within its own bound. Elements without an expectation, or with
/// one that is no better than `tolerance`, are undecided and must be few.
///
/// # Errors
/// [`Disagreement`]; a mismatch before all others but the length.
pub fn compare(actual: &[f32], expected: &[Option<Bounded>], tolerance: f64) -> Result<Agreement, Disagreement> {
    if actual.len() != expected.len() || actual.is_empty() {
        return Err(Disagreement::Length);
    }
    let mut agreement = Agreement { compared: 0, undecided: 0.0, worst: 0.0, worst_of_bound: 0.0 };
    for (index, (&actual, expected)) in actual.iter().zip(expected).enumerate() {
        let Some(expected) = expected.filter(|expected| expected.error <= tolerance) else {
            if actual.is_nan() {
                return Err(Disagreement::Mismatch { index, actual, expected: Bounded::ZERO });
            }
            continue;
        };
        let difference = (f64::from(actual) - expected.value).abs();
        if !(difference <= expected.error) {
            return Err(Disagreement::Mismatch { index, actual, expected });
        }
        agreement.compared += 1;
        agreement.worst = agreement.worst.max(difference);
        if expected.error > 0.0 {
            agreement.worst_of_bound = agreement.worst_of_bound.max(difference / expected.error);
        }
    }
    agreement.undecided = 1.0 - agreement.compared as f64 / actual.len() as f64;
    if agreement.undecided > MOST_UNDECIDED {
        return Err(Disagreement::Undecided { share: agreement.undecided });
    }
    if actual.iter().all(|value| *value == actual[0]) {
        return Err(Disagreement::Constant);
    }
    Ok(agreement)
}
