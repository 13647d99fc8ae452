//! A garden: the table with things on it, outdoors on a terrace, with a house, a fence, bushes, trees, hills and a sky.
//!
//! The same coordinates as in [`crate::room`]: the origin is the middle of the table's top. Things stand at all distances from
//! an arm's length to the hills, and beyond them is the sky, infinitely far away.

use crate::kinds::build::{Build, place};
use crate::kinds::draws::Draws;
use crate::lamp::Lamp;
use crate::material::{Masonry, Material, Plane, Stone};
use crate::room::things::things;
use crate::room::{FLOOR, furniture, of, palette, pattern_seed};
use crate::scenery::{Scenery, SceneryError, Sky};
use crate::shape::Shape;
use crate::texture::{Finish, rgb};
use core::f32::consts::TAU;
use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;

/// Tells the draws of gardens from those of rooms.
const GARDEN: u32 = 101;

/// The sun is so far away, in world units: its shadows do not spread.
const SUN: f32 = 400.0;

/// Greens of leaves.
const GREENS: [Vec3; 6] =
    [rgb(104, 146, 62), rgb(82, 128, 70), rgb(136, 158, 74), rgb(92, 122, 52), rgb(156, 150, 66), rgb(72, 112, 88)];

/// The garden with this seed and index.
///
/// # Errors
/// [`SceneryError`] if something is unusable; none for gardens as they are.
pub fn garden(seed: u64, index: u32) -> Result<Scenery, SceneryError> {
    let mut draws = Draws::new(seed, GARDEN, index);
    let mut build = Build::default();
    ground(&mut draws, &mut build);
    furniture::table(&mut draws, &mut build);
    things(&mut draws, &mut build)?;
    house(&mut draws, &mut build);
    let fence_side = if draws.chance(0.5) { 1.0 } else { -1.0 };
    let fence_x = fence_side * draws.between(6.0, 8.0);
    fence(&mut draws, &mut build, fence_x);
    planting(&mut draws, &mut build);
    let sky = Sky {
        above: draws.one_of([rgb(86, 136, 208), rgb(110, 160, 214), rgb(126, 140, 178)]),
        horizon: rgb(206, 220, 230),
        cloud: rgb(246, 244, 240),
        seed: pattern_seed(&mut draws),
    };
    let side = if draws.chance(0.5) { 1.0 } else { -1.0 };
    let towards = Vec3::new(side * draws.between(0.4, 0.9), -draws.between(0.2, 0.8), draws.between(0.8, 1.3));
    let sun = Lamp {
        centre: towards * (SUN / towards.length()),
        radius: draws.between(0.012, 0.04) * SUN,
        light: Vec3::new(1.0, 0.92, 0.78) * draws.between(0.75, 1.05),
        reach: SUN,
    };
    let around = [Vec3::new(0.2, 0.22, 0.14), Vec3::new(0.42, 0.47, 0.55) * draws.between(0.8, 1.1)];
    Scenery::new(build.parts, vec![sun], around)?.under(sky)
}

/// Blotches of leaves, grass or flowers in them.
fn leaves(draws: &mut Draws, cell: f32, flowers: bool) -> Finish {
    let green = draws.one_of(GREENS) * draws.between(0.85, 1.15);
    let bloom = [rgb(232, 130, 150), rgb(240, 226, 140), rgb(232, 232, 240), rgb(190, 130, 210), rgb(226, 96, 76)];
    let vein = if flowers { draws.one_of(bloom) } else { green * 1.25 };
    let (cell, seed) = (Vec3::splat(cell), pattern_seed(draws));
    of(Material::Stone(Stone { colours: [green * 0.42, green], vein, veined: 0.7, cell, seed }), 0.02)
}

/// Lawn, and a terrace of flags under the table.
fn ground(draws: &mut Draws, build: &mut Build) {
    let lawn = leaves(draws, 0.55, false);
    build.block([0.0, 0.0, FLOOR - 0.3], [55.0, 55.0, 0.24], 0.0, lawn);
    let light = draws.one_of([rgb(196, 186, 168), rgb(186, 150, 120), rgb(172, 172, 170)]);
    let flags = Masonry {
        bricks: [light, light * 0.66],
        mortar: rgb(96, 104, 70),
        plane: Plane::Top,
        size: [draws.between(0.8, 1.2), draws.between(0.6, 0.9)],
        joint: 0.05,
        bond: 0.5,
        seed: pattern_seed(draws),
    };
    let half = [draws.between(4.0, 5.5), draws.between(3.8, 4.6), 0.1];
    build.block([0.0, 0.3, FLOOR - 0.1], half, 0.02, of(Material::Masonry(flags), 0.03));
}

