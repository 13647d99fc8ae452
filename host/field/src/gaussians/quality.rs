//! How sharp the Gaussians of a scene are to be, and the recipe for it.

use super::recipe::Recipe;

/// Iterations of the fast recipe at the finest size of objects: harmonics learn in as many.
const FINEST_OF_OBJECTS: u32 = 160;

/// How sharp the Gaussians are to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// Some ten seconds: for few photographs, and for a look.
    #[default]
    Fast,
    /// Minutes: for a dozen photographs and more, or for some that are near to one another.
    Standard,
    /// Five times as long as [`Quality::Standard`], at up to twice the size.
    High,
}

viewfuse_job::named! {
    // The fastest first.
    pub Quality: "a quality" {
        Fast => "fast",
        Standard => "standard",
        High => "high",
    }
}

impl Quality {
    /// The recipe, for sources with silhouettes or for whole photographs. Beyond [`Quality::Fast`] it begins with few
    /// Gaussians, their number rises to its limit, and colours depend on the direction: with exposures that differ from
    /// photograph to photograph, too, so that these have no gains. Rates are lower, for many iterations. Objects have
    /// such colours in [`Quality::Fast`], too: with as few Gaussians as silhouettes leave, the iterations that they take
    /// at the finest level are affordable. What was measured is in `host/results/gaussian_quality.md`.
    pub fn recipe(self, has_silhouettes: bool) -> Recipe {
        let fast = Recipe::default();
        let (side, finest, max_count) = match self {
            Quality::Fast if has_silhouettes => {
                let ([place, scale, turn, opaque, colour, _], [.., before, half, _]) = (fast.rates, fast.iterations);
                let rates = [place, scale, turn, opaque, colour, 0.0];
                return Recipe { iterations: [0, before, half, FINEST_OF_OBJECTS], rates, degree: 3, ..fast };
            }
            Quality::Fast => return fast,
            Quality::Standard => (800, 3000, 100_000),
            Quality::High => (1600, 10_000, 500_000),
        };
        let whole = Recipe {
            side,
            iterations: [0, 60, 60, finest],
            max_count,
            max_per_pixel: 0.75,
            split_scale: f32::INFINITY,
            rates: [0.1, 0.01, 2.0e-3, 0.05, 5.0e-3, 0.0],
            last_rates: [0.3, 0.2, 0.2, 0.1],
            degree: 3,
            grows: true,
            ..fast
        };
        match has_silhouettes {
            true => Recipe { opacity_penalty: 0.1, silhouette_share: 1.0, ..whole },
            false => whole,
        }
    }
}

/// What the recipe of a scene is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecipeOptions {
    /// How sharp the Gaussians are to be.
    pub quality: Quality,
    /// Iterations at each size that the quality has, in place of its own.
    pub iterations: Option<u32>,
    /// Most Gaussians, whatever the sources' size.
    pub count: Option<u32>,
    /// Whether colours are the same from everywhere, as some files have them: sources have gains then.
    pub is_of_one_colour: bool,
    /// Whether splats keep their integral when they are dilated: for pictures of other sizes than the sources'.
    pub is_antialiased: bool,
    /// Seed of what is drawn at random.
    pub seed: u64,
}

impl RecipeOptions {
    /// The recipe, for sources with silhouettes or for whole photographs.
    pub fn recipe(&self, has_silhouettes: bool) -> Recipe {
        let recipe = self.quality.recipe(has_silhouettes).with(self.iterations, self.count);
        let recipe = Recipe { seed: self.seed, is_antialiased: self.is_antialiased, ..recipe };
        let recipe = match self.is_of_one_colour {
            true => {
                let [.., gain_rate] = Recipe::default().rates;
                let [place, scale, turn, opaque, colour, _] = recipe.rates;
                Recipe { degree: 0, rates: [place, scale, turn, opaque, colour, gain_rate], ..recipe }
            }
            false => recipe,
        };
        // Where they do not depend on the direction, colours that no photograph has are only what fits the sources.
        Recipe { has_limited_colours: recipe.degree == 0, ..recipe }
    }
}
