//! Products by the matrix units of a device: factors in f16, sums in f32
//! ([`Form::Half`](viewfuse_kernels::rows::Form::Half), [`Form::TwoHalves`](viewfuse_kernels::rows::Form::TwoHalves)
//! and their smaller tiles), of matrices that lie in fours.
//!
//! A workgroup has subgroups of 32 invocations below, beside and behind one another, each of which has a part of the
//! tile, in matrices of 16 times 16 sums; those behind one another have the same part and other inner indices. For each
//! step along the inner index the workgroup rounds its rows of the left matrix and its columns of the right one into
//! its memory, while the next step's numbers are on their way; in one part the right one lies in f16 already, since it
//! is read again by each tile below another. Beyond the inner index both are 0; beyond rows and columns the last ones
//! are read and nothing is stored.
//!
//! In two parts a factor is `high + low / 2048`: `high` is the nearest f16, or 0 below 2^-14, and `low` the nearest f16
//! of 2048 times what is missing. One sum has the products of `high`, another one those of a `high` and a `low`. The
//! high part is rounded by its bits, so that no driver takes what is missing for 0.
//!
//! f16 ends at 65,504. A factor beyond that is infinite, and so is no sum of others: a sum that is not finite is NaN,
//! which no rectifier hides. Results are never wrong silently.

/// Blocks once for each number, with the number as a constant: only so an array stays in registers.
macro_rules! unroll {
    ($i:ident in [$($n:literal)*] $body:block) => { $({ const $i: usize = $n; $body })* };
}

#[cfg(target_arch = "spirv")]
mod matrices;
mod repeated;
mod stand_ins;

#[cfg(target_arch = "spirv")]
pub(crate) use matrices::Matrices;
pub(crate) use repeated::{Repeated, SharedOfRepeated};
pub(crate) use stand_ins::StandIns;

use super::wait_for_all;
use core::marker::PhantomData;
use spirv_std::arch::IndexUnchecked;
use spirv_std::glam::{UVec4, Vec4};
use viewfuse_kernels::network::tile::{Left, Loaded, Outputs, Right, Shape, Tiles};
use viewfuse_kernels::rows::Form;

const SUBGROUP: u32 = 32;
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

    /// Two numbers as the nearest f16, the first in the lower half; what is too large is not finite.
    fn pair(a: f32, b: f32) -> u32;

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

/// The sizes of a form.
#[derive(Clone, Copy)]
struct Sizes {
    form: Form,
    /// f16 of a factor.
    parts: u32,
    /// Inner indices of a step.
    step: u32,
    /// Subgroups below, beside and behind one another.
    subgroups: [u32; 3],
}

impl Sizes {
    /// From a row of the left matrix to the next in the workgroup's memory, in eights of f16: odd, for the banks.
    const fn left_stride(self) -> u32 {
        self.step / 8 + 1
    }

    /// From an inner index of the right matrix to the next.
    const fn right_stride(self) -> u32 {
        self.form.columns() / 8 + 1
    }

    /// Eights of a part of the left matrix, and of the right one.
    const fn left(self) -> u32 {
        self.form.rows() * self.left_stride()
    }

    const fn right(self) -> u32 {
        self.step * self.right_stride()
    }

    /// Rows and columns of a subgroup.
    const fn of_subgroup(self) -> [u32; 2] {
        [self.form.rows() / self.subgroups[0], self.form.columns() / self.subgroups[1]]
    }

    /// Fours of a row of a subgroup's sums, and one more for the banks.
    const fn sums_stride(self) -> u32 {
        self.of_subgroup()[1] / 4 + 1
    }

    /// The workgroup's memory: a step, and at the end 16 rows of sums of each subgroup.
    const fn shared(self) -> usize {
        let [down, across, behind] = self.subgroups;
        assert!(down * across * behind * SUBGROUP == self.form.invocations());
        let step = self.parts * (self.left() + self.right());
        assert!(step >= self.parts * down * across * behind * 16 * self.sums_stride());
        assert!(step as usize * size_of::<UVec4>() <= self.form.shared_bytes());
        step as usize
    }
}

/// Eight numbers of a row, next to one another.
type Eight = [Vec4; 2];

#[inline(always)]
fn packed<U: Units>([a, b]: Eight) -> UVec4 {
    UVec4::new(U::pair(a.x, a.y), U::pair(a.z, a.w), U::pair(b.x, b.y), U::pair(b.z, b.w))
}

/// The part that an f16 has (of two equally near ones, the larger): 0 for what is too small for a normal one.
#[inline(always)]
fn high(number: f32) -> f32 {
    let bits = number.to_bits();
    if bits & 0x7fff_ffff < LEAST { 0.0 } else { f32::from_bits(bits.wrapping_add(0x1000) & 0xffff_e000) }
}

