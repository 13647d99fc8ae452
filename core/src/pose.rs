//! Camera poses.
//!
//! A pose is the rigid map from camera coordinates to world coordinates. Inside, axes are always OpenCV's: x to the
//! right of the image, y down, z forward into the scene. Data in OpenGL axes (x right, y up, z backward; NeRF and
//! Blender) has its own constructor, so that frames cannot be confused silently.

use crate::math::{abs, angle_from_components, angle_from_squares, max, norm3};
use bytemuck::{Pod, Zeroable};
use core::fmt;
use glam::Vec3;

/// Largest allowed entry of `R^T R - I` and of the last row's difference from `(0, 0, 0, 1)`.
///
/// Poses are inverted by transposition; an error of this size in the rotation moves a projection by the same fraction
/// of the image. Files with four decimals pass, a rotation scaled by 0.1 % does not.
pub const RIGID_TOLERANCE: f32 = 1.0e-3;

/// Largest allowed coordinate of a camera centre: distances and their squares' scaled forms then stay finite.
pub const MAX_COORDINATE: f32 = 1.0e30;

/// Why a 4x4 matrix is not a camera pose. Rows and columns count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PoseError {
    /// An entry is NaN or infinite.
    NotFinite {
        /// Row of the entry.
        row: u32,
        /// Column of the entry.
        column: u32,
    },
    /// A coordinate of the centre is larger than [`MAX_COORDINATE`].
    TooFar,
    /// The last row is not `0 0 0 1`.
    LastRow,
    /// The upper left 3x3 block is not orthonormal: the largest entry of `|R^T R - I|`.
    NotRigid {
        /// Largest entry of `|R^T R - I|`.
        deviation: f32,
    },
    /// The determinant is -1: an axis is mirrored.
    Mirrored,
    /// [`Pose::look_at`] has no line of sight, or no upward direction beside it.
    NoDirection,
}

/// Sine of the least angle between the line of sight and the upward direction of [`Pose::look_at`].
const MIN_SINE: f32 = 1.0e-6;

/// The same below which rounding has made what is across them oblique.
const NEARLY_PARALLEL: f32 = 0.05;

impl fmt::Display for PoseError {
    /// As a message, in which rows and columns count from 1.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PoseError::NotFinite { row, column } => {
                write!(f, "the entry in row {}, column {} is not finite as a 32-bit number", row + 1, column + 1)
            }
            PoseError::TooFar => {
                write!(f, "a coordinate of the camera's centre is beyond {MAX_COORDINATE:e}")
            }
            PoseError::LastRow => f.write_str("the last row is not 0 0 0 1"),
            PoseError::NotRigid { deviation } => {
                write!(f, "the 3x3 block is scaled or skewed: R^T R differs from the identity by {deviation:.4}")
            }
            PoseError::Mirrored => f.write_str("the determinant of the 3x3 block is -1: an axis is mirrored"),
            PoseError::NoDirection => f.write_str(
                "a camera and the point that it looks at coincide or are not finite, or the upward direction is parallel \
                 to the line between them",
            ),
        }
    }
}

impl core::error::Error for PoseError {}

/// A rigid camera-to-world transform, checked when built.
///
/// The rotation is kept as given, not re-orthonormalised, so that formulas on it reproduce published values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pose {
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    right_world: Vec3,
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    down_world: Vec3,
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    forward_world: Vec3,
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    centre_world: Vec3,
}

/// A pose as plain data: what a kernel reads from a buffer. Made from a checked [`Pose`] by [`Pose::block`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PoseBlock {
    /// The camera's x axis in world coordinates; behind it the centre's x.
    pub right: [f32; 4],
    /// The camera's y axis in world coordinates; behind it the centre's y.
    pub down: [f32; 4],
    /// The principal axis in world coordinates; behind it the centre's z.
    pub forward: [f32; 4],
}

const _: () = assert!(size_of::<PoseBlock>() == 48);

impl PoseBlock {
    /// The pose that the block was made from.
    #[inline]
    pub fn pose(&self) -> Pose {
        Pose {
            right_world: axis(&self.right),
            down_world: axis(&self.down),
            forward_world: axis(&self.forward),
            centre_world: self.centre_world(),
        }
    }

