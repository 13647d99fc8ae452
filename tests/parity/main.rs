//! Every kernel on every device against `f64`, and the negative controls: an input that is off by 1 % must show. The
//! bodies themselves are a device, too: the CPU has faster forms of some.
//!
//! One trial for each kernel and device. A device that is not there gives ignored trials, or, where
//! `VIEWFUSE_REQUIRE_VULKAN=1` asks for it, failing ones.

mod bodies;
mod forms;
mod halves;

use bodies::Bodies;
use libtest_mimic::{Failed, Trial};
use std::process::ExitCode;
use std::sync::Arc;
use viewfuse::check::agreement::{Disagreement, measure};
use viewfuse::check::bounded::Bounded;
use viewfuse::check::case::{Case, Visitor};
use viewfuse::check::cases::visit;
use viewfuse::check::measure::Role;
use viewfuse::check::{Report, check_device, check_kernel};
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::job::progress::Silent;
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_tests::trials::{is_required, needing, run, timed};
use viewfuse_vulkan::kernel::{Access, Kernel};
use viewfuse_vulkan::{Adapter, GpuOptions, Instance, Missing};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_VULKAN";

fn main() -> ExitCode {
    let mut trials: Vec<Trial> = Kernel::ALL.map(|kernel| trial_of("cpu", kernel, uncounted, || Ok(Cpu))).into();
    let together: Vec<Kernel> = Kernel::ALL.into_iter().filter(|kernel| kernel.is_together()).collect();
    for (name, in_workgroups, kernels) in [("bodies", false, Kernel::ALL.to_vec()), ("workgroups", true, together)] {
        let open = move || Ok(Bodies { in_workgroups, ..Bodies::PLAIN });
        trials.extend(kernels.into_iter().map(|kernel| trial_of(name, kernel, uncounted, open)));
    }
    match vulkan_devices() {
        Ok((instance, adapters)) => {
            for adapter in adapters {
                trials.extend(forms::trials(&instance, &adapter));
                trials.extend(halves::trials(&instance, &adapter));
                trials.extend(Kernel::ALL.map(|kernel| {
                    let (instance, opened) = (instance.clone(), adapter.clone());
                    let open = move || Ok(Vulkan::open(&instance, &opened, &GpuOptions::default())?);
                    let count = |device: &Vulkan, kernel| Some(device.tally(kernel).dispatches);
                    trial_of(&adapter.name, kernel, count, open)
                }));
            }
        }
        Err(error) => trials.extend(Kernel::ALL.map(|kernel| {
            let (problem, said) = (error.to_string(), error.to_string());
            let trial = timed(format!("vulkan::{}", kernel.name()), move || Err(said.into()));
            needing(Some(problem), is_required(REQUIRED), trial)
        })),
    }
    for kernel in [Kernel::CompareViews, Kernel::CensusCost, Kernel::WindowCost, Kernel::PlaneOpacity] {
        let name = format!("the_cpu_has_the_bits_of_the_body::{}", kernel.name());
        let same_bits = forms::SameBits { one: &Cpu, other: &Bodies::PLAIN, seeds: 1..=12 };
        trials.push(timed(name, move || visit(kernel, same_bits)));
    }
    trials.push(timed("every_input_has_a_control", every_input_has_a_control));
    for kernel in Kernel::ALL {
        let name = format!("check_reports_a_faulty::{}", kernel.name());
        trials.push(timed(name, move || a_fault_is_reported(kernel)));
    }
    trials.push(timed("a_faulty_device_fails_the_check", a_faulty_device_fails_the_check));
    run(trials)
}

/// Of a device that does not count its dispatches.
fn uncounted<D>(_: &D, _: Kernel) -> Option<u64> {
    None
}

/// A kernel on a device, which every trial opens for itself: its counters then are the trial's own.
fn trial_of<D: Device + 'static>(
    device: &str,
    kernel: Kernel,
    count: fn(&D, Kernel) -> Option<u64>,
    open: impl Fn() -> Result<D, Failed> + Send + 'static,
) -> Trial {
    timed(format!("{device}::{}", kernel.name()), move || parity(&open()?, kernel, count))
}

/// A trial of a Vulkan device; ignored where that lacks something, unless it is required.
fn trial_on(
    instance: &Arc<Instance>,
    adapter: &Adapter,
    name: &str,
    test: impl FnOnce(&Arc<Instance>, &Adapter) -> Result<(), Failed> + Send + 'static,
) -> Trial {
    let missing: Vec<String> = adapter.missing.iter().map(Missing::to_string).collect();
    let (instance, adapter) = (instance.clone(), adapter.clone());
    let trial = timed(format!("{}::{name}", adapter.name), move || test(&instance, &adapter));
    needing((!missing.is_empty()).then(|| missing.join(", ")), is_required(REQUIRED), trial)
}

