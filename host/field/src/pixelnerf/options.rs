//! The options of a PixelNeRF: its samples, and its omissions.

use crate::variant::Options;
use viewfuse_device::Precision;

/// Samples on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Evenly spaced samples of the first pass, at least 1.
    pub coarse_count: u32,
    /// Importance samples of the second pass, by the weights of the first.
    pub importance_count: u32,
    /// Samples of the second pass around the first pass's depth.
    pub depth_count: u32,
    /// Standard deviation of those, world units.
    pub depth_deviation: f32,
    /// Whether that depth is the published one, the sum of weights times depths, which is too near on rays that are not
    /// opaque.
    pub published_depth: bool,
    /// Jitter of the samples in their parts of the ray: 1 as published, 0 for none.
    pub jitter: f32,
    /// Seed of every random draw.
    pub seed: u64,
    /// Near and far bounds; `None`: from the sources' distance to the point that they look at.
    pub near_far: Option<[f32; 2]>,
}

impl Sampling {
    /// Samples on a ray in the first and in the second pass, which evaluates those of the first again.
    pub(super) fn counts(&self) -> [u32; 2] {
        match self.importance_count + self.depth_count {
            0 => [self.coarse_count, 0],
            added => [self.coarse_count, self.coarse_count + added],
        }
    }
}

impl Default for Sampling {
    /// As published (`conf/exp/srn.conf`), but around the mean depth.
    fn default() -> Sampling {
        Sampling {
            coarse_count: 64,
            importance_count: 16,
            depth_count: 16,
            depth_deviation: 0.01,
            published_depth: false,
            jitter: 1.0,
            seed: 0,
            near_far: None,
        }
    }
}

/// Omissions. Each has a switch of its own; [`Omissions::NONE`] leaves nothing out, [`Omissions::ALL`] is the
/// default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Omissions {
    /// The encoding of views that no target uses. Exact.
    pub unused_views: bool,
    /// Latent layers at points: they are applied once at every node of a view's grid, before looking up. Exact up to
    /// rounding, because looking up is linear.
    pub latent_layers: bool,
    /// Half of the bits of the grids that points look up (f16): latents, or the outputs of latent layers, have a
    /// relative error of at most 2^-11, and are limited to 65504.
    pub half_latents: bool,
    /// Views at points behind their cameras, where their weight is 0. Exact.
    pub unseen_points: bool,
    /// First-pass samples in empty space: one ray in every square of this side in pixels (a probe) is computed first,
    /// the others only where the four probes around them are not empty; with a [`probe_error`](Self::probe_error),
    /// probes of which none meets anything are set more densely, down to squares of 2. 0 or 1: no probes.
    pub empty_space: u32,
    /// The largest change of the probes' colours, root mean square, `1` from black to white: the largest threshold of a
    /// part's opacity that stays within it replaces [`MIN_SHARE`]. 0: always [`MIN_SHARE`].
    pub probe_error: f32,
    /// Rays between alike neighbours: a pixel is interpolated where the colours and opacities around it differ by no
    /// more than this in any channel. 0: every pixel has its ray.
    pub interpolation: f32,
    /// Samples of both passes are interpolated along rays between this many evenly spaced nodes, at most 128, at which
    /// alone the second pass's network is evaluated, and not in space that neighbouring rays find empty. 0: no nodes.
    pub nodes: u32,
    /// Second-pass samples on rays whose first pass has an opacity below [`MIN_OPACITY`].
    pub empty_rays: bool,
    /// Second-pass samples in parts of a ray that the first pass found empty, one part to either side included.
    pub empty_parts: bool,
    /// Second-pass samples behind the point where the first pass's transmittance falls to the run's early termination.
    pub hidden_samples: bool,
}

/// A part is empty if its opacity is below this: 1/512, half of a step of 1/256. The probes may raise this threshold.
pub const MIN_SHARE: f32 = 1.0 / 512.0;
/// A ray is empty if its opacity is below this.
pub const MIN_OPACITY: f32 = 1.0 / 256.0;

impl Omissions {
    /// Nothing is left out.
    pub const NONE: Omissions = Omissions {
        unused_views: false,
        latent_layers: false,
        half_latents: false,
        unseen_points: false,
        empty_space: 0,
        probe_error: 0.0,
        interpolation: 0.0,
        nodes: 0,
        empty_rays: false,
        empty_parts: false,
        hidden_samples: false,
    };

    /// The default omissions: all but half precision, and those that only a bound on the error switches on.
    pub const ALL: Omissions = Omissions {
        unused_views: true,
        latent_layers: true,
        half_latents: false,
        unseen_points: true,
        empty_space: 4,
        probe_error: 1.0 / 128.0,
        interpolation: 0.0,
        nodes: 0,
        empty_rays: true,
        empty_parts: true,
        hidden_samples: true,
    };
}

impl Omissions {
    /// Other omissions, but those that views are encoded with, or that cost nothing, as here.
    pub(super) fn kept_in(self, others: Omissions) -> Omissions {
        let Omissions { unused_views, latent_layers, half_latents, unseen_points, .. } = self;
        Omissions { unused_views, latent_layers, half_latents, unseen_points, ..others }
    }
}

impl Default for Omissions {
    /// [`Omissions::ALL`].
    fn default() -> Omissions {
        Omissions::ALL
    }
}

/// A PixelNeRF render's settings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelNerfOptions {
    /// Samples on a ray.
    pub sampling: Sampling,
    /// Omissions.
    pub omissions: Omissions,
    /// Precision of the point networks' layers, on devices that have another than the exact one. Views are encoded
    /// exactly.
    pub precision: Precision,
}

impl Options for PixelNerfOptions {
    /// Where both keep the same grids, whatever the precision: the exact pixels that a bound is checked with are
    /// rendered from the same ones.
    fn encodes_alike(&self, other: &PixelNerfOptions) -> bool {
        let grids = |options: &PixelNerfOptions| (options.omissions.latent_layers, options.omissions.half_latents);
        grids(self) == grids(other)
    }
}

impl PixelNerfOptions {
    /// These settings with at least one sample in the first pass.
    pub(super) fn checked(self) -> PixelNerfOptions {
        let coarse_count = self.sampling.coarse_count.max(1);
        PixelNerfOptions { sampling: Sampling { coarse_count, ..self.sampling }, ..self }
    }
}
