//! What stands on the table.

use super::furniture::spine;
use super::vessels::{fruit, mug, vase};
use super::{of, palette, pattern_seed};
use crate::scenes::kinds::build::Build;
use crate::scenes::kinds::draws::Draws;
use crate::scenes::kinds::{car, chair};
use crate::scenes::material::{Letters, Material, Plane, Setting, Stone};
use crate::scenes::object::Object;
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, Texture, rgb};
use crate::scenes::trace::first;
use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Ray;
use viewfuse_core::math::{max, min};

/// Where tall things may stand: the back of the table.
const BACK: [[f32; 2]; 3] = [[-0.95, 0.5], [0.1, 0.6], [1.0, 0.45]];

/// Where low things may stand: the front and the middle.
const FRONT: [[f32; 2]; 3] = [[-0.95, -0.5], [0.0, -0.3], [0.95, -0.5]];

/// Half edge of a toy block.
const BLOCK: f32 = 0.15;

/// Kinds of things.
#[derive(Clone, Copy, PartialEq)]
enum Thing {
    Vase,
    Blocks,
    Books,
    Chair,
    Car,
    Ball,
    Mug,
    Fruit,
}

/// Adds three tall and three low things, no two of a kind.
pub(crate) fn things(draws: &mut Draws, build: &mut Build) {
    let mut tall = [Thing::Vase, Thing::Blocks, Thing::Books, Thing::Chair];
    let mut low = [Thing::Car, Thing::Ball, Thing::Mug, Thing::Fruit];
    shuffle(draws, &mut tall);
    shuffle(draws, &mut low);
    // A car needs the most room and is the best known: it always comes, in front.
    if let Some(at) = low.iter().position(|thing| *thing == Thing::Car)
        && at > 2
    {
        low.swap(1, at);
    }
    for (thing, place) in tall.into_iter().zip(BACK).chain(low.into_iter().zip(FRONT)) {
        let at = [place[0] + draws.between(-0.08, 0.08), place[1] + draws.between(-0.06, 0.06)];
        match thing {
            Thing::Vase => vase(draws, build, at),
            Thing::Blocks => blocks(draws, build, at),
            Thing::Books => books(draws, build, at),
            Thing::Chair => {
                let chair = chair(u64::from(draws.below(1 << 22)), 0);
                let turn = -FRAC_PI_2 + draws.between(-0.7, 0.7);
                object(draws, build, at, &chair, turn);
            }
            Thing::Car => {
                let car = car(u64::from(draws.below(1 << 22)), 0);
                let turn = draws.one_of([-0.5, 0.45, 2.6, -2.7]) + draws.between(-0.25, 0.25);
                object(draws, build, at, &car, turn);
            }
            Thing::Ball => ball(draws, build, at),
            Thing::Mug => mug(draws, build, at),
            Thing::Fruit => fruit(draws, build, at),
        }
    }
}

fn shuffle<T>(draws: &mut Draws, things: &mut [T]) {
    for last in (1..things.len()).rev() {
        things.swap(last, draws.below(last as u32 + 1) as usize);
    }
}

/// Toy blocks with letters: three in a row, two on them, one on top.
fn blocks(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let along = draws.between(-0.5, 0.5);
    let group = Placement::at(x, y, 0.0).turned_about_z(along);
    let rows: [&[f32]; 3] = [&[-0.34, 0.0, 0.34], &[-0.18, 0.17], &[0.02]];
    for (level, row) in rows.into_iter().enumerate() {
        for &place in row {
            let wood = draws.one_of([rgb(236, 206, 156), rgb(240, 228, 200), rgb(222, 184, 130)]);
            let first = palette::other_paint(draws, wood);
            let inks = [first, palette::other_paint(draws, wood), palette::other_paint(draws, wood)];
            let letters = Letters {
                paper: wood,
                inks,
                setting: Setting::Cube,
                plane: Plane::Front,
                half: [BLOCK; 2],
                line: BLOCK,
                seed: pattern_seed(draws),
            };
            let shape = Shape::Block { half_size: Vec3::splat(BLOCK), rounding: 0.018 };
            let at = Placement::at(place, draws.between(-0.03, 0.03), BLOCK * (2 * level + 1) as f32)
                .turned_about_z(draws.between(-0.25, 0.25));
            build.add(shape, at.within(&group), of(Material::Letters(letters), 0.08));
        }
    }
}

