//! Forms of tiled kernels: what they write while they are measured is compared, and leaves nothing behind; a form that
//! a driver compiles wrongly, or for subgroups of another size, is not used. Faults are made on every device
//! ([`Faults`]).

use crate::candidate::{Candidate, tests};
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_vulkan::kernel::{Form, Kernel, tile_elements};
use viewfuse_vulkan::{AdapterKind, Bound, Faults, Gpu, GpuOptions, VulkanError};

tests!(
    measuring_leaves_the_other_channels_alone,
    a_form_with_other_results_is_not_used,
    a_form_of_other_subgroups_is_not_used,
    kernels_are_compiled_ahead,
    tiles_stay_in_registers,
    arrays_that_end_early_are_read_alike,
);

/// Most registers of an invocation of any device.
const MAX_REGISTERS: f64 = 256.0;

/// What a driver says of each form of a product: no invocation has more registers than there are. Most say nothing.
fn tiles_stay_in_registers(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    for kernel in [Kernel::Linear, Kernel::Convolve] {
        let forms = kernel.forms().iter().chain(kernel.rounded_forms()).chain(&Form::FUSED);
        for form in forms.copied().filter(|form| candidate.adapter.runs(*form)) {
            let statistics = gpu.statistics(kernel, form)?;
            println!("{} {}: {statistics:?}", kernel.name(), form.name());
            let registers = statistics.iter().filter(|(name, _)| name.to_lowercase().contains("register count"));
            registers.for_each(|(name, count)| assert!((1.0..=MAX_REGISTERS).contains(count), "{name}: {count}"));
        }
    }
    Ok(())
}

fn numbers(count: u32) -> Vec<f32> {
    (0..count).map(|at| (at * 7919 % 1000) as f32 / 1000.0 - 0.5).collect()
}

fn bits(gpu: &Gpu, outputs: &viewfuse_vulkan::Buffer<f32>) -> Result<Vec<u32>, VulkanError> {
    Ok(gpu.download(outputs)?.into_iter().map(f32::to_bits).collect())
}

/// The product of two matrices that is large enough for every form, as bits.
fn linear(gpu: &Gpu) -> Result<Vec<u32>, VulkanError> {
    let [row_count, inner_count, column_count] = [300_u32, 130, 150];
    let block = LinearBlock { row_count, inner_count, column_count, ..LinearBlock::default() };
    let [inputs, weights, bias] =
        [row_count * inner_count, inner_count * column_count, column_count].map(|count| gpu.upload(&numbers(count)));
    let (inputs, weights, bias) = (inputs?, weights?, bias?);
    let (residual, outputs) = (gpu.zeros::<f32>(1)?, gpu.zeros::<f32>((row_count * column_count) as usize)?);
    let arrays = [inputs.bind(), weights.bind(), bias.bind(), residual.bind(), outputs.bind()];
    let elements = 0..tile_elements(row_count, column_count);
    gpu.dispatch(Kernel::Linear, bytes_of(&block), elements, &arrays)?;
    bits(gpu, &outputs)
}

