//! Vases, mugs and bowls.

use super::{of, palette, pattern_seed};
use crate::scenes::kinds::build::{Build, place};
use crate::scenes::kinds::draws::Draws;
use crate::scenes::material::{Glaze, Material};
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, rgb};
use core::f32::consts::{FRAC_PI_2, TAU};
use viewfuse_core::Vec3;
use viewfuse_core::math::{sin_cos, sqrt};

/// Painted pottery with rings of this height and so many motifs around.
pub(super) fn glaze(draws: &mut Draws, band: f32, count: u32) -> Material {
    let ground = if draws.chance(0.6) { rgb(236, 228, 206) } else { palette::paint(draws) };
    let first = palette::other_paint(draws, ground);
    let second = palette::other_paint(draws, ground);
    let dark = draws.one_of([rgb(44, 48, 74), rgb(66, 38, 30), rgb(34, 58, 52)]);
    Material::Glaze(Glaze { colours: [ground, first, second, dark], band, count, seed: pattern_seed(draws) })
}

/// A vase with flowers that stands at a point of the table.
pub(super) fn vase(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let (wide, high) = (draws.between(0.2, 0.26), draws.between(0.24, 0.32));
    let band = draws.between(0.085, 0.12);
    let finish = of(glaze(draws, band, 12), 0.22);
    let foot = Shape::Cylinder { radius: 0.55 * wide, half_height: 0.04, rounding: 0.02 };
    build.add(foot, place([x, y, 0.04]), finish);
    build.ellipsoid([x, y, high + 0.03], [wide, wide, high], finish);
    let neck = Shape::Cylinder { radius: 0.42 * wide, half_height: 0.12, rounding: 0.02 };
    build.add(neck, place([x, y, 2.0 * high + 0.06]), finish);
    let top = 2.0 * high + 0.18;
    build.add(Shape::Torus { ring_radius: 0.44 * wide, tube_radius: 0.03 }, place([x, y, top]), finish);
    let green = of(leaves(draws, rgb(92, 138, 70)), 0.02);
    let count = 5 + draws.below(4);
    for stem in 0..count {
        let (sine, cosine) = sin_cos(TAU * (stem as f32 / count as f32 + 0.08 * draws.unit()));
        let (out, up) = (draws.between(0.1, 0.3), draws.between(0.22, 0.48));
        let head = Vec3::new(x + out * cosine, y + out * sine, top + up);
        build.rod(Vec3::new(x + 0.04 * cosine, y + 0.04 * sine, top - 0.02), head, 0.014, green);
        blossom(draws, build, head);
    }
    for leaf in 0..5_u8 {
        let turn = TAU * (f32::from(leaf) / 5.0 + 0.1 * draws.unit());
        let (sine, cosine) = sin_cos(turn);
        let at = Placement::at(x + 0.16 * cosine, y + 0.16 * sine, top + 0.1).turned_about_z(turn).turned_about_y(0.9);
        build.add(Shape::Ellipsoid { radii: Vec3::new(0.016, 0.06, 0.16) }, at, green);
    }
}

fn leaves(draws: &mut Draws, green: Vec3) -> Material {
    palette::stone([green * 0.55, green], rgb(214, 222, 150), 0.5, Vec3::splat(0.08), draws)
}

/// A heart and petals around it, facing up and out a little.
fn blossom(draws: &mut Draws, build: &mut Build, head: Vec3) {
    let colour = draws.one_of([
        rgb(226, 84, 92),
        rgb(240, 190, 70),
        rgb(236, 232, 220),
        rgb(166, 98, 186),
        rgb(238, 138, 80),
        rgb(108, 130, 206),
    ]);
    let petal = palette::stone([colour * 0.68, colour], colour * 0.45, 0.6, Vec3::new(0.04, 0.05, 0.08), draws);
    let petal = of(petal, 0.0);
    let heart = palette::stone([rgb(120, 70, 30), rgb(236, 184, 60)], rgb(90, 50, 24), 0.5, Vec3::splat(0.02), draws);
    build.ellipsoid(head.to_array(), [0.045; 3], of(heart, 0.0));
    let (count, reach) = (6_u8, draws.between(0.07, 0.1));
    for index in 0..count {
        let turn = TAU * f32::from(index) / f32::from(count);
        let (sine, cosine) = sin_cos(turn);
        let at = Placement::at(head.x + reach * cosine, head.y + reach * sine, head.z + 0.01)
            .turned_about_z(turn)
            .turned_about_y(1.25);
        build.add(Shape::Ellipsoid { radii: Vec3::new(0.014, 0.045, 0.06) }, at, petal);
    }
}

/// A mug with a handle.
pub(super) fn mug(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let (radius, half_height) = (draws.between(0.12, 0.15), draws.between(0.14, 0.18));
    let finish = of(glaze(draws, 0.08, 10), 0.25);
    build.add(Shape::Cylinder { radius, half_height, rounding: 0.02 }, place([x, y, half_height]), finish);
    let coffee = Finish { gloss: 0.3, ..of(leaves(draws, rgb(104, 66, 40)), 0.0) };
    let inner = Shape::Cylinder { radius: radius - 0.02, half_height: 0.004, rounding: 0.001 };
    build.add(inner, place([x, y, 2.0 * half_height]), coffee);
    build.add(
        Shape::Torus { ring_radius: radius - 0.012, tube_radius: 0.016 },
        place([x, y, 2.0 * half_height]),
        finish,
    );
    let turn = draws.between(-2.6, -0.6);
    let (sine, cosine) = sin_cos(turn);
    let handle = Placement::at(x + radius * cosine, y + radius * sine, half_height)
        .turned_about_z(turn)
        .turned_about_x(FRAC_PI_2);
    build.add(Shape::Torus { ring_radius: 0.09, tube_radius: 0.022 }, handle, finish);
}

/// Fruit in a woven basket: rings on top of each other.
pub(super) fn fruit(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let straw = palette::stone(
        [rgb(150, 104, 54), rgb(216, 176, 112)],
        rgb(90, 60, 30),
        0.6,
        Vec3::new(0.05, 0.05, 0.03),
        draws,
    );
    let straw = of(straw, 0.03);
    for ring in 0..4_u8 {
        let up = f32::from(ring);
        let shape = Shape::Torus { ring_radius: 0.2 + 0.026 * up, tube_radius: 0.028 };
        build.add(shape, place([x, y, 0.026 + 0.045 * up]), straw);
    }
    build.add(Shape::Cylinder { radius: 0.2, half_height: 0.03, rounding: 0.01 }, place([x, y, 0.03]), straw);
    for index in 0..7_u8 {
        let colour =
            draws.one_of([rgb(214, 66, 48), rgb(232, 146, 46), rgb(176, 196, 74), rgb(236, 206, 84), rgb(150, 40, 58)]);
        let skin = palette::stone(
            [colour, colour * 0.7 + rgb(210, 150, 60) * 0.3],
            rgb(248, 224, 150),
            0.35,
            Vec3::new(0.06, 0.06, 0.2),
            draws,
        );
        let radius = draws.between(0.085, 0.105);
        let (out, up) = if index < 5 { (0.13, 0.13) } else { (0.05, 0.25) };
        let (sine, cosine) = sin_cos(TAU * (f32::from(index) / if index < 5 { 5.0 } else { 2.0 }) + 0.4);
        let at = Placement::at(x + out * cosine, y + out * sine, up)
            .turned_about_x(sqrt(draws.unit()))
            .turned_about_y(draws.unit());
        build.add(Shape::Ellipsoid { radii: Vec3::new(radius, radius, 0.93 * radius) }, at, of(skin, 0.18));
    }
}
