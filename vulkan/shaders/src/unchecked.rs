//! Reading and writing without a panic: one would end an invocation for which others of its workgroup wait.
#![allow(unsafe_code)]

use spirv_std::arch::IndexUnchecked;
use viewfuse_core::pages::Fetch;

/// An array whose missing elements are 0.
#[derive(Clone, Copy)]
pub(crate) struct OrZero<'a>(pub(crate) &'a [f32]);

impl Fetch<f32> for OrZero<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        if index < self.0.len() {
            // SAFETY: just looked.
            unsafe { *self.0.index_unchecked(index) }
        } else {
            0.0
        }
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
