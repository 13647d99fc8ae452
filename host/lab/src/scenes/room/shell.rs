//! Floor, ceiling, walls, a window, and what is seen through it.

use super::{CEILING, FLOOR, HALF_LENGTH, HALF_WIDTH, of, palette, pattern_seed, shifted};
use crate::scenes::kinds::build::{Build, place};
use crate::scenes::kinds::draws::Draws;
use crate::scenes::material::{Cloth, Material, Painting, Plane, Rug};
use crate::scenes::shape::Shape;
use crate::scenes::texture::rgb;
use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;

/// Half of a wall's thickness.
const HALF_THICK: f32 = 0.15;

/// An opening in the back wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Left and right edge.
    x: [f32; 2],
    /// Lower and upper edge.
    z: [f32; 2],
}

/// Adds the room itself; tells where its window is.
pub(super) fn shell(draws: &mut Draws, build: &mut Build) -> Window {
    let (middle, half_high) = (0.5 * (FLOOR + CEILING), 0.5 * (CEILING - FLOOR));
    let floor = of(palette::floor(draws), 0.05);
    build.block([0.0, 0.0, FLOOR - 0.1], [HALF_WIDTH + 0.3, HALF_LENGTH + 0.3, 0.1], 0.0, floor);
    let plaster =
        palette::stone([rgb(236, 232, 222), rgb(206, 200, 190)], rgb(180, 172, 160), 0.2, Vec3::splat(0.8), draws);
    let ceiling = of(plaster, 0.0);
    build.block([0.0, 0.0, CEILING + 0.1], [HALF_WIDTH + 0.3, HALF_LENGTH + 0.3, 0.1], 0.0, ceiling);

    for side in [-1.0, 1.0] {
        let wall = of(palette::wall(draws, Plane::Side), 0.0);
        let centre = [side * (HALF_WIDTH + HALF_THICK), 0.0, middle];
        build.block(centre, [HALF_THICK, HALF_LENGTH + 0.3, half_high], 0.0, wall);
    }
    let front = of(palette::wall(draws, Plane::Front), 0.0);
    build.block([0.0, -HALF_LENGTH - HALF_THICK, middle], [HALF_WIDTH, HALF_THICK, half_high], 0.0, front);

    let left = draws.between(-3.7, -3.3);
    let low = draws.between(0.0, 0.3);
    let window = Window { x: [left, left + draws.between(1.5, 1.9)], z: [low, low + draws.between(2.1, 2.5)] };
    back_wall(draws, build, window);
    window_frame(draws, build, window);
    skirting(draws, build);
    rug(draws, build);
    window
}

/// Four pieces around the opening, with one pattern.
fn back_wall(draws: &mut Draws, build: &mut Build, Window { x, z }: Window) {
    let material = palette::wall(draws, Plane::Front);
    let y = HALF_LENGTH + HALF_THICK;
    let mut piece = |x: [f32; 2], z: [f32; 2]| {
        let centre = [0.5 * (x[0] + x[1]), y, 0.5 * (z[0] + z[1])];
        let half = [0.5 * (x[1] - x[0]), HALF_THICK, 0.5 * (z[1] - z[0])];
        build.block(centre, half, 0.0, shifted(material, 0.0, Vec3::from_array(centre)));
    };
    piece([-HALF_WIDTH, x[0]], [FLOOR, CEILING]);
    piece([x[1], HALF_WIDTH], [FLOOR, CEILING]);
    piece(x, [FLOOR, z[0]]);
    piece(x, [z[1], CEILING]);
}

