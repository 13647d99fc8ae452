//! Arrays whose elements are loaded as vectors: four numbers in a load, where a device would otherwise take four.
//!
//! An entry point takes an array of vectors instead of one of structs or of single numbers; it has the same bytes. Structs
//! are loaded as integers, so that no word passes as a float that it is not.

use spirv_std::glam::{UVec4, Vec2, Vec4};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::frustum::SweptView;

/// A [`CameraBlock`].
pub type CameraWords = [UVec4; 5];
/// A [`SweptView`].
pub type ViewWords = [UVec4; 8];
/// A [`RayPoint`].
pub type PointWords = [UVec4; 2];
/// [`Planes`].
pub type PlaneVectors = [Vec4; 4];

const _: () = assert!(size_of::<CameraWords>() == size_of::<CameraBlock>());
const _: () = assert!(size_of::<ViewWords>() == size_of::<SweptView>());
const _: () = assert!(size_of::<PointWords>() == size_of::<RayPoint>());
const _: () = assert!(size_of::<PlaneVectors>() == size_of::<Planes>());

/// Numbers by fours.
#[derive(Clone, Copy)]
pub(crate) struct Fours<'a, F: ?Sized>(pub(crate) &'a F);

impl<F: Fetch<Vec4> + ?Sized> Fetch<[f32; 4]> for Fours<'_, F> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> [f32; 4] {
        self.0.fetch(index).to_array()
    }
}

/// Numbers by twos.
#[derive(Clone, Copy)]
pub(crate) struct Twos<'a>(pub(crate) &'a [Vec2]);

impl Fetch<[f32; 2]> for Twos<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> [f32; 2] {
        self.0[index].to_array()
    }
}

/// Groups of planes.
#[derive(Clone, Copy)]
pub(crate) struct Groups<'a>(pub(crate) &'a [PlaneVectors]);

impl Fetch<Planes> for Groups<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> Planes {
        let [a, b, c, d] = self.0[index];
        [a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, c.w, d.x, d.y, d.z, d.w]
    }
}

/// A group of planes as it is stored.
#[inline(always)]
pub(crate) fn plane_vectors(planes: &Planes) -> PlaneVectors {
    let four = |first: usize| Vec4::new(planes[first], planes[first + 1], planes[first + 2], planes[first + 3]);
    [four(0), four(4), four(8), four(12)]
}

/// Cameras.
#[derive(Clone, Copy)]
pub(crate) struct Cameras<'a>(pub(crate) &'a [CameraWords]);

impl Fetch<CameraBlock> for Cameras<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> CameraBlock {
        let [right, down, forward, intrinsics, last] = self.0[index];
        camera(right, down, forward, intrinsics, last)
    }
}

/// The views of a frustum.
#[derive(Clone, Copy)]
pub(crate) struct Views<'a>(pub(crate) &'a [ViewWords]);

impl Fetch<SweptView> for Views<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> SweptView {
        let [right, down, forward, intrinsics, size, gain, map, rest] = self.0[index];
        SweptView {
            camera: camera(right, down, forward, intrinsics, size),
            gain: floats(gain),
            weight: f32::from_bits(map.x),
            disparity_step: f32::from_bits(map.y),
            first_disparity: map.z,
            map_width: map.w,
            map_height: rest.x,
            padding: [0; 3],
        }
    }
}

/// Points of rays.
#[derive(Clone, Copy)]
pub(crate) struct Points<'a>(pub(crate) &'a [PointWords]);

impl Fetch<RayPoint> for Points<'_> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> RayPoint {
        let [there, along] = self.0[index];
        let ([x, y, z, length], [dx, dy, dz, _]) = (floats(there), floats(along));
        RayPoint { position: [x, y, z], length, direction: [dx, dy, dz], sample: along.w }
    }
}

#[inline(always)]
fn camera(right: UVec4, down: UVec4, forward: UVec4, intrinsics: UVec4, last: UVec4) -> CameraBlock {
    CameraBlock {
        pose: PoseBlock { right: floats(right), down: floats(down), forward: floats(forward) },
        intrinsics: floats(intrinsics),
        width: last.x,
        height: last.y,
        first_texel: last.z,
        padding: 0,
    }
}

#[inline(always)]
fn floats(words: UVec4) -> [f32; 4] {
    [f32::from_bits(words.x), f32::from_bits(words.y), f32::from_bits(words.z), f32::from_bits(words.w)]
}
