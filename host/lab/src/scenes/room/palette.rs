//! Colours that go together, and materials made of them.

use super::pattern_seed;
use crate::scenes::kinds::draws::Draws;
use crate::scenes::material::{Cloth, Masonry, Material, Motif, Plane, Stone, Wallpaper, Wood};
use crate::scenes::texture::rgb;
use viewfuse_core::Vec3;

/// Light and dark wood: oak, pine, walnut, cherry, ash, mahogany.
const WOODS: [[Vec3; 2]; 6] = [
    [rgb(212, 168, 112), rgb(136, 88, 46)],
    [rgb(230, 190, 130), rgb(170, 112, 58)],
    [rgb(156, 108, 72), rgb(78, 46, 28)],
    [rgb(196, 122, 78), rgb(122, 58, 34)],
    [rgb(222, 200, 164), rgb(150, 122, 86)],
    [rgb(164, 84, 56), rgb(86, 34, 24)],
];

/// A ground and three inks of wallpaper.
const PAPERS: [[Vec3; 4]; 6] = [
    [rgb(226, 214, 184), rgb(186, 74, 62), rgb(222, 160, 74), rgb(92, 124, 88)],
    [rgb(126, 162, 160), rgb(240, 226, 196), rgb(214, 130, 92), rgb(58, 92, 96)],
    [rgb(52, 74, 104), rgb(222, 190, 132), rgb(196, 108, 84), rgb(104, 138, 150)],
    [rgb(206, 190, 196), rgb(142, 74, 102), rgb(232, 210, 140), rgb(104, 122, 110)],
    [rgb(196, 206, 170), rgb(240, 234, 214), rgb(196, 92, 60), rgb(92, 126, 70)],
    [rgb(214, 176, 116), rgb(140, 52, 44), rgb(244, 228, 190), rgb(112, 94, 56)],
];

/// Two kinds of brick and their mortar.
const BRICKS: [[Vec3; 3]; 4] = [
    [rgb(188, 96, 72), rgb(126, 58, 48), rgb(196, 188, 174)],
    [rgb(206, 150, 104), rgb(150, 94, 66), rgb(214, 206, 190)],
    [rgb(172, 166, 156), rgb(112, 104, 100), rgb(206, 202, 194)],
    [rgb(214, 206, 194), rgb(164, 150, 136), rgb(140, 132, 124)],
];

/// Field, border and two motifs of rugs; also ground, checks and lines of cloths.
const TEXTILES: [[Vec3; 4]; 6] = [
    [rgb(150, 44, 42), rgb(38, 48, 84), rgb(222, 188, 124), rgb(236, 226, 202)],
    [rgb(46, 86, 112), rgb(170, 70, 52), rgb(228, 196, 128), rgb(232, 228, 210)],
    [rgb(206, 170, 110), rgb(110, 48, 40), rgb(54, 92, 86), rgb(240, 230, 206)],
    [rgb(74, 104, 76), rgb(198, 148, 70), rgb(150, 58, 48), rgb(236, 224, 196)],
    [rgb(120, 62, 88), rgb(66, 80, 100), rgb(226, 164, 104), rgb(236, 222, 212)],
    [rgb(60, 66, 78), rgb(188, 80, 56), rgb(210, 178, 120), rgb(220, 216, 206)],
];

/// Paints for small things: covers, balls, letters, pottery.
const PAINTS: [Vec3; 14] = [
    rgb(196, 52, 44),
    rgb(226, 120, 42),
    rgb(238, 186, 58),
    rgb(98, 150, 70),
    rgb(38, 104, 86),
    rgb(48, 122, 164),
    rgb(42, 62, 122),
    rgb(116, 66, 132),
    rgb(206, 116, 140),
    rgb(128, 80, 52),
    rgb(228, 214, 182),
    rgb(54, 52, 58),
    rgb(150, 40, 60),
    rgb(112, 158, 170),
];

/// Any paint for small things.
pub(crate) fn paint(draws: &mut Draws) -> Vec3 {
    draws.one_of(PAINTS)
}

