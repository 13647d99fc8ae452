//! Rates of the kernels that take the time, beside what the device can do at most, both measured in the same run.
//!
//! Three limits are measured of each device: how fast a kernel copies, how fast one multiplies and adds in registers, and
//! how fast one looks texels up, bilinear, of four channels. A kernel that must move so many bytes and needs so many operations or
//! look-ups takes at least the longest of the times that these limits allow; its *share* is that time over the time
//! that it took. Limits and kernels are measured in turns, because what else a machine does, and how fast its clock may
//! run, changes from second to second: a share is the median of the shares of all rounds.
//!
//! Bytes count each number once that is read or written; a cache may serve several reads. Of products, convolutions,
//! compositing and the census the operations are counted by hand, those of a convolution's definition: a processor,
//! which convolves large images by fewer (Winograd) and adds the census in whole numbers of 16 bits, may have a share
//! above 1, as arrays may that stay in its caches.
//! An operation that no device may fuse with another takes the place of two. Where views are compared on planes it is
//! look-ups. Other kernels are compared with the copy only.
//!
//! Where a device has matrix units, linear layers and convolutions are measured in their forms of rounded factors as
//! well, and so are the units alone, on factors that stay in registers: their limit, of which two parts, which take three
//! products each, have a third. Where it has none and gains by fusing, they are measured in fused forms: one operation
//! takes the place of two there, so their limit is twice as high.

mod limits;
mod networks;
mod sweeps;

use super::dispatch::Dispatch;
use super::report::CheckError;
use serde::Serialize;
use std::time::{Duration, Instant};
use viewfuse_device::{Device, DeviceError, Precision};
use viewfuse_job::medians;
use viewfuse_job::progress::Progress;
use viewfuse_vulkan::kernel::{Form, Kernel};

/// The default number of rounds.
pub const DEFAULT_ROUNDS: u32 = 5;
/// The time for which a kernel is repeated in a round.
const MEASURED: Duration = Duration::from_millis(20);
/// A limit's own dispatch takes at least this long, beside which sending it takes no time.
const LEAST_OF_LIMITS: Duration = Duration::from_millis(2);
/// Most repetitions in a round.
const MAX_REPEATS: f64 = 500.0;

/// Which limit a kernel is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Bytes copied.
    Copy,
    /// Multiply-adds in registers.
    MultiplyAdd,
    /// Products of f16 by matrix units, in registers.
    MatrixUnits,
    /// Bilinear look-ups of four channels.
    LookUp,
}

/// A kernel at one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelRate {
    /// Its name.
    pub kernel: &'static str,
    /// The form of rounded factors that it was asked for; null for the exact one.
    pub form: Option<&'static str>,
    /// What it worked on.
    pub size: String,
    /// Time of a dispatch, in milliseconds.
    pub milliseconds: f64,
    /// Billions of operations a second, an addition or a product each; null where they are not counted.
    pub giga_operations: Option<f64>,
    /// Billions of bilinear look-ups a second; null where they are not counted.
    pub giga_look_ups: Option<f64>,
    /// Billions of bytes a second that it reads and writes.
    pub giga_bytes: f64,
    /// The limit that allows least.
    pub limit: Limit,
    /// The time that this limit allows over the time that it took.
    pub share: f64,
}

/// A device's limits and the rates of its kernels. All numbers are medians over the rounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceRates {
    /// Its name.
    pub device: String,
    /// Rounds.
    pub rounds: u32,
    /// Billions of bytes a second that a copy reads and writes.
    pub copy_giga_bytes: f64,
    /// Billions of operations a second in registers.
    pub multiply_add_giga_operations: f64,
    /// Billions of operations a second by matrix units, factors in f16, in registers; null without such units.
    pub matrix_unit_giga_operations: Option<f64>,
    /// Billions of bilinear look-ups of four channels a second.
    pub giga_look_ups: f64,
    /// The forms that are not exact that it has: products by matrix units or fused ones, tried and found within their
    /// bounds.
    pub rounded_forms: Vec<&'static str>,
    /// What of it is not used because its results were wrong.
    pub faults: Vec<String>,
    /// The kernels, in the order of the data; those in forms of rounded factors last.
    pub kernels: Vec<KernelRate>,
}

