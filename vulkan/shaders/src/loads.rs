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
use viewfuse_kernels::store::Store;

/// Elements that can be loaded as vectors.
pub trait InVectors: Sized {
    /// As many vectors as have the element's bytes.
    type Vectors: Copy;

    /// The element.
    fn from_vectors(vectors: Self::Vectors) -> Self;
}

/// Elements that can be stored as vectors, too.
pub trait IntoVectors: InVectors {
    /// The element as it is stored.
    fn into_vectors(self) -> Self::Vectors;
}

/// Elements that are loaded as vectors.
#[derive(Clone, Copy)]
pub(crate) struct Vectors<'a, F: ?Sized>(pub(crate) &'a F);

impl<T: InVectors, F: Fetch<T::Vectors> + ?Sized> Fetch<T> for Vectors<'_, F> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        T::from_vectors(self.0.fetch(index))
    }
}

/// Elements that are stored as vectors.
pub(crate) struct VectorsMut<'a, F: ?Sized>(pub(crate) &'a mut F);

impl<T: IntoVectors, F: Store<T::Vectors> + ?Sized> Store<T> for VectorsMut<'_, F> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: T) {
        self.0.store(index, value.into_vectors());
    }
}

impl InVectors for [f32; 4] {
    type Vectors = Vec4;

    #[inline(always)]
    fn from_vectors(four: Vec4) -> [f32; 4] {
        four.to_array()
    }
}

impl IntoVectors for [f32; 4] {
    #[inline(always)]
    fn into_vectors(self) -> Vec4 {
        Vec4::from_array(self)
    }
}

impl InVectors for [f32; 2] {
    type Vectors = Vec2;

    #[inline(always)]
    fn from_vectors(two: Vec2) -> [f32; 2] {
        two.to_array()
    }
}

impl InVectors for Planes {
    type Vectors = [Vec4; 4];

    #[inline(always)]
    fn from_vectors([a, b, c, d]: [Vec4; 4]) -> Planes {
        [a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, c.w, d.x, d.y, d.z, d.w]
    }
}

impl IntoVectors for Planes {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 4] {
        let four = |first: usize| Vec4::new(self[first], self[first + 1], self[first + 2], self[first + 3]);
        [four(0), four(4), four(8), four(12)]
    }
}

impl InVectors for CameraBlock {
    type Vectors = [UVec4; 5];

    #[inline(always)]
    fn from_vectors([right, down, forward, intrinsics, last]: [UVec4; 5]) -> CameraBlock {
        camera(right, down, forward, intrinsics, last)
    }
}

impl InVectors for SweptView {
    type Vectors = [UVec4; 8];

    #[inline(always)]
    fn from_vectors([right, down, forward, intrinsics, size, gain, map, rest]: [UVec4; 8]) -> SweptView {
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

impl InVectors for RayPoint {
    type Vectors = [UVec4; 2];

    #[inline(always)]
    fn from_vectors([there, along]: [UVec4; 2]) -> RayPoint {
        let ([x, y, z, length], [dx, dy, dz, _]) = (floats(there), floats(along));
        RayPoint { position: [x, y, z], length, direction: [dx, dy, dz], sample: along.w }
    }
}

const _: () = assert!(size_of::<<CameraBlock as InVectors>::Vectors>() == size_of::<CameraBlock>());
const _: () = assert!(size_of::<<SweptView as InVectors>::Vectors>() == size_of::<SweptView>());
const _: () = assert!(size_of::<<RayPoint as InVectors>::Vectors>() == size_of::<RayPoint>());
const _: () = assert!(size_of::<<Planes as InVectors>::Vectors>() == size_of::<Planes>());

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
