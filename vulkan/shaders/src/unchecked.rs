//! Reading and writing without a panic: a panic would end an invocation for which others of its workgroup wait.
#![allow(unsafe_code)]

use spirv_std::arch::IndexUnchecked;
use viewfuse_core::fetch::Fetch;

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

/// Writes an element, if it exists.
#[inline(always)]
pub(crate) fn store(values: &mut [f32], index: usize, value: f32) {
    if index < values.len() {
        // SAFETY: just looked.
        unsafe { *values.index_unchecked_mut(index) = value };
    }
}
