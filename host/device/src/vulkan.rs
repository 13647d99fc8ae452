//! Vulkan devices: every kernel a dispatch; the work is in `viewfuse-vulkan`.

mod light;
mod matrices;
mod network;
mod normalise;
mod photo;
mod points;
mod rays;
mod sampler;
mod volumes;
mod weighting;

use super::memory::{Element, KernelTime, Memory};
use std::sync::Arc;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Adapter, Buffer, Gpu, GpuOptions, Instance, Tally, VulkanError};

/// A Vulkan device. Calls return when their work is on its way; only a download waits for it.
pub struct Vulkan {
    gpu: Gpu,
}

/// Elements that keep a graphics processor busy.
const BUSY_ELEMENTS: usize = 1 << 16;

impl Vulkan {
    /// Opens a device.
    ///
    /// # Errors
    /// [`VulkanError`].
    pub fn open(instance: &Arc<Instance>, adapter: &Adapter, options: &GpuOptions) -> Result<Vulkan, VulkanError> {
        Ok(Vulkan { gpu: Gpu::open(instance, adapter, options)? })
    }

    /// What a kernel did, up to the last download.
    pub fn tally(&self, kernel: Kernel) -> Tally {
        self.gpu.tally(kernel)
    }
}

fn count_of(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(u32::MAX)
}

impl Memory for Vulkan {
    type Buffer<T: Element> = Buffer<T>;
    type Error = VulkanError;

    fn name(&self) -> String {
        format!("vulkan ({})", self.gpu.name())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Buffer<T>, VulkanError> {
        self.gpu.upload(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Buffer<T>, VulkanError> {
        self.gpu.zeros(count)
    }

    fn most_elements<T: Element>(&self) -> usize {
        self.gpu.most_elements(size_of::<T>())
    }

    fn busy_elements(&self) -> usize {
        BUSY_ELEMENTS
    }

    fn finish(&self) -> Result<(), VulkanError> {
        self.gpu.wait()
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        let ran = Kernel::ALL.into_iter().map(|kernel| (kernel.name(), self.gpu.tally(kernel)));
        ran.filter(|(_, tally)| tally.dispatches > 0)
            .map(|(kernel, Tally { dispatches, elements, time })| KernelTime { kernel, dispatches, elements, time })
            .collect()
    }

    fn download<T: Element>(&self, buffer: &Buffer<T>) -> Result<Vec<T>, VulkanError> {
        self.gpu.download(buffer)
    }
}
