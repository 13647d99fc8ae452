//! Products by the matrix units of a device: factors in f16, sums in f32
//! ([`Form::Half`](viewfuse_kernels::rows::Form::Half), [`Form::TwoHalves`](viewfuse_kernels::rows::Form::TwoHalves)).
//!
//! A workgroup has four subgroups of 32 invocations, two times two, each of which has a quarter of the tile: matrices
//! of 16 times 16 sums. For each step along the inner index the workgroup rounds its rows of the left matrix and its
//! columns of the right one into its memory, while the next step's numbers are on their way. Beyond the inner index
//! both are 0; beyond rows and columns the last one is read and nothing is stored.
//!
//! A factor is rounded by its bits, so that no driver takes what is missing for 0. In two parts a factor is
//! `high + low / 2048`: `high` is the nearest f16, or 0 below 2^-14, and `low` the nearest f16 of 2048 times what is
//! missing. One sum has the products of `high`, another one those of a `high` and a `low`.
//!
//! f16 ends at 65,504. A factor beyond that is NaN, which no sum and no rectifier hides: results are never wrong
//! silently.

#[cfg(target_arch = "spirv")]
mod matrices;
mod stand_ins;

#[cfg(target_arch = "spirv")]
pub(crate) use matrices::Matrices;
pub(crate) use stand_ins::StandIns;

use super::{fetch_columns, wait_for_all};
use core::marker::PhantomData;
use spirv_std::arch::IndexUnchecked;
use spirv_std::float::vec2_to_f16x2;
use spirv_std::glam::{UVec4, Vec2, Vec4};
use viewfuse_kernels::network::tile::{Left, Shape, Tiles};
use viewfuse_kernels::rows::Form;

/// Inner indices of a step.
const STEP: u32 = 32;
/// Invocations of a workgroup, and of a subgroup.
const INVOCATIONS: u32 = Form::Half.invocations();
const SUBGROUP: u32 = 32;
/// From a row of the left matrix to the next in the workgroup's memory, in eights of f16: odd, for the banks.
const LEFT_STRIDE: u32 = STEP / 8 + 1;
/// The largest f16.
const LARGEST: u32 = 65_504.0_f32.to_bits();
/// The least normal f16.
const LEAST: u32 = (1.0_f32 / 16_384.0).to_bits();
/// What is missing is multiplied by this, so that it is as large as the number.
const LOW: f32 = 2048.0;

/// Matrices of 16 times 16 numbers that a subgroup has together.
pub(crate) trait Units: Copy {
    /// f16, `[row][inner]`.
    type Rows: Copy;
    /// f16, `[inner][column]`.
    type Columns: Copy;
    /// f32, `[row][column]`.
    type Sums: Copy;

    fn zero() -> Self::Sums;

    /// Loads a matrix from the workgroup's memory, where a row begins at `at` and the next one `stride` further.
    fn rows<const N: usize>(shared: &[UVec4; N], at: u32, stride: u32) -> Self::Rows;

    fn columns<const N: usize>(shared: &[UVec4; N], at: u32, stride: u32) -> Self::Columns;

    /// The sums, and the products of the others.
    fn add<const N: usize>(
        sums: Self::Sums,
        rows: Self::Rows,
        columns: Self::Columns,
        shared: &[UVec4; N],
        lane: u32,
    ) -> Self::Sums;

    /// Stores the bits of the sums.
    fn store<const N: usize>(sums: Self::Sums, shared: &mut [UVec4; N], at: u32, stride: u32, lane: u32);
}

/// From an inner index of the right matrix to the next, in eights.
const fn right_stride(form: Form) -> u32 {
    form.side() / 8 + 1
}

/// Eights of a tile's matrices in the workgroup's memory: the left one, then the right one, for each part.
const fn part_eights(form: Form) -> [u32; 2] {
    [form.side() * LEFT_STRIDE, STEP * right_stride(form)]
}

