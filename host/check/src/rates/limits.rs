//! The kernels of a device's limits.

use super::{Operations, Work};
use crate::CheckError;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, LOOK_UPS, LookUpBlock, ROUND_STEPS};
use viewfuse_vulkan::kernel::Kernel;

/// Fours of an array that is copied, 64 MiB: more than a processor's caches hold.
const FOURS: usize = 4 << 20;
/// So many times as large for a GPU, whose caches hold as much.
const MAX_COPY: u32 = 8;
/// Chains of all elements together take milliseconds on a processor and fill a GPU.
const ELEMENTS: u32 = 1 << 18;
const ROUNDS: u32 = 16;
/// So many times as many rounds, and as many look-ups, on the fastest device.
const MAX_WORK: u32 = 256;
/// Columns and rows of the image in which texels are looked up: of the size in which a plane sweep compares views.
const IMAGE: [u32; 2] = [256, 192];

/// What a device is measured by.
pub(super) struct Works<'a> {
    pub(super) copy: Work<'a>,
    pub(super) chains: Work<'a>,
    pub(super) look_ups: Work<'a>,
}

impl<'a> Works<'a> {
    /// Each as large as this device needs: where `is_long` says no, more is done, as far as there is memory.
    pub(super) fn new<D: Device>(
        device: &'a D,
        mut is_long: impl FnMut(&mut Work<'a>) -> Result<bool, CheckError>,
    ) -> Result<Works<'a>, CheckError> {
        Ok(Works {
            copy: grown(Kernel::CopyNumbers, MAX_COPY, |times| copy(device, times), &mut is_long)?,
            chains: grown(Kernel::MultiplyAdd, MAX_WORK, |times| chains(device, times), &mut is_long)?,
            look_ups: grown(Kernel::LookUpTexels, MAX_WORK, |times| look_ups(device, times), &mut is_long)?,
        })
    }
}

/// The smallest work that is long, or the largest that can be made.
fn grown<'a>(
    kernel: Kernel,
    most: u32,
    make: impl Fn(u32) -> Result<Work<'a>, DeviceError>,
    is_long: &mut impl FnMut(&mut Work<'a>) -> Result<bool, CheckError>,
) -> Result<Work<'a>, CheckError> {
    let failed = |source: DeviceError| CheckError::Device { kernel: kernel.name(), source: Box::new(source) };
    let mut work = make(1).map_err(failed)?;
    let mut times = 2;
    while times <= most && !is_long(&mut work)? {
        let Ok(larger) = make(times) else { break };
        work = larger;
        times *= 2;
    }
    Ok(work)
}

fn copy<D: Device>(device: &D, times: u32) -> Result<Work<'_>, DeviceError> {
    let count = (FOURS * times as usize).min(device.most_elements::<[f32; 4]>());
    let (numbers, mut copies) = (device.zeros::<[f32; 4]>(count)?, device.zeros::<[f32; 4]>(count)?);
    Ok(Work {
        kernel: Kernel::CopyNumbers,
        form: None,
        size: format!("{} MiB", (count * 16) >> 20),
        work: Operations::Uncounted,
        bytes: 32.0 * count as f64,
        run: Box::new(move || device.copy_numbers(count as u32, &numbers, &mut copies)),
    })
}

fn chains<D: Device>(device: &D, times: u32) -> Result<Work<'_>, DeviceError> {
    let count = ELEMENTS as usize;
    let (starts, mut ends) = (device.zeros::<f32>(count)?, device.zeros::<f32>(count)?);
    let round_count = ROUNDS * times;
    let block = ChainBlock { factor: 0.9, summand: 0.1, round_count };
    Ok(Work {
        kernel: Kernel::MultiplyAdd,
        form: None,
        size: format!("{ELEMENTS} x {} chains", CHAINS),
        work: Operations::Fused(2.0 * f64::from(ELEMENTS) * f64::from(CHAINS * round_count * ROUND_STEPS)),
        bytes: 8.0 * f64::from(ELEMENTS),
        run: Box::new(move || device.multiply_add(&block, ELEMENTS, &starts, &mut ends)),
    })
}

fn look_ups<D: Device>(device: &D, times: u32) -> Result<Work<'_>, DeviceError> {
    let [width, height] = IMAGE;
    let count = width * height * times;
    let texels = device.zeros::<[f32; 4]>((width * height) as usize)?;
    let mut sums = device.zeros::<f32>(count as usize)?;
    let block = LookUpBlock { width, height };
    Ok(Work {
        kernel: Kernel::LookUpTexels,
        form: None,
        size: format!("{width}x{height}, {LOOK_UPS} look-ups"),
        work: Operations::LookUps(f64::from(count * LOOK_UPS)),
        bytes: 20.0 * f64::from(count),
        run: Box::new(move || device.look_up_texels(&block, count, &texels, &mut sums)),
    })
}
