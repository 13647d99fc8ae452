//! Elementary functions with one result on every target.
//!
//! `libm` and GPU instructions disagree (a driver's `acos` may be off by 4096 ULP, its `sin` by 2^-11), so the
//! functions that decide weights and colours are our own range-reduced polynomials in plain `f32` arithmetic: the
//! same additions and multiplications in the same order everywhere. The polynomials are those of Cephes
//! (S. Moshier, single precision); the stated errors are the largest seen in `tests/numerics/math.rs` against `f64`.
//!
//! This is the only module that names `libm`, and it takes only the correctly rounded square root from it
//! (plus, in `f64` and never run on a device, `log10` for the metrics and three functions for lenses).

use core::f32::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI};

/// Whether a number is NaN, from its bits: a compiler of shaders may assume that there is none, and then finds every
/// comparison with itself true.
#[inline]
pub fn has_nan_bits(x: f32) -> bool {
    x.to_bits() & 0x7fff_ffff > INFINITE_BITS
}

/// Whether a number is neither infinite nor NaN, from its bits.
#[inline]
pub fn has_finite_bits(x: f32) -> bool {
    x.to_bits() & INFINITE_BITS != INFINITE_BITS
}

/// The bits of infinity; those of NaN are above.
const INFINITE_BITS: u32 = 0x7f80_0000;

/// Square root, correctly rounded. Negative input gives NaN.
#[inline]
pub fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Decimal logarithm in `f64`, for metrics on the host.
pub(crate) fn log10(x: f64) -> f64 {
    libm::log10(x)
}

/// Square root in `f64`, correctly rounded, for lenses on the host.
#[inline]
pub(crate) fn sqrt_f64(x: f64) -> f64 {
    libm::sqrt(x)
}

/// Arc tangent in `f64`, for lenses on the host.
#[inline]
pub(crate) fn arc_tangent_f64(x: f64) -> f64 {
    libm::atan(x)
}

/// Tangent in `f64`, for lenses on the host.
#[inline]
pub(crate) fn tangent_f64(x: f64) -> f64 {
    libm::tan(x)
}

/// Absolute value.
#[inline]
pub fn abs(x: f32) -> f32 {
    if x < 0.0 { -x } else { x }
}

/// Largest whole number not above `x`, as an `i32` (saturating; NaN gives 0).
#[inline]
pub fn floor_to_i32(x: f32) -> i32 {
    let truncated = x as i32;
    if (truncated as f32) > x && truncated > i32::MIN { truncated - 1 } else { truncated }
}

/// Smaller of two numbers; if `a` is NaN the result is `b`.
#[inline]
pub fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Larger of two numbers; if `a` is NaN the result is `b`.
#[inline]
pub fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `x` limited to `[low, high]`; NaN gives `low`.
#[inline]
pub fn clamp(x: f32, low: f32, high: f32) -> f32 {
    min(max(x, low), high)
}

/// `e^x`: error at most 1.1 ULP for `x` in `[-87.3, 88.7]`; 0 below (no subnormals: devices may flush them),
/// saturated at `e^88.7` above. NaN gives 0.
#[inline]
pub fn exp(x: f32) -> f32 {
    const LOWEST: f32 = -87.3;
    const HIGHEST: f32 = 88.7;
    // ln 2 in two parts: the first has few enough bits that its product with the whole number is exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    // 1.5 * 2^23: see below.
    const WHOLE: f32 = 12_582_912.0;
    if !(x >= LOWEST) {
        return 0.0;
    }
    let x = min(x, HIGHEST);
    // In [2^23, 2^24) numbers are whole: adding rounds, and the last bits are the integer. A conversion, which must
    // saturate, would keep loops over this function from being vectorised.
    let shifted = x * LOG2_E + WHOLE;
    let k = shifted - WHOLE;
    let power = shifted.to_bits().wrapping_sub(WHOLE.to_bits()) as i32;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_2e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 5.000_000_3e-1;
    let e = p * (r * r) + r + 1.0;
    // 2^power as a product of two normal numbers: power reaches 128.
    let half = power >> 1;
    e * exact_power_of_two(half) * exact_power_of_two(power - half)
}

