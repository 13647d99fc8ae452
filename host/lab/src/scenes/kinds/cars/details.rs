//! What is fixed to a car's body: wheels, lamps, bumpers, mirrors, wings, intakes, beds, cockpits.

use super::super::build::{Build, place};
use super::super::draws::Draws;
use super::super::mix;
use super::super::paint::{contrast, grey, hue, paint, plain};
use super::Car;
use super::style::Top;
use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::{Finish, Texture};
use core::f32::consts::FRAC_PI_2;
use viewfuse_core::Vec3;
use viewfuse_core::math::angle_from_components;

/// Adds everything but body and cabin.
pub(super) fn details(car: &Car, build: &mut Build, draws: &mut Draws) {
    if draws.chance(0.5) {
        wheels(car, build, draws);
    }
    lamps(car, build, draws);
    ends(car, build, draws);
    if draws.chance(0.6) {
        mirrors(car, build, draws);
    }
    if car.style.bed {
        bed(car, build, draws);
    }
    if let Top::Round = car.style.top {
        fenders(car, build, draws);
    }
    let (wing, intake) = if car.style.sporty { (0.7, 0.4) } else { (0.08, 0.08) };
    if draws.chance(wing) && !car.style.bed {
        spoiler(car, build, draws);
    }
    if draws.chance(intake) {
        intakes(car, build, draws);
    }
    if draws.chance(0.12) && car.style.top == Top::Straight && !car.style.sporty {
        roof_rack(car, build, draws);
    }
}

fn wheels(car: &Car, build: &mut Build, draws: &mut Draws) {
    let radius = 0.88 * car.arch;
    let half_height = draws.between(0.018, 0.03);
    let tyre = plain(grey(draws.between(0.04, 0.2)), 0.0);
    let metal = draws.one_of([grey(0.75), grey(0.4), grey(0.12), hue(0.13, 0.6, 0.8)]);
    let spokes = Texture::Slices { colours: [metal, metal * 0.35], pair_count: 4 + draws.below(5) };
    let hub = Finish { texture: spokes, gloss: 0.2 };
    for axle in [car.style.rear_axle, car.style.front_axle] {
        for side in [1.0, -1.0] {
            let at = |y: f32| {
                Placement::at(car.x(axle), side * y, car.z(0.0) + 0.2 * radius).turned_about_x(-side * FRAC_PI_2)
            };
            let y = car.side() - half_height;
            build.add(Shape::Cylinder { radius, half_height, rounding: 0.25 * half_height }, at(y), tyre);
            let rim = Shape::Cylinder { radius: 0.66 * radius, half_height: 0.005, rounding: 0.002 };
            build.add(rim, at(y + half_height), hub);
        }
    }
}

fn lamps(car: &Car, build: &mut Build, draws: &mut Draws) {
    let round = draws.chance(0.4);
    let white = draws.one_of([grey(0.95), hue(0.15, 0.3, 1.0), grey(0.7), hue(0.14, 0.7, 1.0)]);
    let red = hue(draws.between(0.97, 1.0), draws.between(0.75, 1.0), draws.between(0.45, 0.95));
    let size = [0.02, draws.between(0.022, 0.04), draws.between(0.012, 0.022)];
    let y = car.side() - car.nose - draws.between(0.6, 1.2) * size[1] - 0.01;
    let ends = [(1.0, white, car.style.nose_top - 0.14), (-1.0, red, car.style.tail_top - 0.2)];
    for (end, colour, up) in ends {
        for side in [1.0, -1.0] {
            let centre = [end * (car.half[0] - 0.02), side * y, car.z(up)];
            if round && end > 0.0 {
                build.ellipsoid(centre, [0.026, size[1] * 0.8, size[1] * 0.8], plain(colour, 0.3));
            } else {
                build.block(centre, [size[0] + 0.002, size[1], size[2]], 0.006, plain(colour, 0.25));
            }
        }
    }
}

