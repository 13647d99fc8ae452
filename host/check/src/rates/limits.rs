//! The kernels of a device's limits.

use super::Work;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, ROUND_STEPS};
use viewfuse_vulkan::kernel::Kernel;

/// Fours of an array that is copied, 64 MiB: more than caches hold.
const FOURS: usize = 4 << 20;
/// Chains of all elements together take milliseconds on a processor and fill a GPU.
const ELEMENTS: u32 = 1 << 18;
const ROUNDS: u32 = 16;

pub(super) fn copy<D: Device>(device: &D) -> Result<Work<'_>, DeviceError> {
    let count = FOURS.min(device.most_elements::<[f32; 4]>());
    let (numbers, mut copies) = (device.zeros::<[f32; 4]>(count)?, device.zeros::<[f32; 4]>(count)?);
    Ok(Work {
        kernel: Kernel::CopyNumbers,
        size: format!("{} MiB", (count * 16) >> 20),
        operations: None,
        bytes: 32.0 * count as f64,
        run: Box::new(move || device.copy_numbers(count as u32, &numbers, &mut copies)),
    })
}

pub(super) fn chains<D: Device>(device: &D) -> Result<Work<'_>, DeviceError> {
    let count = ELEMENTS as usize;
    let (starts, mut ends) = (device.zeros::<f32>(count)?, device.zeros::<f32>(count)?);
    let block = ChainBlock { factor: 0.9, summand: 0.1, round_count: ROUNDS };
    Ok(Work {
        kernel: Kernel::MultiplyAdd,
        size: format!("{ELEMENTS} x {} chains", CHAINS),
        operations: Some(2.0 * f64::from(ELEMENTS) * f64::from(CHAINS * ROUNDS * ROUND_STEPS)),
        bytes: 8.0 * f64::from(ELEMENTS),
        run: Box::new(move || device.multiply_add(&block, ELEMENTS, &starts, &mut ends)),
    })
}
