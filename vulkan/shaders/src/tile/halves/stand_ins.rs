//! Plain arithmetic in the place of matrix units, for devices that have none: places, barriers and roundings are the
//! same. Factors stay in the workgroup's memory.

use super::{Units, read, write};
use spirv_std::float::vec2_to_f16x2;
use spirv_std::glam::{UVec4, Vec2};
use viewfuse_core::half_precision::f16_value;

#[derive(Clone, Copy)]
pub(crate) struct StandIns;

/// Where a matrix is: its first row, and from a row to the next.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    at: u32,
    stride: u32,
}

/// The largest f16.
const LARGEST: u32 = 65_504.0_f32.to_bits();

/// A number rounded to 11 bits (of two equally near ones, the even one).
#[inline(always)]
fn rounded(number: f32) -> f32 {
    let bits = number.to_bits();
    f32::from_bits(bits.wrapping_add(0xfff + (bits >> 13 & 1)) & 0xffff_e000)
}

/// The bits that make NaN of an f16 if the number is too large for one, or not finite.
#[inline(always)]
fn too_large(number: f32) -> u32 {
    if number.to_bits() & 0x7fff_ffff > LARGEST { 0x7fff } else { 0 }
}

/// A product's number `index` of a row of eights.
#[inline(always)]
fn half<const N: usize>(shared: &[UVec4; N], at: u32, index: u32) -> f32 {
    let eight = read(shared, at + index / 8);
    let pairs = [eight.x, eight.y, eight.z, eight.w];
    let two = index % 8 / 2;
    let pair = if two == 0 {
        pairs[0]
    } else if two == 1 {
        pairs[1]
    } else if two == 2 {
        pairs[2]
    } else {
        pairs[3]
    };
    f16_value(pair >> (index % 2 * 16))
}

impl Units for StandIns {
    type Rows = Place;
    type Columns = Place;
    /// Half a row: an invocation has row `lane / 2`.
    type Sums = [f32; 8];

    /// By the bits: not every driver rounds to the nearest f16.
    #[inline(always)]
    fn pair(a: f32, b: f32) -> u32 {
        vec2_to_f16x2(Vec2::new(rounded(a), rounded(b))) | too_large(a) | too_large(b) << 16
    }

    #[inline(always)]
    fn zero() -> [f32; 8] {
        [0.0; 8]
    }

    #[inline(always)]
    fn rows<const N: usize>(_: &[UVec4; N], at: u32, stride: u32) -> Place {
        Place { at, stride }
    }

    #[inline(always)]
    fn columns<const N: usize>(_: &[UVec4; N], at: u32, stride: u32) -> Place {
        Place { at, stride }
    }

    #[inline(always)]
    fn add<const N: usize>(
        [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h]: [f32; 8],
        rows: Place,
        columns: Place,
        shared: &[UVec4; N],
        lane: u32,
    ) -> [f32; 8] {
        let (row, column) = (rows.at + lane / 2 * rows.stride, columns.at + lane % 2);
        let mut inner = 0;
        while inner < 16 {
            let factor = half(shared, row, inner);
            let eight = read(shared, column + inner * columns.stride);
            a += factor * f16_value(eight.x);
            b += factor * f16_value(eight.x >> 16);
            c += factor * f16_value(eight.y);
            d += factor * f16_value(eight.y >> 16);
            e += factor * f16_value(eight.z);
            f += factor * f16_value(eight.z >> 16);
            g += factor * f16_value(eight.w);
            h += factor * f16_value(eight.w >> 16);
            inner += 1;
        }
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn store<const N: usize>(
        [a, b, c, d, e, f, g, h]: [f32; 8],
        shared: &mut [UVec4; N],
        at: u32,
        stride: u32,
        lane: u32,
    ) {
        let place = at + lane / 2 * stride + lane % 2 * 2;
        write(shared, place, UVec4::new(a.to_bits(), b.to_bits(), c.to_bits(), d.to_bits()));
        write(shared, place + 1, UVec4::new(e.to_bits(), f.to_bits(), g.to_bits(), h.to_bits()));
    }
}
