//! Parameters of attention weighting, read from safetensors files.
//!
//! The variant of a file is recognised by its tensors' names, those of the published `state_dict`s and of the
//! paper's two embeddings:
//!
//! | tensors | variant |
//! |---|---|
//! | `paper.{0,2,4}.{weight,bias}` | cross attention, Fourier embedding (42-64-64-128) |
//! | `paper_flat.{0,2}.{weight,bias}` | cross attention, flattened pose (16-64-128) |
//! | `query_layer.weight`, `key_layer.weight` | published learned cross attention |
//! | `multihead_attention.*`, `weight_calculation_layer.*` | published relative-pose self attention |

mod c_header;
pub mod quantised;
mod range;

pub use c_header::c_header;

use crate::sources::{SourcePoses, SourceWeights};
use safetensors::{Dtype, SafeTensors};
use std::path::{Path, PathBuf};
use viewfuse_core::attention::{
    EMBEDDING, FlatEmbedding, FourierEmbedding, HIDDEN, LearnedCrossAttention, Linear, POSE_FEATURES,
    PoseSelfAttention, cross_attention, learned_cross_attention, pose_self_attention,
};
use viewfuse_core::pose::Pose;
use viewfuse_job::files::read_at_most;
use viewfuse_job::text::in_line;

/// Why attention parameters could not be read.
#[derive(Debug, thiserror::Error)]
pub enum AttentionError {
    /// The file could not be read.
    #[error("{0}: cannot be read: {1}")]
    Io(PathBuf, std::io::Error),
    /// The file is not in the safetensors format.
    #[error("{0}: not a safetensors file: {cause}", cause = in_line(.1))]
    Format(PathBuf, safetensors::SafeTensorError),
    /// No known variant has these tensors.
    #[error(
        "{0}: holds no attention weighting: none of the tensors paper.0.weight, paper_flat.0.weight, \
             query_layer.weight, multihead_attention.in_proj_weight is there"
    )]
    UnknownVariant(PathBuf),
    /// A tensor of the variant is missing.
    #[error("{0}: tensor '{1}' is missing")]
    Missing(PathBuf, String),
    /// A tensor has another type or shape than the variant needs.
    #[error("{}: tensor '{tensor}' must be F32 {expected:?}, but is {dtype:?} {shape:?}", path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The tensor.
        tensor: String,
        /// The required shape.
        expected: Vec<usize>,
        /// The file's type.
        dtype: Dtype,
        /// The file's shape.
        shape: Vec<usize>,
    },
    /// Its finite parameters give logits that are not: the tensor with the largest parameter, and a bound on the logits
    /// of all poses.
    #[error(
        "{0}: the parameters are too large: logits reach {2:.1e}, beyond what 32-bit numbers hold, and all weights \
             would be equal; the largest parameter is in tensor '{1}'"
    )]
    Overflow(PathBuf, String, f64),
    /// A tensor holds NaN or infinity: the index of the first such element, flat.
    #[error("{0}: tensor '{1}' is not finite at flat index {2}")]
    NotFinite(PathBuf, String, usize),
}

/// Attention weighting with its parameters.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one a run, and a weighting keeps it in a box")]
pub enum AttentionModel {
    /// The paper's cross attention on Fourier features of the centre and the view direction.
    Fourier(FourierEmbedding),
    /// The paper's cross attention on the flattened pose.
    Flat(FlatEmbedding),
    /// The published learned cross attention.
    LearnedCross(LearnedCrossAttention),
    /// The published relative-pose self attention.
    PoseSelf(PoseSelfAttention),
}

/// Most bytes of a file of parameters.
const LONGEST_FILE: u64 = 1 << 30;

/// Reads a model's tensors: from name and shape to values, row-major.
pub type TensorSource<'a, E> = dyn FnMut(&str, &[usize]) -> Result<Vec<f32>, E> + 'a;

impl AttentionModel {
    /// Reads the parameters of the file's variant.
    ///
    /// # Errors
    /// [`AttentionError`], always with the file and the tensor.
    pub fn open(path: &Path) -> Result<AttentionModel, AttentionError> {
        let bytes = read_at_most(path, LONGEST_FILE).map_err(|cause| AttentionError::Io(path.to_path_buf(), cause))?;
        let file =
            SafeTensors::deserialize(&bytes).map_err(|cause| AttentionError::Format(path.to_path_buf(), cause))?;
        let has = |name: &str| file.tensor(name).is_ok();
        let mut largest: Option<(String, f32)> = None;
        let mut read = |name: &str, shape: &[usize]| {
            let values = read_tensor(path, &file, name, shape)?;
            let magnitude = values.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
            if largest.as_ref().is_none_or(|(_, most)| magnitude > *most) {
                largest = Some((name.to_owned(), magnitude));
            }
            Ok(values)
        };
        let model = if has("paper.0.weight") {
            AttentionModel::fourier(&mut read)
        } else if has("paper_flat.0.weight") {
            AttentionModel::flat(&mut read)
        } else if has("query_layer.weight") {
            AttentionModel::learned_cross(&mut read)
        } else if has("multihead_attention.in_proj_weight") {
            AttentionModel::pose_self(&mut read)
        } else {
            Err(AttentionError::UnknownVariant(path.to_path_buf()))
        }?;
        let bound = range::largest_logit(&model);
        if bound >= range::MAX_LOGIT {
            let tensor = largest.map_or_else(String::new, |(name, _)| name);
            return Err(AttentionError::Overflow(path.to_path_buf(), tensor, bound));
        }
        Ok(model)
    }

