//! Every form of every tiled kernel that a device can run: against `f64` as the first form is, with the same bits as
//! that one, which has those of the kernel's body, and as itself in pieces, and chosen by measuring where none is asked
//! for.

use super::bodies::Bodies;
use super::{Parity, trial_on};
use libtest_mimic::{Failed, Trial};
use std::ops::RangeInclusive;
use std::process::Command;
use std::sync::Arc;
use viewfuse::check::case::{Case, Visitor};
use viewfuse::check::cases::visit;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Layer, LayerShape, Memory};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_vulkan::kernel::{Form, Kernel};
use viewfuse_vulkan::{Adapter, GpuOptions, Instance, Limits, VulkanError};

/// The trials of a device.
pub(super) fn trials(instance: &Arc<Instance>, adapter: &Adapter) -> Vec<Trial> {
    let tiled = || Kernel::ALL.into_iter().filter(|kernel| kernel.is_tiled());
    let in_pieces = |kernel: Kernel| {
        let name = format!("{}::in_pieces", kernel.name());
        trial_on(instance, adapter, &name, move |instance, adapter| {
            pieces_have_the_same_bits(instance, adapter, kernel)
        })
    };
    let of_body = |kernel: Kernel| {
        let name = format!("{}::as_the_body", kernel.name());
        trial_on(instance, adapter, &name, move |instance, adapter| {
            let device = open(instance, adapter, Form::Single)?;
            visit(kernel, SameBits { one: &Bodies::PLAIN, other: &device, seeds: 1..=3 })
        })
    };
    let is_there = |form: &&Form| **form != Form::Single && adapter.runs(**form);
    let others = |kernel: Kernel| kernel.forms().iter().filter(is_there).map(move |form| (kernel, *form));
    let other = |(kernel, form): (Kernel, Form)| {
        let name = format!("{}::{}", kernel.name(), form.name());
        trial_on(instance, adapter, &name, move |instance, adapter| is_as_the_first(instance, adapter, kernel, form))
    };
    let mut trials: Vec<Trial> =
        tiled().map(in_pieces).chain(tiled().map(of_body)).chain(tiled().flat_map(others).map(other)).collect();
    if adapter.subgroup_size.is_none() {
        trials.push(trial_on(instance, adapter, "a_form_that_the_device_lacks_is_refused", refused));
        return trials;
    }
    trials.push(trial_on(instance, adapter, "a_form_is_measured_and_remembered", measured_and_remembered));
    trials.push(trial_on(instance, adapter, "two_at_a_time_remember_both", two_at_a_time_remember_both));
    if adapter.name.starts_with("llvmpipe") {
        trials.push(trial_on(instance, adapter, "of_wider_subgroups", |_, _| of_wider_subgroups()));
    }
    trials
}

fn open(instance: &Arc<Instance>, adapter: &Adapter, form: Form) -> Result<Vulkan, VulkanError> {
    Vulkan::open(instance, adapter, &GpuOptions { form: Some(form), ..GpuOptions::default() })
}

fn is_as_the_first(instance: &Arc<Instance>, adapter: &Adapter, kernel: Kernel, form: Form) -> Result<(), Failed> {
    let device = open(instance, adapter, form)?;
    visit(kernel, Parity { device: &device })?;
    visit(kernel, SameBits { one: &open(instance, adapter, Form::Single)?, other: &device, seeds: 3..=3 })
}

/// Lavapipe's usual subgroups have eight invocations. In another process it has some of sixteen, which take another
/// way.
fn of_wider_subgroups() -> Result<(), Failed> {
    let mut again = Command::new(std::env::current_exe()?);
    let output = again.args(["--nocapture", "::subgroup"]).env("LP_NATIVE_VECTOR_WIDTH", "512").output()?;
    let said = String::from_utf8_lossy(&output.stdout);
    let tiled = Kernel::ALL.into_iter().filter(|kernel| kernel.is_tiled());
    let is_tried = |kernel: Kernel| {
        let name = format!("512 bits)::{}::subgroup", kernel.name());
        said.lines().any(|line| line.contains(&name) && line.ends_with("ok"))
    };
    let missing: Vec<&str> = tiled.filter(|kernel| !is_tried(*kernel)).map(Kernel::name).collect();
    match output.status.success() && missing.is_empty() {
        true => Ok(()),
        false => Err(format!("not right in subgroups of sixteen: {missing:?}\n{said}").into()),
    }
}

/// A form is never replaced by another one silently.
fn refused(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let options = GpuOptions { form: Some(Form::Subgroup), ..GpuOptions::default() };
    match Vulkan::open(instance, adapter, &options) {
        Ok(_) => Err("a device without fitting subgroups was opened for them".into()),
        Err(error) if error.to_string().contains("subgroups of 8 to 64 invocations") => Ok(()),
        Err(error) => Err(error.to_string().into()),
    }
}