/// A paint that stands out from another one.
pub(crate) fn other_paint(draws: &mut Draws, than: Vec3) -> Vec3 {
    let mut colour = paint(draws);
    for _ in 0..6 {
        if (colour - than).length() > 0.5 {
            break;
        }
        colour = paint(draws);
    }
    colour
}

/// Four colours of a textile.
pub(crate) fn textile(draws: &mut Draws) -> [Vec3; 4] {
    draws.one_of(TEXTILES)
}

/// Wood in planks of this width and length.
pub(crate) fn wood(draws: &mut Draws, plane: Plane, turned: bool, plank: f32, length: f32) -> Material {
    Material::Wood(Wood { colours: draws.one_of(WOODS), plane, turned, plank, length, seed: pattern_seed(draws) })
}

/// The same wood in another plane, for furniture of one wood; other materials stay.
pub(crate) fn same_wood(material: Material, plane: Plane, turned: bool) -> Material {
    match material {
        Material::Wood(wood) => Material::Wood(Wood { plane, turned, seed: wood.seed.wrapping_add(1), ..wood }),
        other => other,
    }
}

/// Blotches of these two colours and of this size, with veins.
pub(crate) fn stone(colours: [Vec3; 2], vein: Vec3, veined: f32, cell: Vec3, draws: &mut Draws) -> Material {
    Material::Stone(Stone { colours, vein, veined, cell, seed: pattern_seed(draws) })
}

/// What walls are covered with: mostly wallpaper, also bricks, boards and plaster.
pub(crate) fn wall(draws: &mut Draws, plane: Plane) -> Material {
    match draws.below(8) {
        0..4 => {
            let [ground, first, second, third] = draws.one_of(PAPERS);
            let motif = draws.one_of([Motif::Flowers, Motif::Stripes, Motif::Trellis, Motif::Flowers]);
            let repeat = draws.between(0.5, 0.8);
            let inks = [first, second, third];
            Material::Wallpaper(Wallpaper { ground, inks, motif, plane, repeat, seed: pattern_seed(draws) })
        }
        4 | 5 => brick(draws, plane),
        6 => {
            let plank = draws.between(0.3, 0.5);
            wood(draws, plane, true, plank, 4.0)
        }
        _ => {
            let [light, _, dark, _] = draws.one_of(PAPERS);
            let cell = Vec3::splat(draws.between(0.5, 1.1));
            stone([light, light * 0.62 + dark * 0.2], dark * 0.7, 0.35, cell, draws)
        }
    }
}

pub(crate) fn brick(draws: &mut Draws, plane: Plane) -> Material {
    let [light, dark, mortar] = draws.one_of(BRICKS);
    let size = [draws.between(0.56, 0.72), draws.between(0.2, 0.26)];
    let seed = pattern_seed(draws);
    Material::Masonry(Masonry { bricks: [light, dark], mortar, plane, size, joint: 0.035, bond: 0.5, seed })
}

/// What floors are made of: planks, tiles or flags.
pub(crate) fn floor(draws: &mut Draws) -> Material {
    if draws.chance(0.65) {
        let turned = draws.chance(0.5);
        let plank = draws.between(0.32, 0.5);
        return wood(draws, Plane::Top, turned, plank, 3.2);
    }
    let [light, dark, mortar] = draws.one_of(BRICKS);
    let edge = draws.between(0.6, 0.9);
    let (bond, seed) = (draws.one_of([0.0, 0.5]), pattern_seed(draws));
    let size = [edge, edge];
    Material::Masonry(Masonry {
        bricks: [light, dark],
        mortar: mortar * 0.7,
        plane: Plane::Top,
        size,
        joint: 0.04,
        bond,
        seed,
    })
}

/// Checked or striped cloth.
pub(crate) fn cloth(draws: &mut Draws, plane: Plane, repeat: f32, thread: f32) -> Material {
    let [a, b, c, d] = textile(draws);
    let colours = if draws.chance(0.5) { [d, a, b] } else { [a, c, d] };
    let striped = draws.chance(0.4);
    Material::Cloth(Cloth { colours, plane, repeat, thread, striped, seed: pattern_seed(draws) })
}
