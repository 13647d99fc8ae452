//! The settings of an optimisation. What was measured of them is in `host/results/gaussians.md`.

use crate::point_cloud::CloudOptions;
use crate::{Purpose, Setting, Variant};
use viewfuse_scene::photographs::SourceImages;

/// Most Gaussians that a person can ask for.
pub const MAX_COUNT: u32 = 2_000_000;
/// Most iterations at a size that a person can ask for.
pub const MAX_ITERATIONS: u32 = 100_000;

/// Most sources whose points count without a second view that confirms them: so few leave too few that are.
const MAX_UNCONFIRMED: usize = 3;

/// Settings of an optimisation. Lengths are in footprints: the size of a level's pixel at the median depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recipe {
    /// Longest side of the finest level, in pixels: larger sources are reduced to it.
    pub side: u32,
    /// Iterations at an eighth, a quarter, a half and the whole of the finest level's size.
    pub iterations: [u32; 4],
    /// For pictures of held-out sources, which are small and only compared, the iterations are divided by this.
    pub trial_divisor: u32,
    /// Most Gaussians.
    pub max_count: usize,
    /// Most Gaussians a pixel of a source at the finest level.
    pub max_per_pixel: f32,
    /// Points in a cube of this side become one Gaussian, in footprints of the finest level.
    pub cell: f32,
    /// Fewest points of a cube that become one.
    pub least_points: u32,
    /// Faint Gaussians at random behind all points, for what is far away; none where silhouettes say what is behind.
    pub background_count: u32,
    /// Standard deviation of those, in footprints at their own depth.
    pub background_scale: f32,
    /// Opacity of the Gaussians from points, and of those behind all points.
    pub opacities: [f32; 2],
    /// Thickness of the Gaussians from points along the surface's normal, relative to the surface's directions; 1 for
    /// balls.
    pub flatness: f32,
    /// Share of `1 - SSIM` in the loss; the rest is the mean absolute difference.
    pub structure_share: f32,
    /// Penalty on the sum of the opacities, a pixel.
    pub opacity_penalty: f32,
    /// Learning rates of position (footprints of the level), log scale, rotation, opacity, colour, and gain.
    pub rates: [f32; 6],
    /// What is left of the rate of position at a level's end, and of those of log scale, opacity and colour at the end
    /// of all iterations, where they fall exponentially.
    pub last_rates: [f32; 4],
    /// Opacity below which a Gaussian is pruned when the level changes.
    pub prune_opacity: f32,
    /// Standard deviation from which on a Gaussian is split when the level changes, in footprints of the new level.
    pub split_scale: f32,
    /// Nearest depth at which anything is seen, relative to the median depth.
    pub near: f32,
    /// Weight of the opacity's difference from a silhouette in the loss.
    pub silhouette_share: f32,
    /// Share of what the Gaussians leave of the photographs that is added to their pictures.
    pub residual_share: f32,
    /// Greatest degree of the spherical harmonics, which are switched on one after the other at the finest level; 0 for
    /// colours that are the same from everywhere.
    pub degree: u32,
    /// Whether the number of Gaussians rises to the most at the finest level.
    pub grows: bool,
    /// Whether colours stay between 0 and 1, as files hold them that have a byte for each.
    pub has_limited_colours: bool,
    /// Whether splats keep their integral when they are dilated (`viewfuse_core::gaussian::project_as`).
    pub is_antialiased: bool,
    /// Seed of what is drawn at random.
    pub seed: u64,
}

impl Default for Recipe {
    fn default() -> Recipe {
        Recipe {
            side: 280,
            iterations: [0, 100, 80, 60],
            trial_divisor: 2,
            max_count: 60_000,
            max_per_pixel: 1.5,
            cell: 6.0,
            least_points: 3,
            background_count: 600,
            background_scale: 16.0,
            opacities: [0.4, 0.2],
            flatness: 0.2,
            structure_share: 0.2,
            opacity_penalty: 0.02,
            rates: [0.15, 0.04, 0.012, 0.1, 0.01, 5.0e-3],
            last_rates: [0.3, 0.5, 0.5, 0.4],
            prune_opacity: 0.03,
            split_scale: 1.2,
            near: 0.5,
            silhouette_share: 0.5,
            residual_share: 1.0,
            degree: 0,
            grows: false,
            has_limited_colours: false,
            is_antialiased: false,
            seed: 0,
        }
    }
}

impl Recipe {
    /// The cloud of so many sources that the optimisation begins with.
    pub fn cloud(source_count: usize) -> CloudOptions {
        let options = CloudOptions::default();
        if source_count <= MAX_UNCONFIRMED { CloudOptions { least_views: 1 } } else { options }
    }

    /// The recipes for pictures that are mixed with the field's own; which of them is better is the scene's
    /// (`host/results/objects.md`). What is far away the other pictures of a mixture show: Gaussians behind all
    /// surfaces would draw its depths behind them. Where there are silhouettes the outline has twice the weight; more
    /// than half of an object's time is that of its trials, and pictures get twice the iterations. They are few and
    /// large, opaque only where that gains, for glossy objects, of which the sources agree on little; or many and small.
    pub fn mixed_with(self, images: &SourceImages) -> Vec<Variant<Recipe>> {
        if !images.has_silhouettes {
            return vec![Variant::to_measure("the usual Gaussians", Recipe { background_count: 0, ..self })];
        }
        let small = Recipe {
            iterations: self.iterations.map(|count| 2 * count),
            trial_divisor: 2 * self.trial_divisor,
            max_per_pixel: self.max_per_pixel.min(0.4),
            opacity_penalty: 0.1,
            silhouette_share: 1.0,
            ..self
        };
        let large = Recipe {
            max_per_pixel: self.max_per_pixel,
            split_scale: f32::INFINITY,
            opacity_penalty: 0.4,
            structure_share: 0.0,
            residual_share: 0.5,
            ..small
        };
        vec![Variant::to_measure("few large Gaussians", large), Variant::to_measure("many small Gaussians", small)]
    }

    /// In a record: those that differ among the recipes for mixtures, where they are not at their defaults.
    pub(crate) fn settings(&self) -> Vec<Setting> {
        let scalars = |recipe: &Recipe| {
            [("opacity penalty", recipe.opacity_penalty), ("structure share", recipe.structure_share)]
                .map(|(name, value)| Setting { name, value })
        };
        let varied = scalars(self).into_iter().zip(scalars(&Recipe::default()));
        varied.filter(|(scalar, default)| scalar != default).map(|(scalar, _)| scalar).collect()
    }

    /// Iterations at all sizes.
    pub(crate) fn all_iterations(&self) -> u32 {
        self.iterations.iter().sum()
    }

    /// The recipe for trials, which are small and only compared. Previews have no Gaussians of their own.
    pub(crate) fn reduced(self, purpose: Purpose) -> Recipe {
        let divisor = if purpose == Purpose::Trial { self.trial_divisor } else { 1 };
        Recipe { iterations: self.iterations.map(|count| count / divisor), ..self }
    }

    /// The recipe with so many iterations at each level that has some, and at most so many Gaussians, whatever the
    /// sources' size.
    pub fn with(mut self, iterations: Option<u32>, count: Option<u32>) -> Recipe {
        if let Some(iterations) = iterations {
            self.iterations.iter_mut().filter(|count| **count > 0).for_each(|count| *count = iterations);
        }
        if let Some(count) = count {
            (self.max_count, self.max_per_pixel) = (count as usize, f32::INFINITY);
        }
        self
    }
}
