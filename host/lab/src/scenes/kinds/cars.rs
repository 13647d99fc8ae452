//! Cars: a body and a cabin with real side views, and what is fixed to them.
//!
//! A car faces along world x. Fractions in this file run from the rear (0) to the front (1) and from the lowest edge of
//! the body (0) to the roof (1).

mod details;
mod style;

use super::build::Build;
use super::draws::Draws;
use super::livery::{Places, livery};
use super::paint::{gloss, grey, hue, paint, plain};
use super::{half_sizes, mix};
use crate::scenes::prism::Width;
use crate::scenes::texture::Finish;
use core::f32::consts::PI;
use style::{Style, Top};
use viewfuse_core::math::{sin_cos, sqrt};

/// Corners of a wheel arch.
const ARCH_CORNER_COUNT: usize = 6;

/// A car under construction: its measures, in world units.
pub(super) struct Car {
    style: Style,
    /// Half of length, width and height, of the body without wheels.
    half: [f32; 3],
    /// Radius of the wheel arches.
    arch: f32,
    /// Of all of the body's edges.
    rounding: f32,
    /// How much the sides of the body come in at the ends.
    nose: f32,
    /// How much the sides of the cabin come in per unit of height.
    lean: f32,
    body: Finish,
    glass: Finish,
    trim: Finish,
}

impl Car {
    /// World x at a fraction of the length.
    fn x(&self, along: f32) -> f32 {
        self.half[0] * (2.0 * along - 1.0)
    }

    /// World z at a fraction of the height.
    fn z(&self, up: f32) -> f32 {
        self.half[2] * (2.0 * up - 1.0)
    }

    /// The side of the body at a height, away from the ends.
    fn side(&self) -> f32 {
        self.half[1]
    }
}

/// Adds a car.
pub(super) fn car(draws: &mut Draws, build: &mut Build) {
    let style = Style::draw(draws);
    let [length, width, height] = half_sizes([1.0, style.width, style.height], draws.between(0.8, 0.98));
    let half = [length, width, height];
    let colour = paint(draws);
    let places = Places {
        half,
        belt: height * (2.0 * style.belt - 1.0),
        doors: [length * (2.0 * style.cowl - 1.0) - 0.02, length * (2.0 * mix(style.deck, style.cowl, 0.3) - 1.0)],
    };
    let body = livery(draws, colour, &places);
    let glass = glass(draws);
    let trim = plain(grey(draws.between(0.02, 0.25)), gloss(draws));
    let car = Car {
        half,
        arch: length * draws.between(0.145, 0.175) * style.wheels,
        rounding: height * draws.between(0.04, 0.16),
        nose: width * draws.between(0.05, 0.3) * style.pointed,
        // The roof keeps a good part of the width, however high it is.
        lean: draws.between(0.15, 0.5).min(0.55 * width / (2.0 * height * (1.15 - style.belt))),
        body,
        glass,
        trim,
        style,
    };
    body_shell(&car, build, draws);
    cabin(&car, build, draws);
    details::details(&car, build, draws);
}

/// Mostly dark, sometimes bright or tinted.
fn glass(draws: &mut Draws) -> Finish {
    let brightness = match draws.below(6) {
        0 => draws.between(0.4, 0.8),
        1 | 2 => draws.between(0.2, 0.45),
        _ => draws.between(0.02, 0.2),
    };
    let tint = hue(draws.between(0.45, 0.65), draws.between(0.0, 0.35), brightness);
    plain(tint, draws.between(0.05, 0.3))
}

/// The body up to the windows, with notches for the wheels that a darker block fills.
fn body_shell(car: &Car, build: &mut Build, draws: &mut Draws) {
    let (style, r) = (&car.style, car.rounding);
    // Rounding widens the outline: corners stand that much inside of what they are to become.
    let x = |along: f32| car.x(along) * (1.0 - r / car.half[0]);
    let z = |up: f32| car.z(up) + r * (1.0 - 2.0 * up).max(-1.0);
    let sill = draws.between(0.0, 0.06);
    let ends = [draws.between(0.04, 0.2), draws.between(0.02, 0.2)];
    let reach = car.arch + r + 0.01;
    let low_rear = (car.x(style.rear_axle) - reach).min(x(0.08));
    let low_front = (car.x(style.front_axle) + reach).max(x(0.93));
    let mut corners = vec![[x(0.0), z(ends[0])], [low_rear, z(sill)]];
    arch(car, style.rear_axle, z(sill), &mut corners);
    arch(car, style.front_axle, z(sill), &mut corners);
    corners.extend([[low_front, z(sill)], [x(0.995), z(ends[1])]]);
    let bonnet = mix(style.nose_top, style.cowl_top, draws.between(0.45, 0.85));
    corners.extend([
        [x(1.0), z(mix(ends[1], style.nose_top, 0.6))],
        [x(mix(0.94, 0.985, draws.unit())), z(style.nose_top)],
        [x(mix(style.cowl, 1.0, 0.6)), z(bonnet)],
        [x(style.cowl), z(style.cowl_top)],
        [x(style.deck), z(style.deck_top)],
        [x((style.deck - 0.01).min(mix(0.01, 0.06, draws.unit()))), z(style.tail_top)],
        [x(0.0), z(mix(ends[0], style.tail_top, draws.between(0.4, 0.8)))],
    ]);
    let width = Width {
        half_width: car.half[1],
        waist: car.z(draws.between(0.25, 0.5)),
        lean: draws.between(0.0, 0.25),
        shoulder: car.half[0] * draws.between(0.35, 0.7),
        nose: car.nose,
        rounding: r.min(0.15 * car.half[1]),
    };
    build.prism(&corners, width, car.body);
    let inner = [0.82 * car.half[0], car.half[1] - car.nose - 0.03, 0.22 * car.half[2]];
    build.block([0.0, 0.0, car.z(sill) + inner[2] + 0.01], inner, 0.005, plain(grey(0.04), 0.0));
}

