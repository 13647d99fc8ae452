//! Reading and writing without a panic: a panic would end an invocation for which others of its workgroup wait.
#![allow(unsafe_code)]

use crate::tile::wait_for_all;
use spirv_std::arch::IndexUnchecked;
use viewfuse_core::fetch::Fetch;
use viewfuse_kernels::store::Store;
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
