//! Objects: cars to learn from, and chairs that stand in rooms. Each is a whole distribution, of which one is named by
//! a seed and an index.
//!
//! Everything about an object is drawn with counter-based random numbers (`viewfuse_core::random`): proportions, parts,
//! colours, patterns, lamps. The same seed and index give the same object bit for bit, whatever was drawn before.
//! They stand upright along world z, face along world x, and are normalised as ShapeNet's are: the diagonal of the box
//! around them is about 1 (0.8 to 1), its middle about the origin. No car reaches farther than [`MAX_RADIUS`], so that
//! no camera of [`crate::scenes::cameras`] cuts anything off.

pub(crate) mod build;
mod cars;
mod chairs;
pub(crate) mod draws;
mod livery;
pub(crate) mod paint;

use crate::scenes::object::Object;
use build::Build;
use draws::Draws;
use viewfuse_core::Vec3;

/// Farthest that an object reaches from the origin, in world units.
pub const MAX_RADIUS: f32 = 0.55;

/// Tell the draws of one kind from those of another and of rooms.
const CARS: u32 = 0;
const CHAIRS: u32 = 1;

/// The car with this seed and index: a saloon, hatchback, van, pick-up, sports or race car, about half of them without
/// wheels.
pub fn car(seed: u64, index: u32) -> Object {
    object(seed, CARS, index, cars::car)
}

/// The chair with this seed and index.
pub(crate) fn chair(seed: u64, index: u32) -> Object {
    object(seed, CHAIRS, index, chairs::chair)
}

fn object(seed: u64, kind: u32, index: u32, add: fn(&mut Draws, &mut Build)) -> Object {
    let mut draws = Draws::new(seed, kind, index);
    let mut build = Build::default();
    add(&mut draws, &mut build);
    Object::new(build.parts).under(paint::light(&mut draws))
}

/// Linear blend.
fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Half sizes of a box with these proportions and this diagonal.
fn half_sizes(proportions: [f32; 3], diagonal: f32) -> [f32; 3] {
    let length = Vec3::from_array(proportions).length();
    proportions.map(|side| 0.5 * diagonal * side / length)
}
