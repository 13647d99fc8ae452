//! The kernels of a device's limits.

use super::{Operations, Work};
use crate::CheckError;
use crate::poses::{numbers, random};
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, LOOK_UPS, LookUpBlock, REPEATED, ROUND_STEPS, RepeatedBlock};
use viewfuse_vulkan::kernel::{Form, Kernel};

/// Fours of an array that is copied, 64 MiB: more than a processor's caches hold.
const FOURS: usize = 4 << 20;
/// So many times as large for a GPU, whose caches hold as much.
const MAX_COPY: u32 = 8;
/// Chains of all elements together take milliseconds on a processor and fill a GPU.
const ELEMENTS: u32 = 1 << 18;
const ROUNDS: u32 = 16;
/// So many times as many rounds, and as many look-ups, on the fastest device.
const MAX_WORK: u32 = 256;
/// Rows and columns of a product that keeps the units of a GPU busy: 1,024 workgroups.
const PRODUCT: u32 = 4096;
/// Columns and rows of the image in which texels are looked up: of the size in which a plane sweep compares views.
const IMAGE: [u32; 2] = [256, 192];

/// What a device is measured by.
pub(super) struct Works<'a> {
    pub(super) copy: Work<'a>,
    pub(super) chains: Work<'a>,
    pub(super) look_ups: Work<'a>,
    /// Of matrix units, where there are some.
    pub(super) units: Option<Work<'a>>,
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
            units: has_units(device)?
                .then(|| grown(Kernel::RepeatProduct, MAX_WORK, |times| units(device, times), &mut is_long))
                .transpose()?,
        })
    }
}

fn failed(kernel: Kernel, source: DeviceError) -> CheckError {
    CheckError::Device { kernel: kernel.name(), source: Box::new(source) }
}

/// The smallest work that is long, or the largest that can be made.
fn grown<'a>(
    kernel: Kernel,
    most: u32,
    make: impl Fn(u32) -> Result<Work<'a>, DeviceError>,
    is_long: &mut impl FnMut(&mut Work<'a>) -> Result<bool, CheckError>,
) -> Result<Work<'a>, CheckError> {
    let mut work = make(1).map_err(|source| failed(kernel, source))?;
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

/// Whether a device multiplies by matrix units. What stands in for them on a processor is not measured.
fn has_units<D: Device>(device: &D) -> Result<bool, CheckError> {
    if device.is_software() {
        return Ok(false);
    }
    product(device, 4, 1).and_then(|mut product| product()).map_err(|source| failed(Kernel::RepeatProduct, source))
}

fn units<D: Device>(device: &D, times: u32) -> Result<Work<'_>, DeviceError> {
    let round_count = ROUNDS * times;
    let mut product = product(device, PRODUCT, round_count)?;
    let sums = f64::from(PRODUCT) * f64::from(PRODUCT);
    Ok(Work {
        kernel: Kernel::RepeatProduct,
        form: Some(Form::Half),
        size: format!("{PRODUCT}x{REPEATED}x{PRODUCT}, {round_count} times"),
        work: Operations::Fused(2.0 * sums * f64::from(REPEATED * round_count)),
        bytes: 4.0 * (sums + 2.0 * f64::from(PRODUCT * REPEATED)),
        run: Box::new(move || product().map(|_| ())),
    })
}

/// A product by units of so many rows and columns; whether there are some.
fn product<D: Device>(
    device: &D,
    side: u32,
    round_count: u32,
) -> Result<impl FnMut() -> Result<bool, DeviceError>, DeviceError> {
    let block = RepeatedBlock { row_count: side, column_count: side, round_count };
    // A unit whose factors are 0 may run faster than one that has something to multiply.
    let random = &mut random(93, 1, 1);
    let mut matrix = || device.upload(&numbers((side * REPEATED) as usize, || random.range(-0.5, 0.5)));
    let (left, right, mut sums) = (matrix()?, matrix()?, device.zeros((side * side) as usize)?);
    Ok(move || device.repeat_product_by_units(&block, &left, &right, &mut sums))
}