/// Fours of a row of a subgroup's sums, and one more for the banks.
const fn sums_stride(form: Form) -> u32 {
    form.side() / 2 / 4 + 1
}

/// The workgroup's memory: a step, and at the end 16 rows of sums of each subgroup.
const fn shared_eights(form: Form, parts: u32) -> usize {
    let [left, right] = part_eights(form);
    let step = parts * (left + right);
    assert!(step >= parts * 4 * 16 * sums_stride(form) && step as usize * size_of::<UVec4>() <= form.shared_bytes());
    step as usize
}

pub(crate) type SharedOfHalf = [UVec4; shared_eights(Form::Half, 1)];
pub(crate) type SharedOfTwoHalves = [UVec4; shared_eights(Form::TwoHalves, 2)];

/// Eight numbers of a row, next to one another.
type Eight = [Vec4; 2];

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

/// Two numbers as f16.
#[inline(always)]
fn pair(a: f32, b: f32) -> u32 {
    // What is rounded already is not rounded again, whatever the device's rounding is.
    vec2_to_f16x2(Vec2::new(rounded(a), rounded(b))) | too_large(a) | too_large(b) << 16
}

#[inline(always)]
fn packed([a, b]: Eight) -> UVec4 {
    UVec4::new(pair(a.x, a.y), pair(a.z, a.w), pair(b.x, b.y), pair(b.z, b.w))
}

/// The part that an f16 has: 0 for what is too small for a normal one.
#[inline(always)]
fn high(number: f32) -> f32 {
    if number.to_bits() & 0x7fff_ffff < LEAST { 0.0 } else { rounded(number) }
}

#[inline(always)]
fn high_four(four: Vec4) -> Vec4 {
    Vec4::new(high(four.x), high(four.y), high(four.z), high(four.w))
}

#[inline(always)]
#[allow(unsafe_code)]
fn read<const N: usize>(shared: &[UVec4; N], place: u32) -> UVec4 {
    // SAFETY: places are those that the array was made for (`shared_eights`).
    unsafe { *shared.index_unchecked(place as usize) }
}

#[inline(always)]
#[allow(unsafe_code)]
fn write<const N: usize>(shared: &mut [UVec4; N], place: u32, value: UVec4) {
    // SAFETY: as in `read`.
    unsafe { *shared.index_unchecked_mut(place as usize) = value };
}

#[inline(always)]
fn numbers(bits: UVec4) -> Vec4 {
    Vec4::new(f32::from_bits(bits.x), f32::from_bits(bits.y), f32::from_bits(bits.z), f32::from_bits(bits.w))
}

/// Writes a part of eight numbers, and the other part `low` further if there are two.
#[inline(always)]
fn put<const TWO: bool, const N: usize>(shared: &mut [UVec4; N], place: u32, low: u32, eight: Eight) {
    if TWO {
        let [a, b] = eight;
        let high = [high_four(a), high_four(b)];
        // Too large a number is NaN in this part, whatever the other one is.
        let UVec4 { x, y, z, w } = packed(high);
        let large = |a: f32, b: f32| too_large(a) | too_large(b) << 16;
        let bits = UVec4::new(x | large(a.x, a.y), y | large(a.z, a.w), z | large(b.x, b.y), w | large(b.z, b.w));
        write(shared, place, bits);
        write(shared, place + low, packed([(a - high[0]) * LOW, (b - high[1]) * LOW]));
    } else {
        write(shared, place, packed(eight));
    }
}

/// Eight numbers of a row from an inner index on, 0 beyond the matrix.
#[inline(always)]
fn fetch_row<L: Left>(left: L, row: u32, first: u32, shape: Shape) -> Eight {
    let row = left.row(row.min(shape.row_count - 1));
    let number = move |inner: u32| {
        let number = left.number(row, left.inner(inner));
        if inner < shape.inner_count { number } else { 0.0 }
    };
    [
        Vec4::new(number(first), number(first + 1), number(first + 2), number(first + 3)),
        Vec4::new(number(first + 4), number(first + 5), number(first + 6), number(first + 7)),
    ]
}