/// What a kernel has to compute.
#[derive(Clone, Copy)]
enum Operations {
    /// Not counted.
    Uncounted,
    /// Additions and products, which may be fused in pairs.
    Fused(f64),
    /// Operations that may not be fused.
    Single(f64),
    /// Bilinear look-ups of four channels.
    LookUps(f64),
}

impl Operations {
    /// Additions and products.
    fn arithmetic(self) -> Option<f64> {
        match self {
            Operations::Fused(count) | Operations::Single(count) => Some(count),
            Operations::Uncounted | Operations::LookUps(_) => None,
        }
    }

    fn look_ups(self) -> Option<f64> {
        match self {
            Operations::LookUps(count) => Some(count),
            _ => None,
        }
    }
}

/// A dispatch that can be repeated.
struct Work<'a> {
    kernel: Kernel,
    form: Option<Form>,
    size: String,
    work: Operations,
    /// Bytes of all numbers that it reads and writes, once each.
    bytes: f64,
    run: Box<dyn FnMut() -> Result<(), DeviceError> + 'a>,
}

impl<'a> Work<'a> {
    fn new<D: Device, K: Dispatch>(
        device: &'a D,
        dispatch: K,
        size: String,
        work: Operations,
        bytes: f64,
    ) -> Result<Work<'a>, DeviceError>
    where
        K::Loaded<D>: 'a,
    {
        let mut loaded = K::upload(device, std::slice::from_ref(&dispatch))?;
        let run = Box::new(move || dispatch.dispatch(device, &mut loaded, 0));
        Ok(Work { kernel: K::KERNEL, form: None, size, work, bytes, run })
    }
}

