//! Reading and writing without a panic: a panic would end an invocation for which others of its workgroup wait.
#![allow(unsafe_code)]

use spirv_std::arch::IndexUnchecked;
use viewfuse_core::fetch::Fetch;
use viewfuse_kernels::store::Store;

/// An array with at least one element; an index beyond its end reads the last one.
#[derive(Clone, Copy)]
pub(crate) struct Endless<'a>(pub(crate) &'a [f32]);

impl Fetch<f32> for Endless<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        // SAFETY: the list of kernels demands an element of the arrays that kernels read so.
        unsafe { *self.0.index_unchecked(index.min(self.0.len() - 1)) }
    }
}

/// An array of which an element is written only if it exists.
pub(crate) struct Unchecked<'a>(pub(crate) &'a mut [f32]);

impl Store<f32> for Unchecked<'_> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: f32) {
        if index < self.0.len() {
            // SAFETY: just looked.
            unsafe { *self.0.index_unchecked_mut(index) = value };
        }
    }
}