/// Eight numbers of an inner index from a column on, 0 beyond the matrix.
#[inline(always)]
fn fetch_eight(right: impl Fn(u32, u32) -> f32 + Copy, inner: u32, first: u32, shape: Shape) -> Eight {
    let column = move |more: u32| (first + more).min(shape.column_count - 1);
    let fours = [[column(0), column(1), column(2), column(3)], [column(4), column(5), column(6), column(7)]];
    [fetch_columns(right, inner, fours[0], shape), fetch_columns(right, inner, fours[1], shape)]
}

/// Blocks once for each number, with the number as a constant: only so an array stays in registers.
macro_rules! unroll {
    ($i:ident in [$($n:literal)*] $body:block) => { $({ const $i: usize = $n; $body })* };
}

/// A form: its shared memory, its parts, and the numbers of a subgroup's matrices below and beside one another.
macro_rules! form {
    ($(#[$doc:meta])* $Form:ident, $Shared:ident, two parts $two:literal, matrices [$($i:literal)*]) => {
        $(#[$doc])*
        pub(crate) struct $Form<'a, U> {
            pub(crate) units: PhantomData<U>,
            pub(crate) shared: &'a mut $Shared,
            /// The subgroup's number in the workgroup, and the invocation's number in it.
            pub(crate) subgroup: u32,
            pub(crate) lane: u32,
        }

        impl<U: Units> Tiles for $Form<'_, U> {
            #[inline(always)]
            fn multiply<L: Left>(
                self,
                invocation: u32,
                shape: Shape,
                left: L,
                right: impl Fn(u32, u32) -> f32 + Copy,
                mut store: impl FnMut(u32, u32, f32),
            ) {
                const FORM: Form = Form::$Form;
                const SIDE: u32 = FORM.side();
                const MATRICES: usize = [$($i),*].len();
                const RIGHT_STRIDE: u32 = right_stride(FORM);
                const LEFT: u32 = part_eights(FORM)[0];
                const RIGHT: u32 = part_eights(FORM)[1];
                const PARTS: u32 = if $two { 2 } else { 1 };
                // Rows between two that an invocation fetches, and inner indices.
                const ROWS: u32 = INVOCATIONS / (STEP / 8);
                const INNERS: u32 = INVOCATIONS / (SIDE / 8);
                const { assert!(MATRICES as u32 * 32 == SIDE && MATRICES as u32 * ROWS == SIDE) };
                const { assert!(MATRICES as u32 * INNERS == STEP) };

                let $Form { units: _, shared, subgroup, lane } = self;
                let (group, own) = (invocation / INVOCATIONS, invocation % INVOCATIONS);
                let across = shape.column_count.div_ceil(SIDE);
                let (first_row, first_column) = (group / across * SIDE, group % across * SIDE);
                let (own_row, own_column) = (subgroup / 2 * (SIDE / 2), subgroup % 2 * (SIDE / 2));
                let (row, row_inner) = (own / (STEP / 8), own % (STEP / 8));
                let (column_inner, column) = (own / (SIDE / 8), own % (SIDE / 8));
                let row_place = row * LEFT_STRIDE + row_inner;
                let column_place = PARTS * LEFT + column_inner * RIGHT_STRIDE + column;

                let fetch_rows = move |start: u32| {
                    [$(fetch_row(left, first_row + row + $i * ROWS, start + row_inner * 8, shape)),*]
                };
                let fetch_columns = move |start: u32| {
                    [$(fetch_eight(right, start + column_inner + $i * INNERS, first_column + column * 8, shape)),*]
                };
                let (rows, columns) = (fetch_rows(0), fetch_columns(0));
                $(put::<$two, _>(shared, row_place + $i * ROWS * LEFT_STRIDE, LEFT, rows[$i]);)*
                $(put::<$two, _>(shared, column_place + $i * INNERS * RIGHT_STRIDE, RIGHT, columns[$i]);)*
                wait_for_all();

                let mut sums = [[U::zero(); MATRICES]; MATRICES];
                // Of a high part and a low one.
                let mut rest = [[U::zero(); MATRICES]; MATRICES];
                let mut start = 0;
                while start < shape.inner_count {
                    // Beyond the last step these are zeros, which nobody reads.
                    let (rows, columns) = (fetch_rows(start + STEP), fetch_columns(start + STEP));
                    unroll!(HALF in [0 1] {
                        let left_at = own_row * LEFT_STRIDE + HALF as u32 * 2;
                        let right_at = PARTS * LEFT + HALF as u32 * 16 * RIGHT_STRIDE + own_column / 8;
                        let high = [$(U::rows(shared, left_at + $i * 16 * LEFT_STRIDE, LEFT_STRIDE)),*];
                        // The same again where there is one part, and not used.
                        let low_at = left_at + (PARTS - 1) * LEFT;
                        let low = [$(U::rows(shared, low_at + $i * 16 * LEFT_STRIDE, LEFT_STRIDE)),*];
                        unroll!(J in [$($i)*] {
                            let columns = U::columns(shared, right_at + J as u32 * 2, RIGHT_STRIDE);
                            if $two {
                                let low_columns = U::columns(shared, right_at + RIGHT + J as u32 * 2, RIGHT_STRIDE);
                                $(rest[$i][J] = U::add(rest[$i][J], low[$i], columns, shared, lane);)*
                                $(rest[$i][J] = U::add(rest[$i][J], high[$i], low_columns, shared, lane);)*
                            }
                            $(sums[$i][J] = U::add(sums[$i][J], high[$i], columns, shared, lane);)*
                        });
                    });
                    wait_for_all();
                    $(put::<$two, _>(shared, row_place + $i * ROWS * LEFT_STRIDE, LEFT, rows[$i]);)*
                    $(put::<$two, _>(shared, column_place + $i * INNERS * RIGHT_STRIDE, RIGHT, columns[$i]);)*
                    wait_for_all();
                    start += STEP;
                }

                // 16 rows of each subgroup's sums at a time go through the memory.
                const STRIDE: u32 = sums_stride(FORM);
                const FOURS: u32 = SIDE / 2 / 4;
                let patch = subgroup * PARTS * 16 * STRIDE;
                unroll!(I in [$($i)*] {
                    $(U::store(sums[I][$i], shared, patch + $i * 4, STRIDE, lane);)*
                    if $two {
                        $(U::store(rest[I][$i], shared, patch + 16 * STRIDE + $i * 4, STRIDE, lane);)*
                    }
                    wait_for_all();
                    let mut index = lane;
                    while index < 16 * FOURS {
                        let place = patch + index / FOURS * STRIDE + index % FOURS;
                        let mut sum = numbers(read(shared, place));
                        if $two {
                            sum += numbers(read(shared, place + 16 * STRIDE)) * (1.0 / LOW);
                        }
                        let row = first_row + own_row + I as u32 * 16 + index / FOURS;
                        let column = first_column + own_column + index % FOURS * 4;
                        let mut store_one = |column: u32, sum: f32| {
                            if row < shape.row_count && column < shape.column_count {
                                store(row, column, sum);
                            }
                        };
                        store_one(column, sum.x);
                        store_one(column + 1, sum.y);
                        store_one(column + 2, sum.z);
                        store_one(column + 3, sum.w);
                        index += SUBGROUP;
                    }
                    wait_for_all();
                });
            }
        }
    };
}

form! {
    /// Factors of one f16.
    Half, SharedOfHalf, two parts false, matrices [0 1 2 3]
}
form! {
    /// Factors in two parts.
    TwoHalves, SharedOfTwoHalves, two parts true, matrices [0 1]
}
