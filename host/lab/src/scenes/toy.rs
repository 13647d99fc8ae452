//! The sample scene: a toy lorry with its load, and the cameras around it.
//!
//! The lorry is 0.8 units long (0.9 along its diagonal), drives along world x and stands upright along z. It has an
//! open bed (concave), an exhaust, mirrors, bumpers and rails (thin, but nowhere thinner than three pixels of the
//! sample's pictures), and no two sides of one colour: cameras on opposite sides see different things, and weighting
//! the views has a point.

mod load;

use crate::scenes::object::Object;
use crate::scenes::orbit::Orbit;
use crate::scenes::part::Part;
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, Texture, rgb};
use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::pose::PoseError;

const RED: Vec3 = rgb(222, 54, 44);
const DARK_RED: Vec3 = rgb(160, 30, 36);
const YELLOW: Vec3 = rgb(250, 200, 44);
const ORANGE: Vec3 = rgb(246, 134, 36);
const GREEN: Vec3 = rgb(52, 160, 84);
const LIME: Vec3 = rgb(160, 208, 80);
const BLUE: Vec3 = rgb(44, 104, 200);
const SKY: Vec3 = rgb(150, 208, 240);
const PURPLE: Vec3 = rgb(134, 80, 180);
const PINK: Vec3 = rgb(242, 140, 176);
const WHITE: Vec3 = rgb(244, 240, 230);
const STEEL: Vec3 = rgb(176, 182, 190);
const SLATE: Vec3 = rgb(96, 104, 120);
const RUBBER: Vec3 = rgb(74, 74, 82);
const WOOD: [Vec3; 2] = [rgb(232, 190, 128), rgb(176, 122, 70)];

/// How many of the scene's views are for building on; the test views follow them.
pub const TRAINING_VIEW_COUNT: u32 = 20;

/// Sines of 10 and 60 degrees: the zone that the cameras stand in.
const ZONE: [f32; 2] = [0.173_648_18, 0.866_025_4];

/// Azimuths in radians and sines of the elevation of the test views, in the widest gaps of the spiral: each is 16 to 20
/// degrees from its nearest training view, where training views are 25 degrees apart.
const TEST_PLACES: [[f32; 2]; 4] = [[0.7, 0.5], [2.15, 0.4], [4.1, 0.7], [5.55, 0.6]];

/// Why the sample scene cannot be described; with the constants of this file it always can.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ToyError {
    #[error("the sample's intrinsics are unusable: {0}")]
    Pinhole(PinholeError),
    #[error("a camera of the sample is unusable: {0}")]
    Pose(PoseError),
}

/// The views to build on: 20 on a spiral.
pub fn training_cameras() -> Result<Vec<Camera>, ToyError> {
    orbit()?.spiral(TRAINING_VIEW_COUNT, ZONE).map_err(ToyError::Pose)
}

/// The views to test on: 4, none of them near a training view.
pub fn test_cameras() -> Result<Vec<Camera>, ToyError> {
    let orbit = orbit()?;
    TEST_PLACES.iter().map(|&[azimuth, sine]| orbit.camera(azimuth, sine).map_err(ToyError::Pose)).collect()
}

/// 128 x 128 pixels at focal length 131.25 from a distance of 1.3: the numbers of the ShapeNet car scenes.
fn orbit() -> Result<Orbit, ToyError> {
    let pinhole = Pinhole::new([131.25, 131.25], [64.0, 64.0], 128, 128).map_err(ToyError::Pinhole)?;
    Ok(Orbit { radius: 1.3, pinhole })
}

/// The toy lorry.
pub fn lorry() -> Object {
    let mut parts = Vec::new();
    running_gear(&mut parts);
    cab(&mut parts);
    bed(&mut parts);
    load::load(&mut parts);
    Object::new(parts)
}

/// Chassis, axles and wheels.
fn running_gear(parts: &mut Vec<Part>) {
    parts.push(part(block(0.36, 0.085, 0.03, 0.01), Placement::at(0.0, 0.0, -0.085), plain(SLATE, 0.05)));
    let axles = [(0.245, YELLOW, ORANGE), (-0.1, SKY, LIME), (-0.29, SKY, LIME)];
    for (x, left, right) in axles {
        for (side, hub) in [(1.0, left), (-1.0, right)] {
            let wheel = |y: f32| Placement::at(x, side * y, -0.105).turned_about_x(-side * FRAC_PI_2);
            let tread = Texture::Slices { colours: [RUBBER, rgb(104, 104, 114)], pair_count: 9 };
            let tyre = Shape::Cylinder { radius: 0.085, half_height: 0.036, rounding: 0.02 };
            parts.push(part(tyre, wheel(0.13), Finish { texture: tread, gloss: 0.05 }));
            let disc = Shape::Cylinder { radius: 0.052, half_height: 0.01, rounding: 0.008 };
            let spokes = Texture::Slices { colours: [hub, hub * 0.72], pair_count: 4 };
            parts.push(part(disc, wheel(0.162), Finish { texture: spokes, gloss: 0.2 }));
            parts.push(part(ball(0.022), wheel(0.168), plain(WHITE, 0.25)));
        }
    }
}

