//! Kinds of objects to learn from: each is a whole distribution, and an object of it is named by a seed and an index.
//!
//! Everything about an object is drawn with counter-based random numbers (`viewfuse_core::random`): proportions, parts,
//! colours, patterns, lamps. The same seed and index give the same object bit for bit, whatever was drawn before.
//! Objects stand upright along world z, cars and chairs face along world x, and all are normalised as ShapeNet's are: the
//! diagonal of the box around them is about 1 (0.8 to 1), its middle about the origin. Nothing reaches farther
//! than [`MAX_RADIUS`], so that no camera of [`crate::cameras`] cuts anything off.

pub(crate) mod build;
mod cars;
mod chairs;
pub(crate) mod draws;
mod livery;
pub(crate) mod paint;
mod toys;

use crate::object::{Object, ObjectError};
use build::Build;
use draws::Draws;
use std::fmt;
use std::str::FromStr;
use viewfuse_core::Vec3;

/// Farthest that an object reaches from the origin, in world units.
pub const MAX_RADIUS: f32 = 0.55;

/// What an object is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Saloons, hatchbacks, vans, pick-ups, sports and race cars, about half of them without wheels.
    Cars,
    /// Chairs, stools and armchairs.
    Chairs,
    /// Heaps and towers of primitives.
    Toys,
}

/// The name is none of a kind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a kind of objects: cars, chairs or toys")]
pub struct UnknownKind(String);

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 3] = [Kind::Cars, Kind::Chairs, Kind::Toys];

    /// The object of this kind with this seed and index.
    ///
    /// # Errors
    /// [`ObjectError`] if a part is unusable; none for the kinds as they are.
    pub fn object(self, seed: u64, index: u32) -> Result<Object, ObjectError> {
        let mut draws = Draws::new(seed, self as u32, index);
        let mut build = Build::default();
        match self {
            Kind::Cars => cars::car(&mut draws, &mut build),
            Kind::Chairs => chairs::chair(&mut draws, &mut build),
            Kind::Toys => toys::toy(&mut draws, &mut build),
        }
        Object::new(build.parts)?.under(paint::light(&mut draws))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Kind::Cars => "cars",
            Kind::Chairs => "chairs",
            Kind::Toys => "toys",
        })
    }
}

impl FromStr for Kind {
    type Err = UnknownKind;

    fn from_str(name: &str) -> Result<Kind, UnknownKind> {
        Kind::ALL.into_iter().find(|kind| kind.to_string() == name).ok_or_else(|| UnknownKind(name.to_owned()))
    }
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