/// Measures a device.
///
/// # Errors
/// [`CheckError`] if it fails, or the work is cancelled.
pub fn measure_rates<D: Device>(device: &D, rounds: u32, progress: &dyn Progress) -> Result<DeviceRates, CheckError> {
    let rounds = rounds.max(1);
    let making =
        |kernel: &'static str| move |source: DeviceError| CheckError::Device { kernel, source: Box::new(source) };
    let is_long = |work: &mut Work<'_>| Ok(once(device, work)? >= LEAST_OF_LIMITS.as_secs_f64());
    let limits::Works { mut copy, mut chains, mut look_ups, mut units } = limits::Works::new(device, is_long)?;
    let mut works = sweeps::works(device).map_err(making("compare_views"))?;
    works.extend(networks::works(device).map_err(making("linear"))?);
    let copies = repeats(device, &mut copy)?;
    let rounds_of_chains = repeats(device, &mut chains)?;
    let rounds_of_look_ups = repeats(device, &mut look_ups)?;
    let rounds_of_units = units.as_mut().map(|units| repeats(device, units)).transpose()?.unwrap_or(1);
    let mut limits = Vec::new();
    let mut times = vec![Vec::new(); works.len()];
    let mut shares = vec![Vec::new(); works.len()];
    for round in 0..rounds as usize {
        progress.stage(&format!("round {} of {rounds}", round + 1), round..round + 1, rounds as usize);
        progress.expect(works.len());
        for (at, work) in works.iter_mut().enumerate() {
            progress.check()?;
            let limit = Limits {
                bytes: rate(device, &mut copy, copies)?,
                operations: rate(device, &mut chains, rounds_of_chains)?,
                look_ups: rate(device, &mut look_ups, rounds_of_look_ups)?,
                units: units.as_mut().map(|units| rate(device, units, rounds_of_units)).transpose()?,
            };
            let count = repeats(device, work)?;
            let time = seconds(device, work, count)?;
            shares[at].push(limit.seconds(work).0 / time);
            times[at].push(time);
            limits.push(limit);
            progress.step();
        }
    }
    let of_limits = |value: fn(&Limits) -> f64| median(limits.iter().map(value).collect()) / 1.0e9;
    let typical = Limits {
        bytes: median(limits.iter().map(|limit| limit.bytes).collect()),
        operations: median(limits.iter().map(|limit| limit.operations).collect()),
        look_ups: median(limits.iter().map(|limit| limit.look_ups).collect()),
        units: limits.iter().map(|limit| limit.units).collect::<Option<Vec<f64>>>().map(median),
    };
    let kernel = |((work, times), shares): ((&Work<'_>, Vec<f64>), Vec<f64>)| {
        let time = median(times);
        KernelRate {
            kernel: work.kernel.name(),
            form: work.form.map(Form::name),
            size: work.size.clone(),
            milliseconds: 1.0e3 * time,
            giga_operations: work.work.arithmetic().map(|operations| operations / time / 1.0e9),
            giga_look_ups: work.work.look_ups().map(|look_ups| look_ups / time / 1.0e9),
            giga_bytes: work.bytes / time / 1.0e9,
            limit: typical.seconds(work).1,
            share: median(shares),
        }
    };
    Ok(DeviceRates {
        device: device.name(),
        rounds,
        copy_giga_bytes: of_limits(|limit| limit.bytes),
        multiply_add_giga_operations: of_limits(|limit| limit.operations),
        matrix_unit_giga_operations: typical.units.map(|rate| rate / 1.0e9),
        giga_look_ups: of_limits(|limit| limit.look_ups),
        faults: device.faults(),
        rounded_forms: device.precisions().into_iter().filter_map(Precision::form).map(Form::name).collect(),
        kernels: works.iter().zip(times).zip(shares).map(kernel).collect(),
    })
}

/// What a device can do in a second.
struct Limits {
    bytes: f64,
    operations: f64,
    look_ups: f64,
    /// Operations of matrix units, where there are some.
    units: Option<f64>,
}

impl Limits {
    /// The least time for some work, and what takes it.
    fn seconds(&self, work: &Work<'_>) -> (f64, Limit) {
        let copying = work.bytes / self.bytes;
        let units = work.form.filter(|form| form.needs_matrices()).zip(self.units);
        let (computing, limit) = match work.work {
            Operations::Uncounted => (0.0, Limit::Copy),
            Operations::Fused(count) if let Some((form, rate)) = units => {
                (f64::from(form.part_products()) * count / rate, Limit::MatrixUnits)
            }
            Operations::Fused(count) if work.form.is_some_and(Form::may_fuse) => {
                (count / (2.0 * self.operations), Limit::MultiplyAdd)
            }
            Operations::Fused(count) => (count / self.operations, Limit::MultiplyAdd),
            Operations::Single(count) => (2.0 * count / self.operations, Limit::MultiplyAdd),
            Operations::LookUps(count) => (count / self.look_ups, Limit::LookUp),
        };
        if computing > copying { (computing, limit) } else { (copying, Limit::Copy) }
    }
}

/// How fast a limit's own kernel is: operations or look-ups a second, or bytes if it has none.
fn rate<D: Device>(device: &D, work: &mut Work<'_>, repeats: u32) -> Result<f64, CheckError> {
    let amount = work.work.arithmetic().or(work.work.look_ups()).unwrap_or(work.bytes);
    Ok(amount / seconds(device, work, repeats)?)
}

/// Seconds of one dispatch, after one for what is made at the first use.
fn once<D: Device>(device: &D, work: &mut Work<'_>) -> Result<f64, CheckError> {
    seconds(device, work, 1)?;
    seconds(device, work, 1)
}

/// As many repetitions as take the time that is measured, after one for what is made at the first use.
fn repeats<D: Device>(device: &D, work: &mut Work<'_>) -> Result<u32, CheckError> {
    Ok((MEASURED.as_secs_f64() / once(device, work)?.max(1.0e-9)).clamp(1.0, MAX_REPEATS) as u32)
}

/// The time of a dispatch, of several behind each other.
fn seconds<D: Device>(device: &D, work: &mut Work<'_>, repeats: u32) -> Result<f64, CheckError> {
    let kernel = work.kernel.name();
    let failed = |source: DeviceError| CheckError::Device { kernel, source: Box::new(source) };
    device.finish().map_err(failed)?;
    let start = Instant::now();
    for _ in 0..repeats {
        (work.run)().map_err(failed)?;
    }
    device.finish().map_err(failed)?;
    Ok(start.elapsed().as_secs_f64().max(1.0e-9) / f64::from(repeats))
}

/// The median over rounds, of which there is one at least.
fn median(values: Vec<f64>) -> f64 {
    medians::median(values).expect("a round")
}
