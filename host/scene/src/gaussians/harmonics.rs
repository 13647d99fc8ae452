//! Spherical harmonics in other worlds and of other degrees.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use viewfuse_core::Vec3;
use viewfuse_core::gaussian::{REST_COUNTS, harmonics};

/// Coefficients of a channel beyond degree 0.
const COUNT: usize = 15;
/// Nodes and weights of Gauss and Legendre: with eight angles around, exact for products of two harmonics.
const NODES: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_8),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_8),
];
const ANGLES: u32 = 8;

/// Turns coefficients, `[gaussian][channel][coefficient]`, so that the same colours are seen along directions that
/// `new_from_old` has turned. Degrees do not mix: a turned harmonic is a sum of those of its own degree.
pub(super) fn rotate(f_rest: &mut [f32], degree: u32, new_from_old: DMat3) {
    let count = REST_COUNTS[degree as usize] as usize;
    if count == 0 {
        return;
    }
    let matrix = matrix(new_from_old.inverse());
    for channel in f_rest.chunks_exact_mut(count) {
        let old: Vec<f64> = channel.iter().map(|value| f64::from(*value)).collect();
        for (new, value) in channel.iter_mut().enumerate() {
            *value = old.iter().enumerate().map(|(index, old)| old * matrix[index][new]).sum::<f64>() as f32;
        }
    }
}

/// Element `[i][j]` is the integral over all directions `d` of `basis_i(old_from_new d) basis_j(d)`.
fn matrix(old_from_new: DMat3) -> [[f64; COUNT]; COUNT] {
    let mut sums = [[0.0; COUNT]; COUNT];
    for (z, weight) in NODES {
        for step in 0..ANGLES {
            let (sine, cosine) = (2.0 * PI * f64::from(step) / f64::from(ANGLES)).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            let direction = DVec3::new(ring * cosine, ring * sine, z);
            let (old, new) = (basis(old_from_new * direction), basis(direction));
            let weight = weight * 2.0 * PI / f64::from(ANGLES);
            for (row, old) in sums.iter_mut().zip(old) {
                row.iter_mut().zip(new).for_each(|(sum, new)| *sum += weight * old * new);
            }
        }
    }
    // What is not of the same degree is 0 but for rounding.
    let degree = |index: usize| REST_COUNTS.iter().position(|count| index < *count as usize);
    for (row, values) in sums.iter_mut().enumerate() {
        let others = values.iter_mut().enumerate().filter(|(column, _)| degree(*column) != degree(row));
        others.for_each(|(_, value)| *value = 0.0);
    }
    sums
}

/// The harmonics of core along a direction.
fn basis(direction: DVec3) -> [f64; COUNT] {
    harmonics(direction.as_vec3()).map(f64::from)
}

/// The coefficients of a Gaussian of this degree as those of the greatest: zeros behind each channel's.
pub(super) fn padded(f_rest: &[f32], degree: u32) -> [f32; 3 * COUNT] {
    let count = REST_COUNTS[degree as usize] as usize;
    std::array::from_fn(|index| match index % COUNT < count {
        true => f_rest.get(index / COUNT * count + index % COUNT).copied().unwrap_or_default(),
        false => 0.0,
    })
}

/// A place where the axes y and z point the other way, as between the worlds of `.ply` and `.spz`: the sign of each
/// harmonic.
pub(super) fn signs_without_yz() -> [f32; COUNT] {
    let along = Vec3::new(0.3, 0.5, 0.7).as_dvec3();
    let (here, there) = (basis(along), basis(along * DVec3::new(1.0, -1.0, -1.0)));
    std::array::from_fn(|index| if here[index] * there[index] < 0.0 { -1.0 } else { 1.0 })
}
