//! Half precision, from its definition: one bit of sign, five of the exponent, ten of the fraction.

/// The largest finite number.
const MAX: f64 = 65504.0;

/// The number that these bits stand for.
pub fn from_half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2.0_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2.0_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

/// The bits of the nearest number, of two the even one, none larger than the largest. Not for NaN.
pub fn nearest(number: f64) -> u16 {
    let magnitude = number.abs().min(MAX);
    // Between two powers of two the numbers lie evenly, and below 2^-14 as they do above it.
    let exponent = (magnitude.log2().floor() as i32).clamp(-14, 15);
    let steps = (magnitude * 2.0_f64.powi(10 - exponent)).round_ties_even();
    // The bits of positive numbers count up with them: a fraction that is full is the next exponent.
    let bits = (exponent + 14) as u16 * 1024 + steps as u16;
    if number.is_sign_negative() { bits | 1 << 15 } else { bits }
}
