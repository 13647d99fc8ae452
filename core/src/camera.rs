//! Pinhole cameras: rays through pixels and projections of points.
//!
//! Image coordinates are continuous, in pixels, x to the right and y down, the origin at the outer corner of the top
//! left pixel: the centre of pixel `(column, row)` is `(column + 0.5, row + 0.5)` and the image covers
//! `[0, width] x [0, height]`.

use crate::math::abs;
use crate::pose::Pose;
use glam::Vec3;

/// Why numbers are not a pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinholeError {
    /// A focal length is not a finite positive number.
    Focal,
    /// A coordinate of the principal point is not finite.
    Principal,
    /// Width or height is zero or above 2^20.
    Size,
}

/// Intrinsics of a camera without distortion, checked when built.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// [`PinholeError`] names the first quantity that is not usable.
    pub fn new(focal: [f32; 2], principal: [f32; 2], width: u32, height: u32) -> Result<Pinhole, PinholeError> {
        let usable = |f: f32| f > 0.0 && f <= f32::MAX;
        if !(usable(focal[0]) && usable(focal[1])) {
            return Err(PinholeError::Focal);
        }
        if !(abs(principal[0]) <= f32::MAX && abs(principal[1]) <= f32::MAX) {
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
    /// [`PinholeError::Size`] for an unusable size.
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
pub struct Ray {
    /// Where it starts, in world coordinates.
    pub origin_world: Vec3,
    /// Unit vector along it, in world coordinates.
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
pub struct Projection {
    /// Continuous image coordinate to the right, in pixels. 0 where the point is behind the camera.
    pub x: f32,
    /// Continuous image coordinate downwards, in pixels. 0 where the point is behind the camera.
    pub y: f32,
    /// Distance along the principal axis, in world units; not positive for points behind the camera.
    pub depth: f32,
    /// The point is in front of the camera: `x` and `y` mean something.
    pub in_front: bool,
    /// The point is in front of the camera and inside the image.
    pub in_image: bool,
}

/// A pinhole camera with its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where the camera stands and how it is turned.
    pub pose: Pose,
    /// How it maps directions to pixels.
    pub pinhole: Pinhole,
}

impl Camera {
    /// The ray through the continuous image coordinate `(x, y)`; pixel centres are at halves.
    #[inline]
    pub fn ray(&self, x: f32, y: f32) -> Ray {
        let Pinhole { focal, principal, .. } = self.pinhole;
        let direction_camera = Vec3::new((x - principal[0]) / focal[0], (y - principal[1]) / focal[1], 1.0);
        let direction_world = self.pose.rotate_to_world(direction_camera);
        Ray { origin_world: self.pose.centre_world(), direction_world: direction_world / direction_world.length() }
    }

    /// Where a world point appears. Points at or behind the camera's plane are masked (`in_front` is false, the
    /// coordinates are 0) instead of being mirrored into the image, and never divide by zero.
    #[inline]
    pub fn project(&self, point_world: Vec3) -> Projection {
        let Pinhole { focal, principal, width, height } = self.pinhole;
        let p = self.pose.to_camera(point_world);
        // The smallest depth whose reciprocal and products stay finite for any point that is worth looking at.
        if !(p.z > 1.0e-20) {
            return Projection { x: 0.0, y: 0.0, depth: p.z, in_front: false, in_image: false };
        }
        let inverse_depth = 1.0 / p.z;
        let x = focal[0] * (p.x * inverse_depth) + principal[0];
        let y = focal[1] * (p.y * inverse_depth) + principal[1];
        let in_image = x >= 0.0 && y >= 0.0 && x <= width as f32 && y <= height as f32;
        Projection { x, y, depth: p.z, in_front: true, in_image }
    }
}