/// A device on which a dispatch has one workgroup, so that products are cut: workgroups of both sizes.
fn pieces_have_the_same_bits(instance: &Arc<Instance>, adapter: &Adapter, kernel: Kernel) -> Result<(), Failed> {
    for form in [Form::Single, Form::Large].into_iter().filter(|form| adapter.runs(*form)) {
        let usual = GpuOptions { form: Some(form), ..GpuOptions::default() };
        let whole = Vulkan::open(instance, adapter, &usual)?;
        let limits = Limits { workgroup_count: 1, ..usual.limits };
        let cut = Vulkan::open(instance, adapter, &GpuOptions { limits, ..usual })?;
        visit(kernel, SameBits { one: &whole, other: &cut, seeds: 3..=3 })?;
        let [one, several] = [&whole, &cut].map(|device| device.tally(kernel).dispatches);
        if several <= one {
            return Err(format!("{}: {several} dispatches instead of {one}", form.name()).into());
        }
    }
    Ok(())
}

/// Two devices with the same bits.
pub(super) struct SameBits<'a, A, B> {
    pub(super) one: &'a A,
    pub(super) other: &'a B,
    pub(super) seeds: RangeInclusive<u64>,
}

impl<A: Device, B: Device> Visitor for SameBits<'_, A, B> {
    type Output = Result<(), Failed>;

    fn visit<C: Case>(self) -> Result<(), Failed> {
        let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<u32>>();
        for (seed, size) in self.seeds.flat_map(|seed| [(seed, 65), (seed, 700)]) {
            let inputs = C::inputs(seed, size);
            if bits(C::results(self.one, &inputs)?) != bits(C::results(self.other, &inputs)?) {
                return Err(format!("another result of {} at size {size}, seed {seed}", C::KERNEL.name()).into());
            }
        }
        Ok(())
    }
}

/// A linear layer of `row_count` rows that is large enough to be measured: its outputs, and how many submissions it
/// took.
fn linear(device: &Vulkan, row_count: u32) -> Result<(Vec<f32>, u64), Failed> {
    let block = LinearBlock { row_count, inner_count: 130, column_count: 150, ..LinearBlock::default() };
    let shape = LayerShape { inner_count: 130, column_count: 150, has_wide_images: false };
    let number = |index: usize| (index * 7919 % 1000) as f32 / 1000.0 - 0.5;
    let numbers = |count: usize| (0..count).map(number).collect::<Vec<f32>>();
    let layer = Layer::new(device, &shape, &numbers(130 * 150), &numbers(150))?;
    let row_count = row_count as usize;
    let (inputs, mut outputs) = (device.upload(&numbers(row_count * 130))?, device.zeros::<f32>(row_count * 150)?);
    device.finish()?;
    let before = device.submission_count();
    device.linear(&block, &inputs, &layer.weights, &layer.bias, None, &mut outputs)?;
    device.finish()?;
    let submissions = device.submission_count() - before;
    Ok((device.download(&outputs)?, submissions))
}

/// What two open devices measure is all there for a third, whichever is closed first.
fn two_at_a_time_remember_both(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let open = || Vulkan::open_with_memory(instance, adapter, &GpuOptions::default(), folder.path());
    let (one, another) = (open()?, open()?);
    let measuring = [linear(&one, 300)?.1, linear(&another, 1200)?.1];
    drop((one, another));
    let third = open()?;
    let recalled = [linear(&third, 300)?.1, linear(&third, 1200)?.1];
    assert!(measuring.iter().all(|count| *count > 1) && recalled == [1, 1], "{measuring:?}, then {recalled:?}");
    Ok(())
}

/// A linear layer that is large enough to be measured, on one device after another with a common memory.
fn measured_and_remembered(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let run = |device: &Vulkan| linear(device, 300);
    let usual = GpuOptions::default();
    let files =
        || std::fs::read_dir(folder.path()).map(|files| files.flatten().map(|file| file.path()).collect::<Vec<_>>());
    let (first, measuring) = run(&Vulkan::open_with_memory(instance, adapter, &usual, folder.path())?)?;
    let [file] = &files()?[..] else { return Err(format!("it left {:?}", files()).into()) };
    let kept = std::fs::read(file)?;
    let (second, recalled) = run(&Vulkan::open_with_memory(instance, adapter, &usual, folder.path())?)?;
    assert!(measuring > recalled && recalled == 1, "{measuring} submissions, then {recalled}");
    // A driver may give its compiled pipelines in another order: the file's bytes may change, not whether it serves.
    let kept = std::fs::read(file).unwrap_or(kept);
    // A damaged file is replaced, and one that is a folder costs nothing but time.
    let damaged: Vec<u8> = kept.iter().map(|byte| byte ^ 1).collect();
    std::fs::write(file, &damaged)?;
    let (third, again) = run(&Vulkan::open_with_memory(instance, adapter, &usual, folder.path())?)?;
    assert!(again > 1 && std::fs::read(file)? != damaged, "{again} submissions with a damaged file");
    let (fourth, _) = run(&Vulkan::open_with_memory(instance, adapter, &usual, &file.join("folder"))?)?;
    let single = Vulkan::open(instance, adapter, &GpuOptions { form: Some(Form::Single), ..usual })?;
    let (expected, _) = run(&single)?;
    for found in [first, second, third, fourth] {
        assert!(found == expected, "the choice changed the result");
    }
    Ok(())
}
