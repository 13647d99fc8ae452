//! Products that are not exact against `f64` within the bounds that follow from the roundings. Of factors in f16, in one
//! part and in two: by a device's matrix units where it has them, and on lavapipe by what stands in for them, which has
//! the same places, barriers and roundings. Fused with sums: on every device.

use super::trial_on;
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Layer, LayerShape, Memory};
use viewfuse_kernels::network::convolve::{ConvolveBlock, patch_value};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_tests::devices::{exchanged_stand_ins, stand_ins, takes_stand_ins};
use viewfuse_vulkan::kernel::{Form, Kernel};
use viewfuse_vulkan::{Adapter, AdapterKind, Gpu, GpuOptions, Instance};

/// The trials of a device.
pub(super) fn trials(instance: &Arc<Instance>, adapter: &Adapter) -> Vec<Trial> {
    let mut trials = vec![trial_on(instance, adapter, "fused_products_are_tried", fused_products_are_tried)];
    for form in Form::FUSED.into_iter().filter(|form| adapter.has_room_for(*form)) {
        let options = GpuOptions { form: Some(form), ..GpuOptions::default() };
        trials.push(trial_on(instance, adapter, form.name(), move |instance, adapter| {
            is_within_its_bound(instance, adapter, &options, form)
        }));
    }
    if !takes_stand_ins(adapter) {
        return trials;
    }
    for form in Form::ROUNDED {
        for (what, stand_ins) in [("stands_in", Some(stand_ins())), ("units", None)] {
            if stand_ins.is_none() && !adapter.has_matrices || !adapter.has_room_for(form) {
                continue;
            }
            let options = GpuOptions { form: Some(form), stand_ins, ..GpuOptions::default() };
            trials.push(trial_on(instance, adapter, &format!("{}::{what}", form.name()), move |instance, adapter| {
                is_within_its_bound(instance, adapter, &options, form)
            }));
        }
    }
    trials.push(trial_on(instance, adapter, "rounded_forms_are_trusted_after_a_probe", trusted_after_a_probe));
    trials
}

/// A linear layer or a convolution: the left matrix, the right one and what is added.
struct Product {
    left: Vec<f32>,
    weights: Vec<f32>,
    first: Vec<f32>,
    columns: usize,
}

fn numbers(count: usize, mut seed: u32) -> Vec<f32> {
    let draw = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    std::iter::repeat_with(draw).take(count).collect()
}

/// The largest share of its bound that an output's error takes; an error where a number is beyond it.
fn compare(form: Form, product: &Product, outputs: &[f32]) -> Result<f64, Failed> {
    let Product { left, weights, first, columns } = product;
    let inners = weights.len() / columns;
    let (relative, absolute) = match form {
        form if form.may_fuse() => (0.0, 0.0),
        Form::Half | Form::HalfSmall | Form::HalfTiny => (2_f64.powi(-11), 2_f64.powi(-14)),
        _ => (2_f64.powi(-22), 2_f64.powi(-25)),
    };
    let off = |factor: f64| (factor.abs() * relative).max(absolute);
    let mut worst = 0.0_f64;
    for (element, found) in outputs.iter().enumerate() {
        let (row, column) = (element / columns, element % columns);
        let left = &left[row * inners..(row + 1) * inners];
        if form.needs_matrices() && left.iter().any(|number| number.abs() > 65_504.0) {
            if !found.is_nan() {
                return Err(format!("{found} hides a factor that is too large").into());
            }
            continue;
        }
        let (mut sum, mut total, mut bound) = (f64::from(first[element]), f64::from(first[element].abs()), 0.0);
        for (inner, a) in left.iter().enumerate() {
            let (a, b) = (f64::from(*a), f64::from(weights[inner * columns + column]));
            sum += a * b;
            total += (a * b).abs();
            bound += off(a) * b.abs() + off(b) * a.abs() + off(a) * off(b);
            bound += if form.sizes()[0] == Form::TwoHalves { (a * b).abs() * relative } else { 0.0 };
        }
        // Half a unit a product and half a unit a sum, where units of matrices may cut instead.
        bound += (inners + 4) as f64 * if form.may_fuse() { 2_f64.powi(-23) } else { 2_f64.powi(-22) } * total;
        let share = (f64::from(*found) - sum).abs() / bound;
        if share.is_nan() || share > 1.0 {
            return Err(format!("row {row}, column {column}: {found} instead of {sum}, bound {bound}").into());
        }
        worst = worst.max(share);
    }
    Ok(worst)
}

