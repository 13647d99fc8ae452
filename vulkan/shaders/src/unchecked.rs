//! Reading and writing without a panic: a panic would end an invocation for which others of its workgroup wait.
#![allow(unsafe_code)]

use crate::tile::wait_for_all;
use spirv_std::arch::IndexUnchecked;
use spirv_std::glam::{UVec2, Vec4};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::half_precision::f16_value;
use viewfuse_kernels::network::tile::Fours;
use viewfuse_kernels::store::{Store, StoreFours};
use viewfuse_kernels::workgroup::Workgroup;

/// An array with at least one element; an index beyond its end reads the last one.
#[derive(Clone, Copy)]
pub(crate) struct Endless<'a, T>(pub(crate) &'a [T]);

impl<T: Copy> Fetch<T> for Endless<'_, T> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        // SAFETY: the list of kernels demands an element of the arrays that kernels read so.
        unsafe { *self.0.index_unchecked(index.min(self.0.len() - 1)) }
    }
}

impl Fours for Endless<'_, f32> {}

/// An array of whole fours of numbers, at least one; an index beyond its end reads the last four.
#[derive(Clone, Copy)]
pub(crate) struct EndlessFours<'a>(pub(crate) &'a [Vec4]);

impl Fetch<f32> for EndlessFours<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        let four = self.four(index as u32);
        let [near, far] = if index & 1 == 0 { [four.x, four.z] } else { [four.y, four.w] };
        if index & 2 == 0 { near } else { far }
    }
}

impl Fours for EndlessFours<'_> {
    #[inline(always)]
    fn four(&self, index: u32) -> Vec4 {
        Endless(self.0).fetch((index / 4) as usize)
    }
}

/// An array of whole fours of numbers in half precision, at least one; an index beyond its end reads the last four.
#[derive(Clone, Copy)]
pub(crate) struct EndlessHalves<'a>(pub(crate) &'a [UVec2]);

impl Fetch<f32> for EndlessHalves<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        let [near, far] = self.four_halves(index as u32);
        f16_value(if index & 2 == 0 { near } else { far } >> (index as u32 % 2 * 16))
    }
}

impl Fours for EndlessHalves<'_> {
    #[inline(always)]
    fn four_halves(&self, index: u32) -> [u32; 2] {
        let UVec2 { x, y } = Endless(self.0).fetch((index / 4) as usize);
        [x, y]
    }
}

/// An array of which an element is written only if it exists.
pub(crate) struct Unchecked<'a, T>(pub(crate) &'a mut [T]);

impl<T> Store<T> for Unchecked<'_, T> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: T) {
        if index < self.0.len() {
            // SAFETY: just looked.
            unsafe { *self.0.index_unchecked_mut(index) = value };
        }
    }
}

impl StoreFours for Unchecked<'_, f32> {}

/// An array of whole fours of numbers, of which a four is written only if it exists.
pub(crate) struct UncheckedFours<'a>(pub(crate) &'a mut [Vec4]);

impl Store<f32> for UncheckedFours<'_> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: f32) {
        if index / 4 < self.0.len() {
            // SAFETY: just looked.
            let four = unsafe { self.0.index_unchecked_mut(index / 4) };
            match index % 4 {
                0 => four.x = value,
                1 => four.y = value,
                2 => four.z = value,
                _ => four.w = value,
            }
        }
    }
}

impl StoreFours for UncheckedFours<'_> {
    #[inline(always)]
    fn store_four(&mut self, index: usize, values: Vec4) {
        Unchecked(&mut *self.0).store(index / 4, values);
    }
}

/// The memory of a workgroup that computes an element together.
pub(crate) struct Together<'a, const N: usize>(pub(crate) &'a mut [u32; N]);

impl<const N: usize> Workgroup for Together<'_, N> {
    #[inline(always)]
    fn put_word(&mut self, index: usize, word: u32) {
        // SAFETY: within the array for all indices.
        unsafe { *self.0.index_unchecked_mut(index.min(N - 1)) = word };
    }

    #[inline(always)]
    fn word(&self, index: usize) -> u32 {
        // SAFETY: within the array for all indices.
        unsafe { *self.0.index_unchecked(index.min(N - 1)) }
    }

    #[inline(always)]
    fn wait(&mut self) {
        wait_for_all();
    }
}