/// Frame, bars and sill, and a curtain on either side.
fn window_frame(draws: &mut Draws, build: &mut Build, Window { x, z }: Window) {
    let painted = draws.chance(0.5);
    let material = if painted {
        let colours = [rgb(238, 236, 228), rgb(204, 202, 194)];
        let cell = Vec3::new(0.1, 0.1, 0.5);
        palette::stone(colours, colours[1] * 0.8, 0.3, cell, draws)
    } else {
        palette::wood(draws, Plane::Front, true, 0.3, 3.0)
    };
    let frame = of(material, 0.1);
    let (middle_x, middle_z) = (0.5 * (x[0] + x[1]), 0.5 * (z[0] + z[1]));
    let (half_x, half_z) = (0.5 * (x[1] - x[0]), 0.5 * (z[1] - z[0]));
    let y = HALF_LENGTH + 0.06;
    for edge in x {
        build.block([edge, y - 0.07, middle_z], [0.07, 0.08, half_z + 0.07], 0.01, frame);
    }
    build.block([middle_x, y - 0.07, z[1]], [half_x + 0.07, 0.08, 0.07], 0.01, frame);
    build.block([middle_x, y - 0.16, z[0] - 0.02], [half_x + 0.2, 0.2, 0.05], 0.02, frame);
    build.block([middle_x, y, middle_z], [0.035, 0.03, half_z], 0.005, frame);
    for part in [-0.33, 0.33] {
        build.block([middle_x, y, middle_z + part * 2.0 * half_z * 0.5], [half_x, 0.03, 0.03], 0.005, frame);
    }

    // Curtains: folds side by side, moved a little in and out.
    let [a, b, _, d] = palette::textile(draws);
    let colours = if draws.chance(0.5) { [a, d, b] } else { [d, b, a] };
    let seed = pattern_seed(draws);
    let repeat = draws.between(0.4, 0.7);
    for (edge, side) in [(x[0], -1.0), (x[1], 1.0)] {
        for fold in 0..5_i16 {
            let (wave, _) = sin_cos(2.4 * f32::from(fold) + side);
            let at = [edge + side * (0.1 * f32::from(fold) - 0.12), HALF_LENGTH - 0.2 + 0.035 * wave, middle_z - 0.35];
            let cloth = Cloth { colours, plane: Plane::Front, repeat, thread: 0.035, striped: false, seed };
            let shape = Shape::Cylinder { radius: 0.075, half_height: half_z + 0.6, rounding: 0.03 };
            build.add(shape, place(at), shifted(Material::Cloth(cloth), 0.0, Vec3::from_array(at)));
        }
    }
    let rail = of(palette::wood(draws, Plane::Front, false, 0.2, 4.0), 0.2);
    let [from, to] = [x[0] - 0.75, x[1] + 0.75].map(|x| Vec3::new(x, HALF_LENGTH - 0.2, middle_z + half_z + 0.28));
    build.rod(from, to, 0.04, rail);
}

/// Boards along the feet of the walls.
fn skirting(draws: &mut Draws, build: &mut Build) {
    let board = palette::wood(draws, Plane::Front, false, 0.5, 5.0);
    let side = palette::same_wood(board, Plane::Side, false);
    let z = FLOOR + 0.14;
    build.block([0.0, HALF_LENGTH - 0.03, z], [HALF_WIDTH, 0.03, 0.14], 0.01, of(board, 0.08));
    build.block([0.0, 0.03 - HALF_LENGTH, z], [HALF_WIDTH, 0.03, 0.14], 0.01, of(board, 0.08));
    for x in [HALF_WIDTH - 0.03, 0.03 - HALF_WIDTH] {
        build.block([x, 0.0, z], [0.03, HALF_LENGTH, 0.14], 0.01, of(side, 0.08));
    }
}

fn rug(draws: &mut Draws, build: &mut Build) {
    let half = [draws.between(2.5, 3.0), draws.between(2.0, 2.4)];
    let (colours, motif) = (palette::textile(draws), draws.between(0.32, 0.42));
    let rug = of(Material::Rug(Rug { colours, half, motif, seed: pattern_seed(draws) }), 0.0);
    build.block([0.0, 0.2, FLOOR + 0.02], [half[0], half[1], 0.02], 0.01, rug);
}

/// A garden behind the window, as a picture on a wall far behind it and bushes before that. These parts glow.
pub(super) fn outside(draws: &mut Draws, build: &mut Build, Window { x, .. }: Window) {
    let seed = pattern_seed(draws);
    let middle = 0.5 * (x[0] + x[1]);
    let view = Painting { half: [9.0, 3.2], plane: Plane::Front, seed: day_from(seed) };
    build.block([middle - 1.0, 13.0, 2.4], [9.0, 0.1, 5.0], 0.0, of(Material::Painting(view), 0.0));
    for _ in 0..6 {
        let size = draws.between(0.5, 1.1);
        let at = [middle + draws.between(-3.0, 2.5), draws.between(7.0, 10.0), FLOOR + draws.between(0.4, 1.9)];
        let green = draws.one_of([rgb(96, 140, 62), rgb(130, 160, 78), rgb(70, 120, 70), rgb(150, 150, 70)]);
        let leaves = palette::stone(
            [green * 0.5, green],
            draws.one_of([rgb(230, 226, 150), rgb(226, 120, 120), rgb(60, 90, 40)]),
            0.6,
            Vec3::splat(0.35),
            draws,
        );
        build.ellipsoid(at, [size, 0.8 * size, 0.9 * size], of(leaves, 0.0));
    }
}

/// The next seed from here on whose painting is a landscape by day.
fn day_from(seed: u32) -> u32 {
    (seed..seed.saturating_add(64)).find(|&seed| Painting::is_day(seed)).unwrap_or(seed)
}
