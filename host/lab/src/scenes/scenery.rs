//! Scenery: an object that surrounds the cameras, with lamps of its own.

use crate::scenes::lamp::Lamp;
use crate::scenes::noise::blend;
use crate::scenes::object::Object;
use crate::scenes::part::Part;
use viewfuse_core::Vec3;

/// Parts all around, and light.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenery {
    object: Object,
    lamps: Vec<Lamp>,
    /// From straight below and straight above.
    around: [Vec3; 2],
    /// The first part that glows; all after it do.
    first_glowing: usize,
}

impl Scenery {
    /// Parts, lamps, and the light that comes from straight below and straight above where nothing is near.
    pub fn new(parts: Vec<Part>, lamps: Vec<Lamp>, around: [Vec3; 2]) -> Scenery {
        let first_glowing = parts.len();
        Scenery { object: Object::new(parts), lamps, around, first_glowing }
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

    pub fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    /// The light from around on a surface whose normal has this share of up (-1 to 1).
    pub fn around(&self, up: f32) -> Vec3 {
        blend(self.around[0], self.around[1], 0.5 + 0.5 * up)
    }

    /// Whether the part with this index glows.
    pub fn glows(&self, part: usize) -> bool {
        part >= self.first_glowing
    }
}
