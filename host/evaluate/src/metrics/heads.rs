//! Heads: the few numbers on top of a trunk that were fitted to human judgement.
//!
//! The published ones are part of this project: LPIPS version 0.1 (`lin*.model.1.weight` for AlexNet, VGG16 and
//! SqueezeNet; BSD 2-clause, `heads/LICENSE-LPIPS.txt`) and DISTS (`alpha`, `beta`; MIT, `heads/LICENSE-DISTS.txt`).
//! Others are read from files with the same names.

use super::lpips::LpipsTrunk;
use safetensors::SafeTensors;
use std::collections::BTreeMap;
use std::path::PathBuf;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError, TensorShape};

/// The heads that LPIPS was published with, for a trunk.
///
/// # Errors
/// Only if the program's own copy is damaged.
pub fn published_lpips(trunk: LpipsTrunk) -> Result<Checkpoint, CheckpointError> {
    match trunk {
        LpipsTrunk::Alex => included("published LPIPS heads (alex)", include_bytes!("heads/lpips_alex.safetensors")),
        LpipsTrunk::Vgg => included("published LPIPS heads (vgg)", include_bytes!("heads/lpips_vgg.safetensors")),
        LpipsTrunk::Squeeze => {
            included("published LPIPS heads (squeeze)", include_bytes!("heads/lpips_squeeze.safetensors"))
        }
    }
}

/// The weights that DISTS was published with.
///
/// # Errors
/// Only if the program's own copy is damaged.
pub fn published_dists() -> Result<Checkpoint, CheckpointError> {
    included("published DISTS weights", include_bytes!("heads/dists.safetensors"))
}

fn included(label: &str, bytes: &[u8]) -> Result<Checkpoint, CheckpointError> {
    let damaged = |error| CheckpointError::Content(PathBuf::from(label), format!("is damaged: {error}"));
    let file = SafeTensors::deserialize(bytes).map_err(damaged)?;
    let tensor = |(name, view): (&str, safetensors::tensor::TensorView<'_>)| {
        let values = view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        (TensorShape { name: name.to_owned(), shape: view.shape().to_vec() }, values)
    };
    let tensors: Vec<_> = file.iter().map(tensor).collect();
    Ok(Checkpoint::in_memory(label, tensors, BTreeMap::new()))
}
