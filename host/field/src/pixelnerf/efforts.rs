//! The ways to render a picture, from the cheapest to the exact one.

use super::node_picture::MAX_NODES;
use super::options::{Omissions, PixelNerfOptions};
use crate::Effort;

/// Nodes between which samples are interpolated, in 64ths of the samples of the first pass, with the largest difference between
/// the rays around an interpolated pixel, the error that is typical of it and its typical work. Measured on the included network
/// (host/results/efforts.md).
const NODES: [(u32, f32, f32, f32); 9] = [
    (12, 0.25, 0.03, 0.01),
    (16, 0.2, 0.021, 0.012),
    (20, 0.2, 0.0167, 0.014),
    (24, 0.2, 0.0135, 0.017),
    (32, 0.15, 0.0092, 0.021),
    (36, 0.13, 0.0078, 0.024),
    (40, 0.12, 0.0068, 0.028),
    (48, 0.1, 0.0054, 0.04),
    (64, 0.06, 0.0036, 0.09),
];
/// Both passes, without nodes.
const TWO_PASSES: [(&str, Omissions, f32, f32); 2] = [
    (
        "both passes, empty space left out",
        Omissions { interpolation: 0.05, probe_error: 1.0 / 512.0, ..ALL },
        0.0021,
        0.32,
    ),
    ("both passes, empty parts left out", Omissions { interpolation: 0.02, ..PARTS }, 0.0014, 0.42),
];
/// Second-pass samples in empty parts of rays are left out; rays stay independent of one another.
const PARTS: Omissions = Omissions { empty_space: 0, ..ALL };
const ALL: Omissions = Omissions::ALL;

/// The efforts of a network with these options, the cheapest first. Counts of samples are shares of the options'. Whether
/// latent layers are applied on the grid, and in which precision grids are kept, does not change: views are encoded for it.
pub(super) fn of(options: &PixelNerfOptions) -> Vec<(Effort, PixelNerfOptions)> {
    let full = options.sampling;
    let keep = |omissions: Omissions| Omissions {
        unused_views: options.omissions.unused_views,
        latent_layers: options.omissions.latent_layers,
        half_latents: options.omissions.half_latents,
        unseen_points: options.omissions.unseen_points,
        ..omissions
    };
    let between_nodes = NODES.map(|(share, interpolation, error, work)| {
        let nodes = (full.coarse_count * share).div_ceil(64).clamp(1, MAX_NODES);
        let omissions = keep(Omissions { nodes, interpolation, ..ALL });
        (Effort::new(format!("{nodes} nodes"), error, work), PixelNerfOptions { sampling: full, omissions })
    });
    let two_passes = TWO_PASSES.map(|(name, omissions, error, work)| {
        (Effort::new(name, error, work), PixelNerfOptions { sampling: full, omissions: keep(omissions) })
    });
    let mut efforts: Vec<_> = between_nodes.into_iter().chain(two_passes).collect();
    efforts.push((Effort::exact(), exact(options)));
    efforts
}

/// Nothing is left out of a picture but what costs nothing or rounding.
pub(super) fn exact(options: &PixelNerfOptions) -> PixelNerfOptions {
    let Omissions { unused_views, latent_layers, half_latents, unseen_points, .. } = options.omissions;
    let omissions = Omissions { unused_views, latent_layers, half_latents, unseen_points, ..Omissions::NONE };
    PixelNerfOptions { omissions, ..*options }
}
