//! Table, book shelf, chest of drawers, plant.

use super::{FLOOR, HALF_LENGTH, HALF_WIDTH, TABLE, of, palette, pattern_seed, shifted};
use crate::scenes::kinds::build::{Build, place};
use crate::scenes::kinds::draws::Draws;
use crate::scenes::material::{Material, Plane, Spine};
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, rgb};
use core::f32::consts::TAU;
use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;

/// Half of the thickness of boards.
const BOARD: f32 = 0.04;

/// Adds the furniture.
pub(super) fn furniture(draws: &mut Draws, build: &mut Build) {
    table(draws, build);
    let left = draws.between(0.9, 1.2);
    let right = left + draws.between(2.4, 2.8);
    shelf(draws, build, [left, right]);
    let side = if draws.chance(0.5) { 1.0 } else { -1.0 };
    chest(draws, build, side);
    plant(draws, build, [-side * (HALF_WIDTH - 0.7), HALF_LENGTH - 0.75]);
}

/// The top lies below `z = 0`; a cloth lies on it, thinner than a finger.
pub(crate) fn table(draws: &mut Draws, build: &mut Build) {
    let [half_x, half_y] = TABLE;
    let plank = draws.between(0.3, 0.42);
    let wood = palette::wood(draws, Plane::Top, false, plank, 5.0);
    build.block([0.0, 0.0, -0.06], [half_x, half_y, 0.06], 0.02, of(wood, 0.16));
    let upright = of(palette::same_wood(wood, Plane::Front, true), 0.1);
    let apron = of(palette::same_wood(wood, Plane::Front, false), 0.1);
    let end = of(palette::same_wood(wood, Plane::Side, false), 0.1);
    for side in [-1.0, 1.0] {
        build.block([0.0, side * (half_y - 0.2), -0.24], [half_x - 0.2, 0.04, 0.12], 0.01, apron);
        build.block([side * (half_x - 0.2), 0.0, -0.24], [0.04, half_y - 0.2, 0.12], 0.01, end);
        for other in [-1.0, 1.0] {
            let at = [side * (half_x - 0.2), other * (half_y - 0.2), 0.5 * (FLOOR - 0.12)];
            build.block(at, [0.1, 0.1, 0.5 * (-0.12 - FLOOR)], 0.02, upright);
        }
    }
    let (repeat, turn) = (draws.between(0.35, 0.6), draws.between(-0.25, 0.25));
    let cloth = of(palette::cloth(draws, Plane::Top, repeat, 0.022), 0.0);
    let half_size = Vec3::new(draws.between(0.75, 1.0), draws.between(0.5, 0.65), 0.006);
    let at = Placement::at(draws.between(-0.25, 0.25), draws.between(-0.15, 0.15), 0.002).turned_about_z(turn);
    build.add(Shape::Block { half_size, rounding: 0.004 }, at, cloth);
}

/// A shelf against the back wall from one x to another, full of books.
fn shelf(draws: &mut Draws, build: &mut Build, x: [f32; 2]) {
    let (depth, top) = (0.3, draws.between(2.2, 2.7));
    let y = HALF_LENGTH - depth - 0.02;
    let wood = palette::wood(draws, Plane::Front, false, 0.3, 4.0);
    let upright = of(palette::same_wood(wood, Plane::Front, true), 0.08);
    let lying = of(palette::same_wood(wood, Plane::Top, false), 0.08);
    let (middle_x, middle_z) = (0.5 * (x[0] + x[1]), 0.5 * (FLOOR + top));
    let (half_x, half_z) = (0.5 * (x[1] - x[0]), 0.5 * (top - FLOOR));
    build.block([middle_x, y + depth, middle_z], [half_x, 0.015, half_z], 0.0, upright);
    for edge in x {
        build.block([edge, y, middle_z], [BOARD, depth, half_z], 0.008, upright);
    }
    let count = 5_u16;
    let step = (top - FLOOR) / f32::from(count);
    for board in 0..=count {
        let z = FLOOR + step * f32::from(board) - if board == count { BOARD } else { -BOARD };
        build.block([middle_x, y, z], [half_x, depth, BOARD], 0.008, lying);
        if board < count {
            books(draws, build, [x[0] + BOARD, x[1] - BOARD], [y, z + BOARD], step - 2.0 * BOARD);
        }
    }
}

