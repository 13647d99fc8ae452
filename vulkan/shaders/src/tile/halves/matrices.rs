//! The matrices of `SPV_KHR_cooperative_matrix`.
//!
//! `spirv_std` has their type and their product. Loading eights of f16 from memory of `u32` vectors and storing sums
//! there are instructions, written out.
#![allow(unsafe_code)]

use super::Units;
use core::arch::asm;
use core::mem::MaybeUninit;
use spirv_std::arch::IndexUnchecked;
use spirv_std::cooperative_matrix::{CooperativeMatrix, MATRIX_A, MATRIX_ACCUMULATOR, MATRIX_B, mul_add};
use spirv_std::float::vec2_to_f16x2;
use spirv_std::glam::{UVec4, Vec2};

#[derive(Clone, Copy)]
pub(crate) struct Matrices;

impl Units for Matrices {
    type Rows = CooperativeMatrix<f16, MATRIX_A, 16, 16>;
    type Columns = CooperativeMatrix<f16, MATRIX_B, 16, 16>;
    type Sums = CooperativeMatrix<f32, MATRIX_ACCUMULATOR, 16, 16>;

    /// The device rounds.
    #[inline(always)]
    fn pair(a: f32, b: f32) -> u32 {
        vec2_to_f16x2(Vec2::new(a, b))
    }

    #[inline(always)]
    fn zero() -> Self::Sums {
        let mut out = MaybeUninit::<Self::Sums>::uninit();
        // SAFETY: every number of the matrix is 0.
        unsafe {
            asm!(
                "%f32 = OpTypeFloat 32",
                "%zero = OpConstant %f32 0",
                "%sums = OpCompositeConstruct typeof* {out} %zero",
                "OpStore {out} %sums",
                out = in(reg) out.as_mut_ptr(),
            );
            out.assume_init()
        }
    }

    #[inline(always)]
    fn rows<const N: usize>(shared: &[UVec4; N], at: u32, stride: u32) -> Self::Rows {
        let mut out = MaybeUninit::<Self::Rows>::uninit();
        // SAFETY: the matrix is within the array (`Sizes::shared`); layout 0 is row after row.
        unsafe {
            asm!(
                "%u32 = OpTypeInt 32 0",
                "%layout = OpConstant %u32 0",
                "%matrix = OpCooperativeMatrixLoadKHR typeof* {out} {from} %layout {stride}",
                "OpStore {out} %matrix",
                from = in(reg) shared.index_unchecked(at as usize),
                stride = in(reg) stride,
                out = in(reg) out.as_mut_ptr(),
            );
            out.assume_init()
        }
    }

    #[inline(always)]
    fn columns<const N: usize>(shared: &[UVec4; N], at: u32, stride: u32) -> Self::Columns {
        let mut out = MaybeUninit::<Self::Columns>::uninit();
        // SAFETY: as in `rows`.
        unsafe {
            asm!(
                "%u32 = OpTypeInt 32 0",
                "%layout = OpConstant %u32 0",
                "%matrix = OpCooperativeMatrixLoadKHR typeof* {out} {from} %layout {stride}",
                "OpStore {out} %matrix",
                from = in(reg) shared.index_unchecked(at as usize),
                stride = in(reg) stride,
                out = in(reg) out.as_mut_ptr(),
            );
            out.assume_init()
        }
    }

    #[inline(always)]
    fn add<const N: usize>(
        sums: Self::Sums,
        rows: Self::Rows,
        columns: Self::Columns,
        _: &[UVec4; N],
        _: u32,
    ) -> Self::Sums {
        mul_add(rows, columns, sums)
    }

    #[inline(always)]
    fn store<const N: usize>(sums: Self::Sums, shared: &mut [UVec4; N], at: u32, stride: u32, _: u32) {
        // SAFETY: as in `rows`.
        unsafe {
            asm!(
                "%u32 = OpTypeInt 32 0",
                "%layout = OpConstant %u32 0",
                "%matrix = OpLoad _ {sums}",
                "OpCooperativeMatrixStoreKHR {to} %matrix %layout {stride}",
                to = in(reg) shared.index_unchecked_mut(at as usize),
                sums = in(reg) &sums,
                stride = in(reg) stride,
            );
        }
    }
}