    /// The camera's centre in world coordinates.
    #[inline]
    pub fn centre_world(&self) -> Vec3 {
        Vec3::new(self.right[3], self.down[3], self.forward[3])
    }

    /// A vector in camera axes, in world axes.
    #[inline]
    pub fn rotate_to_world(&self, x: f32, y: f32, z: f32) -> Vec3 {
        axis(&self.right) * x + axis(&self.down) * y + axis(&self.forward) * z
    }

    /// Components of a world vector along the camera's axes.
    #[inline]
    pub fn rotate_to_camera(&self, vector_world: Vec3) -> Vec3 {
        Vec3::new(
            axis(&self.right).dot(vector_world),
            axis(&self.down).dot(vector_world),
            axis(&self.forward).dot(vector_world),
        )
    }
}

#[inline]
fn axis(row: &[f32; 4]) -> Vec3 {
    Vec3::new(row[0], row[1], row[2])
}

impl Pose {
    /// At the world's origin, looking along world z, with world y down.
    pub const IDENTITY: Pose =
        Pose { right_world: Vec3::X, down_world: Vec3::Y, forward_world: Vec3::Z, centre_world: Vec3::ZERO };

    /// From a row-major camera-to-world matrix in OpenCV axes (x right, y down, z forward).
    ///
    /// # Errors
    /// [`PoseError`] if an entry is not finite, a coordinate is beyond 1e30, the block is not a rotation to within
    /// [`RIGID_TOLERANCE`], or the last row is not `0 0 0 1` to within that.
    pub fn from_opencv(world_from_camera: &[[f32; 4]; 4]) -> Result<Pose, PoseError> {
        let m = world_from_camera;
        let mut row = 0;
        while row < 4 {
            let mut column = 0;
            while column < 4 {
                if !(abs(m[row][column]) <= f32::MAX) {
                    return Err(PoseError::NotFinite { row: row as u32, column: column as u32 });
                }
                column += 1;
            }
            row += 1;
        }
        let last_row = max(max(abs(m[3][0]), abs(m[3][1])), max(abs(m[3][2]), abs(m[3][3] - 1.0)));
        if last_row > RIGID_TOLERANCE {
            return Err(PoseError::LastRow);
        }
        let pose = Pose {
            right_world: Vec3::new(m[0][0], m[1][0], m[2][0]),
            down_world: Vec3::new(m[0][1], m[1][1], m[2][1]),
            forward_world: Vec3::new(m[0][2], m[1][2], m[2][2]),
            centre_world: Vec3::new(m[0][3], m[1][3], m[2][3]),
        };
        let centre = pose.centre_world;
        if max(max(abs(centre.x), abs(centre.y)), abs(centre.z)) > MAX_COORDINATE {
            return Err(PoseError::TooFar);
        }
        let deviation = pose.deviation_from_rigid();
        if !(deviation <= RIGID_TOLERANCE) {
            return Err(PoseError::NotRigid { deviation });
        }
        if pose.right_world.cross(pose.down_world).dot(pose.forward_world) < 0.0 {
            return Err(PoseError::Mirrored);
        }
        Ok(pose)
    }

    /// From a row-major camera-to-world matrix in OpenGL axes (x right, y up, z backward).
    ///
    /// # Errors
    /// As [`Pose::from_opencv`].
    pub fn from_opengl(world_from_camera: &[[f32; 4]; 4]) -> Result<Pose, PoseError> {
        let mut m = *world_from_camera;
        let mut row = 0;
        while row < 3 {
            m[row][1] = -m[row][1];
            m[row][2] = -m[row][2];
            row += 1;
        }
        Pose::from_opencv(&m)
    }

    /// The pose as plain data for kernels.
    #[inline]
    pub fn block(&self) -> PoseBlock {
        let Pose { right_world: right, down_world: down, forward_world: forward, centre_world: centre } = *self;
        PoseBlock {
            right: [right.x, right.y, right.z, centre.x],
            down: [down.x, down.y, down.z, centre.y],
            forward: [forward.x, forward.y, forward.z, centre.z],
        }
    }