/// Three books on top of each other, the uppermost open.
fn books(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let mut z = 0.0;
    let mut long = draws.between(0.36, 0.42);
    for _ in 0..3 + draws.below(2) {
        let half = [draws.between(0.045, 0.075), 0.72 * long, long];
        let turn = draws.between(-0.35, 0.35);
        let at = Placement::at(x, y, z + half[0]).turned_about_z(turn).turned_about_y(FRAC_PI_2);
        build.add(Shape::Block { half_size: Vec3::from_array(half), rounding: 0.01 }, at, spine(draws, half));
        z += 2.0 * half[0] + 0.001;
        long *= 0.94;
    }
    let turn = draws.between(-0.4, 0.4);
    let half = [0.19, 0.25];
    for side in [-1.0, 1.0] {
        let letters = Letters {
            paper: rgb(240, 234, 214),
            inks: [rgb(50, 46, 50), rgb(160, 50, 40), rgb(60, 80, 130)],
            setting: Setting::Page,
            plane: Plane::Top,
            half,
            line: 0.045,
            seed: pattern_seed(draws),
        };
        let group = Placement::at(x, y, z + 0.03).turned_about_z(turn);
        let page = Placement::at(side * 0.19, 0.0, 0.0).turned_about_y(-side * 0.1).within(&group);
        let shape = Shape::Block { half_size: Vec3::new(half[0], half[1], 0.02), rounding: 0.008 };
        build.add(shape, page, of(Material::Letters(letters), 0.02));
    }
}

/// A ball of glazed rings or of marble.
fn ball(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2]) {
    let radius = draws.between(0.2, 0.26);
    let material = if draws.chance(0.6) {
        super::vessels::glaze(draws, 0.1, 14)
    } else {
        let colour = palette::paint(draws);
        let colours = [colour, palette::other_paint(draws, colour)];
        palette::stone(colours, rgb(244, 236, 214), 0.8, Vec3::splat(0.2), draws)
    };
    let at =
        Placement::at(x, y, radius).turned_about_x(draws.between(-1.0, 1.0)).turned_about_y(draws.between(-0.8, 0.8));
    build.add(Shape::Sphere { radius }, at, of(material, 0.3));
}

/// A toy, turned about its axis, with its lowest point on the table.
fn object(draws: &mut Draws, build: &mut Build, [x, y]: [f32; 2], object: &Object, turn: f32) {
    let lowest = lowest_point(object);
    let group = Placement::at(x, y, -lowest).turned_about_z(turn);
    for part in object.parts() {
        build.add(part.shape, part.placement.within(&group), hand_painted(draws, part.finish));
    }
}

/// A finish of one colour as painted by hand, with patches of thicker and thinner paint; others as they are.
fn hand_painted(draws: &mut Draws, finish: Finish) -> Finish {
    let seed = pattern_seed(draws);
    let Texture::Plain { colour } = finish.texture else {
        return finish;
    };
    let colours = [colour * 0.7 + Vec3::splat(0.02), colour * 0.92 + Vec3::splat(0.07)];
    let paint = Stone { colours, vein: colour * 0.5, veined: 0.35, cell: Vec3::splat(0.11), seed };
    of(Material::Stone(paint), finish.gloss)
}

/// Height of the lowest point of an object, by rays from below on a grid.
fn lowest_point(object: &Object) -> f32 {
    const SIDE: i16 = 48;
    let reach = object.bounding_radius();
    let mut lowest = f32::MAX;
    for row in -SIDE..=SIDE {
        for column in -SIDE..=SIDE {
            let at = |index: i16| reach * f32::from(index) / f32::from(SIDE);
            let origin_world = Vec3::new(at(column), at(row), -2.0 * max(reach, 0.1));
            let ray = Ray { origin_world, direction_world: Vec3::Z };
            if let Some((distance, _)) = first(object, &ray, f32::MAX) {
                lowest = min(lowest, origin_world.z + distance);
            }
        }
    }
    if lowest < f32::MAX { lowest } else { -reach }
}
