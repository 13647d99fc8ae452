//! Whether forms that are not exact ([`Form::ROUNDED`], [`Form::FUSED`]) give on a device what they promise: a product is
//! tried first, and of fused ones the time, too.

use crate::buffer::{Bound, Buffer};
use crate::dispatch::lies_in_fours;
use crate::error::VulkanError;
use crate::forms::ENOUGH_TILES;
use crate::gpu::Gpu;
use crate::kernel::{Form, Kernel};
use bytemuck::bytes_of;
use std::ops::Range;
use std::time::{Duration, Instant};
use viewfuse_kernels::network::convolve::{ConvolveBlock, patch_value};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::network::tile::Shape;

/// The largest f16.
const LARGEST: f32 = 65_504.0;
/// Measurements of a form's time, and dispatches of each.
const ROUNDS: u32 = 3;
const REPEATS: u32 = 4;

impl Gpu {
    /// As [`Gpu::dispatch`], with a form that is not [exact](Form::is_exact) where this device is trusted with it
    /// ([`Gpu::trusts`]) and the arrays lie in fours ([`Kernel::used_in_fours`]): other numbers, within that form's
    /// bound; otherwise as `dispatch`. Weights that a form [reads as f16](Form::has_f16_weights) are rounded at their
    /// first use and kept so beside the others, half as many bytes, until they are written; without memory for that, as
    /// `dispatch`. Of the form's [sizes](Form::sizes) that is taken which suits the product, where
    /// the device is trusted with it as well as with the largest one.
    ///
    /// # Errors
    /// Those of [`Gpu::dispatch`].
    pub fn dispatch_rounded(
        &self,
        kernel: Kernel,
        form: Form,
        parameters: &[u8],
        elements: Range<u32>,
        arrays: &[Bound<'_>],
    ) -> Result<(), VulkanError> {
        let form = match kernel.shape(parameters) {
            Some(shape) if !form.is_exact() && lies_in_fours(kernel, parameters, arrays) => {
                Some(self.sized(form, shape))
            }
            _ => None,
        };
        let form = match form {
            Some(form) if self.trusts(kernel, self.largest(form))? && self.trusts(kernel, form)? => Some(form),
            _ => None,
        };
        match self.dispatch_in(kernel, form, parameters, elements.clone(), arrays) {
            // For weights as f16.
            Err(VulkanError::OutOfMemory { .. }) if form.is_some_and(Form::has_f16_weights) => {
                self.dispatch(kernel, parameters, elements, arrays)
            }
            done => done,
        }
    }

    /// As [`Gpu::dispatch`] in a form of rounded factors, whatever the size of the product; `false`, and nothing is done,
    /// where the device is [not trusted](Gpu::trusts) with it. The arrays lie in fours.
    ///
    /// # Errors
    /// Those of [`Gpu::dispatch`].
    pub fn dispatch_by_units(
        &self,
        kernel: Kernel,
        form: Form,
        parameters: &[u8],
        elements: Range<u32>,
        arrays: &[Bound<'_>],
    ) -> Result<bool, VulkanError> {
        if !form.needs_matrices() || !self.trusts(kernel, form)? {
            return Ok(false);
        }
        self.dispatch_in(kernel, Some(form), parameters, elements, arrays)?;
        Ok(true)
    }

    /// The largest of a form's [sizes](Form::sizes) for which the device's workgroups have room: whether it is
    /// [trusted](Gpu::trusts) decides for all.
    pub fn largest(&self, form: Form) -> Form {
        form.sizes().iter().find(|form| self.runs(**form)).copied().unwrap_or(form)
    }

    /// A form in the largest tiles of which a product has enough, or in its smallest. A matter of the product and of
    /// the room in a workgroup: another form has its sums in another order.
    fn sized(&self, form: Form, shape: Shape) -> Form {
        let sizes = form.sizes();
        let has_enough = |form: &&Form| {
            // Large tiles are worth more the more there is to round.
            let enough = if **form == Form::TwoHalves { ENOUGH_TILES / 2 } else { ENOUGH_TILES };
            self.runs(**form) && form.tiles(shape.row_count, shape.column_count) >= enough
        };
        sizes.iter().find(has_enough).copied().unwrap_or(sizes[sizes.len() - 1])
    }

    /// Whether this device is trusted with a form of a kernel that is not [exact](Form::is_exact): it has the units, and
    /// a product of made-up numbers was within the form's bound of the exact result, with NaN where a factor was too
    /// large. One of [`Form::FUSED`] must be [faster](crate::GpuOptions::min_fused_gain), too. All that is tried at the
    /// first question; exact forms are always trusted, and other kernels have no such form.
    ///
    /// # Errors
    /// If the device fails, or failed before.
    pub fn trusts(&self, kernel: Kernel, form: Form) -> Result<bool, VulkanError> {
        if form.is_exact() {
            return Ok(true);
        }
        // A processor's driver fuses nothing, and would take a second to show it.
        let has_no_use = form.may_fuse() && self.is_software && self.min_fused_gain > 0.0;
        if !kernel.has_inexact(form) || !self.runs(form) || has_no_use {
            return Ok(false);
        }
        if let Some(is_trusted) = self.lock().verdicts.get(kernel, form) {
            return Ok(is_trusted);
        }
        // A driver that does not compile it is only not trusted.
        let is_compiled = self.pipelines.get((kernel, form, 0)).is_ok();
        let is_right = is_compiled
            && match kernel {
                // It only measures the units, which a linear layer shows to be right.
                Kernel::RepeatProduct => self.trusts(Kernel::Linear, form)?,
                _ => Probe::new(kernel).is_kept_by(self, form)?,
            };
        let is_any_gain_enough = !form.may_fuse() || self.min_fused_gain <= 0.0;
        let is_trusted = is_right && (is_any_gain_enough || self.gain(kernel, form)? >= self.min_fused_gain);
        self.lock().verdicts.set(kernel, form, is_trusted);
        Ok(is_trusted)
    }

    /// Compiles what [`Gpu::trusts`] will try, side by side: a driver takes a second for each of these forms.
    pub fn compile_trials(&self, trials: &[(Kernel, Form)]) {
        let is_open = |(kernel, form): &&(Kernel, Form)| {
            kernel.has_inexact(*form) && self.runs(*form) && self.lock().verdicts.get(*kernel, *form).is_none()
        };
        let keys: Vec<_> = trials.iter().filter(is_open).map(|(kernel, form)| (*kernel, *form, 0)).collect();
        // What does not compile is not trusted.
        let _ = self.pipelines.prepare(&keys);
    }

    /// The time of a product that keeps a GPU busy in the form of the same [code](Form::code), over that in this form.
    fn gain(&self, kernel: Kernel, form: Form) -> Result<f64, VulkanError> {
        let side = 64;
        let block = ConvolveBlock {
            in_height: side,
            in_width: side,
            in_channels: side,
            out_height: side,
            out_width: side,
            out_channels: 512,
            size: 3,
            stride: 1,
            padding: 1,
            ..ConvolveBlock::default()
        };
        let (parameters, shape) = match kernel {
            Kernel::Convolve => {
                let shape = Shape { row_count: side * side, inner_count: 9 * side, column_count: 512 };
                (bytes_of(&block.packed()).to_vec(), shape)
            }
            _ => {
                let shape = Shape { row_count: 4096, inner_count: 512, column_count: 512 };
                let Shape { row_count, inner_count, column_count } = shape;
                (
                    bytes_of(&LinearBlock { row_count, inner_count, column_count, ..LinearBlock::default() }).to_vec(),
                    shape,
                )
            }
        };
        let Shape { row_count, inner_count, column_count } = shape;
        let zeros = |count: u32| self.zeros::<f32>(count as usize);
        let (inputs, weights) = (zeros(row_count * inner_count)?, zeros(inner_count * column_count)?);
        let (bias, outputs) = (zeros(column_count)?, zeros(row_count * column_count)?);
        let arrays = [inputs.bind(), weights.bind(), bias.bind(), bias.bind(), outputs.bind()];
        let elements = || 0..Form::Single.elements(row_count, column_count);
        let run = |form, count| {
            (0..count).try_for_each(|_| self.dispatch_in(kernel, Some(form), &parameters, elements(), &arrays))?;
            self.wait()
        };
        let mut times = [Duration::MAX; 2];
        for round in 0..=ROUNDS {
            for (time, form) in times.iter_mut().zip([form.code(), form]) {
                let start = Instant::now();
                run(form, REPEATS)?;
                // What is made at the first use is not measured.
                if round > 0 {
                    *time = start.elapsed().min(*time);
                }
            }
        }
        Ok(times[0].as_secs_f64() / times[1].as_secs_f64().max(1e-9))
    }

    /// The forms of rounded factors that were asked for and are not used: their results were beyond their bounds, or
    /// the driver does not compile them. On a device without faults there are none.
    pub fn distrusted_forms(&self) -> Vec<(Kernel, Form)> {
        self.lock().verdicts.distrusted()
    }
}

/// A product that shows whether a form is right: sizes that no tile divides, several steps, numbers of both signs and
/// of all magnitudes, small ones and zeros among them, and three that are too large, one of them a weight. Outputs are
/// rectified, which must not hide NaN.
struct Probe {
    kernel: Kernel,
    parameters: Vec<u8>,
    shape: Shape,
    inputs: Vec<f32>,
    weights: Vec<f32>,
    bias: Vec<f32>,
    /// The left matrix.
    left: Vec<f32>,
}

impl Probe {
    fn new(kernel: Kernel) -> Probe {
        let mut seed = 1_u32;
        let mut draw = move || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let number = (seed >> 8) as f32 / (1 << 24) as f32 - 0.5;
            match seed >> 28 {
                0 => number * 1e-5,
                1 => 0.0,
                2 => number * 100.0,
                _ => number,
            }
        };
        let mut numbers = |count: u32| (0..count).map(|_| draw()).collect::<Vec<f32>>();
        let (parameters, shape, inputs, left) = match kernel {
            Kernel::Convolve => {
                let block = ConvolveBlock {
                    in_height: 13,
                    in_width: 11,
                    in_channels: 8,
                    out_height: 13,
                    out_width: 11,
                    out_channels: 148,
                    size: 3,
                    stride: 1,
                    padding: 1,
                    relu_outputs: 1,
                    ..ConvolveBlock::default()
                }
                .packed();
                let shape = Shape { row_count: 143, inner_count: 72, column_count: 148 };
                let mut inputs = numbers(143 * 8);
                (inputs[5], inputs[600]) = (-70_000.0, 1e30);
                let rows = (0..143).flat_map(|row| (0..72).map(move |inner| (row, inner)));
                let left = rows.map(|(row, inner)| patch_value(&inputs[..], &block, row, inner)).collect();
                (bytes_of(&block).to_vec(), shape, inputs, left)
            }
            _ => {
                let shape = Shape { row_count: 143, inner_count: 68, column_count: 148 };
                let Shape { row_count, inner_count, column_count } = shape;
                let block =
                    LinearBlock { row_count, inner_count, column_count, relu_outputs: 1, ..LinearBlock::default() };
                let mut inputs = numbers(143 * 68);
                (inputs[5], inputs[9000]) = (-70_000.0, 1e30);
                (bytes_of(&block).to_vec(), shape, inputs.clone(), inputs)
            }
        };
        let mut weights = numbers(shape.inner_count * shape.column_count);
        // Of the third column.
        weights[2] = 70_000.0;
        Probe { kernel, parameters, shape, inputs, weights, bias: numbers(shape.column_count), left }
    }

    /// Whether a device's outputs are within the bound.
    fn is_kept_by(&self, gpu: &Gpu, form: Form) -> Result<bool, VulkanError> {
        let Shape { row_count, column_count, .. } = self.shape;
        let [inputs, weights, bias] = [&self.inputs, &self.weights, &self.bias].map(|numbers| gpu.upload(numbers));
        let (inputs, weights, bias) = (inputs?, weights?, bias?);
        let outputs: Buffer<f32> = gpu.upload(&vec![f32::INFINITY; (row_count * column_count) as usize])?;
        let arrays = [inputs.bind(), weights.bind(), bias.bind(), bias.bind(), outputs.bind()];
        let elements = 0..Form::Single.elements(row_count, column_count);
        gpu.dispatch_in(self.kernel, Some(form), &self.parameters, elements, &arrays)?;
        Ok(self.is_within(form, &gpu.download(&outputs)?))
    }

    fn is_within(&self, form: Form, outputs: &[f32]) -> bool {
        let Shape { row_count, inner_count, column_count } = self.shape;
        let (inner_count, column_count) = (inner_count as usize, column_count as usize);
        (0..row_count as usize * column_count).all(|element| {
            let (row, column) = (element / column_count, element % column_count);
            let left = &self.left[row * inner_count..(row + 1) * inner_count];
            let (found, first) = (outputs[element], f64::from(self.bias[column]));
            let right = || self.weights.iter().skip(column).step_by(column_count);
            if form.needs_matrices() && left.iter().chain(right()).any(|number| number.abs() > LARGEST) {
                return found.is_nan();
            }
            let (mut sum, mut bound, mut total) = (first, 0.0, first.abs());
            for (left, right) in left.iter().zip(right()).map(|(left, right)| (f64::from(*left), f64::from(*right))) {
                sum += left * right;
                total += (left * right).abs();
                bound += product_bound(form, left, right);
            }
            (f64::from(found) - sum.max(0.0)).abs() <= bound + sum_bound(form, inner_count, total)
        })
    }
}

/// The most that rounded factors change of a product.
fn product_bound(form: Form, left: f64, right: f64) -> f64 {
    if form.may_fuse() {
        return 0.0;
    }
    let (relative, absolute) = match form {
        Form::Half | Form::HalfSmall | Form::HalfTiny => (2_f64.powi(-11), 2_f64.powi(-14)),
        _ => (2_f64.powi(-22), 2_f64.powi(-25)),
    };
    let [left_error, right_error] = [left, right].map(|factor| (factor.abs() * relative).max(absolute));
    // Of two parts, the product of the low ones is omitted.
    let omitted = if form.sizes()[0] == Form::TwoHalves { (left * right).abs() * relative } else { 0.0 };
    left_error * right.abs() + right_error * left.abs() + left_error * right_error + omitted
}

/// The most that sums in f32 change whose magnitudes add up to `total`: units cut what rounding would round, and align
/// several summands at once. What may be fused is rounded twice at the most, by half of 2^-23 each.
fn sum_bound(form: Form, inner_count: usize, total: f64) -> f64 {
    let unit = if form.may_fuse() { 2_f64.powi(-23) } else { 2_f64.powi(-22) };
    (inner_count + 4) as f64 * unit * total
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_kernels::network::linear::rectified;

    /// Exact outputs of a probe, whose factors are first changed.
    fn outputs(probe: &Probe, factor: impl Fn(f32) -> f32) -> Vec<f32> {
        let Shape { row_count, inner_count, column_count } = probe.shape;
        let [rows, inners, columns] = [row_count, inner_count, column_count].map(|count| count as usize);
        let sum = |row: usize, column: usize| {
            let product = |inner: usize| {
                let (left, right) = (probe.left[row * inners + inner], probe.weights[inner * columns + column]);
                let too_large = left.abs().max(right.abs()) > LARGEST;
                if too_large { f64::NAN } else { f64::from(factor(left)) * f64::from(factor(right)) }
            };
            rectified(((0..inners).map(product).sum::<f64>() + f64::from(probe.bias[column])) as f32, 1)
        };
        (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (row, column)))
            .map(|(row, column)| sum(row, column))
            .collect()
    }