    /// A camera at `centre_world` that looks at `point_world`, with the image's up direction as near to `up_world` as
    /// it can be.
    ///
    /// # Errors
    /// [`PoseError::NoDirection`] if the two points coincide, `up_world` is parallel to the line between them (to a
    /// millionth), or a number is not finite or so large that a product overflows; [`PoseError::TooFar`] as of
    /// [`Pose::from_opencv`].
    pub fn look_at(centre_world: Vec3, point_world: Vec3, up_world: Vec3) -> Result<Pose, PoseError> {
        let degenerate = PoseError::NoDirection;
        let forward = unit(point_world - centre_world).ok_or(degenerate)?;
        // Of parallel directions the cross product is noise, and as long as they are.
        let across = forward.cross(unit(up_world).ok_or(degenerate)?);
        if !(across.length() > MIN_SINE) {
            return Err(degenerate);
        }
        let right = unit(forward.cross(up_world)).ok_or(degenerate)?;
        // Of nearly parallel directions it is not yet at a right angle to the line of sight.
        let right = match across.length() < NEARLY_PARALLEL {
            true => unit(right - forward * forward.dot(right)).ok_or(degenerate)?,
            false => right,
        };
        let down = forward.cross(right);
        let (c, r, d, f) = (centre_world, right, down, forward);
        Pose::from_opencv(&[[r.x, d.x, f.x, c.x], [r.y, d.y, f.y, c.y], [r.z, d.z, f.z, c.z], [0.0, 0.0, 0.0, 1.0]])
    }

    /// The camera's centre in world coordinates.
    #[inline]
    pub fn centre_world(&self) -> Vec3 {
        self.centre_world
    }

    /// The principal axis: the viewing direction, in world coordinates.
    #[inline]
    pub fn forward_world(&self) -> Vec3 {
        self.forward_world
    }

    /// The direction of increasing image x, in world coordinates.
    #[inline]
    pub fn right_world(&self) -> Vec3 {
        self.right_world
    }

    /// The direction of increasing image y, in world coordinates.
    #[inline]
    pub fn down_world(&self) -> Vec3 {
        self.down_world
    }

    /// A direction given in camera coordinates, in world coordinates.
    #[inline]
    pub fn rotate_to_world(&self, direction_camera: Vec3) -> Vec3 {
        self.right_world * direction_camera.x
            + self.down_world * direction_camera.y
            + self.forward_world * direction_camera.z
    }

    /// A point given in world coordinates, in camera coordinates (inverse by transposition).
    #[inline]
    pub fn to_camera(&self, point_world: Vec3) -> Vec3 {
        let offset = point_world - self.centre_world;
        Vec3::new(self.right_world.dot(offset), self.down_world.dot(offset), self.forward_world.dot(offset))
    }

    /// Row-major 4x4 camera-to-world matrix in OpenCV axes.
    pub fn to_opencv(&self) -> [[f32; 4]; 4] {
        let (r, d, f, c) = (self.right_world, self.down_world, self.forward_world, self.centre_world);
        [[r.x, d.x, f.x, c.x], [r.y, d.y, f.y, c.y], [r.z, d.z, f.z, c.z], [0.0, 0.0, 0.0, 1.0]]
    }

    /// Row-major 4x4 camera-to-world matrix in OpenGL axes: the frame of the published formulas.
    pub fn to_opengl(&self) -> [[f32; 4]; 4] {
        let mut m = self.to_opencv();
        let mut row = 0;
        while row < 3 {
            m[row][1] = -m[row][1];
            m[row][2] = -m[row][2];
            row += 1;
        }
        m
    }

    /// Distance between the centres of two cameras, in world units.
    #[inline]
    pub fn distance(&self, other: &Pose) -> f32 {
        let d = self.centre_world - other.centre_world;
        norm3(d.x, d.y, d.z)
    }

