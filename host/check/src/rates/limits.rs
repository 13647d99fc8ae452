//! The kernels of a device's limits.

use super::{Operations, Work};
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, LOOK_UPS, LookUpBlock, ROUND_STEPS};
use viewfuse_vulkan::kernel::Kernel;

/// Fours of an array that is copied, 64 MiB: more than caches hold.
const FOURS: usize = 4 << 20;
/// Chains of all elements together take milliseconds on a processor and fill a GPU.
const ELEMENTS: u32 = 1 << 18;
const ROUNDS: u32 = 16;
/// Columns and rows of the image in which texels are looked up: of the size in which a plane sweep compares views.
const IMAGE: [u32; 2] = [256, 192];

pub(super) fn copy<D: Device>(device: &D) -> Result<Work<'_>, DeviceError> {
    let count = FOURS.min(device.most_elements::<[f32; 4]>());
    let (numbers, mut copies) = (device.zeros::<[f32; 4]>(count)?, device.zeros::<[f32; 4]>(count)?);
    Ok(Work {
        kernel: Kernel::CopyNumbers,
        size: format!("{} MiB", (count * 16) >> 20),
        work: Operations::Uncounted,
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
        work: Operations::Fused(2.0 * f64::from(ELEMENTS) * f64::from(CHAINS * ROUNDS * ROUND_STEPS)),
        bytes: 8.0 * f64::from(ELEMENTS),
        run: Box::new(move || device.multiply_add(&block, ELEMENTS, &starts, &mut ends)),
    })
}

pub(super) fn look_ups<D: Device>(device: &D) -> Result<Work<'_>, DeviceError> {
    let [width, height] = IMAGE;
    let count = width * height;
    let (texels, mut sums) = (device.zeros::<[f32; 4]>(count as usize)?, device.zeros::<f32>(count as usize)?);
    let block = LookUpBlock { width, height };
    Ok(Work {
        kernel: Kernel::LookUpTexels,
        size: format!("{width}x{height}, {LOOK_UPS} look-ups"),
        work: Operations::LookUps(f64::from(count * LOOK_UPS)),
        bytes: 20.0 * f64::from(count),
        run: Box::new(move || device.look_up_texels(&block, count, &texels, &mut sums)),
    })
}
