//! Colours, finishes and lamps, as they are found.

use super::draws::Draws;
use super::mix;
use crate::scenes::light::Light;
use crate::scenes::texture::{Finish, Texture};
use core::f32::consts::TAU;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, clamp, sin_cos};

/// One colour with this gloss.
pub(crate) fn plain(colour: Vec3, gloss: f32) -> Finish {
    Finish { texture: Texture::Plain { colour }, gloss }
}

/// Grey of this brightness.
pub(crate) fn grey(brightness: f32) -> Vec3 {
    Vec3::splat(brightness)
}

/// A display colour from a hue in turns, a saturation and the largest channel.
pub(crate) fn hue(turns: f32, saturation: f32, value: f32) -> Vec3 {
    // Each channel is a trapezium over the circle of hues, its middle at 0, 1/3 and 2/3.
    let channel = |shift: f32| {
        let place = 6.0 * (turns + shift);
        let wrapped = place - 6.0 * if place >= 6.0 { 1.0 } else { 0.0 };
        let pure = clamp(abs(wrapped - 3.0) - 1.0, 0.0, 1.0);
        value * mix(1.0, pure, saturation)
    };
    Vec3::new(channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0))
}

/// Any paint: white and silver, black, vivid, dull. Vivid ones are red, blue and yellow more often than others, as
/// paints are.
pub(crate) fn paint(draws: &mut Draws) -> Vec3 {
    let turns = match draws.below(8) {
        0 | 1 => draws.between(0.96, 1.05),
        2 | 3 => draws.between(0.53, 0.68),
        4 => draws.between(0.05, 0.17),
        _ => draws.unit(),
    };
    let turns = if turns < 1.0 { turns } else { turns - 1.0 };
    let tint = draws.between(0.0, 0.12);
    match draws.below(20) {
        0..4 => hue(turns, tint, draws.between(0.85, 1.0)),
        4..6 => hue(turns, tint, draws.between(0.45, 0.8)),
        6..8 => hue(turns, tint, draws.between(0.03, 0.22)),
        8..15 => hue(turns, draws.between(0.7, 1.0), draws.between(0.6, 1.0)),
        15..17 => hue(turns, draws.between(0.5, 0.95), draws.between(0.2, 0.5)),
        _ => hue(turns, draws.between(0.2, 0.6), draws.between(0.5, 1.0)),
    }
}

/// A paint that stands out from another: drawn again a few times while it is near.
pub(crate) fn contrast(draws: &mut Draws, to: Vec3) -> Vec3 {
    let mut colour = paint(draws);
    for _ in 0..4 {
        if (colour - to).length() > 0.45 {
            break;
        }
        colour = paint(draws);
    }
    colour
}

/// From matt to varnish.
pub(crate) fn gloss(draws: &mut Draws) -> f32 {
    let shine = draws.unit();
    0.3 * shine * shine
}

/// A pattern over a whole part: mostly one colour. `size` is the size of what repeats, in world units.
pub(crate) fn pattern(draws: &mut Draws, colour: Vec3, size: f32) -> Texture {
    let colours = [colour, contrast(draws, colour)];
    let seed = draws.below(1 << 20);
    match draws.below(12) {
        0 => Texture::Checker { colours, size },
        1 | 2 => {
            let (sine, cosine) = sin_cos(TAU * draws.unit());
            let across = draws.one_of([
                Vec3::new(cosine, sine, 0.0),
                Vec3::new(cosine, 0.0, sine),
                Vec3::new(0.0, cosine, sine),
            ]);
            Texture::Stripes { colours, across, width: size }
        }
        3 => Texture::Spots { colours, cell: 1.6 * size, radius: draws.between(0.25, 0.48), seed },
        4 => Texture::Mottle { colours, cell: Vec3::new(2.0, 0.6, 0.8) * size, seed },
        5 => Texture::Mottle { colours: [colour, colour * 0.6], cell: Vec3::splat(0.4 * size), seed },
        _ => Texture::Plain { colour },
    }
}

/// A bright or a dull day, with the key lamp on any side and high.
pub(crate) fn light(draws: &mut Draws) -> Light {
    let (sine, cosine) = sin_cos(TAU * draws.unit());
    let spread = draws.between(0.2, 1.1);
    let soft = draws.unit();
    let below = draws.between(0.45, 0.85);
    let above = mix(0.45, 0.95, soft);
    Light {
        key: Vec3::new(spread * cosine, spread * sine, 1.0),
        key_light: mix(0.8, 0.15, soft) * draws.between(0.85, 1.15),
        fill: Vec3::new(-cosine, -sine, draws.between(0.2, 0.6)),
        fill_light: draws.between(0.0, 0.25),
        around: [above * below, above],
    }
}