#[inline(always)]
fn high_four(four: Vec4) -> Vec4 {
    Vec4::new(high(four.x), high(four.y), high(four.z), high(four.w))
}

/// A sum, or NaN where it is not finite.
#[inline(always)]
fn finite(sum: f32) -> f32 {
    if sum.to_bits() & 0x7f80_0000 == 0x7f80_0000 { f32::NAN } else { sum }
}

#[inline(always)]
#[allow(unsafe_code)]
fn read<const N: usize>(shared: &[UVec4; N], place: u32) -> UVec4 {
    // SAFETY: places are those that the array was made for (`Sizes::shared`).
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
fn put<U: Units, const TWO: bool, const N: usize>(shared: &mut [UVec4; N], place: u32, low: u32, eight: Eight) {
    if TWO {
        let [a, b] = eight;
        let high = [high_four(a), high_four(b)];
        write(shared, place, packed::<U>(high));
        write(shared, place + low, packed::<U>([(a - high[0]) * LOW, (b - high[1]) * LOW]));
    } else {
        write(shared, place, packed::<U>(eight));
    }
}

/// Loads eight numbers of a row from the inner index on whose place is given.
#[inline(always)]
fn fetch_row<L: Left>(left: L, row: L::Row, place: L::Inner) -> [Loaded; 2] {
    [left.four(row, place), left.four(row, left.moved(place, 4))]
}

/// They themselves, `first` being their first inner index; 0 beyond the matrix, which a step may reach if it is `last`.
#[inline(always)]
fn finished_row<L: Left>(left: L, is_last: bool, first: u32, [near, far]: [Loaded; 2], shape: Shape) -> Eight {
    let (near, far) = (left.finished(near), left.finished(far));
    if !is_last {
        return [near, far];
    }
    [
        if first < shape.inner_count { near } else { Vec4::ZERO },
        if first + 4 < shape.inner_count { far } else { Vec4::ZERO },
    ]
}

/// Eight numbers of an inner index from a column on, as they are loaded.
trait Columns: Copy {
    const ZERO: Self;

    fn fetch(right: impl Right, inner: u32, first: u32, shape: Shape) -> Self;

    /// Writes them into the workgroup's memory, a low part `low` further if there are two.
    fn put<U: Units, const N: usize>(self, shared: &mut [UVec4; N], place: u32, low: u32);

    /// They themselves, 0 beyond the inner indices.
    #[inline(always)]
    fn finished(self, is_last: bool, inner: u32, shape: Shape) -> Self {
        if is_last && inner >= shape.inner_count { Self::ZERO } else { self }
    }
}

/// Both fours of eight columns: beyond the matrix the last one, again.
#[inline(always)]
fn fours(first: u32, shape: Shape) -> [u32; 2] {
    let last = shape.column_count - 4;
    [first.min(last), (first + 4).min(last)]
}

/// Of a form of two parts.
impl Columns for Eight {
    const ZERO: Eight = [Vec4::ZERO; 2];

    #[inline(always)]
    fn fetch(right: impl Right, inner: u32, first: u32, shape: Shape) -> Eight {
        let [near, far] = fours(first, shape);
        [right.four(inner, near), right.four(inner, far)]
    }

    #[inline(always)]
    fn put<U: Units, const N: usize>(self, shared: &mut [UVec4; N], place: u32, low: u32) {
        put::<U, true, N>(shared, place, low, self);
    }
}

/// Of a form of one part: they lie in f16.
impl Columns for UVec4 {
    const ZERO: UVec4 = UVec4::ZERO;

    #[inline(always)]
    fn fetch(right: impl Right, inner: u32, first: u32, shape: Shape) -> UVec4 {
        let [near, far] = fours(first, shape);
        let ([a, b], [c, d]) = (right.four_halves(inner, near), right.four_halves(inner, far));
        UVec4::new(a, b, c, d)
    }

    #[inline(always)]
    fn put<U: Units, const N: usize>(self, shared: &mut [UVec4; N], place: u32, _: u32) {
        write(shared, place, self);
    }
}

/// A form: its shared memory, its parts, its subgroups, inner indices of a step and what a subgroup multiplies of them,
/// what an invocation fetches of each matrix, and a subgroup's matrices below and beside one another.
macro_rules! form {
    (
        $(#[$doc:meta])* $Form:ident, $Shared:ident, two parts $two:literal, columns $Columns:ty, subgroups $subgroups:expr,
        step $step:literal in [$($chunk:literal)*], fetches [$($l:literal)*], matrices [$($i:literal)*] x [$($j:literal)*]
    ) => {
        $(#[$doc])*
        pub(crate) struct $Form<'a, U> {
            pub(crate) units: PhantomData<U>,
            pub(crate) shared: &'a mut $Shared,
            /// The subgroup's number in the workgroup, and the invocation's number in it.
            pub(crate) subgroup: u32,
            pub(crate) lane: u32,
        }

        pub(crate) type $Shared = [UVec4; $Form::<StandIns>::SIZES.shared()];

        impl<U> $Form<'_, U> {
            const SIZES: Sizes =
                Sizes { form: Form::$Form, parts: if $two { 2 } else { 1 }, step: $step, subgroups: $subgroups };
        }

        impl<U: Units> Tiles for $Form<'_, U> {
            // Some forms have one subgroup beside or behind another.
            #[allow(clippy::modulo_one)]
            #[inline(always)]
            fn multiply<L: Left>(
                self,
                invocation: u32,
                shape: Shape,
                left: L,
                right: impl Right,
                mut outputs: impl Outputs,
            ) {
                const SIZES: Sizes = $Form::<StandIns>::SIZES;
                const FORM: Form = SIZES.form;
                const ROWS: u32 = FORM.rows();
                const COLUMNS: u32 = FORM.columns();
                const INVOCATIONS: u32 = FORM.invocations();
                const ACROSS: u32 = SIZES.subgroups[1];
                const BEHIND: u32 = SIZES.subgroups[2];
                const OWN_ROWS: u32 = SIZES.of_subgroup()[0];
                const OWN_COLUMNS: u32 = SIZES.of_subgroup()[1];
                const STEP: u32 = SIZES.step;
                const PARTS: u32 = SIZES.parts;
                const LEFT: u32 = SIZES.left();
                const RIGHT: u32 = SIZES.right();
                const LEFT_STRIDE: u32 = SIZES.left_stride();
                const RIGHT_STRIDE: u32 = SIZES.right_stride();
                // Rows between two that an invocation fetches, and inner indices.
                const NEXT_ROW: u32 = INVOCATIONS / (STEP / 8);
                const NEXT_INNER: u32 = INVOCATIONS / (COLUMNS / 8);
                const FETCHES: u32 = [$($l),*].len() as u32;
                const DOWN_MATRICES: usize = [$($i),*].len();
                const ACROSS_MATRICES: usize = [$($j),*].len();
                const { assert!(FETCHES * NEXT_ROW == ROWS && FETCHES * NEXT_INNER == STEP) };
                const { assert!(DOWN_MATRICES as u32 * 16 == OWN_ROWS && ACROSS_MATRICES as u32 * 16 == OWN_COLUMNS) };
                const { assert!([$($chunk),*].len() as u32 * BEHIND * 16 == STEP) };

                let $Form { units: _, shared, subgroup, lane } = self;
                let (group, local) = (invocation / INVOCATIONS, invocation % INVOCATIONS);
                let group_columns = shape.column_count.div_ceil(COLUMNS);
                let (first_row, first_column) = (group / group_columns * ROWS, group % group_columns * COLUMNS);
                let behind = subgroup % BEHIND;
                let own_row = subgroup / BEHIND / ACROSS * OWN_ROWS;
                let own_column = subgroup / BEHIND % ACROSS * OWN_COLUMNS;
                let (row, row_inner) = (local / (STEP / 8), local % (STEP / 8) * 8);
                let (column_inner, column) = (local / (COLUMNS / 8), local % (COLUMNS / 8));
                let row_place = row * LEFT_STRIDE + row_inner / 8;
                let column_place = PARTS * LEFT + column_inner * RIGHT_STRIDE + column;

                let own_rows = [$(left.row((first_row + row + $l * NEXT_ROW).min(shape.row_count - 1))),*];
                let fetch_rows = move |place: L::Inner| [$(fetch_row(left, own_rows[$l], place)),*];
                let fetch_columns = move |start: u32| {
                    let first = start + column_inner;
                    [$(<$Columns>::fetch(right, first + $l * NEXT_INNER, first_column + column * 8, shape)),*]
                };
                let mut place = left.inner(row_inner);
                let (rows, columns) = (fetch_rows(place), fetch_columns(0));
                let is_last = STEP > shape.inner_count;
                $(
                    let eight = finished_row(left, is_last, row_inner, rows[$l], shape);
                    put::<U, $two, _>(shared, row_place + $l * NEXT_ROW * LEFT_STRIDE, LEFT, eight);
                )*
                $(
                    let eight = columns[$l].finished(is_last, column_inner + $l * NEXT_INNER, shape);
                    eight.put::<U, _>(shared, column_place + $l * NEXT_INNER * RIGHT_STRIDE, RIGHT);
                )*
                wait_for_all();

                let mut sums = [[U::zero(); ACROSS_MATRICES]; DOWN_MATRICES];
                // Of a high part and a low one.
                let mut rest = [[U::zero(); ACROSS_MATRICES]; DOWN_MATRICES];
                let mut start = 0;
                while start < shape.inner_count {
                    // Beyond the last step nobody reads these.
                    let next = start + STEP;
                    place = left.moved(place, STEP);
                    let (rows, columns) = (fetch_rows(place), fetch_columns(next));
                    unroll!(CHUNK in [$($chunk)*] {
                        let inner = (CHUNK as u32 * BEHIND + behind) * 16;
                        let left_at = own_row * LEFT_STRIDE + inner / 8;
                        let right_at = PARTS * LEFT + inner * RIGHT_STRIDE + own_column / 8;
                        let high = [$(U::rows(shared, left_at + $i * 16 * LEFT_STRIDE, LEFT_STRIDE)),*];
                        // The same again where there is one part, and not used.
                        let low_at = left_at + (PARTS - 1) * LEFT;
                        let low = [$(U::rows(shared, low_at + $i * 16 * LEFT_STRIDE, LEFT_STRIDE)),*];
                        unroll!(J in [$($j)*] {
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
                    let is_last = next + STEP > shape.inner_count;
                    $(
                        let eight = finished_row(left, is_last, next + row_inner, rows[$l], shape);
                        put::<U, $two, _>(shared, row_place + $l * NEXT_ROW * LEFT_STRIDE, LEFT, eight);
                    )*
                    $(
                        let eight = columns[$l].finished(is_last, next + column_inner + $l * NEXT_INNER, shape);
                        eight.put::<U, _>(shared, column_place + $l * NEXT_INNER * RIGHT_STRIDE, RIGHT);
                    )*
                    wait_for_all();
                    start = next;
                }

                // 16 rows of each subgroup's sums at a time go through the memory.
                const STRIDE: u32 = SIZES.sums_stride();
                const PATCH: u32 = PARTS * 16 * STRIDE;
                const FOURS: u32 = OWN_COLUMNS / 4;
                let patch = subgroup * PATCH;
                // That of the first of those behind one another.
                let patches = (subgroup - behind) * PATCH;
                unroll!(I in [$($i)*] {
                    $(U::store(sums[I][$j], shared, patch + $j * 4, STRIDE, lane);)*
                    if $two {
                        $(U::store(rest[I][$j], shared, patch + 16 * STRIDE + $j * 4, STRIDE, lane);)*
                    }
                    wait_for_all();
                    let mut index = behind * SUBGROUP + lane;
                    while index < 16 * FOURS {
                        let place = index / FOURS * STRIDE + index % FOURS;
                        let (mut sum, mut other) = (Vec4::ZERO, 0);
                        while other < BEHIND {
                            let place = patches + other * PATCH + place;
                            sum += numbers(read(shared, place));
                            if $two {
                                sum += numbers(read(shared, place + 16 * STRIDE)) * (1.0 / LOW);
                            }
                            other += 1;
                        }
                        let row = first_row + own_row + I as u32 * 16 + index / FOURS;
                        let column = first_column + own_column + index % FOURS * 4;
                        if row < shape.row_count && column < shape.column_count {
                            let sums = Vec4::new(finite(sum.x), finite(sum.y), finite(sum.z), finite(sum.w));
                            outputs.put_four(row, column, sums);
                        }
                        index += BEHIND * SUBGROUP;
                    }
                    wait_for_all();
                });
            }
        }
    };
}

form! {
    /// Factors of one f16.
    Half, SharedOfHalf, two parts false, columns UVec4, subgroups [2, 2, 1], step 32 in [0 1], fetches [0 1 2 3],
    matrices [0 1 2 3] x [0 1 2 3]
}
form! {
    /// The same in tiles of a quarter of the size.
    HalfSmall, SharedOfHalfSmall, two parts false, columns UVec4, subgroups [2, 2, 1], step 32 in [0 1], fetches [0 1],
    matrices [0 1] x [0 1]
}
form! {
    /// The same in tiles of a sixteenth of the size.
    HalfTiny, SharedOfHalfTiny, two parts false, columns UVec4, subgroups [1, 1, 4], step 64 in [0], fetches [0 1],
    matrices [0 1] x [0 1]
}
form! {
    /// Factors in two parts.
    TwoHalves, SharedOfTwoHalves, two parts true, columns Eight, subgroups [2, 4, 1], step 32 in [0 1], fetches [0 1],
    matrices [0 1 2 3] x [0 1]
}
form! {
    /// The same in tiles of a quarter of the size.
    TwoHalvesSmall, SharedOfTwoHalvesSmall, two parts true, columns Eight, subgroups [2, 2, 1], step 32 in [0 1], fetches [0 1],
    matrices [0 1] x [0 1]
}
form! {
    /// The same in tiles of a sixteenth of the size.
    TwoHalvesTiny, SharedOfTwoHalvesTiny, two parts true, columns Eight, subgroups [1, 1, 4], step 64 in [0], fetches [0 1],
    matrices [0 1] x [0 1]
}
