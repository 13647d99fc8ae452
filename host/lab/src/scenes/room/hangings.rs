//! What hangs on the walls: paintings in frames, posters, a clock.

use super::{HALF_LENGTH, HALF_WIDTH, of, palette, pattern_seed};
use crate::scenes::kinds::build::{Build, place};
use crate::scenes::kinds::draws::Draws;
use crate::scenes::kinds::paint::plain;
use crate::scenes::material::{Glaze, Letters, Material, Painting, Plane, Setting};
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, rgb};
use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;

/// Adds pictures on all four walls.
pub(super) fn hangings(draws: &mut Draws, build: &mut Build) {
    // Between the window and the shelf, one above the other.
    let back = |x: f32, z: f32| Placement::at(x, HALF_LENGTH, z);
    let middle = back(draws.between(-0.55, -0.3), draws.between(1.0, 1.2));
    let half = half_sizes(draws, [0.55, 0.48]);
    picture(draws, build, middle, half);
    let upper = draws.between(-0.5, -0.1);
    if draws.chance(0.5) {
        clock(draws, build, back(upper, 2.3));
    } else {
        picture(draws, build, back(upper, 2.45), [0.45, 0.4]);
    }
    let lower = draws.between(-0.6, -0.2);
    picture(draws, build, back(lower, -0.45), [0.42, 0.32]);
    // On the left and right wall; their pictures face the room.
    for side in [-1.0, 1.0] {
        let on_wall = |y: f32, z: f32| Placement::at(side * HALF_WIDTH, y, z).turned_about_z(-side * FRAC_PI_2);
        let mut y = draws.between(2.4, 2.9);
        while y > -3.2 {
            let half = half_sizes(draws, [0.62, 0.55]);
            let at = on_wall(y - half[0], draws.between(0.9, 1.4));
            picture(draws, build, at, half);
            y -= 2.0 * half[0] + draws.between(0.4, 0.8);
        }
    }
    let mut x = -3.4;
    while x < 3.0 {
        let half = half_sizes(draws, [0.6, 0.6]);
        let at = Placement::at(x + half[0], -HALF_LENGTH, draws.between(0.9, 1.4)).turned_about_z(2.0 * FRAC_PI_2);
        picture(draws, build, at, half);
        x += 2.0 * half[0] + draws.between(0.4, 0.9);
    }
}

/// Half sizes of a picture, each up to a quarter more or less than these.
fn half_sizes(draws: &mut Draws, around: [f32; 2]) -> [f32; 2] {
    around.map(|half| half * draws.between(0.75, 1.25))
}

/// A painting or a poster in a frame, its back at the local plane `y = 0`, seen from negative `y`.
fn picture(draws: &mut Draws, build: &mut Build, at: Placement, half: [f32; 2]) {
    let material = if draws.chance(0.3) {
        let (paper, first) = (rgb(238, 228, 202), palette::paint(draws));
        let inks = [first, palette::other_paint(draws, first), rgb(48, 44, 50)];
        let setting = Setting::Poster;
        Material::Letters(Letters {
            paper,
            inks,
            setting,
            plane: Plane::Front,
            half,
            line: 0.1,
            seed: pattern_seed(draws),
        })
    } else {
        Material::Painting(Painting { half, plane: Plane::Front, seed: pattern_seed(draws) })
    };
    let mut board = |x: f32, y: f32, z: f32, half: [f32; 3], finish: Finish| {
        let shape = Shape::Block { half_size: Vec3::from_array(half), rounding: 0.008 };
        build.add(shape, Placement::at(x, y, z).within(&at), finish);
    };
    board(0.0, -0.02, 0.0, [half[0], 0.02, half[1]], of(material, 0.04));
    let width = draws.between(0.035, 0.075);
    let wood = palette::wood(draws, Plane::Front, false, 0.3, 3.0);
    let (lying, standing) = (of(wood, 0.2), of(palette::same_wood(wood, Plane::Front, true), 0.2));
    for side in [-1.0, 1.0] {
        board(side * half[0], -0.04, 0.0, [width, 0.04, half[1] + width], standing);
        board(0.0, -0.04, side * half[1], [half[0] + width, 0.04, width], lying);
    }
}

/// A round clock with painted rings; its hands say ten past ten, as in every catalogue.
fn clock(draws: &mut Draws, build: &mut Build, at: Placement) {
    let colours = [rgb(240, 234, 216), palette::paint(draws), palette::paint(draws), rgb(52, 46, 44)];
    let face = Material::Glaze(Glaze { colours, band: 0.5, count: 12, seed: pattern_seed(draws) });
    let lying = |y: f32| Placement::at(0.0, y, 0.0).within(&at).turned_about_x(FRAC_PI_2);
    build.add(Shape::Cylinder { radius: 0.36, half_height: 0.03, rounding: 0.01 }, lying(-0.03), of(face, 0.1));
    let rim = of(palette::wood(draws, Plane::Top, false, 0.3, 3.0), 0.2);
    build.add(Shape::Torus { ring_radius: 0.37, tube_radius: 0.05 }, lying(-0.05), rim);
    let dark = plain(rgb(40, 36, 36), 0.1);
    for (turn, half_length) in [(-1.05, 0.1), (1.05, 0.14)] {
        let shape = Shape::Block { half_size: Vec3::new(0.016, 0.01, half_length), rounding: 0.004 };
        let hand = place([0.0, -0.07, 0.0]).turned_about_y(turn);
        let out = hand.rotate_to_world(Vec3::new(0.0, 0.0, half_length));
        let moved = Placement::at(out.x, -0.07, out.z).turned_about_y(turn);
        build.add(shape, moved.within(&at), dark);
    }
}
