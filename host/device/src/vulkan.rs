//! Vulkan devices: every kernel a dispatch, as its row says; the work is in `viewfuse-vulkan`.

use super::error::DeviceError;
use super::kernels::{Device, LayerShape};
use super::memory::{Element, KernelTime, Later, Memory, Recorded, TransferCounter, Transfers};
use super::precision::Precision;
use crate::argument;
use bytemuck::bytes_of;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use viewfuse_job::files::{FolderLock, read_at_most, write_whole};
use viewfuse_kernels::rows::*;
use viewfuse_kernels::{elements, for_each_kernel};
use viewfuse_vulkan::{Adapter, AdapterKind, Buffer, Gpu, GpuOptions, Instance, Recording, Tally, VulkanError};

/// A Vulkan device. Calls return when their work is recorded; it is submitted when a download waits for it, or when
/// there is enough of it.
pub struct Vulkan {
    gpu: Gpu,
    transfers: Mutex<TransferCounter>,
    is_software: bool,
    /// Where it remembers what it measured and compiled.
    memory: Option<PathBuf>,
}

/// The kernels that have forms of rounded factors.
const ROUNDED_KERNELS: [Kernel; 2] = [Kernel::Linear, Kernel::Convolve];
/// Elements of a kernel that keep a small GPU busy, and the largest.
const BUSY_ELEMENTS: [u64; 2] = [1 << 16, 1 << 20];
/// Bytes of a GPU's memory for each element that keeps it busy: one with much memory has many units. Buffers for so
/// many elements (some hundred numbers each) take a few hundredths of the memory.
const BYTES_A_BUSY_ELEMENT: u64 = 1 << 16;
/// Most bytes of what a device remembers: more is not its own.
const MAX_REMEMBERED: u64 = 256 << 20;
/// How long a device that is closed waits for others that write what they remember.
const WRITING: Duration = Duration::from_secs(2);

impl Vulkan {
    /// Opens a device.
    ///
    /// # Errors
    /// [`VulkanError`].
    pub fn open(instance: &Arc<Instance>, adapter: &Adapter, options: &GpuOptions) -> Result<Vulkan, VulkanError> {
        let (gpu, is_software) = (Gpu::open(instance, adapter, options)?, adapter.kind == AdapterKind::Software);
        Ok(Vulkan { gpu, transfers: Mutex::default(), is_software, memory: None })
    }

    /// As [`Vulkan::open`], with a folder where the device remembers compiled pipelines and which forms of its kernels
    /// were the fastest: they are read now, and written when the device is closed, if there are new ones. A file of
    /// another driver or of other kernels, and a damaged one, is replaced; what other processes wrote in the meantime
    /// is kept. A folder that cannot be written costs only time.
    ///
    /// # Errors
    /// [`VulkanError`].
    pub fn open_with_memory(
        instance: &Arc<Instance>,
        adapter: &Adapter,
        options: &GpuOptions,
        folder: &Path,
    ) -> Result<Vulkan, VulkanError> {
        let mut vulkan = Vulkan::open(instance, adapter, options)?;
        let file = folder.join(format!("{}.kernels", adapter.memory_name()));
        if let Ok(bytes) = read_at_most(&file, MAX_REMEMBERED) {
            vulkan.gpu.recall(&bytes);
        }
        vulkan.memory = Some(file);
        Ok(vulkan)
    }

    /// How many times commands were submitted so far.
    pub fn submission_count(&self) -> u64 {
        self.gpu.submission_count()
    }

    /// Whether times of kernels are measured.
    pub fn has_timestamps(&self) -> bool {
        self.gpu.has_timestamps()
    }

    fn counter(&self) -> MutexGuard<'_, TransferCounter> {
        self.transfers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A layer in a form of rounded factors. `parameters` say whether there is a residual.
    #[allow(clippy::too_many_arguments)]
    fn layer(
        &self,
        kernel: Kernel,
        form: Form,
        parameters: &[u8],
        elements: u32,
        [inputs, weights, bias]: [&Buffer<f32>; 3],
        residual: Option<&Buffer<f32>>,
        outputs: &Buffer<f32>,
    ) -> Result<(), DeviceError> {
        let residual = residual.unwrap_or(bias);
        let arrays = [inputs, weights, bias, residual, outputs].map(Buffer::bind);
        Ok(self.gpu.dispatch_rounded(kernel, form, parameters, 0..elements, &arrays)?)
    }

    /// The dispatches of a kernel, up to the last download.
    pub fn tally(&self, kernel: Kernel) -> Tally {
        self.gpu.tally(kernel)
    }
}

/// A recording, whose memory is given back with it.
struct KeptRecording<'a> {
    gpu: &'a Gpu,
    /// Until it is dropped.
    recording: Option<Recording>,
}

