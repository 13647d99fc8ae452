//! Trained parameters, by their names in a checkpoint.

use super::TrainError;
use candle_core::{DType, Device, Tensor, Var};
use std::collections::BTreeMap;
use viewfuse_core::random::{normal, threefry_2x32};
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};

/// The content of a checkpoint: tensors with their values, and metadata.
pub(crate) type Contents = (Vec<(TensorShape, Vec<f32>)>, BTreeMap<String, String>);

/// Named parameters.
#[derive(Clone, Debug)]
pub(crate) struct Parameters {
    variables: BTreeMap<String, Var>,
    dtype: DType,
}

impl Parameters {
    /// `value(tensor)` for every tensor.
    pub(crate) fn new(
        tensors: &[TensorShape],
        dtype: DType,
        mut value: impl FnMut(&TensorShape) -> Result<Vec<f32>, TrainError>,
    ) -> Result<Parameters, TrainError> {
        let mut variables = BTreeMap::new();
        for tensor in tensors {
            let values = Tensor::from_vec(value(tensor)?, tensor.shape.as_slice(), &Device::Cpu)?;
            variables.insert(tensor.name.clone(), Var::from_tensor(&values.to_dtype(dtype)?)?);
        }
        Ok(Parameters { variables, dtype })
    }

    /// Those of a checkpoint.
    pub(crate) fn of(checkpoint: &Checkpoint, tensors: &[TensorShape], dtype: DType) -> Result<Parameters, TrainError> {
        Parameters::new(tensors, dtype, |tensor| Ok(checkpoint.tensor(&tensor.name)?))
    }

    /// Their number of elements.
    pub(crate) fn dtype(&self) -> DType {
        self.dtype
    }

    /// One of them.
    pub(crate) fn get(&self, name: &str) -> candle_core::Result<&Tensor> {
        match self.variables.get(name) {
            Some(variable) => Ok(variable.as_tensor()),
            None => candle_core::bail!("there is no parameter '{name}'"),
        }
    }

    /// All of them, in the order of their names.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.variables.iter().map(|(name, variable)| (name.as_str(), variable))
    }

    /// Their values.
    pub(crate) fn values(&self) -> candle_core::Result<Vec<(TensorShape, Vec<f32>)>> {
        let one = |(name, variable): (&str, &Var)| {
            let shape = TensorShape { name: name.to_owned(), shape: variable.dims().to_vec() };
            Ok((shape, variable.flatten_all()?.to_dtype(DType::F32)?.to_vec1::<f32>()?))
        };
        self.iter().map(one).collect()
    }
}

/// Normally distributed numbers of this deviation: a function of the seed and the tensor's name.
pub(crate) fn random(tensor: &TensorShape, seed: u64, deviation: f32) -> Vec<f32> {
    // A key for each name (FNV-1a).
    let hash = tensor
        .name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    let key = threefry_2x32([seed as u32, (seed >> 32) as u32], [hash as u32, (hash >> 32) as u32]);
    let count: usize = tensor.shape.iter().product();
    (0..count).map(|index| deviation * normal(key, index as u32, 0)).collect()
}

/// Inputs of one output of a layer.
pub(crate) fn fan_in(tensor: &TensorShape) -> usize {
    tensor.shape[1..].iter().product::<usize>().max(1)
}
