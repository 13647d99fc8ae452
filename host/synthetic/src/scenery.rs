//! Scenery: an object that surrounds the cameras, with lamps of its own and perhaps a sky.

use crate::lamp::Lamp;
use crate::noise::{blend, layered};
use crate::object::{Object, ObjectError};
use crate::part::Part;
use viewfuse_core::Vec3;
use viewfuse_core::math::{max, sqrt};

/// What is seen where there is nothing: clouds over a horizon, infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Display colour straight above.
    pub above: Vec3,
    /// Display colour at the horizon and below it.
    pub horizon: Vec3,
    /// Display colour of clouds.
    pub cloud: Vec3,
    /// Which clouds.
    pub seed: u32,
}

impl Sky {
    /// The display colour in a direction (unit vector, world z up).
    pub fn colour(&self, direction_world: Vec3) -> Vec3 {
        let up = max(direction_world.z, 0.0);
        let clear = blend(self.horizon, self.above, sqrt(up));
        // Clouds on a ceiling that comes down to the horizon far away.
        let place = Vec3::new(direction_world.x, direction_world.y, 0.0) * (2.2 / (up + 0.22));
        let amount = layered(place, self.seed, 5);
        blend(clear, self.cloud, ((amount - 0.44) * 4.0).clamp(0.0, 0.95))
    }

    fn is_sound(&self) -> bool {
        self.above.is_finite() && self.horizon.is_finite() && self.cloud.is_finite()
    }
}

/// Why parts and lamps are not scenery.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SceneryError {
    /// The parts are not an object.
    #[error(transparent)]
    Object(#[from] ObjectError),
    /// A lamp's place, size or light is not usable. Lamps count from 0.
    #[error("lamp {lamp} has an unusable place, size or light")]
    Lamp {
        /// Which lamp.
        lamp: usize,
    },
    /// The light from around is not finite or negative, or the sky's colours are not finite.
    #[error("the light from around or the sky is unusable")]
    Around,
}

/// Parts all around, and light. Checked when built.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenery {
    object: Object,
    lamps: Vec<Lamp>,
    /// From straight below and straight above.
    around: [Vec3; 2],
    sky: Option<Sky>,
    /// The first part that glows; all after it do.
    first_glowing: usize,
}

impl Scenery {
    /// Parts, lamps, and the light that comes from straight below and straight above where nothing is near.
    ///
    /// # Errors
    /// [`SceneryError`] names what is unusable.
    pub fn new(parts: Vec<Part>, lamps: Vec<Lamp>, around: [Vec3; 2]) -> Result<Scenery, SceneryError> {
        if let Some(lamp) = lamps.iter().position(|lamp| !lamp.is_sound()) {
            return Err(SceneryError::Lamp { lamp });
        }
        if !around.into_iter().all(|light| light.is_finite() && light.cmpge(Vec3::ZERO).all()) {
            return Err(SceneryError::Around);
        }
        let first_glowing = parts.len();
        Ok(Scenery { object: Object::new(parts)?, lamps, around, sky: None, first_glowing })
    }

    /// The same under a sky.
    ///
    /// # Errors
    /// [`SceneryError::Around`].
    pub fn under(self, sky: Sky) -> Result<Scenery, SceneryError> {
        if sky.is_sound() { Ok(Scenery { sky: Some(sky), ..self }) } else { Err(SceneryError::Around) }
    }

    /// The same, where the parts from this index on are shown in their own colours whatever the lamps say: what is seen
    /// through a window.
    #[must_use]
    pub fn glowing_from(self, first_glowing: usize) -> Scenery {
        Scenery { first_glowing, ..self }
    }

    /// All parts as one object.
    pub fn object(&self) -> &Object {
        &self.object
    }

    /// The lamps.
    pub fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    /// The light from around on a surface whose normal has this share of up (-1 to 1).
    pub fn around(&self, up: f32) -> Vec3 {
        blend(self.around[0], self.around[1], 0.5 + 0.5 * up)
    }

    /// The display colour where no part is: the sky's, or black.
    pub fn background(&self, direction_world: Vec3) -> Vec3 {
        self.sky.map_or(Vec3::ZERO, |sky| sky.colour(direction_world))
    }

    /// Whether the part with this index glows.
    pub fn glows(&self, part: usize) -> bool {
        part >= self.first_glowing
    }
}