/// Natural logarithm: error at most 0.9 ULP for normal numbers. Zero, negative numbers, subnormals (devices may flush
/// them) and NaN give the logarithm of the smallest normal number, -87.3; infinity that of the largest finite one,
/// 88.7.
#[inline]
pub fn ln(x: f32) -> f32 {
    // ln 2 in two parts, as in `exp`.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let bits = clamp(x, f32::MIN_POSITIVE, f32::MAX).to_bits();
    let mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    let exponent = (bits >> 23) as i32 - 127;
    // x = 2^k (1 + r) with 1 + r within a factor sqrt(2) of 1.
    let (k, r) = if mantissa > core::f32::consts::SQRT_2 {
        ((exponent + 1) as f32, 0.5 * mantissa - 1.0)
    } else {
        (exponent as f32, mantissa - 1.0)
    };
    let z = r * r;
    let p = 7.037_683_6e-2;
    let p = p * r - 1.151_461e-1;
    let p = p * r + 1.167_699_9e-1;
    let p = p * r - 1.242_014_1e-1;
    let p = p * r + 1.424_932_3e-1;
    let p = p * r - 1.666_805_8e-1;
    let p = p * r + 2.000_071_5e-1;
    let p = p * r - 2.499_999_4e-1;
    let p = p * r + 3.333_333e-1;
    let rest = p * r * z + LN_2_LOW * k - 0.5 * z;
    (r + rest) + LN_2_HIGH * k
}

/// `ln(a / b)` for positive normal numbers whose quotient is one: relative error at most 4e-7, also where they are
/// almost equal and the quotient alone has lost their difference. Otherwise as [`ln`].
#[inline]
pub fn ln_ratio(a: f32, b: f32) -> f32 {
    // Twice the inverse hyperbolic tangent of z; the difference of numbers within a factor of 2 is exact.
    // The sum of the largest would overflow.
    let scale = if max(a, b) > 1.0e38 { 0.5 } else { 1.0 };
    let z = (scale * a - scale * b) / (scale * a + scale * b);
    if abs(z) < 0.17 {
        let square = z * z;
        let rest = square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square * (1.0 / 9.0))));
        return 2.0 * (z + z * rest);
    }
    ln(a / b)
}

/// The seventh root: error at most 1.3 ULP for normal numbers. Below them, and for NaN, it is 0; that of infinity is
/// the root of the largest finite number.
#[inline]
pub fn seventh_root(x: f32) -> f32 {
    if !(x >= f32::MIN_POSITIVE) {
        return 0.0;
    }
    let x = min(x, f32::MAX);
    let root = exp(ln(x) / 7.0);
    // One step of Newton's method: what is left of the first error is its square. Powers stay between 1e-33 and 1e33.
    let square = root * root;
    let cube = square * root;
    root + (x / (cube * cube) - root) / 7.0
}

/// `2^k` exactly, for `k` in `[-126, 127]`.
#[inline]
pub fn exact_power_of_two(k: i32) -> f32 {
    f32::from_bits(((k + 127) as u32) << 23)
}

/// Sine and cosine of an angle in radians: absolute error below 9e-8 for `|x| <= 8192`. Beyond that the argument itself
/// is too coarse for a meaningful result; the results stay in `[-1, 1]` (to the same error). A non-finite angle gives
/// `(0, 1)`.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    // pi / 2 in three parts (Cody and Waite); the products with the first two are exact for |k| < 2^13.
    const FIRST: f32 = 1.570_312_5;
    const SECOND: f32 = 4.837_513e-4;
    const THIRD: f32 = 7.549_789_4e-8;
    let x = if has_finite_bits(x) { x } else { 0.0 };
    let quadrant = floor_to_i32(x * (2.0 / PI) + 0.5);
    let k = quadrant as f32;
    // Rounding of the quadrant lets r exceed pi / 4 a little; the limit only matters for huge arguments.
    let r = clamp(((x - k * FIRST) - k * SECOND) - k * THIRD, -0.8, 0.8);
    let z = r * r;
    let sin = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * r + r;
    let cos = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    match quadrant & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Angle of the point `(x, y)` with `y >= 0` from the positive x axis, in `[0, pi]`, for magnitudes up to 1e38 together:
