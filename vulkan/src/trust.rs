//! Whether forms of rounded factors ([`Form::ROUNDED`]) give on a device what they promise: a product is tried first.

use crate::buffer::{Bound, Buffer};
use crate::error::VulkanError;
use crate::forms::ENOUGH_TILES;
use crate::gpu::Gpu;
use crate::kernel::{Form, Kernel};
use bytemuck::bytes_of;
use std::ops::Range;
use viewfuse_kernels::network::convolve::{ConvolveBlock, patch_value};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::network::tile::Shape;

/// The largest f16.
const LARGEST: f32 = 65_504.0;

impl Gpu {
    /// As [`Gpu::dispatch`], with a form of rounded factors ([`Form::ROUNDED`]) where this device is trusted with it
    /// ([`Gpu::trusts`]) and the arrays lie in fours ([`Kernel::is_in_fours`]): other numbers, within that form's
    /// bound; otherwise as `dispatch`. Of the form's [sizes](Form::sizes) that is taken which suits the product, where
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
            Some(shape) if form.needs_matrices() && kernel.is_in_fours(parameters) => Some(self.sized(form, shape)),
            _ => None,
        };
        let form = match form {
            Some(form) if self.trusts(kernel, self.largest(form))? && self.trusts(kernel, form)? => Some(form),
            _ => None,
        };
        self.dispatch_in(kernel, form, parameters, elements, arrays)
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

    /// Whether this device is trusted with a form of rounded factors of a kernel: it has the units, and a product of
    /// made-up numbers was within the form's bound of the exact result, with NaN where a factor was too large. The
    /// product is computed at the first question; other forms are always trusted, and other kernels have no such form.
    ///
    /// # Errors
    /// If the device fails, or failed before.
    pub fn trusts(&self, kernel: Kernel, form: Form) -> Result<bool, VulkanError> {
        if !form.needs_matrices() {
            return Ok(true);
        }
        if !kernel.rounded_forms().contains(&form) || !self.runs(form) {
            return Ok(false);
        }
        if let Some(is_trusted) = self.lock().verdicts.get(kernel, form) {
            return Ok(is_trusted);
        }
        // A driver that does not compile it is only not trusted.
        let is_compiled = self.pipelines.get((kernel, form, 0)).is_ok();
        let is_trusted = is_compiled && Probe::new(kernel).is_kept_by(self, form)?;
        self.lock().verdicts.set(kernel, form, is_trusted);
        Ok(is_trusted)
    }

    /// Compiles what [`Gpu::trusts`] will try, side by side: a driver takes a second for each of these forms.
    pub fn compile_trials(&self, trials: &[(Kernel, Form)]) {
        let is_open = |(kernel, form): &&(Kernel, Form)| {
            kernel.rounded_forms().contains(form)
                && self.runs(*form)
                && self.lock().verdicts.get(*kernel, *form).is_none()
        };
        let keys: Vec<_> = trials.iter().filter(is_open).map(|(kernel, form)| (*kernel, *form, 0)).collect();
        // What does not compile is not trusted.
        let _ = self.pipelines.prepare(&keys);
    }

    /// The forms of rounded factors that were asked for and are not used: their results were beyond their bounds, or
    /// the driver does not compile them. On a device without faults there are none.
    pub fn distrusted_forms(&self) -> Vec<(Kernel, Form)> {
        self.lock().verdicts.distrusted()
    }
}

/// A product that shows whether a form is right: sizes that no tile divides, several steps, numbers of both signs and
/// of all magnitudes, small ones and zeros among them, and two that are too large. Outputs are rectified, which must
/// not hide NaN.
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
        let weights = numbers(shape.inner_count * shape.column_count);
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
            if left.iter().any(|number| number.abs() > LARGEST) {
                return found.is_nan();
            }
            let right = self.weights.iter().skip(column).step_by(column_count);
            let (mut sum, mut bound, mut total) = (first, 0.0, first.abs());
            for (left, right) in left.iter().zip(right).map(|(left, right)| (f64::from(*left), f64::from(*right))) {
                sum += left * right;
                total += (left * right).abs();
                bound += product_bound(form, left, right);
            }
            (f64::from(found) - sum.max(0.0)).abs() <= bound + sum_bound(inner_count, total)
        })
    }
}

/// The most that rounded factors change of a product.
fn product_bound(form: Form, left: f64, right: f64) -> f64 {
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
/// several summands at once.
fn sum_bound(inner_count: usize, total: f64) -> f64 {
    (inner_count + 4) as f64 * 2_f64.powi(-22) * total
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
                let too_large = left.abs() > LARGEST;
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
            assert!(exact[0].is_nan());
            assert_eq!(changed(0, 0.0), [false; Form::ROUNDED.len()]);
        }
    }
}