/// Arrays that are shorter than a kernel's parameters say, or end within a four: every form reads the last number again,
/// as its body does, and none reads beyond. Forms that read fours do not take them, and take all others.
fn arrays_that_end_early_are_read_alike(candidate: &Candidate) -> Result<(), Failed> {
    let side = 64_u32;
    let block = LinearBlock {
        row_count: side,
        inner_count: side,
        column_count: side,
        has_residual: 1,
        ..LinearBlock::default()
    };
    let whole = [side, side * side];
    let faulty = |form: Form, faults: Faults, [bias_len, residual_len]: [u32; 2]| -> Result<Vec<u32>, VulkanError> {
        let gpu = candidate.gpu(&GpuOptions { form: Some(form), faults, ..GpuOptions::default() })?;
        let [inputs, weights, bias, residual] =
            [side * side, side * side, bias_len, residual_len].map(|count| gpu.upload(&numbers(count)));
        let (inputs, weights, bias, residual) = (inputs?, weights?, bias?, residual?);
        let outputs = gpu.zeros::<f32>((side * side) as usize)?;
        let arrays = [inputs.bind(), weights.bind(), bias.bind(), residual.bind(), outputs.bind()];
        gpu.dispatch(Kernel::Linear, bytes_of(&block), 0..tile_elements(side, side), &arrays)?;
        bits(&gpu, &outputs)
    };
    let product = |form: Form, lengths: [u32; 2]| faulty(form, Faults::default(), lengths);
    for lengths in [[1, 64 * 64], [3, 64 * 64], [61, 64 * 64], [64, 1], [64, 64 * 64 - 3], [8, 64]] {
        let expected = product(Form::Single, lengths)?;
        for form in Form::ALL.into_iter().filter(|form| candidate.adapter.runs(*form)) {
            assert!(product(form, lengths)? == expected, "{} with arrays of {lengths:?}", form.name());
        }
    }
    let expected = product(Form::Single, whole)?;
    for form in Form::ALL.into_iter().filter(|form| form.needs_fours() && candidate.adapter.runs(*form)) {
        let faults = Faults { half_done: Some(form), ..Faults::default() };
        assert!(faulty(form, faults, whole)? != expected, "{} is not taken for whole arrays", form.name());
        assert!(faulty(form, faults, [side - 1, side * side])? == product(form, [side - 1, side * side])?);
    }
    Ok(())
}

/// Channels of a wider image, the first one that a convolution writes, and how many it writes.
const WIDE: u32 = 100;
const FIRST: u32 = 20;
const OWN: u32 = 70;

