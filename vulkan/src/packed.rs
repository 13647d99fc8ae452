//! Weights as f16, for the forms that read them so: made on the device when one is first dispatched, and kept beside
//! the weights until these are written.

use crate::buffer::{Array, Bound, Buffer};
use crate::error::VulkanError;
use crate::gpu::Gpu;
use crate::kernel::{self, Kernel};
use bytemuck::bytes_of;
use std::sync::Arc;
use viewfuse_kernels::rows::word_count;

impl Gpu {
    /// The arrays of a kernel, its weights as f16.
    pub(crate) fn with_weights_in_f16(
        &self,
        kernel: Kernel,
        arrays: &[Bound<'_>],
    ) -> Result<Vec<Arc<Array>>, VulkanError> {
        let array = |(listed, bound): (&kernel::Array, &Bound<'_>)| match listed.is_weights {
            true => self.in_f16(bound.0),
            false => Ok(bound.0.clone()),
        };
        kernel.arrays().iter().zip(arrays).map(array).collect()
    }

    /// The numbers of an array of `f32` as f16, two in a word; NaN for what is larger than 65,504.
    fn in_f16(&self, weights: &Arc<Array>) -> Result<Arc<Array>, VulkanError> {
        if let Some(kept) = weights.halves.get() {
            return Ok(kept);
        }
        let version = weights.halves.version();
        let number_count = (weights.len * weights.stride / size_of::<f32>()) as u32;
        let words: Buffer<u32> = self.zeros(word_count(number_count) as usize)?;
        let arrays = [Bound(weights), words.bind()];
        self.dispatch(Kernel::PackFactors, bytes_of(&number_count), 0..word_count(number_count), &arrays)?;
        weights.halves.keep(version, &words.array);
        Ok(words.array)
    }
}
