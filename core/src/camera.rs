//! Pinhole cameras: rays through pixels and projections of points.
//!
//! Image coordinates are continuous, in pixels, x to the right and y down, the origin at the outer corner of the top
//! left pixel: the centre of pixel `(column, row)` is `(column + 0.5, row + 0.5)` and the image covers
//! `[0, width] x [0, height]`.

use crate::math::abs;
use crate::pose::{Pose, PoseBlock};
use bytemuck::{Pod, Zeroable};
use core::fmt;
use glam::Vec3;

/// Why intrinsics are not those of a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PinholeError {
    /// A focal length is not a number from [`SHORTEST_FOCAL`] to [`LONGEST_FOCAL`].
    Focal,
    /// A coordinate of the principal point is not finite, or larger than [`LONGEST_FOCAL`].
    Principal,
    /// Width or height is zero or above 2^20.
    Size,
}

impl fmt::Display for PinholeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            PinholeError::Focal => "a focal length is not a number from 0.001 to 1e9 pixels",
            PinholeError::Principal => "the principal point is not finite, or further off than 1e9 pixels",
            PinholeError::Size => "width and height must be from 1 to 1048576 pixels",
        })
    }
}

impl core::error::Error for PinholeError {}

/// Least focal length of a pinhole camera, in pixels.
pub const SHORTEST_FOCAL: f32 = 1.0e-3;
/// Greatest focal length, and greatest distance of the principal point from the image's corner, in pixels.
pub const LONGEST_FOCAL: f32 = 1.0e9;

/// Intrinsics of a camera without distortion, checked when built.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pinhole {
    focal: [f32; 2],
    principal: [f32; 2],
    width: u32,
    height: u32,
}

impl Pinhole {
    /// Focal lengths `[x, y]` and principal point `[x, y]` in pixels of an image of `width` x `height`.
    ///
    /// # Errors
    /// [`PinholeError`] names the first invalid quantity.
    pub fn new(focal: [f32; 2], principal: [f32; 2], width: u32, height: u32) -> Result<Pinhole, PinholeError> {
        // Wide enough for any lens on any image, narrow enough that no quotient of coordinates overflows.
        let usable = |f: f32| (SHORTEST_FOCAL..=LONGEST_FOCAL).contains(&f);
        if !(usable(focal[0]) && usable(focal[1])) {
            return Err(PinholeError::Focal);
        }
        if !(abs(principal[0]) <= LONGEST_FOCAL && abs(principal[1]) <= LONGEST_FOCAL) {
            return Err(PinholeError::Principal);
        }
        if width == 0 || height == 0 || width > 1 << 20 || height > 1 << 20 {
            return Err(PinholeError::Size);
        }
        Ok(Pinhole { focal, principal, width, height })
    }

    /// Focal lengths `[x, y]` in pixels.
    #[inline]
    pub fn focal(&self) -> [f32; 2] {
        self.focal
    }

    /// Principal point `[x, y]` in pixels.
    #[inline]
    pub fn principal(&self) -> [f32; 2] {
        self.principal
    }

    /// Width of the image in pixels.
    #[inline]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the image in pixels.
    #[inline]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The same camera with its image resampled to `width` x `height`: both focal lengths and the principal point
    /// scale with their axis.
    ///
    /// # Errors
    /// As of [`Pinhole::new`]: a size of 0, what leaves its range with the size, or the size.
    pub fn resized(&self, width: u32, height: u32) -> Result<Pinhole, PinholeError> {
        // A width of 0 would otherwise be found in the focal length that it scales.
        if width == 0 || height == 0 {
            return Err(PinholeError::Size);
        }
        let x = width as f32 / self.width as f32;
        let y = height as f32 / self.height as f32;
        Pinhole::new(
            [self.focal[0] * x, self.focal[1] * y],
            [self.principal[0] * x, self.principal[1] * y],
            width,
            height,
        )
    }
}

/// A half line in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ray {
    /// Where it starts, in world coordinates.
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    pub origin_world: Vec3,
    /// Unit vector along it, in world coordinates.
    #[cfg_attr(feature = "defmt", defmt(Debug2Format))]
    pub direction_world: Vec3,
}

impl Ray {
    /// The point at distance `t` (world units) from the origin.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin_world + self.direction_world * t
    }
}