    /// Angle between the principal axes of two cameras, in `[0, pi]`.
    ///
    /// `2 atan2(|a - b|, |a + b|)`: exact at 0 and accurate to a few ULP of the result at every angle from 1e-18
    /// on, where the arc cosine of a dot product is quantised to 0.03 degrees near 0. Lengths that are off by
    /// [`RIGID_TOLERANCE`] change it by 1e-6 of itself and 4e-10 rad at most.
    #[inline]
    pub fn axis_angle(&self, other: &Pose) -> f32 {
        let (difference, sum) = self.axis_chords_squared(other);
        2.0 * angle_from_squares(difference, sum)
    }

    /// `|a - b|^2` and `|a + b|^2` of the principal axes `a`, `b` of two cameras: `4 sin^2` and `4 cos^2` of half the
    /// angle between them, if they have length 1. What is parallel to the longer one of `a - b` and `a + b`, a
    /// difference of the lengths, does not count in the other.
    #[inline]
    pub fn axis_chords_squared(&self, other: &Pose) -> (f32, f32) {
        chords_squared(self.forward_world, other.forward_world)
    }

    /// Angle of the full relative rotation between two cameras (roll counts), in `[0, pi]`.
    ///
    /// With `c` the trace of the relative rotation minus 1 (twice the cosine) and `s` twice the sine: `s` comes from
    /// the Frobenius norm of the difference at angles below a right angle, where that norm is exact, and from the
    /// antisymmetric part above it. Accurate to a few 1e-7 rad everywhere and relatively accurate near 0.
    pub fn rotation_angle(&self, other: &Pose) -> f32 {
        let (a, b) = (self, other);
        let trace =
            a.right_world.dot(b.right_world) + a.down_world.dot(b.down_world) + a.forward_world.dot(b.forward_world);
        let twice_cosine = trace - 1.0;
        if twice_cosine > 0.0 {
            // |R_a - R_b|_F^2 = 8 sin^2(angle / 2), of axes of length 1.
            let chord = |a: Vec3, b: Vec3| {
                let (difference, sum) = chords_squared(a, b);
                difference / (difference + sum)
            };
            let sine_squared = 0.5
                * (chord(a.right_world, b.right_world)
                    + chord(a.down_world, b.down_world)
                    + chord(a.forward_world, b.forward_world));
            return 2.0 * angle_from_squares(sine_squared, max(1.0 - sine_squared, 0.0));
        }
        let antisymmetric = Vec3::new(
            a.forward_world.dot(b.down_world) - a.down_world.dot(b.forward_world),
            a.right_world.dot(b.forward_world) - a.forward_world.dot(b.right_world),
            a.down_world.dot(b.right_world) - a.right_world.dot(b.down_world),
        );
        angle_from_components(antisymmetric.length(), twice_cosine)
    }

    fn deviation_from_rigid(&self) -> f32 {
        let (r, d, f) = (self.right_world, self.down_world, self.forward_world);
        let lengths = max(max(abs(r.dot(r) - 1.0), abs(d.dot(d) - 1.0)), max(abs(f.dot(f) - 1.0), abs(r.dot(d))));
        let deviation = max(lengths, max(abs(r.dot(f)), abs(d.dot(f))));
        // `max` drops a NaN on its left: huge entries give infinity or NaN, both of which must fail.
        if deviation <= f32::MAX && r.dot(r) + d.dot(d) + f.dot(f) <= f32::MAX { deviation } else { f32::MAX }
    }
}

/// `|a - b|^2` and `|a + b|^2`, the shorter one without what is parallel to the longer one: the part of the difference
/// of `a` and `b` that is one of their lengths, where these are nearly 1.
#[inline]
fn chords_squared(a: Vec3, b: Vec3) -> (f32, f32) {
    let (difference, sum) = (a - b, a + b);
    let (d, s) = (difference.length_squared(), sum.length_squared());
    let along = difference.dot(sum);
    let (of_difference, of_sum) = if d <= s { (along / s, 0.0) } else { (0.0, along / d) };
    ((difference - sum * of_difference).length_squared(), (sum - difference * of_sum).length_squared())
}

/// The direction of a vector, or `None` for one that is zero or not finite.
fn unit(v: Vec3) -> Option<Vec3> {
    let length = norm3(v.x, v.y, v.z);
    if length > 0.0 && length <= f32::MAX { Some(v / length) } else { None }
}