    /// The paper's cross attention, Fourier embedding.
    ///
    /// # Errors
    /// The errors of `tensors`.
    pub fn fourier<E>(tensors: &mut TensorSource<'_, E>) -> Result<AttentionModel, E> {
        Ok(AttentionModel::Fourier(FourierEmbedding {
            first: linear::<POSE_FEATURES, HIDDEN, E>(tensors, "paper.0")?,
            second: linear::<HIDDEN, HIDDEN, E>(tensors, "paper.2")?,
            third: linear::<HIDDEN, EMBEDDING, E>(tensors, "paper.4")?,
        }))
    }

    /// The paper's cross attention, flattened pose.
    ///
    /// # Errors
    /// The errors of `tensors`.
    pub fn flat<E>(tensors: &mut TensorSource<'_, E>) -> Result<AttentionModel, E> {
        Ok(AttentionModel::Flat(FlatEmbedding {
            first: linear::<16, HIDDEN, E>(tensors, "paper_flat.0")?,
            second: linear::<HIDDEN, EMBEDDING, E>(tensors, "paper_flat.2")?,
        }))
    }

    /// The published learned cross attention.
    ///
    /// # Errors
    /// The errors of `tensors`.
    pub fn learned_cross<E>(tensors: &mut TensorSource<'_, E>) -> Result<AttentionModel, E> {
        let mut layer = |name: &str| {
            let weight = tensors(name, &[POSE_FEATURES, POSE_FEATURES])?;
            Ok(assemble(&weight, &[0.0; POSE_FEATURES]))
        };
        Ok(AttentionModel::LearnedCross(LearnedCrossAttention {
            query: layer("query_layer.weight")?,
            key: layer("key_layer.weight")?,
        }))
    }

    /// The published relative-pose self attention.
    ///
    /// # Errors
    /// The errors of `tensors`.
    pub fn pose_self<E>(tensors: &mut TensorSource<'_, E>) -> Result<AttentionModel, E> {
        const N: usize = POSE_FEATURES;
        let weight = tensors("multihead_attention.in_proj_weight", &[3 * N, N])?;
        let bias = tensors("multihead_attention.in_proj_bias", &[3 * N])?;
        let part = |k: usize| assemble(&weight[k * N * N..(k + 1) * N * N], &bias[k * N..(k + 1) * N]);
        Ok(AttentionModel::PoseSelf(PoseSelfAttention {
            query: part(0),
            key: part(1),
            value: part(2),
            output: linear::<N, N, E>(tensors, "multihead_attention.out_proj")?,
            logit: linear::<N, 1, E>(tensors, "weight_calculation_layer")?,
        }))
    }

    /// The weights of the sources for a target, in the order of the sources.
    pub fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        match self {
            AttentionModel::Fourier(embedding) => cross_attention(embedding, sources, target),
            AttentionModel::Flat(embedding) => cross_attention(embedding, sources, target),
            AttentionModel::LearnedCross(parameters) => learned_cross_attention(parameters, sources, target),
            AttentionModel::PoseSelf(parameters) => pose_self_attention(parameters, sources, target),
        }
    }
}

fn linear<const I: usize, const O: usize, E>(tensors: &mut TensorSource<'_, E>, name: &str) -> Result<Linear<I, O>, E> {
    let weight = tensors(&format!("{name}.weight"), &[O, I])?;
    let bias = tensors(&format!("{name}.bias"), &[O])?;
    Ok(assemble(&weight, &bias))
}

/// Row-major `[O][I]` weights and `[O]` biases as a layer.
fn assemble<const I: usize, const O: usize>(weight: &[f32], bias: &[f32]) -> Linear<I, O> {
    let mut layer = Linear::ZERO;
    for (row, values) in layer.weight.iter_mut().zip(weight.chunks_exact(I)) {
        row.copy_from_slice(values);
    }
    layer.bias.copy_from_slice(bias);
    layer
}

fn read_tensor(
    path: &Path,
    file: &SafeTensors<'_>,
    name: &str,
    expected: &[usize],
) -> Result<Vec<f32>, AttentionError> {
    let path = || path.to_path_buf();
    let view = file.tensor(name).map_err(|_| AttentionError::Missing(path(), name.to_owned()))?;
    if view.dtype() != Dtype::F32 || view.shape() != expected {
        return Err(AttentionError::Shape {
            path: path(),
            tensor: name.to_owned(),
            expected: expected.to_vec(),
            dtype: view.dtype(),
            shape: view.shape().to_vec(),
        });
    }
    let values: Vec<f32> = view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(AttentionError::NotFinite(path(), name.to_owned(), index)),
        None => Ok(values),
    }
}