/// Cab, bonnet and what is fixed to them.
fn cab(parts: &mut Vec<Part>) {
    let paint = plain(RED, 0.22);
    parts.push(part(block(0.095, 0.15, 0.125, 0.035), Placement::at(0.17, 0.0, 0.065), paint));
    parts.push(part(block(0.085, 0.128, 0.068, 0.03), Placement::at(0.315, 0.0, 0.008), paint));
    let roof_stripes = Texture::Stripes { colours: [WHITE, BLUE], across: Vec3::Y, width: 0.05 };
    let roof = Finish { texture: roof_stripes, gloss: 0.15 };
    parts.push(part(block(0.085, 0.125, 0.02, 0.015), Placement::at(0.165, 0.0, 0.19), roof));

    let glass = plain(SKY, 0.3);
    parts.push(part(block(0.012, 0.11, 0.042, 0.01), Placement::at(0.258, 0.0, 0.125), glass));
    parts.push(part(block(0.012, 0.08, 0.035, 0.01), Placement::at(0.078, 0.0, 0.14), glass));
    for side in [1.0, -1.0] {
        parts.push(part(block(0.055, 0.012, 0.042, 0.01), Placement::at(0.175, side * 0.144, 0.118), glass));
        let door = if side > 0.0 { YELLOW } else { BLUE };
        parts.push(part(block(0.055, 0.012, 0.04, 0.01), Placement::at(0.17, side * 0.144, 0.015), plain(door, 0.2)));
        let mirror = Shape::Ellipsoid { radii: Vec3::new(0.02, 0.024, 0.034) };
        parts.push(part(mirror, Placement::at(0.25, side * 0.17, 0.1), plain(ORANGE, 0.2)));
        let lamp = Shape::Ellipsoid { radii: Vec3::new(0.022, 0.032, 0.032) };
        parts.push(part(lamp, Placement::at(0.395, side * 0.085, 0.012), plain(rgb(255, 240, 170), 0.3)));
    }

    let bars = Texture::Stripes { colours: [WHITE, SLATE], across: Vec3::Y, width: 0.028 };
    let grille = Finish { texture: bars, gloss: 0.1 };
    parts.push(part(block(0.012, 0.042, 0.034, 0.008), Placement::at(0.397, 0.0, 0.005), grille));
    let bumper = Shape::Capsule { half_length: 0.12, radius: 0.026 };
    parts.push(part(bumper, Placement::at(0.385, 0.0, -0.085).turned_about_x(FRAC_PI_2), plain(STEEL, 0.25)));
    let mascot = Shape::Torus { ring_radius: 0.034, tube_radius: 0.02 };
    parts.push(part(mascot, Placement::at(0.345, 0.03, 0.085), plain(YELLOW, 0.3)));
    let beacon = Shape::Ellipsoid { radii: Vec3::new(0.032, 0.032, 0.04) };
    parts.push(part(beacon, Placement::at(0.19, 0.06, 0.215), plain(ORANGE, 0.3)));

    let rings = Texture::Stripes { colours: [STEEL, SLATE], across: Vec3::Z, width: 0.045 };
    let pipe = Shape::Capsule { half_length: 0.14, radius: 0.022 };
    parts.push(part(pipe, Placement::at(0.047, -0.115, 0.085), Finish { texture: rings, gloss: 0.25 }));
    let rim = Shape::Torus { ring_radius: 0.018, tube_radius: 0.014 };
    parts.push(part(rim, Placement::at(0.047, -0.115, 0.24), plain(DARK_RED, 0.2)));
}

/// The open bed: a floor and four sides, each with a pattern of its own.
fn bed(parts: &mut Vec<Part>) {
    let planks = Texture::Mottle { colours: WOOD, cell: Vec3::new(0.16, 0.025, 0.05), seed: 3 };
    let floor = block(0.2, 0.15, 0.02, 0.008);
    parts.push(part(floor, Placement::at(-0.185, 0.0, -0.045), Finish { texture: planks, gloss: 0.0 }));

    let left = Texture::Stripes { colours: [GREEN, LIME], across: Vec3::new(0.8, 0.0, 0.6), width: 0.05 };
    let right = Texture::Checker { colours: [BLUE, WHITE], size: 0.055 };
    let back = Texture::Stripes { colours: [YELLOW, rgb(70, 70, 84)], across: Vec3::new(0.0, 0.8, 0.6), width: 0.045 };
    let long = block(0.205, 0.02, 0.065, 0.01);
    let short = block(0.02, 0.15, 0.065, 0.01);
    parts.push(part(long, Placement::at(-0.185, 0.148, 0.01), Finish { texture: left, gloss: 0.1 }));
    parts.push(part(long, Placement::at(-0.185, -0.148, 0.01), Finish { texture: right, gloss: 0.1 }));
    parts.push(part(short, Placement::at(-0.375, 0.0, 0.012), Finish { texture: back, gloss: 0.1 }));
    parts.push(part(short, Placement::at(0.005, 0.0, 0.025), plain(PURPLE, 0.1)));

    for (y, colour) in [(0.095, RED), (-0.095, ORANGE)] {
        let lamp = Shape::Ellipsoid { radii: Vec3::new(0.02, 0.028, 0.022) };
        parts.push(part(lamp, Placement::at(-0.37, y, -0.075), plain(colour, 0.25)));
    }
}

fn part(shape: Shape, placement: Placement, finish: Finish) -> Part {
    Part { shape, placement, finish }
}

fn plain(colour: Vec3, gloss: f32) -> Finish {
    Finish { texture: Texture::Plain { colour }, gloss }
}

fn ball(radius: f32) -> Shape {
    Shape::Sphere { radius }
}

fn block(x: f32, y: f32, z: f32, rounding: f32) -> Shape {
    Shape::Block { half_size: Vec3::new(x, y, z), rounding }
}