/// Sizes of the trials: one element, an odd number, and several workgroups with a rest.
const SIZES: [u32; 3] = [1, 7, 500];

fn parity<D: Device>(device: &D, kernel: Kernel, count: fn(&D, Kernel) -> Option<u64>) -> Result<(), Failed> {
    let before = count(device, kernel);
    visit(kernel, Parity { device })?;
    // The kernel really ran: nobody answered for it.
    match (before, count(device, kernel)) {
        (Some(before), Some(after)) if after <= before => Err("the kernel was never dispatched".into()),
        _ => Ok(()),
    }
}

struct Parity<'a, D> {
    device: &'a D,
}

impl<D: Device> Visitor for Parity<'_, D> {
    type Output = Result<(), Failed>;

    fn visit<C: Case>(self) -> Result<(), Failed> {
        let seeds = 1..=C::SEED_COUNT;
        let inputs: Vec<Vec<C>> = seeds.flat_map(|seed| SIZES.map(|size| C::inputs(seed, size))).collect();
        let expected: Vec<Vec<Option<Bounded>>> = inputs.iter().map(|inputs| C::all_expected(inputs)).collect();
        let mut actual = Vec::new();
        for inputs in &inputs {
            actual.extend(C::results(self.device, inputs)?);
        }
        if let Some(disagreement) = measure(&actual, &expected.concat(), C::LIMITS).disagreement {
            return Err(disagreement.to_string().into());
        }
        // The last world has several workgroups, the first ones may be too small to show anything.
        let last = inputs.len() - 1;
        for (input, change) in C::NEGATIVE_CONTROLS {
            let mut changed = inputs[last].clone();
            changed.iter_mut().for_each(change);
            let outcome = measure(&C::results(self.device, &changed)?, &expected[last], C::LIMITS).disagreement;
            if !matches!(outcome, Some(Disagreement::Mismatch { .. })) {
                return Err(format!("{input} off by 1 %: {outcome:?}").into());
            }
        }
        Ok(())
    }
}

/// Every array that a kernel reads is put off by 1 % in a negative control, and so are its parameters.
fn every_input_has_a_control() -> Result<(), Failed> {
    struct Controls;
    impl Visitor for Controls {
        type Output = Result<(), Failed>;
        fn visit<C: Case>(self) -> Result<(), Failed> {
            let kernel = C::KERNEL;
            let controls: Vec<&str> = C::NEGATIVE_CONTROLS.iter().map(|(input, _)| *input).collect();
            let read = kernel.arrays().iter().filter(|array| array.access == Access::Read).map(|array| array.name);
            let read: Vec<&str> = read.filter(|array| !C::SHAPES_ONLY.contains(array)).collect();
            let missing: Vec<&&str> = read.iter().filter(|array| !controls.contains(array)).collect();
            let unknown: Vec<&&str> =
                controls.iter().filter(|control| **control != "parameters" && !read.contains(control)).collect();
            if !missing.is_empty() || !unknown.is_empty() {
                return Err(format!("{}: without a control {missing:?}, unknown {unknown:?}", kernel.name()).into());
            }
            match controls.contains(&"parameters") == C::HAS_REAL_PARAMETERS {
                true => Ok(()),
                false => Err(format!("{}: parameters", kernel.name()).into()),
            }
        }
    }
    Kernel::ALL.into_iter().try_for_each(|kernel| visit(kernel, Controls))
}

fn faulty(kernel: Kernel) -> Bodies {
    Bodies { faulty: Some(kernel), ..Bodies::PLAIN }
}

/// A device whose results of a kernel are off by a thousandth breaches its tolerance.
fn a_fault_is_reported(kernel: Kernel) -> Result<(), Failed> {
    let report = check_kernel(&faulty(kernel), Role::Other, kernel, 1, &Silent)?;
    match (report.breach, report.versus_cpu) {
        (Some(_), Some(versus)) if versus.absolute > 0.0 && versus.equal < 1.0 => Ok(()),
        (breach, versus) => Err(format!("reported: {breach:?}, {versus:?}").into()),
    }
}

/// And no other kernel's; the whole check fails with it.
fn a_faulty_device_fails_the_check() -> Result<(), Failed> {
    let checked = check_device(&faulty(Kernel::FuseViews), Role::Other, 1, &Silent)?;
    let breaches = checked.breaches();
    let report = Report {
        viewfuse: "",
        seed_count: 1,
        sizes: Vec::new(),
        devices: vec![checked],
        failures: Vec::new(),
        notes: Vec::new(),
    };
    if breaches != ["fuse_views"] || report.exit_code() != 1 {
        return Err(format!("reported: {breaches:?}, exit code {}", report.exit_code()).into());
    }
    let nothing = Report { devices: Vec::new(), ..report };
    if nothing.passes() { Err("nothing was checked, and that passes".into()) } else { Ok(()) }
}
