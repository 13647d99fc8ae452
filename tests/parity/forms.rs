//! Every form of every tiled kernel: against `f64` as the first form is, with the same bits as that one, and chosen by
//! measuring where none is asked for.

use super::Parity;
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;
use viewfuse::check::case::{Case, Visitor};
use viewfuse::check::cases::visit;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Layer, LayerShape, Memory};
use viewfuse_core::network::linear::LinearBlock;
use viewfuse_tests::trials::{is_required, needing};
use viewfuse_vulkan::kernel::{Form, Kernel};
use viewfuse_vulkan::{Adapter, GpuOptions, Instance, Missing};

/// The trials of a device.
pub(super) fn trials(instance: &Arc<Instance>, adapter: &Adapter) -> Vec<Trial> {
    let missing: Vec<String> = adapter.missing.iter().map(Missing::to_string).collect();
    let missing = (!missing.is_empty()).then(|| missing.join(", "));
    let ready = |trial: Trial| needing(missing.clone(), is_required("VIEWFUSE_REQUIRE_VULKAN"), trial);
    let of_form = |kernel: Kernel, form: Form| {
        let (instance, adapter) = (instance.clone(), adapter.clone());
        let name = format!("{}::{}::{}", adapter.name, kernel.name(), form.name());
        ready(Trial::test(name, move || {
            let open =
                |form| Vulkan::open(&instance, &adapter, &GpuOptions { form: Some(form), ..GpuOptions::default() });
            let device = open(form)?;
            visit(kernel, Parity { device: &device })?;
            visit(kernel, SameBits { single: &open(Form::Single)?, other: &device })
        }))
    };
    let tiled = Kernel::ALL.into_iter().filter(|kernel| kernel.is_tiled());
    let others =
        |kernel: Kernel| kernel.forms().iter().filter(|form| **form != Form::Single).map(move |form| (kernel, *form));
    let mut trials: Vec<Trial> = tiled.flat_map(others).map(|(kernel, form)| of_form(kernel, form)).collect();
    let (instance, adapter) = (instance.clone(), adapter.clone());
    let name = format!("{}::a_form_is_measured_and_remembered", adapter.name);
    trials.push(ready(Trial::test(name, move || measured_and_remembered(&instance, &adapter))));
    trials
}

struct SameBits<'a> {
    single: &'a Vulkan,
    other: &'a Vulkan,
}

impl Visitor for SameBits<'_> {
    type Output = Result<(), Failed>;

    fn visit<C: Case>(self) -> Result<(), Failed> {
        for size in [65, 700] {
            let inputs = C::inputs(3, size);
            let bits = |device: &Vulkan| -> Result<Vec<u32>, Failed> {
                Ok(C::results(device, &inputs)?.into_iter().map(f32::to_bits).collect())
            };
            if bits(self.single)? != bits(self.other)? {
                return Err(format!("another result of {} at size {size}", C::KERNEL.name()).into());
            }
        }
        Ok(())
    }
}

/// A linear layer that is large enough to be measured, on one device after another with a common memory.
fn measured_and_remembered(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    let block = LinearBlock { row_count: 300, inner_count: 130, column_count: 150, ..LinearBlock::default() };
    let shape = LayerShape { inner_count: 130, column_count: 150, has_wide_images: false };
    let number = |index: usize| (index * 7919 % 1000) as f32 / 1000.0 - 0.5;
    let numbers = |count: usize| (0..count).map(number).collect::<Vec<f32>>();
    let run = |device: &Vulkan| -> Result<(Vec<f32>, u64), Failed> {
        let layer = Layer::new(device, &shape, &numbers(130 * 150), &numbers(150))?;
        let (inputs, mut outputs) = (device.upload(&numbers(300 * 130))?, device.zeros::<f32>(300 * 150)?);
        device.finish()?;
        let before = device.submission_count();
        device.linear(&block, &inputs, &layer.weights, &layer.bias, None, &mut outputs)?;
        device.finish()?;
        let submissions = device.submission_count() - before;
        Ok((device.download(&outputs)?, submissions))
    };
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