/// Corners of a wheel arch in the lower edge, from its rear to its front.
fn arch(car: &Car, axle: f32, sill: f32, corners: &mut Vec<[f32; 2]>) {
    let radius = car.arch + car.rounding;
    for corner in 0..ARCH_CORNER_COUNT {
        let (sine, cosine) = sin_cos(PI * (1.0 - corner as f32 / (ARCH_CORNER_COUNT - 1) as f32));
        // The first and the last stand on the sill itself.
        let up = if corner == 0 || corner == ARCH_CORNER_COUNT - 1 { 0.0 } else { radius * sine };
        corners.push([car.x(axle) + radius * cosine, sill + up]);
    }
}

/// Roof, pillars and windows, or the hole that is there instead.
fn cabin(car: &Car, build: &mut Build, draws: &mut Draws) {
    let style = &car.style;
    if let Top::Open = style.top {
        details::cockpit(car, build, draws);
        return;
    }
    let r = 0.4 * car.rounding;
    // Sunk into the body, whose rounding lowers its upper edge.
    let sunk = 0.12;
    let base_rear = [car.x(style.deck), car.z(style.deck_top - sunk)];
    let base_front = [car.x(style.cowl), car.z(style.cowl_top - sunk)];
    let roof_front = [car.x(style.screen), car.z(draws.between(0.93, 0.98)) - r];
    let roof_rear = [car.x(style.roof_end), car.z(draws.between(0.9, 0.98)) - r];
    let mut corners = vec![base_rear, base_front];
    match style.top {
        // An arc over the base.
        Top::Round => {
            let middle = 0.5 * (base_rear[0] + base_front[0]);
            let reach = 0.5 * (base_front[0] - base_rear[0]);
            for step in 1..8 {
                let (sine, cosine) = sin_cos(PI * step as f32 / 8.0);
                let height = car.z(1.0) - r - base_rear[1];
                corners.push([middle + reach * cosine, base_rear[1] + height * (0.25 + 0.75 * sine)]);
            }
        }
        _ => {
            let middle = [0.5 * (roof_front[0] + roof_rear[0]), car.z(1.0) - r];
            corners.extend([roof_front, middle, roof_rear]);
        }
    }
    let belt = car.z(style.belt - sunk);
    let width = Width {
        half_width: car.side() - car.rounding * 0.5 - car.half[1] * draws.between(0.0, 0.12),
        waist: belt,
        lean: car.lean,
        shoulder: 0.0,
        nose: 0.0,
        rounding: r,
    };
    let roof = if draws.chance(0.12) { plain(paint(draws), gloss(draws)) } else { car.body };
    build.prism(&corners, width, roof);
    windows(car, build, draws, width, [base_rear, base_front, roof_front, roof_rear]);
}

/// Panes that stand a little out of the cabin: along the sides, in front and behind. `frame` are the corners of the
/// cabin's side: lower rear, lower front, upper front, upper rear.
fn windows(car: &Car, build: &mut Build, draws: &mut Draws, cabin: Width, frame: [[f32; 2]; 4]) {
    let out = 0.003;
    let inside = |along: f32, up: f32| {
        let at = |axis: usize| {
            let lower = mix(frame[0][axis], frame[1][axis], along);
            mix(lower, mix(frame[3][axis], frame[2][axis], along), up)
        };
        [at(0), at(1)]
    };
    let panes = Width { half_width: cabin.half_width + out, rounding: 0.001, ..cabin };
    let [low, high] = [draws.between(0.34, 0.46), draws.between(0.8, 0.92)];
    let pillar = draws.between(0.012, 0.03);
    let ends = match car.style.top {
        Top::Round => [0.16, 0.84],
        _ => [draws.between(0.05, 0.12), draws.between(0.9, 0.96)],
    };
    let from = if car.style.blind > 0.0 { mix(ends[0], ends[1], car.style.blind) } else { ends[0] };
    let count = car.style.window_count;
    for window in 0..count {
        let at = |step: u32| mix(from, ends[1], step as f32 / count as f32);
        let (rear, front) = (at(window) + pillar * 0.5, at(window + 1) - pillar * 0.5);
        build.small_prism(
            &[inside(rear, low), inside(front, low), inside(front, high), inside(rear, high)],
            panes,
            car.glass,
        );
    }
    if let Top::Round = car.style.top {
        return details::round_screens(car, build, frame);
    }
    // Front and rear: a thin slab along the slope.
    let slab = Width { half_width: cabin.half_width - draws.between(0.01, 0.03), rounding: 0.001, ..cabin };
    let screens =
        [(frame[1], frame[2], 1.0, true), (frame[0], frame[3], -1.0, car.style.blind == 0.0 || draws.chance(0.5))];
    for (lower, upper, outwards, there) in screens {
        if !there {
            continue;
        }
        let at = |t: f32, by: f32| {
            let along = [upper[0] - lower[0], upper[1] - lower[1]];
            let length = sqrt(along[0] * along[0] + along[1] * along[1]);
            let off = by * outwards / length;
            [mix(lower[0], upper[0], t) + along[1] * off, mix(lower[1], upper[1], t) - along[0] * off]
        };
        let reach = cabin.rounding + out;
        build.small_prism(&[at(low, -0.01), at(low, reach), at(0.94, reach), at(0.94, -0.01)], slab, car.glass);
    }
}
