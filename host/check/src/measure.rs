//! Running the cases on a device.

use super::agreement::{Agreement, measure, versus};
use super::bounded::Bounded;
use super::case::{Case, SIZES, Visitor};
use super::cases::visit;
use super::report::{CheckError, DeviceReport, KernelReport};
use std::time::{Duration, Instant};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_device::cpu::Cpu;
use viewfuse_job::progress::{Part, Progress};
use viewfuse_vulkan::kernel::Kernel;

/// The default number of seeds for a kernel's check.
pub const DEFAULT_SEED_COUNT: u32 = 4;
/// The duration of timing a kernel.
const MEASURED: Duration = Duration::from_millis(40);

/// The role of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The CPU, which is compared with `f64` only.
    Reference,
    /// Another device, which is compared with the CPU as well.
    Other,
}

/// Checks every kernel of a device, for the seeds `1..=seed_count`.
///
/// # Errors
/// [`CheckError`] if the device fails. An exceeded tolerance is not an error but part of the report.
pub fn check_device<D: Device>(
    device: &D,
    role: Role,
    seed_count: u32,
    progress: &dyn Progress,
) -> Result<DeviceReport, CheckError> {
    let mut kernels = Vec::new();
    for (index, kernel) in Kernel::ALL.into_iter().enumerate() {
        let part = Part::begin(progress, kernel.name(), index..index + 1, Kernel::ALL.len());
        kernels.push(check_kernel(device, role, kernel, seed_count, &part)?);
    }
    Ok(DeviceReport { device: device.name(), kernels, picture: None })
}

/// Checks a kernel of a device.
///
/// # Errors
/// As [`check_device`].
pub fn check_kernel<D: Device>(
    device: &D,
    role: Role,
    kernel: Kernel,
    seed_count: u32,
    progress: &dyn Progress,
) -> Result<KernelReport, CheckError> {
    visit(kernel, Check { device, role, seed_count, progress })
}

struct Check<'a, D> {
    device: &'a D,
    role: Role,
    seed_count: u32,
    progress: &'a dyn Progress,
}

impl<D: Device> Visitor for Check<'_, D> {
    type Output = Result<KernelReport, CheckError>;

    fn visit<C: Case>(self) -> Result<KernelReport, CheckError> {
        let kernel = C::KERNEL.name();
        let failed = |source: DeviceError| CheckError::Device { kernel, source: Box::new(source) };
        let mut actual = Vec::new();
        let mut on_cpu = Vec::new();
        let mut expected: Vec<Option<Bounded>> = Vec::new();
        for seed in 1..=u64::from(self.seed_count) {
            for (index, size) in SIZES.into_iter().enumerate() {
                self.progress.check()?;
                let inputs = C::inputs(seed, size);
                // A device has a kernel compiled, or reads it back, where it is first called.
                match (self.role, seed, index) {
                    (Role::Other, 1, 0) => self.progress.stage("compiling", 0..1, 2),
                    (Role::Other, 1, 1) => self.progress.stage("comparing", 1..2, 2),
                    _ => {}
                }
                actual.extend(C::results(self.device, &inputs).map_err(failed)?);
                expected.extend(C::all_expected(&inputs));
                if self.role == Role::Other {
                    on_cpu.extend(C::results(&Cpu, &inputs).map_err(failed)?);
                }
            }
        }
        let Agreement { compared, undecided, worst, worst_of_bound, largest_bound, disagreement } =
            measure(&actual, &expected, C::LIMITS);
        let versus_cpu = match self.role {
            Role::Reference => None,
            Role::Other => Some(versus(&actual, &on_cpu, &expected, C::LIMITS).into()),
        };
        Ok(KernelReport {
            kernel,
            compared,
            undecided,
            absolute: worst.absolute,
            relative: worst.relative,
            ulps: worst.ulps,
            least: C::LIMITS.least,
            of_bound: worst_of_bound,
            tolerance: largest_bound,
            reason: C::REASON,
            versus_cpu,
            nanoseconds_per_element: 1.0e9 * seconds_per_element::<C, D>(self.device).map_err(failed)?,
            breach: disagreement.map(|disagreement| disagreement.to_string()),
        })
    }
}

/// The time of an element at the largest size. Calls may return before the kernel is done: a download waits for all of
/// them, and its own time is subtracted.
fn seconds_per_element<C: Case, D: Device>(device: &D) -> Result<f64, DeviceError> {
    let inputs = C::inputs(1, SIZES[SIZES.len() - 1]);
    let element_count: usize = inputs.iter().map(C::element_count).sum();
    let mut loaded = C::upload(device, &inputs)?;
    // Once for what is made at the first use.
    C::run(device, &inputs, &mut loaded)?;
    C::read(device, &inputs, &loaded)?;
    let start = Instant::now();
    C::run(device, &inputs, &mut loaded)?;
    C::read(device, &inputs, &loaded)?;
    let once = start.elapsed();
    let start = Instant::now();
    C::read(device, &inputs, &loaded)?;
    let download = start.elapsed();
    let run_count = (MEASURED.as_secs_f64() / once.as_secs_f64().max(1.0e-6)).clamp(1.0, 1000.0) as u32;
    let start = Instant::now();
    for _ in 0..run_count {
        C::run(device, &inputs, &mut loaded)?;
    }
    C::read(device, &inputs, &loaded)?;
    let runs = start.elapsed().saturating_sub(download);
    Ok(runs.as_secs_f64() / f64::from(run_count) / element_count as f64)
}