/// Grille, bumpers and plates.
fn ends(car: &Car, build: &mut Build, draws: &mut Draws) {
    let across = car.side() - car.nose;
    if draws.chance(0.75) {
        let half = [0.01, across * draws.between(0.25, 0.7), car.half[2] * draws.between(0.06, 0.16)];
        build.block([car.half[0] - 0.006, 0.0, car.z(draws.between(0.2, 0.32))], half, 0.004, car.trim);
    }
    if draws.chance(0.5) {
        let colour = draws.one_of([grey(0.08), grey(0.3), grey(0.75), grey(0.9)]);
        for (end, up) in [(1.0, draws.between(0.1, 0.2)), (-1.0, draws.between(0.12, 0.24))] {
            let half = [0.03, across * 0.95, car.half[2] * draws.between(0.06, 0.14)];
            build.block([end * (car.half[0] - 0.025), 0.0, car.z(up)], half, 0.012, plain(colour, 0.1));
        }
    }
    if draws.chance(0.5) {
        for end in [1.0, -1.0] {
            let centre = [end * (car.half[0] + 0.002), 0.0, car.z(draws.between(0.2, 0.34))];
            build.block(centre, [0.008, 0.04, 0.01], 0.0, plain(draws.one_of([grey(0.92), hue(0.15, 0.8, 0.95)]), 0.0));
        }
    }
}

fn mirrors(car: &Car, build: &mut Build, draws: &mut Draws) {
    let finish = if draws.chance(0.5) { car.trim } else { plain(paint(draws), 0.1) };
    for side in [1.0, -1.0] {
        let centre = [car.x(car.style.cowl - 0.05), side * (car.side() + 0.008), car.z(car.style.belt + 0.05)];
        build.ellipsoid(centre, [0.013, 0.018, 0.013], finish);
    }
}

/// Walls around the load, and sometimes a load.
fn bed(car: &Car, build: &mut Build, draws: &mut Draws) {
    let floor = car.z(car.style.deck_top);
    let top = car.z(draws.between(0.55, 0.64));
    let (rear, front) = (car.x(0.015), car.x(car.style.deck));
    let middle = [0.5 * (rear + front), 0.0, 0.5 * (floor + top) - 0.01];
    let half = [0.5 * (front - rear), 0.012, 0.5 * (top - floor) + 0.01];
    let y = car.side() - car.nose * 0.6 - 0.02;
    for side in [1.0, -1.0] {
        build.block([middle[0], side * y, middle[2]], half, 0.006, car.body);
    }
    build.block([rear + 0.012, 0.0, middle[2]], [0.012, y, half[2]], 0.006, car.body);
    build.block([middle[0], 0.0, floor], [half[0], y, 0.008], 0.0, plain(grey(draws.between(0.1, 0.4)), 0.0));
    for _ in 0..draws.below(4) {
        let size = draws.between(0.02, 0.045);
        let centre = [mix(rear, front, draws.between(0.25, 0.75)), y * draws.between(-0.5, 0.5), floor + size];
        build.block(centre, [size, size * draws.between(0.6, 1.4), size], 0.008, plain(paint(draws), 0.1));
    }
}

/// Bulges over the wheels.
fn fenders(car: &Car, build: &mut Build, draws: &mut Draws) {
    let finish = if draws.chance(0.7) { car.body } else { plain(contrast(draws, grey(0.5)), 0.15) };
    let bulge = draws.between(0.9, 1.15);
    for axle in [car.style.rear_axle, car.style.front_axle] {
        for side in [1.0, -1.0] {
            let centre = [car.x(axle), side * (car.side() - 0.045), car.z(0.22)];
            build.ellipsoid(centre, [car.arch * 1.5 * bulge, 0.06, car.arch * 1.15 * bulge], finish);
        }
    }
}

/// Front and rear screens of a round cabin: flat lenses along its slopes.
pub(super) fn round_screens(car: &Car, build: &mut Build, frame: [[f32; 2]; 4]) {
    let middle = 0.5 * (frame[0][0] + frame[1][0]);
    let reach = 0.5 * (frame[1][0] - frame[0][0]);
    let height = car.z(1.0) - frame[0][1];
    for side in [1.0, -1.0] {
        let half = Vec3::new(0.24 * height, car.side() * 0.55, 0.02);
        let turn = side * (angle_from_components(0.62 * reach, 0.62 * height) - FRAC_PI_2);
        let at = Placement::at(middle + side * reach * 0.76, 0.0, frame[0][1] + height * 0.735).turned_about_y(-turn);
        build.add(Shape::Block { half_size: half, rounding: 0.015 }, at, car.glass);
    }
}

