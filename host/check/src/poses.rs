//! Seeded poses: random, on rings, close together, far away.

use crate::oracle::{Matrix, cross, normalised};
use viewfuse_core::pose::Pose;
use viewfuse_core::random::threefry_2x32;

/// A sequence of random draws that a seed determines.
#[derive(Clone, Debug)]
pub struct Random {
    seed: u32,
    count: u32,
}

impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u32) -> Random {
        Random { seed, count: 0 }
    }

    /// Uniform in `[0, 1)` with 53 bits.
    pub fn unit(&mut self) -> f64 {
        self.count += 1;
        let [high, low] = threefry_2x32([self.seed, 0x5eed], [self.count, 0]);
        ((u64::from(high) << 21) ^ u64::from(low >> 11)) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `[low, high)`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm between two positive numbers.
    pub fn log_range(&mut self, low: f64, high: f64) -> f64 {
        self.range(low.ln(), high.ln()).exp()
    }

    /// A whole number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// Normally distributed (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (self.unit() * std::f64::consts::TAU).cos()
    }

    /// Three normally distributed coordinates.
    pub fn vector(&mut self) -> [f64; 3] {
        [self.normal(), self.normal(), self.normal()]
    }

    /// A rotation, uniform over all of them.
    pub fn rotation(&mut self) -> Matrix {
        let axis = self.vector();
        let w = self.normal();
        let norm = (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt();
        rotation_about(axis, 2.0 * norm.atan2(w))
    }

    /// A camera of any orientation with a centre of normally distributed coordinates times `scale`.
    pub fn pose(&mut self, scale: f64) -> Pose {
        let rotation = self.rotation();
        let c = self.vector();
        pose_of(&rotation, [c[0] * scale, c[1] * scale, c[2] * scale])
    }
}

/// The rotation by `angle` radians about an axis of any length above 0.
pub fn rotation_about(axis: [f64; 3], angle: f64) -> Matrix {
    let [x, y, z] = normalised(axis);
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
    ]
}

/// The pose with these rotation (columns: right, down, forward) and centre, rounded to `f32`.
///
/// # Panics
/// If it is not a rotation.
pub fn pose_of(rotation: &Matrix, centre: [f64; 3]) -> Pose {
    let mut m = [[0.0_f32; 4]; 4];
    for row in 0..3 {
        for column in 0..3 {
            m[row][column] = rotation[row][column] as f32;
        }
        m[row][3] = centre[row] as f32;
    }
    m[3][3] = 1.0;
    Pose::from_opencv(&m).unwrap_or_else(|error| panic!("{m:?} is no pose: {error:?}"))
}

/// A camera at `centre` that looks at the origin, rolled by `roll` radians.
pub fn looking_at_origin(centre: [f64; 3], roll: f64) -> Pose {
    let forward = normalised([-centre[0], -centre[1], -centre[2]]);
    let right = normalised(cross(forward, [0.0, 0.0, 1.0]));
    let down = cross(forward, right);
    let (s, c) = roll.sin_cos();
    let mut rotation = [[0.0; 3]; 3];
    for axis in 0..3 {
        rotation[axis] = [c * right[axis] + s * down[axis], c * down[axis] - s * right[axis], forward[axis]];
    }
    pose_of(&rotation, centre)
}

/// `count` cameras on a horizontal ring of a radius, `height` above the origin, that look at the origin.
pub fn ring(count: usize, radius: f64, height: f64, roll: f64) -> Vec<Pose> {
    (0..count)
        .map(|i| {
            let (s, c) = (std::f64::consts::TAU * (i as f64 + 0.1) / count as f64).sin_cos();
            looking_at_origin([radius * c, radius * s, height], roll * i as f64)
        })
        .collect()
}

/// The random numbers of a seed and a size, for one kernel.
pub(crate) fn random(kernel: u32, seed: u64, size: u32) -> Random {
    Random::new((seed as u32).wrapping_mul(0x9e37_79b9) ^ (size << 8) ^ kernel)
}

/// `count` draws as `f32`.
pub(crate) fn numbers(count: usize, mut next: impl FnMut() -> f64) -> Vec<f32> {
    (0..count).map(|_| next() as f32).collect()
}
