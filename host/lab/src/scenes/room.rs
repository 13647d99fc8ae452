//! A room: a table with things on it, and furniture, pictures and a window around it.
//!
//! The world's origin is the middle of the table's top, which lies in the plane `z = 0`; a unit is about a third of a
//! metre. The room is closed: floor, ceiling and four walls. Everything is drawn for a seed: materials, colours, what
//! stands on the table and where, what hangs on the walls.

pub(crate) mod furniture;
mod hangings;
pub(crate) mod palette;
mod shell;
pub(crate) mod things;
mod vessels;

use crate::scenes::kinds::build::Build;
use crate::scenes::kinds::draws::Draws;
use crate::scenes::lamp::Lamp;
use crate::scenes::material::Material;
use crate::scenes::rig::Walk;
use crate::scenes::scenery::Scenery;
use crate::scenes::texture::{Finish, Texture};
use viewfuse_core::Vec3;

/// Distance of the left and right wall from the middle.
pub const HALF_WIDTH: f32 = 4.5;

/// Distance of the back wall (along y) and the front wall (against it) from the middle.
pub const HALF_LENGTH: f32 = 4.3;

/// Height of the floor: the table stands on it.
pub const FLOOR: f32 = -2.2;

/// Height of the ceiling.
pub const CEILING: f32 = 5.2;

/// Half of the table's length and width.
pub const TABLE: [f32; 2] = [1.6, 1.15];

/// Tells the draws of rooms from those of all kinds of objects.
const ROOM: u32 = 100;

/// Where a person with a camera walks in the room.
pub const WALK: Walk = Walk { subject: Vec3::new(0.0, 0.12, 0.34), distance: 3.1, heights: [0.95, 1.6] };

/// The room with this seed and index.
pub fn room(seed: u64, index: u32) -> Scenery {
    let mut draws = Draws::new(seed, ROOM, index);
    let mut build = Build::default();
    let window = shell::shell(&mut draws, &mut build);
    furniture::furniture(&mut draws, &mut build);
    hangings::hangings(&mut draws, &mut build);
    things::things(&mut draws, &mut build);
    let first_glowing = build.parts.len();
    shell::outside(&mut draws, &mut build, window);
    let lamps = lamps(&mut draws);
    let dim = draws.between(0.36, 0.46);
    let around = [Vec3::new(1.0, 0.9, 0.78) * (0.7 * dim), Vec3::new(0.92, 0.96, 1.0) * dim];
    Scenery::new(build.parts, lamps, around).glowing_from(first_glowing)
}

/// A warm lamp above the table, to one side, and a cool one on the other side: the first throws the sharper shadows.
fn lamps(draws: &mut Draws) -> Vec<Lamp> {
    let side = if draws.chance(0.5) { 1.0 } else { -1.0 };
    let strength = draws.between(0.95, 1.1);
    let warm = Lamp {
        centre: Vec3::new(side * draws.between(1.3, 2.2), draws.between(-1.6, -0.6), draws.between(3.8, 4.4)),
        radius: draws.between(0.3, 0.45),
        light: Vec3::new(1.0, 0.88, 0.7) * strength,
        reach: 4.6,
    };
    let cool = Lamp {
        centre: Vec3::new(-side * draws.between(2.4, 3.2), draws.between(-1.6, 0.6), draws.between(2.8, 3.6)),
        radius: draws.between(0.6, 0.9),
        light: Vec3::new(0.7, 0.84, 1.0) * (0.42 * strength),
        reach: 4.4,
    };
    vec![warm, cool]
}

/// A material with a gloss, the pattern's origin at the part's.
pub(crate) fn of(material: Material, gloss: f32) -> Finish {
    shifted(material, gloss, Vec3::ZERO)
}

/// A material whose pattern is moved: parts of one wall share one pattern.
pub(crate) fn shifted(material: Material, gloss: f32, shift: Vec3) -> Finish {
    Finish { texture: Texture::Material { material, shift }, gloss }
}

/// A seed for a material.
pub(crate) fn pattern_seed(draws: &mut Draws) -> u32 {
    draws.below(1 << 22)
}