/// A wing on struts, or a lip.
fn spoiler(car: &Car, build: &mut Build, draws: &mut Draws) {
    let finish = if draws.chance(0.5) { car.body } else { plain(paint(draws), 0.15) };
    let finish = match finish.texture {
        Texture::Patches { ground, .. } => plain(ground, finish.gloss),
        _ => finish,
    };
    let tail = car.z(car.style.tail_top);
    let x = -car.half[0] + draws.between(0.02, 0.06);
    let y = (car.side() - car.nose * 0.5) * draws.between(0.8, 1.0);
    let chord = draws.between(0.02, 0.045);
    let high = if draws.chance(0.3) { 0.014 } else { draws.between(0.03, 0.09) };
    let wing = Shape::Block { half_size: Vec3::new(chord, y, 0.007), rounding: 0.005 };
    build.add(wing, place([x, 0.0, tail + high]).turned_about_y(draws.between(0.0, 0.3)), finish);
    for side in [1.0, -1.0] {
        let strut = side * y * 0.6;
        build.block([x, strut, tail + 0.5 * high - 0.01], [0.012, 0.006, 0.5 * high + 0.01], 0.002, car.trim);
        if high > 0.04 {
            build.block([x, side * y, tail + high], [chord * 1.15, 0.005, 0.022], 0.002, finish);
        }
    }
}

/// Scoops on the bonnet or the roof, and holes in the sides.
fn intakes(car: &Car, build: &mut Build, draws: &mut Draws) {
    match draws.below(3) {
        0 => {
            let x = car.x(mix(car.style.cowl, 1.0, draws.between(0.3, 0.6)));
            let up = mix(car.style.cowl_top, car.style.nose_top, 0.4);
            build.block([x, 0.0, car.z(up)], [0.05, car.side() * 0.3, 0.02], 0.008, car.trim);
        }
        1 if car.style.top == Top::Straight => {
            let x = car.x(mix(car.style.roof_end, car.style.screen, 0.5));
            build.block([x, 0.0, car.z(1.0)], [0.04, 0.035, 0.018], 0.01, car.trim);
        }
        _ => {
            for side in [1.0, -1.0] {
                let centre = [car.x(draws.between(0.3, 0.4)), side * (car.side() - 0.006), car.z(0.42)];
                build.block(centre, [0.035, 0.01, 0.02], 0.004, plain(grey(0.03), 0.0));
            }
        }
    }
}

fn roof_rack(car: &Car, build: &mut Build, draws: &mut Draws) {
    let x = car.x(mix(car.style.roof_end, car.style.screen, 0.5));
    if draws.chance(0.5) {
        // A taxi's sign or the lights of the police.
        let colour = contrast(draws, grey(0.5));
        build.block([x, 0.0, car.z(1.0) + 0.012], [0.018, draws.between(0.04, 0.1), 0.016], 0.006, plain(colour, 0.25));
    } else {
        let size = [draws.between(0.05, 0.12), 0.08, draws.between(0.015, 0.035)];
        build.block([x, 0.0, car.z(1.0) + size[2]], size, 0.012, plain(paint(draws), 0.1));
    }
}

/// The hole of an open car with a driver, a small screen and what protects the driver's head.
pub(super) fn cockpit(car: &Car, build: &mut Build, draws: &mut Draws) {
    let style = &car.style;
    let (rear, front) = (car.x(mix(style.deck, style.cowl, 0.35)), car.x(style.cowl - 0.02));
    let middle = 0.5 * (rear + front);
    let floor = car.z(style.belt) + 0.004;
    let wide = car.side() * draws.between(0.35, 0.75);
    build.block([middle, 0.0, floor], [0.5 * (front - rear), wide, 0.012], 0.01, plain(grey(0.04), 0.0));
    let beside = if draws.chance(0.5) { 0.0 } else { wide * 0.5 };
    if draws.chance(0.8) {
        let helmet = draws.between(0.028, 0.036);
        build.ellipsoid([middle - 0.02, beside, floor + 0.03], [helmet; 3], plain(paint(draws), 0.3));
    }
    let screen = Shape::Block { half_size: Vec3::new(0.004, wide, 0.03), rounding: 0.002 };
    build.add(screen, place([front, 0.0, floor + 0.012]).turned_about_y(-0.7), car.glass);
    let hoop = car.z(1.0) + draws.between(-0.01, 0.02);
    if draws.chance(0.5) {
        let foot = |side: f32| Vec3::new(rear, beside + side * 0.045, floor);
        let head = |side: f32| Vec3::new(rear, beside + side * 0.035, hoop);
        build.rod(foot(1.0), head(1.0), 0.008, car.trim);
        build.rod(foot(-1.0), head(-1.0), 0.008, car.trim);
        build.rod(head(1.0), head(-1.0), 0.008, car.trim);
    } else {
        build.ellipsoid([rear - 0.05, beside, floor], [0.1, 0.05, hoop - floor], car.body);
    }
}
