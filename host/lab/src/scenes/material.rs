//! Materials: patterns with structure at every size, as surfaces in a room and outdoors have them.
//!
//! A material is a function of the point like a texture, most of them flat: they look at two of the three coordinates.
//! None repeats itself exactly. Every brick, plank and motif differs a little from its neighbours, so that a place in
//! one photograph can be told from its neighbours in another one. Colours are display values, lengths are in world
//! units.

mod cloth;
mod font;
mod glaze;
mod letters;
mod masonry;
mod painting;
mod rug;
mod spine;
mod stone;
mod wallpaper;
mod wood;

pub use cloth::Cloth;
pub use glaze::Glaze;
pub use letters::{Letters, Setting};
pub use masonry::Masonry;
pub use painting::Painting;
pub use rug::Rug;
pub use spine::Spine;
pub use stone::Stone;
pub use wallpaper::{Motif, Wallpaper};
pub use wood::Wood;

use crate::scenes::noise::layered;
use viewfuse_core::Vec3;

/// Which two local coordinates a flat pattern is drawn with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// `x` to the right and `z` up: what stands.
    Front,
    /// `y` to the right and `z` up: what stands and is seen from the side.
    Side,
    /// `x` to the right and `y` up: what lies.
    Top,
}

impl Plane {
    /// The coordinates to the right, upwards, and through the plane.
    pub fn coordinates(self, p: Vec3) -> [f32; 3] {
        match self {
            Plane::Front => [p.x, p.z, p.y],
            Plane::Side => [p.y, p.z, p.x],
            Plane::Top => [p.x, p.y, p.z],
        }
    }

    /// The plane with the same pattern whose right is this one's up.
    pub fn turned(self, coordinates: [f32; 3]) -> [f32; 3] {
        let [right, up, through] = coordinates;
        [up, right, through]
    }
}

macro_rules! materials {
    ($($Material:ident),+) => {
        /// What a surface is made of.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Material {
            $($Material($Material),)+
        }

        impl Material {
            /// The display colour at a point in local coordinates.
            pub fn colour(&self, point_local: Vec3) -> Vec3 {
                match self {
                    $(Material::$Material(material) => material.colour(point_local),)+
                }
            }
        }
    };
}

materials!(Wood, Masonry, Wallpaper, Cloth, Rug, Letters, Painting, Spine, Glaze, Stone);

/// A colour with the small unevenness of everything that was made or used: `strength` of it, in spots of `size`.
fn worn(colour: Vec3, p: Vec3, size: f32, strength: f32, seed: u32) -> Vec3 {
    colour * (1.0 + strength * (2.0 * layered(p / size, seed, 2) - 1.0))
}

/// Softly 1 inside and 0 outside of an edge at 0; `width` is that of the transition.
fn inside(distance: f32, width: f32) -> f32 {
    (0.5 - distance / width).clamp(0.0, 1.0)
}
