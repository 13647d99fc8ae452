//! Prisms: tracing against a walk in small steps through their definition in `f64`.

use super::RED;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Ray;
use viewfuse_core::random::uniform;
use viewfuse_lab::scenes::prism::Width;
use viewfuse_lab::scenes::{Finish, Object, Part, Placement, Prism, Shape, Texture, trace};

/// A side view with a notch below, as of a car with one wheel arch.
const CORNERS: [[f32; 2]; 9] = [
    [-0.4, -0.1],
    [-0.2, -0.1],
    [-0.15, -0.02],
    [-0.08, -0.1],
    [0.4, -0.1],
    [0.38, 0.02],
    [0.1, 0.06],
    [-0.05, 0.2],
    [-0.35, 0.16],
];

const WIDTH: Width = Width { half_width: 0.18, waist: 0.0, lean: 0.3, shoulder: 0.15, nose: 0.06, rounding: 0.0 };

fn object(corners: &[[f32; 2]], width: Width) -> Object {
    let finish = Finish { texture: Texture::Plain { colour: RED }, gloss: 0.0 };
    Object::new(vec![Part {
        shape: Shape::Prism(Prism::new(corners, width)),
        placement: Placement::at(0.0, 0.0, 0.0),
        finish,
    }])
}

/// Whether a point lies inside: the definition, with the outline
/// by the angles that its corners turn through.
fn inside(point: [f64; 3]) -> bool {
    let [x, y, z] = point;
    let t = ((x.abs() - 0.15) / (0.4 - 0.15)).clamp(0.0, 1.0);
    let half_width = 0.18 - 0.3 * z.max(0.0) - 0.06 * t * t;
    let angle = |corner: [f32; 2]| (f64::from(corner[1]) - z).atan2(f64::from(corner[0]) - x);
    let turned: f64 = (0..CORNERS.len())
        .map(|i| {
            let step = angle(CORNERS[(i + 1) % CORNERS.len()]) - angle(CORNERS[i]);
            step - std::f64::consts::TAU * (step / std::f64::consts::TAU).round()
        })
        .sum();
    y.abs() < half_width && turned.abs() > 3.0
}

#[test]
fn rays_meet_a_prism_where_its_definition_says() {
    let object = object(&CORNERS, WIDTH);
    let step = 1.0e-3;
    let (mut hits, mut misses, mut grazing) = (0, 0, 0);
    for index in 0..1500 {
        let number = |axis: u32| 2.0 * uniform(4, index, axis) - 1.0;
        let from = Vec3::new(number(0), number(1), number(2)).normalize_or(Vec3::Z);
        let towards = Vec3::new(0.4 * number(3), 0.2 * number(4), 0.15 * number(5));
        let ray = Ray { origin_world: from, direction_world: (towards - from).normalize_or(Vec3::X) };
        let [start, direction] = [from, ray.direction_world].map(|v| v.to_array().map(f64::from));
        let at = |t: f64| std::array::from_fn(|axis| start[axis] + direction[axis] * t);
        let first = (0..2000).map(|k| f64::from(k) * step).find(|&t| inside(at(t)));
        match (first, trace(&object, &ray)) {
            (Some(first), Some(hit)) => {
                let early = first - f64::from(hit.distance);
                // At a slant the ray arrives a little before the surface, and the walk up to a step behind it.
                if (-1.0e-4..2.0 * step).contains(&early) { hits += 1 } else { grazing += 1 }
            }
            (None, None) => misses += 1,
            _ => grazing += 1,
        }
    }
    assert!(hits > 500 && misses > 200, "{hits} hits, {misses} misses");
    // Rays that cut a corner shorter than a step.
    assert!(grazing <= 15, "{grazing} of 1500 rays disagree");
}

#[test]
fn distances_to_a_prism_are_never_too_long_and_its_box_holds_it() {
    for rounding in [0.0, 0.03] {
        let prism = Prism::new(&CORNERS, Width { rounding, ..WIDTH });
        let points: Vec<Vec3> = (0..60_000)
            .map(|index| {
                let number = |axis: u32| 2.0 * uniform(5, index, axis) - 1.0;
                Vec3::new(0.5 * number(0), 0.25 * number(1), 0.3 * number(2))
            })
            .collect();
        let (within, without): (Vec<Vec3>, Vec<Vec3>) = points.iter().partition(|&&p| prism.distance(p) < 0.0);
        assert!(within.len() > 5000, "{} points inside", within.len());
        let half_box = prism.half_box();
        assert!(within.iter().all(|p| p.abs().cmple(half_box).all()), "a point inside is outside of the box");
        for p in without.iter().step_by(97) {
            let nearest = within.iter().map(|q| p.distance(*q)).fold(f32::MAX, f32::min);
            let distance = prism.distance(*p);
            assert!(distance <= nearest, "{p}: distance {distance}, but {nearest} away there is material");
            // Tracing makes headway: what is called near is near.
            assert!(distance > 0.015 || nearest < 0.08, "{p}: distance {distance} of about {nearest}");
        }
    }
}
