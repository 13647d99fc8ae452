//! Opens a PixelNeRF from a checkpoint with a person's options.

use super::{Omissions, PixelNerf, PixelNerfOptions, Sampling};
use crate::AnyField;
use crate::options::{Computable, FieldOptions, OpenError};
use viewfuse_nn::checkpoint::Checkpoint;

/// Omissions that `compute` switches off.
pub const COMPUTABLE: &[Computable] = &[
    ("layers", "PixelNeRF: latent layers at every point instead of once on the grid"),
    ("behind", "PixelNeRF: views at points behind their cameras, where their weight is 0"),
    ("space", "PixelNeRF: first-pass samples in empty space"),
    ("rays", "PixelNeRF: second-pass samples on empty rays"),
    ("parts", "PixelNeRF: second-pass samples in empty parts of rays"),
    ("hidden", "PixelNeRF: second-pass samples behind surfaces"),
];

/// Opens the network with these options.
///
/// # Errors
/// [`OpenError`] if the checkpoint cannot be used, or an option does not fit.
pub fn open(checkpoint: Checkpoint, options: &FieldOptions) -> Result<AnyField, OpenError> {
    let default = Sampling::default();
    let [coarse_count, importance_count, depth_count] = match options.samples[..] {
        [] => [default.coarse_count, default.importance_count, default.depth_count],
        [coarse, importance, depth] => [coarse, importance, depth],
        _ => {
            let (option, reason) = ("samples".to_owned(), "is a PixelNeRF".to_owned());
            return Err(OpenError::Refused { option, problem: "takes three numbers", reason });
        }
    };
    let sampling = Sampling {
        coarse_count,
        importance_count,
        depth_count,
        seed: options.seed,
        near_far: options.near_far,
        published_depth: options.published_depth,
        ..default
    };
    let (usual, computes) = (Omissions::default(), |what| options.computes(what));
    let omissions = Omissions {
        unused_views: !computes("views"),
        latent_layers: !computes("layers"),
        half_latents: options.half_latents,
        unseen_points: !computes("behind"),
        empty_space: if computes("space") { 0 } else { options.probe_step.unwrap_or(usual.empty_space) },
        probe_error: if options.exact { 0.0 } else { options.probe_error.unwrap_or(usual.probe_error) },
        interpolation: usual.interpolation,
        nodes: usual.nodes,
        empty_rays: !computes("rays"),
        empty_parts: !computes("parts"),
        hidden_samples: !computes("hidden"),
    };
    Ok(PixelNerf::new(&checkpoint, PixelNerfOptions { sampling, omissions })?.into())
}

impl From<PixelNerf> for AnyField {
    /// Compiled here for both devices, not again in every crate that calls it.
    #[inline(never)]
    fn from(field: PixelNerf) -> AnyField {
        AnyField::new(field)
    }
}
