//! Products that are not exact against `f64` within the bounds that follow from the roundings. Of factors in f16, in one
//! part and in two: by a device's matrix units where it has them, and on lavapipe by what stands in for them, which has
//! the same places, barriers and roundings. Fused with sums: on every device.

use super::trial_on;
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Layer, LayerShape, Memory, Precision};
use viewfuse_core::sampler::Mix;
use viewfuse_kernels::limits::{REPEATED, RepeatedBlock};
use viewfuse_kernels::network::convolve::{ConvolveBlock, patch_value};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_tests::devices::{exchanged_stand_ins, stand_ins, takes_stand_ins};
use viewfuse_vulkan::kernel::{Form, Kernel};
use viewfuse_vulkan::{Adapter, AdapterKind, Buffer, Gpu, GpuOptions, Instance, Limits};

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
    trials.push(trial_on(instance, adapter, "a_product_is_repeated_by_units", repeated_by_units));
    trials.push(trial_on(instance, adapter, "rounded_forms_are_trusted_after_a_probe", trusted_after_a_probe));
    trials.push(trial_on(instance, adapter, "written_weights_are_rounded_again", written_weights_are_rounded_again));
    trials.push(trial_on(instance, adapter, "without_memory_for_f16_products_are_exact", without_memory_for_f16));
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
        let right = || weights.iter().skip(column).step_by(*columns);
        if form.needs_matrices() && left.iter().chain(right()).any(|number| number.abs() > 65_504.0) {
            if !found.is_nan() {
                return Err(format!("{found} hides a factor that is too large").into());
            }
            continue;
        }
        let (mut sum, mut total, mut bound) = (f64::from(first[element]), f64::from(first[element].abs()), 0.0);
        for (a, b) in left.iter().zip(right()) {
            let (a, b) = (f64::from(*a), f64::from(*b));
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
        let mut weights = numbers(inners * columns, 2);
        let (bias, residual) = (numbers(columns, 3), numbers(rows * columns, 4));
        if rows > 100 {
            left[inners + 1] = 70_000.0;
            left[3 * inners] = if form.needs_matrices() { f32::NEG_INFINITY } else { -1e9 };
            left[5 * inners] = 60_000.0;
            left[5 * inners + 1] = 3e-6;
            // One that every row of its column multiplies, and those that f16 has just.
            weights[2 * columns + 1] = if form.needs_matrices() { 70_000.0 } else { 1e9 };
            weights[2] = -65_504.0;
            weights[columns + 2] = 3e-6;
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

/// What measures matrix units computes what it says: products within a tile, beyond it and of none of their rounds. It
/// does nothing where columns are not whole fours, or there are no units.
fn repeated_by_units(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let open = |stand_ins| Vulkan::open(instance, adapter, &GpuOptions { stand_ins, ..GpuOptions::default() });
    let device = open(Some(stand_ins()))?;
    let inner = REPEATED as usize;
    for (rows, columns, rounds) in [(1, 4, 1), (131, 196, 3), (128, 128, 40), (5, 8, 0)] {
        let (mut left, right) = (numbers(rows * inner, 1), numbers(inner * columns, 2));
        if rows == 131 {
            left[3 * inner] = 70_000.0;
        }
        let block = RepeatedBlock { row_count: rows as u32, column_count: columns as u32, round_count: rounds as u32 };
        let (inputs, weights) = (device.upload(&left)?, device.upload(&right)?);
        let mut sums = device.upload(&vec![f32::INFINITY; rows * columns])?;
        assert!(device.repeat_product_by_units(&block, &inputs, &weights, &mut sums)?, "a device with units");
        if rounds == 0 {
            assert_eq!(device.download(&sums)?, vec![0.0; rows * columns]);
            continue;
        }
        let left = left.chunks(inner).flat_map(|row| row.repeat(rounds)).collect();
        let product = Product { left, weights: right.repeat(rounds), first: vec![0.0; rows * columns], columns };
        compare(Form::Half, &product, &device.download(&sums)?)?;
    }
    let block = RepeatedBlock { row_count: 2, column_count: 6, round_count: 1 };
    let (left, right, mut sums) = (device.zeros(32)?, device.zeros(96)?, device.upload(&[1.0; 12])?);
    assert!(!device.repeat_product_by_units(&block, &left, &right, &mut sums)?, "columns in no fours");
    assert_eq!(device.download(&sums)?, [1.0; 12]);
    if !adapter.has_matrices {
        let without = open(None)?;
        let block = RepeatedBlock { column_count: 4, ..block };
        let (left, right, mut sums) = (without.zeros(32)?, without.zeros(64)?, without.zeros(8)?);
        assert!(!without.repeat_product_by_units(&block, &left, &right, &mut sums)?, "a device without units");
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

/// Rows, inner indices and columns of the products below, as parameters.
fn block(sizes: [u32; 3]) -> LinearBlock {
    let [row_count, inner_count, column_count] = sizes;
    LinearBlock { row_count, inner_count, column_count, ..LinearBlock::default() }
}

/// The device keeps weights as f16: not those from before a kernel wrote others, also one that was recorded.
fn written_weights_are_rounded_again(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let device =
        Vulkan::open(instance, adapter, &GpuOptions { stand_ins: Some(stand_ins()), ..GpuOptions::default() })?;
    const SIDE: usize = 64;
    let block = block([SIDE as u32; 3]);
    let identity = |scale: f32| -> Vec<f32> {
        (0..SIDE * SIDE).map(|at| if at / SIDE == at % SIDE { scale } else { 0.0 }).collect()
    };
    let (inputs, bias) = (device.upload(&numbers(SIDE * SIDE, 1))?, device.upload(&[0.0; SIDE])?);
    let product = |weights: &_| -> Result<Vec<f32>, Failed> {
        let mut outputs = device.upload(&[f32::INFINITY; SIDE * SIDE])?;
        device.linear_in(Precision::Half, &block, &inputs, weights, &bias, None, &mut outputs)?;
        Ok(device.download(&outputs)?)
    };
    let (first, second) = (numbers(SIDE * SIDE, 2), numbers(SIDE * SIDE, 3));
    let mut weights = device.upload(&first)?;
    let before = product(&weights)?;
    assert_eq!(before, product(&weights)?, "the same weights");
    let (doubled, of_others) = (device.upload(&identity(2.0))?, device.upload(&second)?);
    device.linear(&block, &doubled, &of_others, &bias, None, &mut weights)?;
    let expected: Vec<f32> = second.iter().map(|number| 2.0 * number).collect();
    assert_eq!(device.download(&weights)?, expected);
    let after = product(&weights)?;
    assert_ne!(after, before, "the weights from before");
    assert_eq!(after, product(&device.upload(&expected)?)?);
    let copy = |from: &Buffer<f32>, to: &mut Buffer<f32>| {
        let mix = Mix { state: 1.0, results: [0.0; 4] };
        device.mix_pictures(&mix, (SIDE * SIDE) as u32, from, from, from, from, from, to)
    };
    let (mut source, others) = (device.upload(&first)?, device.upload(&expected)?);
    let ((), writing) = device.recorded(|| copy(&source, &mut weights))?;
    let writing = writing.ok_or("it is not recorded")?;
    assert_eq!(product(&weights)?, before);
    copy(&others, &mut source)?;
    writing.again()?;
    assert_eq!(product(&weights)?, after, "the weights from before the recording was submitted again");
    Ok(())
}

/// Where there is no memory for weights as f16, a product is exact.
fn without_memory_for_f16(instance: &Arc<Instance>, adapter: &Adapter) -> Result<(), Failed> {
    let limits = Limits { memory: 96 << 20, ..GpuOptions::default().limits };
    let options = GpuOptions { stand_ins: Some(stand_ins()), limits, ..GpuOptions::default() };
    let device = Vulkan::open(instance, adapter, &options)?;
    const SIDE: usize = 1024;
    let block = block([32, SIDE as u32, SIDE as u32]);
    let (inputs, weights) = (device.upload(&numbers(32 * SIDE, 1))?, device.upload(&numbers(SIDE * SIDE, 2))?);
    let (bias, mut outputs) = (device.upload(&[0.0; SIDE])?, device.zeros::<f32>(32 * SIDE)?);
    assert!(device.rounds(Precision::Half));
    device.linear(&block, &inputs, &weights, &bias, None, &mut outputs)?;
    let exact = device.download(&outputs)?;
    // Pieces that are smaller than the weights in f16, until none is left.
    let mut taken = Vec::new();
    while let Ok(piece) = device.zeros::<u32>(1 << 18) {
        taken.push(piece);
    }
    assert!(!taken.is_empty());
    device.linear_in(Precision::Half, &block, &inputs, &weights, &bias, None, &mut outputs)?;
    assert_eq!(device.download(&outputs)?, exact);
    drop(taken);
    device.linear_in(Precision::Half, &block, &inputs, &weights, &bias, None, &mut outputs)?;
    assert_ne!(device.download(&outputs)?, exact, "there is memory now");
    Ok(())
}