impl KeptRecording<'_> {
    fn again(&self) -> Result<(), DeviceError> {
        Ok(self.recording.as_ref().map_or(Ok(()), |recording| self.gpu.submit_again(recording))?)
    }
}

impl Drop for KeptRecording<'_> {
    fn drop(&mut self) {
        self.recording = None;
        self.gpu.release();
    }
}

impl Drop for Vulkan {
    fn drop(&mut self) {
        let Some(file) = self.memory.as_ref().filter(|_| self.gpu.has_new_memories()) else { return };
        // One process after the other reads and writes. What could not be kept is made anew.
        let lock = file.parent().map(|folder| {
            let _ = std::fs::create_dir_all(folder);
            FolderLock::wait(folder, WRITING)
        });
        let kept = read_at_most(file, MAX_REMEMBERED).unwrap_or_default();
        let _ = write_whole(file, &self.gpu.remembered(&kept));
        drop(lock);
    }
}

impl Memory for Vulkan {
    type Buffer<T: Element> = Buffer<T>;

    fn name(&self) -> String {
        format!("vulkan ({})", self.gpu.name())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Buffer<T>, DeviceError> {
        let buffer = self.gpu.upload(values)?;
        self.counter().upload(size_of_val(values));
        Ok(buffer)
    }

    fn table<T: Element>(&self, values: &[T]) -> Result<Buffer<T>, DeviceError> {
        match self.gpu.table(values)? {
            Some(table) => Ok(table),
            None => self.upload(values),
        }
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Buffer<T>, DeviceError> {
        Ok(self.gpu.zeros(count)?)
    }

    fn most_elements<T: Element>(&self) -> usize {
        self.gpu.most_elements(size_of::<T>())
    }

    fn busy_elements(&self) -> usize {
        let [least, most] = BUSY_ELEMENTS;
        match self.is_software {
            true => least as usize,
            false => (self.gpu.limits().memory / BYTES_A_BUSY_ELEMENT).clamp(least, most) as usize,
        }
    }

    fn is_software(&self) -> bool {
        self.is_software
    }

    /// The cores of a software driver have the host's work to do.
    fn submit(&self) -> Result<(), DeviceError> {
        if self.is_software { Ok(()) } else { Ok(self.gpu.submit()?) }
    }

    fn finish(&self) -> Result<(), DeviceError> {
        Ok(self.gpu.wait()?)
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        let ran = Kernel::ALL.into_iter().map(|kernel| (kernel.name(), self.gpu.tally(kernel)));
        ran.filter(|(_, tally)| tally.dispatches > 0)
            .map(|(kernel, Tally { dispatches, elements, time })| KernelTime { kernel, dispatches, elements, time })
            .collect()
    }

    fn transfers(&self) -> Transfers {
        self.counter().transfers()
    }

    fn download_first<T: Element>(&self, buffer: &Buffer<T>, count: usize) -> Result<Vec<T>, DeviceError> {
        let values = self.gpu.download_first(buffer, count)?;
        self.counter().download(size_of_val(&values[..]));
        Ok(values)
    }

    fn download_later<T: Element>(&self, buffer: &Buffer<T>) -> Result<Later<'_, T>, DeviceError> {
        let Some(coming) = self.gpu.download_later(buffer)? else {
            let values = self.download(buffer)?;
            return Ok(Later::new(move || Ok(values)));
        };
        let (number, bytes) = (self.counter().ask(), buffer.len() * size_of::<T>());
        Ok(Later::new(move || {
            if self.counter().take(number, bytes) {
                self.gpu.wait()?;
            }
            Ok(self.gpu.arrived(coming)?)
        }))
    }

    fn recorded<T>(
        &self,
        work: impl FnOnce() -> Result<T, DeviceError>,
    ) -> Result<(T, Option<Recorded<'_>>), DeviceError> {
        let (value, recording) = self.gpu.recorded(work)?;
        let kept = recording.map(|recording| KeptRecording { gpu: &self.gpu, recording: Some(recording) });
        Ok((value, kept.map(|kept| Recorded::new(move || kept.again()))))
    }
}

/// How it is bound. A buffer must be bound also where an optional array is left out.
macro_rules! bind {
    (optional $array:ident $other:ident) => {
        $array.map_or_else(|| $other.bind(), Buffer::bind)
    };
    ($kind:ident $array:ident) => {
        $array.bind()
    };
}

/// The bytes of a kernel's parameters.
macro_rules! parameters {
    () => {
        &[]
    };
    ($block:ident) => {
        bytes_of($block)
    };
}

macro_rules! dispatches {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({
            $kind:ident $array:ident: $Host:ty, as $entry:tt at $place:tt
            unless { $($other:ident $told:ident $flag:ident)? }
        })+ }
        elements { $($elements:tt)* }
        $($rest:tt)*
    })+) => {
        impl Device for Vulkan {
            type Weights = Buffer<f32>;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Buffer<f32>, DeviceError> {
                self.upload(&weights[..shape.inner_count * shape.column_count])
            }

            fn rounds(&self, precision: Precision) -> bool {
                // A device that fails says so at its next kernel.
                let is_trusted = |kernel, form| self.gpu.trusts(kernel, self.gpu.largest(form)).unwrap_or(false);
                precision.form().is_some_and(|form| {
                    ROUNDED_KERNELS.into_iter().fold(true, |all, kernel| is_trusted(kernel, form) && all)
                })
            }

            fn precisions(&self) -> Vec<Precision> {
                let forms = || Precision::ROUNDED.into_iter().filter_map(Precision::form).map(|form| self.gpu.largest(form));
                let trials = ROUNDED_KERNELS.into_iter().flat_map(|kernel| forms().map(move |form| (kernel, form)));
                self.gpu.compile_trials(&trials.collect::<Vec<_>>());
                let rounded: Vec<Precision> =
                    Precision::ROUNDED.into_iter().filter(|precision| self.rounds(*precision)).collect();
                // Two parts are faster than fused products wherever there are matrix units.
                match rounded.is_empty() && self.rounds(Precision::Fused) {
                    true => vec![Precision::Fused],
                    false => rounded,
                }
            }

            fn precisions_for(&self, multiply_adds: u64) -> Vec<Precision> {
                match multiply_adds < self.gpu.min_rounded_work() {
                    true => Vec::new(),
                    false => self.precisions(),
                }
            }

            fn compile_ahead(&self, kernels: &[Kernel]) {
                // The cores of a software driver have its kernels to run.
                if !self.is_software {
                    self.gpu.compile_ahead(kernels);
                }
            }

            fn faults(&self) -> Vec<String> {
                let unused = |(kernel, form): (Kernel, Form), fault: &str| {
                    let (device, kernel, form) = (self.gpu.name(), kernel.name(), form.name());
                    format!("{device}: the form '{form}' of {kernel} is not used, because {fault}")
                };
                let beyond = "its results were beyond their bound, or the driver does not compile it";
                let other = "it gave other results than 'single', or was compiled for subgroups of another size";
                let distrusted = self.gpu.distrusted_forms().into_iter().map(|form| unused(form, beyond));
                let refused = self.gpu.refused_forms().into_iter().map(|form| unused(form, other));
                distrusted.chain(refused).collect()
            }

            fn linear_in(
                &self,
                precision: Precision,
                block: &LinearBlock,
                inputs: &Buffer<f32>,
                weights: &Buffer<f32>,
                bias: &Buffer<f32>,
                residual: Option<&Buffer<f32>>,
                outputs: &mut Buffer<f32>,
            ) -> Result<(), DeviceError> {
                let Some(form) = precision.form() else {
                    return self.linear(block, inputs, weights, bias, residual, outputs);
                };
                let block = LinearBlock { has_residual: u32::from(residual.is_some()), ..*block };
                let elements = tile_elements(block.row_count, block.column_count);
                let given = [inputs, weights, bias];
                self.layer(Kernel::Linear, form, bytes_of(&block), elements, given, residual, outputs)
            }

            fn convolve_in(
                &self,
                precision: Precision,
                block: &ConvolveBlock,
                inputs: &Buffer<f32>,
                weights: &Buffer<f32>,
                bias: &Buffer<f32>,
                residual: Option<&Buffer<f32>>,
                outputs: &mut Buffer<f32>,
            ) -> Result<(), DeviceError> {
                let Some(form) = precision.form() else {
                    return self.convolve(block, inputs, weights, bias, residual, outputs);
                };
                let block = ConvolveBlock { has_residual: u32::from(residual.is_some()), ..*block };
                let elements = tile_elements(block.pixel_count(), block.out_channels);
                let given = [inputs, weights, bias];
                self.layer(Kernel::Convolve, form, bytes_of(&block), elements, given, residual, outputs)
            }

            fn repeat_product_by_units(
                &self,
                block: &RepeatedBlock,
                left: &Buffer<f32>,
                right: &Buffer<f32>,
                sums: &mut Buffer<f32>,
            ) -> Result<bool, DeviceError> {
                let elements = 0..tile_elements(block.row_count, block.column_count);
                let arrays = [left.bind(), right.bind(), sums.bind()];
                let (kernel, form) = (Kernel::RepeatProduct, Form::Half);
                Ok(block.is_in_fours()
                    && self.gpu.dispatch_by_units(kernel, form, bytes_of(block), elements, &arrays)?)
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    $($(
                        let mut told = *$told;
                        told.$flag = u32::from($array.is_some());
                        let $told = &told;
                    )?)+
                    let arrays = [$(bind!($kind $array $($other)?)),+];
                    Ok(self.gpu.dispatch(Kernel::$Kernel, parameters!($($block)?), elements!($($elements)*), &arrays)?)
                }
            )+
        }
    };
}

for_each_kernel!(dispatches);
