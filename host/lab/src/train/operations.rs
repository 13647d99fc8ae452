//! Custom operations of the automatic differentiation: each computes its value and its gradient on plain numbers, in
//! `f32` for training and in `f64` for the tests that compare gradients with central differences.
//!
//! There is a custom operation only where the library has none with the published conventions, or where the library
//! would write whole images of intermediate numbers to memory that fit into a processor's caches.

mod convolve;
mod density;
mod enlarge;
mod linear;
mod march_volumes;
mod normalise;
mod point_network;

pub(crate) use convolve::{Convolution, DepthwiseConvolution, Window};
pub(crate) use density::RectifiedDensity;
pub(crate) use enlarge::AddEnlarged;
pub(crate) use march_volumes::{MarchSizes, MarchVolumes, SampledRays};
pub(crate) use normalise::Normalise;
pub(crate) use point_network::{PointNetwork, PointNetworkSizes, Points};

use candle_core::{
    CpuStorage, CustomOp1, CustomOp2, CustomOp3, DType, Layout, Result, Shape, Storage, Tensor, WithDType,
};
use ndarray::LinalgScalar;

/// A number that operations compute with.
pub(crate) trait Real: WithDType + LinalgScalar + PartialOrd + std::ops::AddAssign {
    /// The nearest number.
    fn of(value: f32) -> Self {
        Self::from_f64(f64::from(value))
    }

    /// `e^x`.
    fn exponential(self) -> Self;
}

impl Real for f32 {
    fn exponential(self) -> f32 {
        viewfuse_core::math::exp(self)
    }
}

impl Real for f64 {
    fn exponential(self) -> f64 {
        self.exp()
    }
}

/// A function of `N` tensors, all contiguous and row-major, all of one type.
pub(crate) trait Operation<const N: usize>: Send + Sync + 'static {
    /// Its name in messages.
    const NAME: &'static str;

    /// Shape of the result.
    fn shape(&self) -> Vec<usize>;

    /// The result.
    fn forward<T: Real>(&self, inputs: [&[T]; N]) -> Vec<T>;

    /// Gradients of the inputs (`None` where not needed), given the result and its gradient.
    fn backward<T: Real>(&self, inputs: [&[T]; N], output: &[T], gradient: &[T]) -> [Option<Vec<T>>; N];
}

/// An operation in the library's form.
pub(crate) struct Apply<O>(pub(crate) O);

fn slice<'a, T: WithDType>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [T]> {
    let all = T::cpu_storage_as_slice(storage)?;
    match layout.contiguous_offsets() {
        Some((start, end)) => Ok(&all[start..end]),
        None => candle_core::bail!("a custom operation was given a tensor that is not contiguous"),
    }
}

fn on_cpu<'a>(storage: &'a Storage, name: &str) -> Result<&'a CpuStorage> {
    match storage {
        Storage::Cpu(storage) => Ok(storage),
        _ => candle_core::bail!("{name} runs on the CPU only"),
    }
}

fn forward<const N: usize, O: Operation<N>>(
    operation: &O,
    inputs: [(&CpuStorage, &Layout); N],
) -> Result<(CpuStorage, Shape)> {
    fn typed<const N: usize, O: Operation<N>, T: Real>(
        operation: &O,
        inputs: [(&CpuStorage, &Layout); N],
    ) -> Result<CpuStorage> {
        let mut slices: [&[T]; N] = [&[]; N];
        for (input, (storage, layout)) in slices.iter_mut().zip(inputs) {
            *input = slice(storage, layout)?;
        }
        Ok(T::to_cpu_storage_owned(operation.forward(slices)))
    }
    let storage = match inputs[0].0 {
        CpuStorage::F32(_) => typed::<N, O, f32>(operation, inputs)?,
        CpuStorage::F64(_) => typed::<N, O, f64>(operation, inputs)?,
        _ => candle_core::bail!("{} takes numbers of 32 or 64 bits", O::NAME),
    };
    Ok((storage, Shape::from(operation.shape())))
}

fn backward<const N: usize, O: Operation<N>>(
    operation: &O,
    inputs: [&Tensor; N],
    [output, gradient]: [&Tensor; 2],
) -> Result<[Option<Tensor>; N]> {
    fn typed<const N: usize, O: Operation<N>, T: Real>(
        operation: &O,
        inputs: [&Tensor; N],
        [output, gradient]: [&Tensor; 2],
    ) -> Result<[Option<Tensor>; N]> {
        let gradient = gradient.contiguous()?;
        let guards = inputs.map(Tensor::storage_and_layout);
        let (output_guard, output_layout) = output.storage_and_layout();
        let (gradient_guard, gradient_layout) = gradient.storage_and_layout();
        let mut slices: [&[T]; N] = [&[]; N];
        for (input, (guard, layout)) in slices.iter_mut().zip(&guards) {
            *input = slice(on_cpu(guard, O::NAME)?, layout)?;
        }
        let output = slice(on_cpu(&output_guard, O::NAME)?, output_layout)?;
        let gradient = slice(on_cpu(&gradient_guard, O::NAME)?, gradient_layout)?;
        let gradients = operation.backward(slices, output, gradient);
        let mut tensors = [const { None }; N];
        for ((tensor, values), input) in tensors.iter_mut().zip(gradients).zip(inputs) {
            *tensor = values.map(|values| Tensor::from_vec(values, input.shape(), input.device())).transpose()?;
        }
        Ok(tensors)
    }
    match gradient.dtype() {
        DType::F32 => typed::<N, O, f32>(operation, inputs, [output, gradient]),
        DType::F64 => typed::<N, O, f64>(operation, inputs, [output, gradient]),
        _ => candle_core::bail!("{} takes numbers of 32 or 64 bits", O::NAME),
    }
}

impl<O: Operation<1>> CustomOp1 for Apply<O> {
    fn name(&self) -> &'static str {
        O::NAME
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        forward(&self.0, [(storage, layout)])
    }

    fn bwd(&self, input: &Tensor, output: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let [first] = backward(&self.0, [input], [output, gradient])?;
        Ok(first)
    }
}

impl<O: Operation<2>> CustomOp2 for Apply<O> {
    fn name(&self) -> &'static str {
        O::NAME
    }

    fn cpu_fwd(&self, s1: &CpuStorage, l1: &Layout, s2: &CpuStorage, l2: &Layout) -> Result<(CpuStorage, Shape)> {
        forward(&self.0, [(s1, l1), (s2, l2)])
    }

    fn bwd(
        &self,
        a: &Tensor,
        b: &Tensor,
        output: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let [first, second] = backward(&self.0, [a, b], [output, gradient])?;
        Ok((first, second))
    }
}

impl<O: Operation<3>> CustomOp3 for Apply<O> {
    fn name(&self) -> &'static str {
        O::NAME
    }

    fn cpu_fwd(
        &self,
        s1: &CpuStorage,
        l1: &Layout,
        s2: &CpuStorage,
        l2: &Layout,
        s3: &CpuStorage,
        l3: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        forward(&self.0, [(s1, l1), (s2, l2), (s3, l3)])
    }

    fn bwd(
        &self,
        a: &Tensor,
        b: &Tensor,
        c: &Tensor,
        output: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let [first, second, third] = backward(&self.0, [a, b, c], [output, gradient])?;
        Ok((first, second, third))
    }
}