    /// To this many bits less, by cutting.
    fn cut(bits: u32) -> impl Fn(f32) -> f32 {
        move |number| f32::from_bits(number.to_bits() >> bits << bits)
    }

    #[test]
    fn a_probe_tells_what_is_right() {
        for probe in [Kernel::Linear, Kernel::Convolve].map(Probe::new) {
            let exact = outputs(&probe, |number| number);
            assert!(Form::ROUNDED.into_iter().all(|form| probe.is_within(form, &exact)));
            // Twelve bits that are cut are off by less than 2^-11: as rounding to f16, and far beyond two parts.
            assert!(!probe.is_within(Form::TwoHalves, &outputs(&probe, cut(12))));
            assert!(probe.is_within(Form::Half, &outputs(&probe, cut(12))));
            assert!(!probe.is_within(Form::Half, &outputs(&probe, cut(17))));
            // A number that is missing, one elsewhere, and one that hides that a factor was too large.
            let changed = |at: usize, to: f32| {
                let mut outputs = exact.clone();
                outputs[at] = to;
                Form::ROUNDED.map(|form| probe.is_within(form, &outputs))
            };
            let last = exact.len() - 1;
            assert_eq!(changed(last, f32::INFINITY), [false; Form::ROUNDED.len()]);
            assert_eq!(changed(last, f32::NAN), [false; Form::ROUNDED.len()]);
            assert_eq!(changed(last, exact[last] + 50.0), [false; Form::ROUNDED.len()]);
            // In the first row, and in the third column of the last one.
            for too_large in [0, last - 145] {
                assert!(exact[too_large].is_nan());
                assert_eq!(changed(too_large, 0.0), [false; Form::ROUNDED.len()]);
            }
        }
    }
}
