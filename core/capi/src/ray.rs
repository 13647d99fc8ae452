//! Compositing: samples along a ray become a pixel.

use crate::lent::{Input, read, write};
use crate::status::Status;
use viewfuse_core::composite::{Compositor, RayBlock};
use viewfuse_core::fetch::Fetch;

/// The state of compositing along a ray. Initialised by viewfuse_ray_start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Weighted sums of red, green and blue so far.
    pub accumulated: [f32; 3],
    /// Weighted sum of the depths so far.
    pub weighted_depth: f32,
    /// Sum of the optical depths.
    pub optical_depth: f32,
    /// Transmittance of the samples so far, from 0 to 1. Early termination: stop where it is below a threshold. The
    /// samples behind change a colour by at most this fraction of its range.
    pub transmittance: f32,
}

/// The composited pixel of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Pixel {
    /// Red, green, blue, composited over the background.
    pub rgb: [f32; 3],
    /// Mean depth of what was hit.
    pub depth: f32,
    /// Opacity: 1 minus the transmittance, from 0 to 1.
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

/// Starts a ray: no samples yet, transmittance 1.
///
/// # Safety
/// The pointer is null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_start(ray: *mut Ray) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe { write(ray, Ray::from(Compositor::<3>::START.block())) })
}

/// Adds the next sample, front to back: its colour `[3]`, its optical depth (density times length; negative or NaN
/// counts as 0, infinity as opaque) and its distance along the ray.
///
/// # Safety
/// Pointers are null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_add(ray: *mut Ray, rgb: *const f32, optical_depth: f32, depth: f32) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe {
        add(ray, rgb, |ray, rgb| {
            ray.add(rgb, optical_depth, depth);
        })
    })
}

/// Adds the next sample of a solid with a soft boundary, front to back: its colour `[3]`, its occupancy from 0 to 1
/// (NaN counts as 0), which is a lower bound of the ray's opacity, and its distance along the ray. For one ray use
/// either this or viewfuse_ray_add.
///
/// # Safety
/// Pointers are null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_ray_add_solid(ray: *mut Ray, rgb: *const f32, occupancy: f32, depth: f32) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe {
        add(ray, rgb, |ray, rgb| {
            ray.add_solid(rgb, occupancy, depth);
        })
    })
}

/// The pixel, with the background `[3]` behind everything; `empty_depth` is the depth of a ray that hit nothing. The
/// ray is not changed.
///
/// # Safety
/// Pointers are null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
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