/// A row of books from one x to another, their feet at this y and z, in a compartment of this height.
fn books(draws: &mut Draws, build: &mut Build, x: [f32; 2], [y, z]: [f32; 2], room: f32) {
    let mut at = x[0] + 0.01;
    loop {
        // Here and there a vase or a box stands in a gap between books.
        let gap = if draws.chance(0.06) { draws.between(0.12, 0.3) } else { 0.0 };
        at += gap;
        let half = [draws.between(0.035, 0.075), draws.between(0.19, 0.25), draws.between(0.29, 0.46) * room];
        if at + 2.0 * half[0] > x[1] {
            return;
        }
        let centre = [at + half[0], y - 0.02 + draws.between(0.0, 0.05), z + half[2]];
        build.block(centre, half, 0.008, spine(draws, half));
        at += 2.0 * half[0] + 0.003;
    }
}

/// A book of these half sizes.
pub(super) fn spine(draws: &mut Draws, half: [f32; 3]) -> Finish {
    let cover = palette::paint(draws);
    let (band, ink) = (palette::other_paint(draws, cover), palette::other_paint(draws, cover));
    of(Material::Spine(Spine { colours: [cover, band, ink], half, seed: pattern_seed(draws) }), 0.05)
}

/// A chest of drawers against the left or right wall.
fn chest(draws: &mut Draws, build: &mut Build, side: f32) {
    let [deep, long, high] = [0.32, draws.between(0.9, 1.2), draws.between(0.7, 0.85)];
    let x = side * (HALF_WIDTH - deep - 0.02);
    let y = draws.between(0.6, 1.6);
    let wood = palette::wood(draws, Plane::Side, false, 0.34, 4.0);
    let body = of(wood, 0.1);
    let top = of(palette::same_wood(wood, Plane::Top, true), 0.12);
    build.block([x, y, FLOOR + high], [deep, long, high], 0.02, body);
    build.block([x - side * 0.02, y, FLOOR + 2.0 * high + 0.03], [deep + 0.05, long + 0.05, 0.035], 0.01, top);
    let front = shifted(palette::same_wood(wood, Plane::Side, false), 0.1, Vec3::new(0.0, 3.1, 7.7));
    let knob = of(palette::wood(draws, Plane::Side, false, 0.2, 1.0), 0.3);
    for drawer in 0..3_u8 {
        let z = FLOOR + (0.34 + 0.64 * f32::from(drawer)) * high;
        build.block([x - side * deep, y, z], [0.03, long - 0.06, 0.28 * high], 0.015, front);
        for end in [-0.5, 0.5] {
            let at = [x - side * (deep + 0.06), y + end * long, z];
            build.ellipsoid(at, [0.045; 3], knob);
        }
    }
}

/// A plant in a pot on the floor, in a corner.
fn plant(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let pot = of(super::vessels::glaze(draws, 0.14, 18), 0.15);
    let pot_shape = Shape::Cylinder { radius: 0.36, half_height: 0.38, rounding: 0.06 };
    build.add(pot_shape, place([x, y, FLOOR + 0.38]), pot);
    build.add(Shape::Torus { ring_radius: 0.34, tube_radius: 0.05 }, place([x, y, FLOOR + 0.75]), pot);
    let green = draws.one_of([rgb(86, 134, 66), rgb(62, 116, 84), rgb(124, 150, 70), rgb(108, 128, 92)]);
    let stems = 13 + draws.below(6);
    for stem in 0..stems {
        let turn = TAU * (stem as f32 * 0.381_966 + 0.05 * draws.unit());
        let lean = draws.between(0.1, 0.75);
        let length = draws.between(0.5, 0.85);
        let (sine, cosine) = sin_cos(turn);
        let middle = length * draws.between(0.8, 1.5);
        let at = Placement::at(x + 0.7 * lean * middle * cosine, y + 0.7 * lean * middle * sine, FLOOR + 0.75 + middle)
            .turned_about_z(turn)
            .turned_about_y(lean);
        let leaf = palette::stone(
            [green * draws.between(0.45, 0.65), green * draws.between(0.9, 1.2)],
            rgb(206, 216, 140),
            0.7,
            Vec3::new(0.1, 0.12, 0.4),
            draws,
        );
        let radii = Vec3::new(0.035, draws.between(0.1, 0.17), length);
        build.add(Shape::Ellipsoid { radii }, at, of(leaf, 0.06));
    }
}