/// Where a point appears in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Projection {
    /// Continuous image coordinate to the right, in pixels. 0 where the point is behind the camera.
    pub x: f32,
    /// Continuous image coordinate downwards, in pixels. 0 where the point is behind the camera.
    pub y: f32,
    /// Distance along the principal axis, in world units; not positive for points behind the camera.
    pub depth: f32,
    /// The point is more than 1e-20 in front of the camera's plane: `x` and `y` are defined, and infinite where they
    /// leave the range of `f32`.
    pub in_front: bool,
    /// The point is in front of the camera and inside the image.
    pub in_image: bool,
}

/// A pinhole camera with its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Camera {
    /// The camera's centre and orientation.
    pub pose: Pose,
    /// The intrinsics.
    pub pinhole: Pinhole,
}

impl Camera {
    /// The ray through the continuous image coordinate `(x, y)`; pixel centres are at halves. The direction is 0 for
    /// coordinates so large that its square overflows: from some 1e19 focal lengths on.
    #[inline]
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let direction_world = self.block(0).towards(x, y);
        Ray { origin_world: self.pose.centre_world(), direction_world: direction_world / direction_world.length() }
    }

    /// Where a world point appears; see [`CameraBlock::project`].
    #[inline]
    pub fn project(&self, point_world: Vec3) -> Projection {
        self.block(0).project(point_world)
    }

    /// The camera as plain data for kernels. `first_texel` is where its image starts in a buffer of several images.
    #[inline]
    pub fn block(&self, first_texel: u32) -> CameraBlock {
        let Pinhole { focal, principal, width, height } = self.pinhole;
        CameraBlock {
            pose: self.pose.block(),
            intrinsics: [focal[0], focal[1], principal[0], principal[1]],
            width,
            height,
            first_texel,
            padding: 0,
        }
    }
}

/// A camera as plain data: what a kernel reads from a buffer. Made from a checked [`Camera`] by [`Camera::block`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CameraBlock {
    /// The camera's centre and orientation.
    pub pose: PoseBlock,
    /// Focal lengths x, y and principal point x, y, in pixels.
    pub intrinsics: [f32; 4],
    /// Width of the image in pixels, at least 1.
    pub width: u32,
    /// Height of the image in pixels, at least 1.
    pub height: u32,
    /// Index of the image's first texel in a buffer of several images.
    pub first_texel: u32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<CameraBlock>() == 80);

impl CameraBlock {
    /// The camera's centre in world coordinates.
    #[inline]
    pub fn centre_world(&self) -> Vec3 {
        self.pose.centre_world()
    }

    /// The world direction from the centre through the image coordinate `(x, y)`, of length such that its component
    /// along the principal axis is 1: the point at camera depth `z` is `centre + z * towards(x, y)`.
    #[inline]
    pub fn towards(&self, x: f32, y: f32) -> Vec3 {
        let [focal_x, focal_y, principal_x, principal_y] = self.intrinsics;
        let (across, below) = ((x - principal_x) / focal_x, (y - principal_y) / focal_y);
        self.pose.rotate_to_world(across, below, 1.0)
    }

    /// Where a world point appears. Points at or behind the camera's plane are masked (`in_front` is false, the
    /// coordinates are 0) instead of being mirrored into the image, and never divide by zero.
    #[inline]
    pub fn project(&self, point_world: Vec3) -> Projection {
        let [focal_x, focal_y, principal_x, principal_y] = self.intrinsics;
        let place = self.pose.rotate_to_camera(point_world - self.centre_world());
        let depth = place.z;
        // The smallest depth whose reciprocal and products stay finite for every coordinate in range.
        if !(depth > 1.0e-20) {
            return Projection { x: 0.0, y: 0.0, depth, in_front: false, in_image: false };
        }
        let inverse_depth = 1.0 / depth;
        let x = focal_x * (place.x * inverse_depth) + principal_x;
        let y = focal_y * (place.y * inverse_depth) + principal_y;
        let in_image = x >= 0.0 && y >= 0.0 && x <= self.width as f32 && y <= self.height as f32;
        Projection { x, y, depth, in_front: true, in_image }
    }

    /// Index in the texel buffer of the pixel that contains an image coordinate inside the image.
    #[inline]
    pub fn texel_at(&self, x: f32, y: f32) -> usize {
        let column = (x as u32).min(self.width - 1);
        let row = (y as u32).min(self.height - 1);
        self.first_texel as usize + row as usize * self.width as usize + column as usize
    }
}
