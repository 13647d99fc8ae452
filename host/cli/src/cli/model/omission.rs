//! What `--compute` turns on again.

use clap::ValueEnum;
use viewfuse_field::family::Family;
use viewfuse_field::{genvs, pixelnerf};

/// Something that a network leaves out where nothing needs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Omission {
    /// Encode views that no target uses
    Views,
    /// PixelNeRF: latent layers at every point instead of once on the grid
    Layers,
    /// PixelNeRF: first-pass samples in empty space
    Space,
    /// PixelNeRF: second-pass samples on empty rays
    Rays,
    /// PixelNeRF: second-pass samples in empty parts of rays
    Parts,
    /// PixelNeRF: second-pass samples behind surfaces
    Hidden,
    /// GeNVS: rows of volumes that no ray reaches
    Rows,
    /// GeNVS: calls of the denoiser that change nothing that can be seen
    Calls,
}

impl Omission {
    /// Whether there is such a thing in a network of this family.
    pub(super) fn is_of(self, family: Family) -> bool {
        match self {
            Omission::Views => true,
            Omission::Rows | Omission::Calls => family == Family::Genvs,
            _ => family == Family::PixelNerf,
        }
    }
}

/// What a PixelNeRF leaves out if it must compute these.
pub(super) fn of_pixelnerf(
    computes: impl Fn(Omission) -> bool,
    probe_step: u32,
    probe_error: f32,
) -> pixelnerf::Omissions {
    pixelnerf::Omissions {
        unused_views: !computes(Omission::Views),
        latent_layers: !computes(Omission::Layers),
        empty_space: if computes(Omission::Space) { 0 } else { probe_step },
        probe_error,
        empty_rays: !computes(Omission::Rays),
        empty_parts: !computes(Omission::Parts),
        hidden_samples: !computes(Omission::Hidden),
    }
}

/// What a GeNVS leaves out, besides calls, if it must compute these.
pub(super) fn of_genvs(
    computes: impl Fn(Omission) -> bool,
    reuse: Option<f32>,
    half_volumes: bool,
) -> genvs::Omissions {
    let (unused_views, unseen_rows) = (!computes(Omission::Views), !computes(Omission::Rows));
    genvs::Omissions { unused_views, unseen_rows, reuse, half_volumes }
}
