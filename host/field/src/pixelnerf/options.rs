//! What a person can set about a PixelNeRF render, and what may be left out of it.

/// Samples on a ray, and where they go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Evenly spread samples of the first pass, at least 1.
    pub coarse_count: u32,
    /// Samples that the second pass adds where the first saw something.
    pub importance_count: u32,
    /// Samples that it adds around the depth that the first saw.
    pub depth_count: u32,
    /// Standard deviation of those, world units.
    pub depth_deviation: f32,
    /// Around which depth: as published the sum of weights times depths, which is too near on rays that are not opaque.
    pub published_depth: bool,
    /// How far samples stray at random in their part of the ray: 1 as published, 0 not at all.
    pub jitter: f32,
    /// Seed of every random number.
    pub seed: u64,
    /// Where rays begin and end; `None`: by the sources' distance from what they look at.
    pub near_far: Option<[f32; 2]>,
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

/// What may be left out. Each is a switch of its own; none at all are [`Omissions::NONE`], all are
/// [`Omissions::ALL`] and the default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Omissions {
    /// The encoding of views that no target uses. Exact.
    pub unused_views: bool,
    /// Latent layers at points: they are applied once at every node of a view's grid, before looking up. Exact up to
    /// rounding, because looking up is linear.
    pub latent_layers: bool,
    /// First-pass samples in empty space: a ray in every square of this many pixels on a side is looked at first, and
    /// the others only where the four around them met something. 0 or 1: no.
    pub empty_space: u32,
    /// How much the probes' colours may change in the root of the mean square, `1` from black to white, if parts of rays
    /// that stop little light count as empty: the largest share of the light that is no more than that is taken instead of
    /// [`LEAST_SHARE`]. 0: always [`LEAST_SHARE`].
    pub probe_error: f32,
    /// Second-pass samples on rays in whose first pass less than [`LEAST_OPACITY`] stopped.
    pub empty_rays: bool,
    /// Second-pass samples in parts of a ray where the first pass, one part to either side included, met nothing.
    pub empty_parts: bool,
    /// Second-pass samples behind where the first pass's transmittance falls to the run's limit of early termination.
    pub hidden_samples: bool,
}

/// A part is empty if it stops less than this share of the light that reaches it: 1/512, half of a half of a level of 256.
/// Where probes show that more costs little, it is more.
pub const LEAST_SHARE: f32 = 1.0 / 512.0;
/// A ray is empty if it stops less than this share of the light.
pub const LEAST_OPACITY: f32 = 1.0 / 256.0;

impl Omissions {
    /// Nothing is left out.
    pub const NONE: Omissions = Omissions {
        unused_views: false,
        latent_layers: false,
        empty_space: 0,
        probe_error: 0.0,
        empty_rays: false,
        empty_parts: false,
        hidden_samples: false,
    };

    /// All that is left out unless a person says otherwise.
    pub const ALL: Omissions = Omissions {
        unused_views: true,
        latent_layers: true,
        empty_space: 4,
        probe_error: 1.0 / 128.0,
        empty_rays: true,
        empty_parts: true,
        hidden_samples: true,
    };
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
    /// What may be left out.
    pub omissions: Omissions,
}

impl PixelNerfOptions {
    /// With at least one sample in the first pass.
    pub(super) fn checked(self) -> PixelNerfOptions {
        let coarse_count = self.sampling.coarse_count.max(1);
        PixelNerfOptions { sampling: Sampling { coarse_count, ..self.sampling }, ..self }
    }
}
