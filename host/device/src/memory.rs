//! What a device holds, and what it tells about itself.

use super::error::DeviceError;
use bytemuck::Pod;
use std::time::Duration;

/// What a buffer can hold: plain data.
pub trait Element: Pod + Default + Send + Sync {}
impl<T: Pod + Default + Send + Sync> Element for T {}

/// What a kernel took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelTime {
    /// Its name.
    pub kernel: &'static str,
    /// How many times it was dispatched.
    pub dispatches: u64,
    /// How many elements it computed.
    pub elements: u64,
    /// Its time on the device.
    pub time: Duration,
}

/// What went over the border of a device's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transfers {
    /// How many arrays went to the device.
    pub uploads: u64,
    /// Their bytes.
    pub uploaded_bytes: u64,
    /// How many arrays came back.
    pub downloads: u64,
    /// Their bytes.
    pub downloaded_bytes: u64,
}

/// Memory that kernels work on.
pub trait Memory {
    /// Memory of the device that holds `T`s.
    type Buffer<T: Element>;

    /// What the run record calls it.
    fn name(&self) -> String;

    /// A buffer with these values.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn upload<T: Element>(&self, values: &[T]) -> Result<Self::Buffer<T>, DeviceError>;

    /// A buffer of `count` default values.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn zeros<T: Element>(&self, count: usize) -> Result<Self::Buffer<T>, DeviceError>;

    /// Most elements of a buffer that is bound as a whole: what grows with the work is cut so that it fits.
    fn most_elements<T: Element>(&self) -> usize;

    /// Fewest elements of a kernel that keep the device busy: work between two looks at the interrupt flag is not cut
    /// finer.
    fn busy_elements(&self) -> usize;

    /// Waits until everything that was asked for is done, so that its time can be told.
    ///
    /// # Errors
    /// If the device is lost, or a kernel took too long.
    fn finish(&self) -> Result<(), DeviceError>;

    /// What each kernel took so far, kernels that never ran left out; nothing for devices that do not tell.
    fn kernel_times(&self) -> Vec<KernelTime>;

    /// What was transferred so far; nothing for devices whose memory is the host's.
    fn transfers(&self) -> Transfers {
        Transfers::default()
    }

    /// The values of a buffer.
    ///
    /// # Errors
    /// If the device is lost.
    fn download<T: Element>(&self, buffer: &Self::Buffer<T>) -> Result<Vec<T>, DeviceError>;
}
