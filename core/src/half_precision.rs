//! Numbers in half precision (f16, IEEE 754 binary16), two in a word, the lower half first: half the memory at 11
//! significant bits.
//!
//! Conversions use integer arithmetic only: devices without an f16 type, or with another rounding, get the same bits.

use crate::fetch::Fetch;

/// The largest number in half precision.
pub const MAX_F16: f32 = 65504.0;

/// The f16 bits nearest to a number, of two equally near ones the even ones: off by at most 2^-11 of the number, below
/// 2^-14 by 2^-25. Larger numbers and infinity become [`MAX_F16`]; NaN stays NaN.
#[inline]
pub fn f16_bits(number: f32) -> u32 {
    let bits = number.to_bits();
    let (sign, magnitude) = (bits >> 16 & 0x8000, bits & 0x7fff_ffff);
    if magnitude > 0x7f80_0000 {
        return sign | 0x7e00;
    }
    if magnitude >= MAX_F16.to_bits() {
        return sign | 0x7bff;
    }
    let exponent = magnitude >> 23;
    if exponent >= 113 {
        // 112 less in the exponent. What rounding carries goes there as well, which is right.
        return sign | rounded(magnitude - (112 << 23), 13);
    }
    // In units of 2^-24; what is less than half a unit becomes 0.
    if exponent < 102 { sign } else { sign | rounded(magnitude & 0x007f_ffff | 0x0080_0000, 126 - exponent) }
}

/// As [`f16_bits`], but NaN for what is larger than [`MAX_F16`]: for factors, of which no product may look right.
#[inline]
pub fn f16_bits_or_nan(number: f32) -> u32 {
    if number.to_bits() & 0x7fff_ffff > MAX_F16.to_bits() { 0x7e00 } else { f16_bits(number) }
}

/// `number / 2^shift`, the nearest or the even one; `shift` is 1 to 24.
#[inline(always)]
fn rounded(number: u32, shift: u32) -> u32 {
    let is_odd = number >> shift & 1;
    (number + (1 << (shift - 1)) - 1 + is_odd) >> shift
}

/// The number that the lower 16 bits stand for, exactly.
#[inline(always)]
pub fn f16_value(bits: u32) -> f32 {
    let (sign, magnitude) = ((bits & 0x8000) << 16, bits & 0x7fff);
    let whole = match magnitude >> 10 {
        // A whole number of units, of which there are fewer than 1024: a power of two times it is exact.
        0 => (magnitude as f32 * f32::from_bits((127 - 24) << 23)).to_bits(),
        31 => (magnitude << 13) + (224 << 23),
        _ => (magnitude << 13) + (112 << 23),
    };
    f32::from_bits(sign | whole)
}

/// Number `index` of `words`, two in each.
#[inline(always)]
pub fn fetch_f16(words: &(impl Fetch<u32> + ?Sized), index: usize) -> f32 {
    f16_value(words.fetch(index / 2) >> (16 * (index as u32 % 2)))
}

/// Words as the numbers that they hold, two in each.
#[derive(Clone, Copy)]
pub struct Halves<'a, W: ?Sized>(
    /// The words.
    pub &'a W,
);

impl<W: Fetch<u32> + ?Sized> Fetch<f32> for Halves<'_, W> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        fetch_f16(self.0, index)
    }
}

/// Word `element`: numbers `2 element` and the one behind it, where there is one.
#[inline]
pub fn packed_f16(numbers: &(impl Fetch<f32> + ?Sized), number_count: u32, element: usize) -> u32 {
    packed(numbers, number_count, element, f16_bits)
}

/// As [`packed_f16`], of factors: NaN for what is larger than [`MAX_F16`].
#[inline]
pub fn packed_factors(numbers: &(impl Fetch<f32> + ?Sized), number_count: u32, element: usize) -> u32 {
    packed(numbers, number_count, element, f16_bits_or_nan)
}

#[inline(always)]
fn packed(numbers: &(impl Fetch<f32> + ?Sized), number_count: u32, element: usize, bits: impl Fn(f32) -> u32) -> u32 {
    let lower = bits(numbers.fetch(2 * element));
    if 2 * element + 1 < number_count as usize { lower | bits(numbers.fetch(2 * element + 1)) << 16 } else { lower }
}

/// Words that this many numbers take.
#[inline]
pub const fn word_count(number_count: u32) -> u32 {
    number_count.div_ceil(2)
}
