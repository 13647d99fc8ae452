//! Samples along a ray become a pixel.

use crate::lent::{Input, read, write};
use crate::status::Status;
use viewfuse_core::composite::{Compositor, RayBlock};
use viewfuse_core::pages::Fetch;

/// A ray on its way from the camera. Made by viewfuse_ray_start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Red, green and blue gathered so far.
    pub accumulated: [f32; 3],
    /// Depth gathered so far, times its weight.
    pub weighted_depth: f32,
    /// Sum of the optical depths.
    pub optical_depth: f32,
    /// How much light passes what was met so far, in 0 to 1. The ray may end where this is so small that nothing behind
    /// can matter: a colour changes by at most this much of its range.
    pub transmittance: f32,
}

/// What a ray saw.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Pixel {
    /// Red, green, blue, with the background behind.
    pub rgb: [f32; 3],
    /// Mean depth of what was hit.
    pub depth: f32,
    /// How much of the background is hidden, in 0 to 1.
    pub opacity: f32,
}

impl From<RayBlock> for Ray {
    fn from(block: RayBlock) -> Ray {
        let RayBlock { accumulated, weighted_depth, optical_depth, transmittance } = block;
        Ray { accumulated, weighted_depth, optical_depth, transmittance }
    }
}

impl Ray {
    fn compositor(self) -> Compositor<3> {
        let Ray { accumulated, weighted_depth, optical_depth, transmittance } = self;
        RayBlock { accumulated, weighted_depth, optical_depth, transmittance }.compositor()
    }
}

/// A ray that has met nothing yet.
///
/// # Safety
/// The pointer is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_start(ray: *mut Ray) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe { write(ray, Ray::from(Compositor::<3>::START.block())) })
}

/// Adds the next sample, front to back: its colour `[3]`, its optical depth (density times length; negative or NaN counts
/// as 0, infinity as opaque) and its distance along the ray.
///
/// # Safety
/// Pointers are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_add(ray: *mut Ray, rgb: *const f32, optical_depth: f32, depth: f32) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe {
        add(ray, rgb, |ray, rgb| {
            ray.add(rgb, optical_depth, depth);
        })
    })
}

/// Adds the next sample of a solid with a soft boundary, front to back: its colour `[3]`, its occupancy in 0 to 1 (NaN
/// counts as 0), which the ray's opacity will at least be, and its distance along the ray. For one ray use either this or
/// viewfuse_ray_add.
///
/// # Safety
/// Pointers are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_add_solid(ray: *mut Ray, rgb: *const f32, occupancy: f32, depth: f32) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe {
        add(ray, rgb, |ray, rgb| {
            ray.add_solid(rgb, occupancy, depth);
        })
    })
}

/// The pixel, with the background `[3]` behind everything; `empty_depth` is the depth of a ray that hit nothing. The ray
/// stays as it is.
///
/// # Safety
/// Pointers are null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_finish(
    ray: *const Ray,
    background: *const f32,
    empty_depth: f32,
    pixel: *mut Pixel,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { finish(ray, background, empty_depth, pixel) })
}

/// # Safety
/// Pointers are null or valid.
unsafe fn add(ray: *mut Ray, rgb: *const f32, add: impl FnOnce(&mut Compositor<3>, &[f32; 3])) -> Result<(), Status> {
    // SAFETY: the caller's promise; every bit pattern is a ray.
    let (state, rgb) = unsafe { (read(ray)?, three(rgb)?) };
    let mut compositor = state.compositor();
    add(&mut compositor, &rgb);
    // SAFETY: the caller's promise.
    unsafe { write(ray, Ray::from(compositor.block())) }
}

/// # Safety
/// Pointers are null or valid.
unsafe fn finish(ray: *const Ray, background: *const f32, empty_depth: f32, pixel: *mut Pixel) -> Result<(), Status> {
    // SAFETY: the caller's promise; every bit pattern is a ray.
    let (state, background) = unsafe { (read(ray)?, three(background)?) };
    let composite = state.compositor().finish(&background, empty_depth);
    let seen = Pixel { rgb: composite.channels, depth: composite.depth, opacity: composite.opacity };
    // SAFETY: the caller's promise.
    unsafe { write(pixel, seen) }
}

/// # Safety
/// The pointer is null or valid for three floats.
unsafe fn three(first: *const f32) -> Result<[f32; 3], Status> {
    // SAFETY: the caller's promise.
    let numbers = unsafe { Input::new(first, 3) }?;
    Ok([numbers.fetch(0), numbers.fetch(1), numbers.fetch(2)])
}