/// A wall of bricks or boards behind the table, on one side, with a door, windows and a roof.
fn house(draws: &mut Draws, build: &mut Build) {
    let side = if draws.chance(0.5) { 1.0 } else { -1.0 };
    let (y, half_wide, half_high) = (draws.between(6.0, 8.0), draws.between(3.6, 5.0), 3.2);
    let x = side * (half_wide + draws.between(-0.8, 0.6));
    let wall = if draws.chance(0.7) {
        palette::brick(draws, Plane::Front)
    } else {
        palette::wood(draws, Plane::Front, false, 0.35, 4.0)
    };
    build.block([x, y + 3.0, FLOOR + half_high], [half_wide, 3.0, half_high], 0.0, of(wall, 0.0));
    let tiles = palette::brick(draws, Plane::Front);
    for row in 0..5_u8 {
        let up = f32::from(row);
        let at = [x, y + 0.55 * up + 1.4, FLOOR + 2.0 * half_high + 0.1 + 0.42 * up];
        build.block(at, [half_wide + 0.4, 1.8, 0.24], 0.05, of(tiles, 0.04));
    }
    let frame = of(palette::wood(draws, Plane::Front, true, 0.3, 3.0), 0.06);
    let door = of(palette::wood(draws, Plane::Front, true, 0.28, 5.0), 0.1);
    let door_x = x - side * 0.55 * half_wide;
    build.block([door_x, y, FLOOR + 1.5], [0.85, 0.08, 1.6], 0.02, frame);
    build.block([door_x, y - 0.06, FLOOR + 1.45], [0.7, 0.06, 1.45], 0.02, door);
    for window in 0..3_u8 {
        let at = x + side * (0.42 * f32::from(window) - 0.05) * half_wide;
        if (at - x).abs() > half_wide - 0.8 {
            continue;
        }
        let pane = Stone {
            colours: [rgb(56, 76, 96), rgb(150, 182, 204)],
            vein: rgb(226, 234, 238),
            veined: 0.5,
            cell: Vec3::new(0.5, 0.5, 0.7),
            seed: pattern_seed(draws),
        };
        let z = FLOOR + 3.2;
        build.block([at, y, z], [0.62, 0.07, 0.8], 0.02, frame);
        build.block([at, y - 0.03, z], [0.52, 0.06, 0.7], 0.0, of(Material::Stone(pane), 0.25));
        build.block([at, y - 0.08, z], [0.03, 0.03, 0.7], 0.0, frame);
        build.block([at, y - 0.08, z], [0.52, 0.03, 0.03], 0.0, frame);
        let box_of_flowers = leaves(draws, 0.12, true);
        build.ellipsoid([at, y - 0.2, z - 0.8], [0.62, 0.22, 0.22], box_of_flowers);
    }
}

/// Boards side by side along y, of unequal height.
fn fence(draws: &mut Draws, build: &mut Build, x: f32) {
    let wood = palette::wood(draws, Plane::Side, true, 0.5, 4.0);
    for board in 0..40_u8 {
        let half_high = draws.between(1.0, 1.15);
        let at = [x + draws.between(-0.03, 0.03), 0.52 * f32::from(board) - 10.0, FLOOR + half_high];
        let finish = crate::room::shifted(wood, 0.03, Vec3::from_array(at));
        build.block(at, [0.04, 0.23, half_high], 0.02, finish);
    }
}

/// Bushes near by, trees all around, hills far away.
fn planting(draws: &mut Draws, build: &mut Build) {
    for bush in 0..14_u8 {
        let turn = TAU * (f32::from(bush) + draws.unit()) / 14.0;
        let (sine, cosine) = sin_cos(turn);
        let (out, size) = (draws.between(5.2, 9.0), draws.between(0.5, 1.0));
        let finish = leaves(draws, 0.2, bush % 2 == 0);
        for _ in 0..3 {
            let at = [
                out * cosine + draws.between(-0.6, 0.6),
                out * sine + draws.between(-0.6, 0.6),
                FLOOR + size * draws.between(0.4, 0.9),
            ];
            build.ellipsoid(at, [size, size, size * draws.between(0.7, 1.0)], finish);
        }
    }
    for tree in 0..16_u8 {
        let turn = TAU * (f32::from(tree) + draws.unit()) / 16.0;
        let (sine, cosine) = sin_cos(turn);
        let out = 10.0 + 26.0 * draws.unit() * draws.unit();
        let (x, y, tall) = (out * cosine, out * sine, draws.between(1.6, 2.8));
        let bark = of(palette::wood(draws, Plane::Front, true, 0.6, 2.0), 0.0);
        let blossoms = draws.chance(0.2);
        let trunk = Shape::Cylinder { radius: draws.between(0.22, 0.4), half_height: tall, rounding: 0.05 };
        build.add(trunk, place([x, y, FLOOR + tall]), bark);
        let finish = leaves(draws, 0.5, blossoms);
        for _ in 0..6 {
            let size = draws.between(0.9, 1.6);
            let at = [
                x + draws.between(-1.2, 1.2),
                y + draws.between(-1.2, 1.2),
                FLOOR + 2.0 * tall + draws.between(-0.2, 1.9),
            ];
            build.ellipsoid(at, [size, size, 0.8 * size], finish);
        }
    }
    for hill in 0..9_u8 {
        let (sine, cosine) = sin_cos(TAU * (f32::from(hill) + 0.6 * draws.unit()) / 9.0);
        let finish = leaves(draws, 2.5, false);
        let radii = [draws.between(20.0, 30.0), draws.between(20.0, 30.0), draws.between(4.0, 9.0)];
        build.ellipsoid([62.0 * cosine, 62.0 * sine, FLOOR], radii, finish);
    }
}