/// error at most 3 ULP.
/// `(0, 0)` gives 0. This form is exact at 0 and pi, where `acos` of a dot product loses half of the digits.
#[inline]
pub fn angle_from_components(y: f32, x: f32) -> f32 {
    let far = abs(x);
    // Three ranges of the acute angle, each brought within pi / 8 of 0 by one division: straight, turned back by
    // pi / 4, turned back by pi / 2.
    let (numerator, denominator, offset) = if y > far * TAN_3_PI_8 {
        (-far, y, FRAC_PI_2)
    } else if y > far * TAN_PI_8 {
        (y - far, y + far, FRAC_PI_4)
    } else {
        (y, far, 0.0)
    };
    let acute = offset + small_arc_tangent(numerator, denominator);
    if x < 0.0 { PI - acute } else { acute }
}

/// Angle of the point `(sqrt(x), sqrt(y))` from the positive x axis, in `[0, pi / 2]`, for `x` and `y` of at least 0:
/// the same from squares, with one square root, where their product neither overflows nor vanishes (both 0, or both
/// between 1e-19 and 1e19). `(0, 0)` gives 0.
#[inline]
pub fn angle_from_squares(y: f32, x: f32) -> f32 {
    let mean = sqrt(y * x);
    let (numerator, denominator, offset) = if y > x * (TAN_3_PI_8 * TAN_3_PI_8) {
        (-mean, y, FRAC_PI_2)
    } else if y > x * (TAN_PI_8 * TAN_PI_8) {
        (y - x, y + x + 2.0 * mean, FRAC_PI_4)
    } else {
        (mean, x, 0.0)
    };
    offset + small_arc_tangent(numerator, denominator)
}

const TAN_PI_8: f32 = 0.414_213_57;
const TAN_3_PI_8: f32 = 2.414_213_7;

/// Arc tangent of a quotient of at most `tan(pi / 8)` in magnitude; 0 where the denominator is 0.
#[inline]
fn small_arc_tangent(numerator: f32, denominator: f32) -> f32 {
    let r = if denominator > 0.0 { numerator / denominator } else { 0.0 };
    let z = r * r;
    let p = ((8.053_744_5e-2 * z - 1.387_768_6e-1) * z + 1.997_771_1e-1) * z - 3.333_295e-1;
    p * z * r + r
}

/// `a + b` as the rounded sum and the exact rest (Knuth). Overflow gives NaN in the rest.
#[inline]
pub fn two_sum(a: f32, b: f32) -> (f32, f32) {
    let sum = a + b;
    let added = sum - a;
    (sum, (a - (sum - added)) + (b - added))
}

/// `a * b` as the rounded product and the exact rest (Dekker), for magnitudes of the factors below 1e15 and of the
/// product above 1e-30; smaller rests are lost, larger factors give NaN.
#[inline]
pub fn two_product(a: f32, b: f32) -> (f32, f32) {
    // 2^12 + 1 cuts 24 bits into two halves.
    const SPLITTER: f32 = 4097.0;
    let cut = |x: f32| {
        let scaled = SPLITTER * x;
        let high = scaled - (scaled - x);
        (high, x - high)
    };
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (cut(a), cut(b));
    (product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low)
}

/// Euclidean norm of three components without overflow or underflow: the components are divided by the largest
/// magnitude first. Error at most 2 ULP for magnitudes in `[1e-15, 1e15]`, 3 ULP elsewhere; all zero gives 0, infinity
/// infinity, and NaN NaN.
#[inline]
pub fn norm3(x: f32, y: f32, z: f32) -> f32 {
    let largest = max(max(abs(x), abs(y)), abs(z));
    if largest > 1.0e-15 && largest < 1.0e15 {
        // Squares neither overflow nor vanish: no scaling, one rounding less.
        return sqrt(x * x + y * y + z * z);
    }
    if !(largest > 0.0 && largest <= f32::MAX) {
        return abs(x) + abs(y) + abs(z);
    }
    let (x, y, z) = (x / largest, y / largest, z / largest);
    largest * sqrt(x * x + y * y + z * z)
}