/// A convolution that is large enough to be measured, into some channels of a wider image that holds numbers before, as
/// bits.
fn convolve_into_a_wider_image(gpu: &Gpu) -> Result<Vec<u32>, VulkanError> {
    let [side, in_channels, size] = [20_u32, 32, 3];
    let block = ConvolveBlock {
        in_height: side,
        in_width: side,
        in_channels,
        out_height: side,
        out_width: side,
        out_channels: OWN,
        size,
        stride: 1,
        padding: 1,
        ..ConvolveBlock::default()
    };
    let block = ConvolveBlock { out_pitch: WIDE, out_first: FIRST, ..block.packed() };
    let counts = [side * side * in_channels, size * size * in_channels * OWN, OWN, 1, side * side * WIDE];
    let [inputs, weights, bias, residual, outputs] = counts.map(|count| gpu.upload(&numbers(count)));
    let (inputs, weights, bias, residual, outputs) = (inputs?, weights?, bias?, residual?, outputs?);
    let arrays: [Bound<'_>; 5] = [inputs.bind(), weights.bind(), bias.bind(), residual.bind(), outputs.bind()];
    let elements = 0..tile_elements(block.pixel_count(), OWN);
    gpu.dispatch(Kernel::Convolve, bytes_of(&block), elements, &arrays)?;
    bits(gpu, &outputs)
}

/// Kernels that are compiled ahead give the same results, whatever became of the threads that compile.
fn kernels_are_compiled_ahead(candidate: &Candidate) -> Result<(), Failed> {
    let expected = linear(&candidate.gpu(&GpuOptions::default())?)?;
    let gpu = candidate.gpu(&GpuOptions::default())?;
    gpu.compile_ahead(&[Kernel::Linear, Kernel::Convolve, Kernel::Linear]);
    assert!(linear(&gpu)? == expected);
    let kept = gpu.remembered(&[]);
    let again = candidate.gpu(&GpuOptions::default())?;
    assert!(again.recall(&kept));
    again.compile_ahead(&[Kernel::Linear]);
    assert!(linear(&again)? == expected);
    // A device that is closed at once waits for what is being compiled, and for no more.
    candidate.gpu(&GpuOptions::default())?.compile_ahead(&Kernel::ALL);
    Ok(())
}

fn with_faults(faults: Faults) -> GpuOptions {
    GpuOptions { faults, ..GpuOptions::default() }
}

const OF_SINGLE: fn() -> GpuOptions = || GpuOptions { form: Some(Form::Single), ..GpuOptions::default() };

fn measuring_leaves_the_other_channels_alone(candidate: &Candidate) -> Result<(), Failed> {
    let (measured, single) = (candidate.gpu(&GpuOptions::default())?, candidate.gpu(&OF_SINGLE())?);
    let (found, expected) = (convolve_into_a_wider_image(&measured)?, convolve_into_a_wider_image(&single)?);
    let is_software = candidate.adapter.kind == AdapterKind::Software;
    let has_several = !is_software || candidate.adapter.subgroup_size.is_some();
    assert_eq!(measured.submission_count() > single.submission_count(), has_several, "it was measured");
    assert!(found == expected, "measuring changed the result");
    assert_eq!(measured.refused_forms(), []);
    let before = numbers(found.len() as u32);
    let is_own = |at: usize| (FIRST..FIRST + OWN).contains(&(at as u32 % WIDE));
    let others = (0..found.len()).filter(|at| !is_own(*at));
    assert!(others.clone().count() > 0 && others.into_iter().all(|at| found[at] == before[at].to_bits()));
    assert!((0..found.len()).filter(|at| is_own(*at)).any(|at| found[at] != before[at].to_bits()));
    Ok(())
}

fn a_form_with_other_results_is_not_used(candidate: &Candidate) -> Result<(), Failed> {
    // Without subgroups there is one form.
    if candidate.adapter.subgroup_size.is_none() {
        return Ok(());
    }
    let expected = linear(&candidate.gpu(&OF_SINGLE())?)?;
    // Half of the work takes half of the time: it would be chosen.
    let half_done = Some(Form::Subgroup);
    let faulty = candidate.gpu(&with_faults(Faults { half_done, ..Faults::default() }))?;
    assert!(linear(&faulty)? == expected, "a form that does half of the work was used");
    assert_eq!(faulty.refused_forms(), [(Kernel::Linear, Form::Subgroup)]);
    // The fault is one: whoever asks for this form gets its results.
    let options = GpuOptions { form: half_done, ..with_faults(Faults { half_done, ..Faults::default() }) };
    assert!(linear(&candidate.gpu(&options)?)? != expected);
    Ok(())
}

fn a_form_of_other_subgroups_is_not_used(candidate: &Candidate) -> Result<(), Failed> {
    let expected = linear(&candidate.gpu(&OF_SINGLE())?)?;
    let pretend = |size: u32| Faults { reported_subgroup_size: Some(size), ..Faults::default() };
    let Some(size) = candidate.adapter.subgroup_size else {
        // Nothing needs subgroups here, so nothing is reported, and nothing is refused.
        let gpu = candidate.gpu(&with_faults(pretend(8)))?;
        assert!(linear(&gpu)? == expected && gpu.refused_forms().is_empty());
        assert_eq!(gpu.reported_subgroup_size(Kernel::Linear), None);
        return Ok(());
    };
    for (reported, refused) in [(size, &[][..]), (2 * size, &[(Kernel::Linear, Form::Subgroup)][..])] {
        let gpu = candidate.gpu(&with_faults(pretend(reported)))?;
        assert!(linear(&gpu)? == expected, "subgroups of {reported}");
        assert_eq!(gpu.reported_subgroup_size(Kernel::Linear), Some(reported));
        assert_eq!(gpu.refused_forms(), refused, "subgroups of {reported}");
    }
    // A form is never replaced by another one silently.
    let asked = GpuOptions { form: Some(Form::Subgroup), ..with_faults(pretend(2 * size)) };
    match linear(&candidate.gpu(&asked)?) {
        Err(error @ VulkanError::Missing { .. }) => {
            assert!(error.to_string().contains("subgroups of the size that was asked for"), "{error}");
        }
        other => {
            return Err(format!("subgroups of another size were used: {:?}", other.map(|found| found.len())).into());
        }
    }
    Ok(())
}
