//! Buffers on a device, its kernel times and transfers.

use super::error::DeviceError;
use bytemuck::Pod;
use std::time::Duration;

/// Elements of a buffer: plain data.
pub trait Element: Pod + Default + Send + Sync {}
impl<T: Pod + Default + Send + Sync> Element for T {}

/// The time of a kernel.
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

/// Transfers between host and device. Arrays of [`Memory::download_later`] that are waited for together are one
/// download.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transfers {
    /// Arrays that were uploaded.
    pub uploads: u64,
    /// Their bytes.
    pub uploaded_bytes: u64,
    /// How often the host waited for arrays from the device.
    pub downloads: u64,
    /// Their bytes.
    pub downloaded_bytes: u64,
}

/// Counts the transfers of a device.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransferCounter {
    transfers: Transfers,
    /// How many arrays were asked for to be there later, of which so many are.
    asked: u64,
    arrived: u64,
}

impl TransferCounter {
    /// The transfers so far.
    pub fn transfers(&self) -> Transfers {
        self.transfers
    }

    /// An array was uploaded.
    pub fn upload(&mut self, bytes: usize) {
        self.transfers.uploads += 1;
        self.transfers.uploaded_bytes += bytes as u64;
    }

    /// An array was waited for, and with it all that were asked for.
    pub fn download(&mut self, bytes: usize) {
        self.transfers.downloads += 1;
        self.transfers.downloaded_bytes += bytes as u64;
        self.arrived = self.asked;
    }

    /// Asks for an array to be there later: its number.
    pub fn ask(&mut self) -> u64 {
        self.asked += 1;
        self.asked
    }

    /// An array that was asked for is taken. Returns whether it has to be waited for, and with it all others.
    pub fn take(&mut self, number: u64, bytes: usize) -> bool {
        self.transfers.downloaded_bytes += bytes as u64;
        let is_late = number > self.arrived;
        if is_late {
            self.arrived = self.asked;
            self.transfers.downloads += 1;
        }
        is_late
    }
}

/// Values on their way from a device.
pub struct Later<'d, T>(Box<dyn FnOnce() -> Result<Vec<T>, DeviceError> + 'd>);

impl<'d, T> Later<'d, T> {
    /// What has these values when they are needed.
    pub fn new(values: impl FnOnce() -> Result<Vec<T>, DeviceError> + 'd) -> Later<'d, T> {
        Later(Box::new(values))
    }

    /// The values; waits for them, and for all others that were asked for, where they are not there yet.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn get(self) -> Result<Vec<T>, DeviceError> {
        (self.0)()
    }
}

/// Work of a device that was recorded, to be done again.
pub struct Recorded<'d>(Box<dyn Fn() -> Result<(), DeviceError> + 'd>);

impl<'d> Recorded<'d> {
    /// What does it again.
    pub fn new(again: impl Fn() -> Result<(), DeviceError> + 'd) -> Recorded<'d> {
        Recorded(Box::new(again))
    }

    /// Does it again, in the same arrays, with what they contain by then.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn again(&self) -> Result<(), DeviceError> {
        (self.0)()
    }
}

/// Memory that kernels work on.
pub trait Memory {
    /// Memory of the device that holds `T`s.
    type Buffer<T: Element>;

    /// Its name in the run record.
    fn name(&self) -> String;

    /// A buffer with these values.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn upload<T: Element>(&self, values: &[T]) -> Result<Self::Buffer<T>, DeviceError>;

    /// As [`Memory::upload`], of values that are not needed any more: where memory is the host's, they are not copied.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn upload_owned<T: Element>(&self, values: Vec<T>) -> Result<Self::Buffer<T>, DeviceError> {
        self.upload(&values)
    }

    /// A short buffer that kernels only read, as parameters of theirs are: a GPU reads it where the host wrote it, and
    /// nothing is transferred. As [`Memory::upload`] for more than some ten thousand bytes, and where memory is the
    /// host's.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn table<T: Element>(&self, values: &[T]) -> Result<Self::Buffer<T>, DeviceError> {
        self.upload(values)
    }

    /// A buffer of `count` elements whose bytes are 0.
    ///
    /// # Errors
    /// If the device has no memory left.
    fn zeros<T: Element>(&self, count: usize) -> Result<Self::Buffer<T>, DeviceError>;

    /// The most elements of a buffer that is bound as a whole: buffers that grow with the work are split to fit.
    fn most_elements<T: Element>(&self) -> usize;

    /// The fewest elements of a kernel that keep the device busy: work between two checks for cancellation is not split
    /// finer.
    fn busy_elements(&self) -> usize;

    /// Whether the kernels run on the host's processor, as those of a software driver do.
    fn is_software(&self) -> bool {
        true
    }

    /// Lets a device begin with all dispatched work, which it would otherwise do when somebody waits or there is enough
    /// of it: the host has other things to do before it waits.
    ///
    /// # Errors
    /// If the device is lost.
    fn submit(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    /// Waits until all dispatched work is done, so that its time can be measured.
    ///
    /// # Errors
    /// If the device is lost, or a kernel took too long.
    fn finish(&self) -> Result<(), DeviceError>;

    /// The time of each kernel so far, without those that never ran; empty for devices without timestamps.
    fn kernel_times(&self) -> Vec<KernelTime>;

    /// The transfers so far; zeros for devices whose memory is the host's.
    fn transfers(&self) -> Transfers {
        Transfers::default()
    }

    /// The first `count` values of a buffer, or all if it has fewer.
    ///
    /// # Errors
    /// If the device is lost.
    fn download_first<T: Element>(&self, buffer: &Self::Buffer<T>, count: usize) -> Result<Vec<T>, DeviceError>;

    /// The values of a buffer.
    ///
    /// # Errors
    /// If the device is lost.
    fn download<T: Element>(&self, buffer: &Self::Buffer<T>) -> Result<Vec<T>, DeviceError> {
        self.download_first(buffer, usize::MAX)
    }

    /// The values that a buffer has now, to be waited for later: one wait serves all that were asked for before it.
    ///
    /// # Errors
    /// If the device is lost, or there is no memory left.
    fn download_later<T: Element>(&self, buffer: &Self::Buffer<T>) -> Result<Later<'_, T>, DeviceError> {
        let values = self.download(buffer)?;
        Ok(Later::new(move || Ok(values)))
    }

    /// Does work, and records what it dispatches, where the device gains by that and can repeat it: where nothing but
    /// kernels ran, on arrays that were there before. What depends on the host, as parameters of a kernel do, is
    /// repeated as it was.
    ///
    /// # Errors
    /// The work's, or if the device is lost.
    fn recorded<T>(
        &self,
        work: impl FnOnce() -> Result<T, DeviceError>,
    ) -> Result<(T, Option<Recorded<'_>>), DeviceError> {
        Ok((work()?, None))
    }
}
