//! Numbers in `f64` with a bound on the error of the same calculation in `f32` (running error analysis, Wilkinson
//! 1963).
//!
//! Every operation propagates the errors of its operands and adds its own rounding, counted twice because the code
//! under test may order its operations differently. A division has the error that Vulkan allows, so a bound holds on
//! every device, not only on those with correctly rounded divisions. A comparison within the errors has no answer.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Twice the unit roundoff of `f32`, relative.
pub const ROUNDING: f64 = 2.0 / 16_777_216.0;

/// The error of a division, relative: Vulkan allows 2.5 ULP, and a device may multiply with the rounded reciprocal,
/// which is one rounding more.
pub const DIVISION: f64 = 3.0 * ROUNDING;

/// Absolute error of our sine and cosine for arguments up to 8192.
const SINE_ERROR: f64 = 9.0e-8;

/// The relative error of `count` roundings in sequence: `n u / (1 - n u)` (Higham, "Accuracy and
/// Stability of Numerical Algorithms", section 3.1).
pub fn roundings(count: usize) -> f64 {
    let all = count as f64 * ROUNDING / 2.0;
    all / (1.0 - all)
}

/// A value and a bound on the error of its `f32` counterpart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// The value in `f64`.
    pub value: f64,
    /// The bound on the error of `f32`.
    pub error: f64,
}

impl Bounded {
    /// Zero, exactly.
    pub const ZERO: Bounded = Bounded { value: 0.0, error: 0.0 };
    /// One, exactly.
    pub const ONE: Bounded = Bounded { value: 1.0, error: 0.0 };

    /// The result of an operation: its own rounding is added to the errors of its operands.
    fn rounded(value: f64, brought: f64) -> Bounded {
        Bounded { value, error: brought + ROUNDING * value.abs() }
    }

    /// A sum of products in any order.
    ///
    /// Of `n` summands each is rounded at most `n` times: once as a product, and in at most `n - 1` additions, in
    /// whichever order they run (Higham, section 4.2). Underflow of products, which a device may flush to 0, is
    /// included.
    pub fn sum(summands: impl Iterator<Item = f64>) -> Bounded {
        let (mut value, mut magnitudes, mut count) = (0.0, 0.0, 0);
        for summand in summands {
            value += summand;
            magnitudes += summand.abs();
            count += 1;
        }
        let flushed = count as f64 * f64::from(f32::MIN_POSITIVE);
        Bounded { value, error: magnitudes * roundings(count) + flushed }
    }

    /// Whether this is below another number; `None` if it depends on rounding.
    pub fn below(self, other: Bounded) -> Option<bool> {
        let margin = other.value - self.value;
        // Exactly known operands compare exactly.
        if margin.abs() > self.error + other.error || self.error + other.error == 0.0 {
            Some(margin > 0.0)
        } else {
            None
        }
    }

    /// The smaller of two.
    pub fn lesser(self, other: Bounded) -> Bounded {
        match self.below(other) {
            Some(true) => self,
            Some(false) => other,
            None => Bounded { value: self.value.min(other.value), error: self.error.max(other.error) },
        }
    }

    /// The larger of two.
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

    /// Its magnitude.
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
        // The exponential of an error this large may be infinite where the value is 0.
        let brought =
            if self.error < 1.0 { value * self.error.exp_m1() } else { (self.value + self.error).exp() - value };
        Bounded { value, error: brought + 2.0 * ROUNDING * value + 2.0e-38 }
    }

    /// The natural logarithm of a positive number; the function under test is off by at most 2 ULP.
    pub fn ln(self) -> Bounded {
        let value = self.value.ln();
        Bounded { value, error: -(-self.error / self.value).ln_1p() + 2.0 * ROUNDING * value.abs() }
    }

    /// The square root; a device may take it as the reciprocal of a reciprocal root, 4.5 ULP together.
    pub fn square_root(self) -> Bounded {
        let value = self.value.sqrt();
        let least = (self.value - self.error).max(0.0).sqrt();
        let brought = if self.error > 0.0 { self.error / (value + least) } else { 0.0 };
        Bounded { value, error: brought + 4.5 * ROUNDING * value }
    }

    /// The sine of at most 8192 rad. It is nowhere steeper than 1.
    pub fn sine(self) -> Bounded {
        Bounded { value: self.value.sin(), error: self.error + SINE_ERROR }
    }

    /// The cosine of at most 8192 rad.
    pub fn cosine(self) -> Bounded {
        Bounded { value: self.value.cos(), error: self.error + SINE_ERROR }
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

impl Neg for Bounded {
    type Output = Bounded;
    fn neg(self) -> Bounded {
        Bounded { value: -self.value, ..self }
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
        Bounded { value, error: (self.error + value.abs() * other.error) / least_divisor + DIVISION * value.abs() }
    }
}
