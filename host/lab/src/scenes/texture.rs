//! Appearance: colour as a function of the point, and gloss.
//!
//! Textures are solid: they fill the space around the primitive in its own coordinates, and the surface cuts through
//! them. So they need no unwrapping, have no seams and mean the same for every shape. Colours are display values
//! (what an 8-bit image stores, divided by 255), red, green, blue.

use crate::scenes::material::Material;
use viewfuse_core::Vec3;
use viewfuse_core::math::{angle_from_components, floor_to_i32, sqrt};
use viewfuse_core::random::threefry_2x32;

/// How many boxes [`Texture::Patches`] has.
pub const PATCH_COUNT: usize = 10;

/// A box of one colour, in local coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Its lowest corner.
    pub from: Vec3,
    /// Its highest corner.
    pub to: Vec3,
    pub colour: Vec3,
}

impl Patch {
    /// A box that holds no point.
    pub const NOTHING: Patch = Patch { from: Vec3::ONE, to: Vec3::ZERO, colour: Vec3::ZERO };
}

/// A pattern of two colours, or one colour alone. Sizes are in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "as with shapes: few, and in one piece of memory")]
pub enum Texture {
    /// One colour.
    Plain {
        /// Everywhere.
        colour: Vec3,
    },
    /// Cubes of alternating colours; the local origin is the middle of one of the first colour.
    Checker {
        /// The two colours.
        colours: [Vec3; 2],
        /// Edge of a cube.
        size: f32,
    },
    /// Layers of alternating colours; the local origin is the middle of one of the first colour.
    Stripes {
        /// The two colours.
        colours: [Vec3; 2],
        /// Unit vector across the layers, in local coordinates.
        across: Vec3,
        /// Thickness of a layer.
        width: f32,
    },
    /// Slices of alternating colours around the local z axis, like a beach ball's.
    Slices {
        /// The two colours.
        colours: [Vec3; 2],
        /// Slices of each colour.
        pair_count: u32,
    },
    /// Balls of the second colour at random places in the first, one in each cell of a grid.
    Spots {
        /// Ground and spots.
        colours: [Vec3; 2],
        /// Edge of a cell.
        cell: f32,
        /// Radius of a ball as a fraction of the cell, at most 0.5: a ball never leaves its cell.
        radius: f32,
        seed: u32,
    },
    /// Boxes of other colours in one colour: lines, panels, numbers.
    Patches {
        /// Outside of all boxes.
        ground: Vec3,
        /// The boxes; a later one covers an earlier one.
        patches: [Patch; PATCH_COUNT],
    },
    /// Smooth random mixture of the two colours.
    Mottle {
        /// The extremes.
        colours: [Vec3; 2],
        /// Size of a blotch along each axis: unequal ones give a grain.
        cell: Vec3,
        seed: u32,
    },
    /// What things in rooms and outdoors are made of.
    Material {
        /// Its pattern.
        material: Material,
        /// Added to the point: where in the pattern the local origin lies.
        shift: Vec3,
    },
}

/// What a surface looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finish {
    /// Its colour.
    pub texture: Texture,
    /// Strength of the highlight, 0 (matt) to about 0.3 (varnish).
    pub gloss: f32,
}

impl Texture {
    /// The display colour at a point in local coordinates.
    pub fn colour(&self, point_local: Vec3) -> Vec3 {
        let p = point_local;
        match *self {
            Texture::Plain { colour } => colour,
            Texture::Checker { colours, size } => {
                let [x, y, z] = cell_of(p / size + Vec3::splat(0.5));
                alternate(colours, x.wrapping_add(y).wrapping_add(z))
            }
            Texture::Stripes { colours, across, width } => {
                alternate(colours, floor_to_i32(p.dot(across) / width + 0.5))
            }
            Texture::Slices { colours, pair_count } => {
                // The angle in turns: the lower half plane is the upper one, turned by half a turn.
                let upper = if p.y >= 0.0 { 0.0 } else { 0.5 };
                let (y, x) = if p.y >= 0.0 { (p.y, p.x) } else { (-p.y, -p.x) };
                let turns = upper + angle_from_components(y, x) * (0.5 / core::f32::consts::PI);
                alternate(colours, floor_to_i32(turns * (2 * pair_count) as f32))
            }
            Texture::Spots { colours, cell, radius, seed } => {
                let scaled = p / cell;
                let index = cell_of(scaled);
                let corner = Vec3::new(index[0] as f32, index[1] as f32, index[2] as f32);
                let [a, b] = random_words(seed, index);
                let place = Vec3::new(fraction(a), fraction(a << 16), fraction(b));
                let centre = corner + Vec3::splat(radius) + place * (1.0 - 2.0 * radius);
                let offset = scaled - centre;
                colours[usize::from(offset.dot(offset) < radius * radius)]
            }
            Texture::Patches { ground, ref patches } => {
                let holds = |patch: &&Patch| p.cmpge(patch.from).all() && p.cmple(patch.to).all();
                patches.iter().rev().find(holds).map_or(ground, |patch| patch.colour)
            }
            Texture::Mottle { colours, cell, seed } => {
                let amount = value_noise(p / cell, seed);
                colours[0] * (1.0 - amount) + colours[1] * amount
            }
            Texture::Material { ref material, shift } => material.colour(p + shift),
        }
    }
}

/// A display colour from 8-bit values.
pub const fn rgb(red: u8, green: u8, blue: u8) -> Vec3 {
    Vec3::new(red as f32 / 255.0, green as f32 / 255.0, blue as f32 / 255.0)
}

/// The light that a display colour stands for: its square. A gamma of 2 rather than sRGB's curve, because its inverse
/// is the square root, which every machine rounds alike.
pub fn light_from_display(colour: Vec3) -> Vec3 {
    colour * colour
}

/// The display colour of an amount of light in `[0, 1]` per channel: its square root.
pub fn display_from_light(light: Vec3) -> Vec3 {
    Vec3::new(sqrt(light.x), sqrt(light.y), sqrt(light.z))
}

fn alternate(colours: [Vec3; 2], index: i32) -> Vec3 {
    colours[(index & 1) as usize]
}

/// The unit cell that a point lies in.
fn cell_of(p: Vec3) -> [i32; 3] {
    [floor_to_i32(p.x), floor_to_i32(p.y), floor_to_i32(p.z)]
}

fn random_words(seed: u32, cell: [i32; 3]) -> [u32; 2] {
    threefry_2x32([seed, cell[0] as u32], [cell[1] as u32, cell[2] as u32])
}

/// A number in `[0, 1)` from the upper 16 bits.
fn fraction(word: u32) -> f32 {
    (word >> 16) as f32 * (1.0 / 65_536.0)
}

/// Random values in `[0, 1)` at whole-numbered points, and a smooth trilinear blend between them.
fn value_noise(p: Vec3, seed: u32) -> f32 {
    let [x, y, z] = cell_of(p);
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let weight = [ease(p.x - x as f32), ease(p.y - y as f32), ease(p.z - z as f32)];
    let mut sum = 0.0;
    for corner in 0..8 {
        let upper = [corner & 1, (corner >> 1) & 1, corner >> 2];
        let [value, _] =
            random_words(seed, [x.wrapping_add(upper[0]), y.wrapping_add(upper[1]), z.wrapping_add(upper[2])]);
        let mut share = fraction(value);
        for axis in 0..3 {
            share *= if upper[axis] == 1 { weight[axis] } else { 1.0 - weight[axis] };
        }
        sum += share;
    }
    sum
}