fn is_within_its_bound(
    instance: &Arc<Instance>,
    adapter: &Adapter,
    options: &GpuOptions,
    form: Form,
) -> Result<(), Failed> {
    let device = Vulkan::open(instance, adapter, options)?;
    // Rows and columns within a tile, of one, and beyond it; inner indices of a part of a step, of whole ones, and
    // more. All in fours, as the forms need them.
    let shapes = [(1, 4, 4), (5, 28, 4), (64, 32, 64), (128, 64, 128), (131, 68, 196), (130, 300, 68)];
    for (rows, inners, columns) in shapes {
        let mut left = numbers(rows * inners, 1);
        let weights = numbers(inners * columns, 2);
        let (bias, residual) = (numbers(columns, 3), numbers(rows * columns, 4));
        if rows > 100 {
            left[inners + 1] = 70_000.0;
            left[3 * inners] = if form.needs_matrices() { f32::NEG_INFINITY } else { -1e9 };
            left[5 * inners] = 60_000.0;
            left[5 * inners + 1] = 3e-6;
        }
        let block = LinearBlock {
            row_count: rows as u32,
            inner_count: inners as u32,
            column_count: columns as u32,
            ..LinearBlock::default()
        };
        let shape = LayerShape { inner_count: inners, column_count: columns, has_wide_images: false };
        let layer = Layer::new(&device, &shape, &weights, &bias)?;
        let (inputs, more) = (device.upload(&left)?, device.upload(&residual)?);
        let mut outputs = device.upload(&vec![f32::INFINITY; rows * columns])?;
        device.linear(&block, &inputs, &layer.weights, &layer.bias, Some(&more), &mut outputs)?;
        let first = residual.iter().enumerate().map(|(element, more)| bias[element % columns] + more).collect();
        compare(form, &Product { left, weights, first, columns }, &device.download(&outputs)?)?;
    }
    for (size, stride, dilation, enlarge) in [(1, 1, 1, 1), (3, 1, 1, 1), (3, 2, 1, 1), (3, 1, 2, 1), (3, 1, 1, 2)] {
        let side = |of: u32| (of * enlarge + 2 * (size / 2) - (size - 1) * dilation - 1) / stride + 1;
        let (channels, out_channels) = (12, 72);
        let block = ConvolveBlock {
            in_height: 12,
            in_width: 14,
            in_channels: channels,
            out_height: side(12),
            out_width: side(14),
            out_channels,
            size,
            stride,
            padding: size / 2,
            ..ConvolveBlock::default()
        };
        let block = ConvolveBlock { in_pitch: channels, dilation, enlarge, ..block.packed() };
        let (columns, inners) = (out_channels as usize, block.patch_len() as usize);
        let image = numbers((12 * 14 * channels) as usize, 5);
        let (weights, bias) = (numbers(inners * columns, 6), numbers(columns, 7));
        let shape = LayerShape { inner_count: inners, column_count: columns, has_wide_images: false };
        let layer = Layer::new(&device, &shape, &weights, &bias)?;
        let inputs = device.upload(&image)?;
        let pixels = block.pixel_count();
        let mut outputs = device.upload(&vec![f32::INFINITY; pixels as usize * columns])?;
        device.convolve(&block, &inputs, &layer.weights, &layer.bias, None, &mut outputs)?;
        let patches = (0..pixels).flat_map(|pixel| (0..inners as u32).map(move |inner| (pixel, inner)));
        let left = patches.map(|(pixel, inner)| patch_value(&image[..], &block, pixel, inner)).collect();
        let first = (0..pixels as usize * columns).map(|element| bias[element % columns]).collect();
        compare(form, &Product { left, weights, first, columns }, &device.download(&outputs)?)?;
    }
    Ok(())
}

/// Fused products are used where they gain something, which they do on no processor.
fn fused_products_are_tried(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let kernels = [Kernel::Linear, Kernel::Convolve];
    let open = |min_fused_gain| Gpu::open(instance, adapter, &GpuOptions { min_fused_gain, ..GpuOptions::default() });
    let (usual, whenever_right, never) = (open(1.1)?, open(0.0)?, open(f64::INFINITY)?);
    for (kernel, form) in kernels.into_iter().flat_map(|kernel| Form::FUSED.map(|form| (kernel, form))) {
        let is_trusted = usual.trusts(kernel, form)?;
        println!("{} {}: {is_trusted}", kernel.name(), form.name());
        assert!(!is_trusted || adapter.kind != AdapterKind::Software, "a processor gained by {}", form.name());
        assert_eq!(whenever_right.trusts(kernel, form)?, adapter.has_room_for(form), "{}", form.name());
        assert!(!never.trusts(kernel, form)?, "no form is so much faster");
    }
    assert!(!whenever_right.trusts(Kernel::MatrixProduct, Form::Fused)?, "a kernel without the form");
    assert!(never.distrusted_forms().is_empty(), "what gains nothing is no fault");
    Ok(())
}

/// What stands in is trusted, a module that computes something else is not, and a device without units has neither.
fn trusted_after_a_probe(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let open = |stand_ins| Gpu::open(instance, adapter, &GpuOptions { stand_ins, ..GpuOptions::default() });
    let kernels = [Kernel::Linear, Kernel::Convolve];
    let right = open(Some(stand_ins()))?;
    let forms = Form::ROUNDED.into_iter().filter(|form| adapter.has_room_for(*form)).collect::<Vec<Form>>();
    for (kernel, form) in kernels.into_iter().flat_map(|kernel| forms.iter().map(move |form| (kernel, *form))) {
        assert!(right.trusts(kernel, form)?, "{} {}", kernel.name(), form.name());
    }
    assert!(!right.trusts(Kernel::MatrixProduct, Form::Half)?, "a kernel without the form");
    assert!(right.distrusted_forms().is_empty(), "nothing was tried that is wrong");
    if !adapter.has_matrices {
        let without = open(None)?;
        assert!(!without.trusts(Kernel::Linear, Form::Half)?, "a device without units");
    }
    let wrong = open(Some(exchanged_stand_ins()))?;
    let largest = wrong.largest(Form::TwoHalves);
    assert!(!wrong.trusts(Kernel::Linear, largest)?, "another form in its place");
    assert_eq!(wrong.distrusted_forms(), [(Kernel::Linear, largest)]);
    Ok(())
}
