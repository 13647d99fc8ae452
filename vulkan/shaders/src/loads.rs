//! Arrays whose elements are loaded as vectors: four numbers in a load, where a device would otherwise take four.
//!
//! An entry point takes an array of vectors instead of one of structs or of single numbers; it has the same bytes.
//! Structs are loaded as integers, so that no word passes as a float that it is not.

use spirv_std::glam::{UVec4, Vec2, Vec4};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian};
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::gaussians::blend_gradient::SplatGradient;
use viewfuse_kernels::gaussians::steps::{HarmonicTerm, ParticleState, TermState};
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

impl InVectors for GaussianBlock {
    type Vectors = [Vec4; 4];

    #[inline(always)]
    fn from_vectors([place, scales, rotation, colour]: [Vec4; 4]) -> GaussianBlock {
        GaussianBlock {
            position: [place.x, place.y, place.z],
            opacity: place.w,
            log_scales: [scales.x, scales.y, scales.z],
            padding: 0.0,
            rotation: rotation.to_array(),
            colour: [colour.x, colour.y, colour.z],
            padding_end: 0.0,
        }
    }
}

impl IntoVectors for GaussianBlock {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 4] {
        let ([x, y, z], [a, b, c], [red, green, blue]) = (self.position, self.log_scales, self.colour);
        [
            Vec4::new(x, y, z, self.opacity),
            Vec4::new(a, b, c, 0.0),
            Vec4::from_array(self.rotation),
            Vec4::new(red, green, blue, 0.0),
        ]
    }
}

impl InVectors for ProjectedGaussian {
    type Vectors = [Vec4; 4];

    #[inline(always)]
    fn from_vectors([mean, conic, colour, extent]: [Vec4; 4]) -> ProjectedGaussian {
        ProjectedGaussian {
            mean: [mean.x, mean.y],
            depth: mean.z,
            opacity: mean.w,
            conic: [conic.x, conic.y, conic.z],
            padding: 0.0,
            colour: [colour.x, colour.y, colour.z],
            padding_colour: 0.0,
            extent: [extent.x, extent.y],
            padding_end: [0.0; 2],
        }
    }
}

impl IntoVectors for ProjectedGaussian {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 4] {
        let ([x, y], [xx, xy, yy], [red, green, blue], [right, down]) =
            (self.mean, self.conic, self.colour, self.extent);
        [
            Vec4::new(x, y, self.depth, self.opacity),
            Vec4::new(xx, xy, yy, 0.0),
            Vec4::new(red, green, blue, 0.0),
            Vec4::new(right, down, 0.0, 0.0),
        ]
    }
}

impl InVectors for SplatGradient {
    type Vectors = [Vec4; 3];

    #[inline(always)]
    fn from_vectors([first, squares, colour]: [Vec4; 3]) -> SplatGradient {
        SplatGradient {
            opacity: first.x,
            along: [first.y, first.z],
            padding: 0.0,
            squares: [squares.x, squares.y, squares.z],
            unused: 0.0,
            colour: [colour.x, colour.y, colour.z],
            behind: 0.0,
        }
    }
}

impl IntoVectors for SplatGradient {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 3] {
        let ([xx, xy, yy], [red, green, blue]) = (self.squares, self.colour);
        [
            Vec4::new(self.opacity, self.along[0], self.along[1], 0.0),
            Vec4::new(xx, xy, yy, 0.0),
            Vec4::new(red, green, blue, 0.0),
        ]
    }
}

impl InVectors for ParticleState {
    type Vectors = [UVec4; 8];

    #[inline(always)]
    fn from_vectors([first, second, third, fourth, fifth, sixth, seventh, last]: [UVec4; 8]) -> ParticleState {
        let ([a, b], [c, d], [e, f], [g, h]) = (pairs(first), pairs(second), pairs(third), pairs(fourth));
        let ([i, j], [k, l], [m, n]) = (pairs(fifth), pairs(sixth), pairs(seventh));
        ParticleState {
            moments: [a, b, c, d, e, f, g, h, i, j, k, l, m, n],
            step_count: last.x,
            moved: f32::from_bits(last.y),
            moved_count: last.z,
            rest_count: last.w,
        }
    }
}

impl IntoVectors for ParticleState {
    #[inline(always)]
    fn into_vectors(self) -> [UVec4; 8] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n] = self.moments;
        let last = UVec4::new(self.step_count, self.moved.to_bits(), self.moved_count, self.rest_count);
        [words(a, b), words(c, d), words(e, f), words(g, h), words(i, j), words(k, l), words(m, n), last]
    }
}

impl InVectors for HarmonicTerm {
    type Vectors = [Vec4; 1];

    #[inline(always)]
    fn from_vectors([value]: [Vec4; 1]) -> HarmonicTerm {
        HarmonicTerm { value: [value.x, value.y, value.z], padding: 0.0 }
    }
}

impl IntoVectors for HarmonicTerm {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 1] {
        let [x, y, z] = self.value;
        [Vec4::new(x, y, z, 0.0)]
    }
}

impl InVectors for TermState {
    type Vectors = [Vec4; 2];

    #[inline(always)]
    fn from_vectors([first, last]: [Vec4; 2]) -> TermState {
        TermState { moments: [[first.x, first.y], [first.z, first.w], [last.x, last.y]], padding: [0.0; 2] }
    }
}

impl IntoVectors for TermState {
    #[inline(always)]
    fn into_vectors(self) -> [Vec4; 2] {
        let [[a, b], [c, d], [e, f]] = self.moments;
        [Vec4::new(a, b, c, d), Vec4::new(e, f, 0.0, 0.0)]
    }
}

const _: () = assert!(size_of::<<ParticleState as InVectors>::Vectors>() == size_of::<ParticleState>());
const _: () = assert!(size_of::<<HarmonicTerm as InVectors>::Vectors>() == size_of::<HarmonicTerm>());
const _: () = assert!(size_of::<<TermState as InVectors>::Vectors>() == size_of::<TermState>());
const _: () = assert!(size_of::<<CameraBlock as InVectors>::Vectors>() == size_of::<CameraBlock>());
const _: () = assert!(size_of::<<SweptView as InVectors>::Vectors>() == size_of::<SweptView>());
const _: () = assert!(size_of::<<RayPoint as InVectors>::Vectors>() == size_of::<RayPoint>());
const _: () = assert!(size_of::<<GaussianBlock as InVectors>::Vectors>() == size_of::<GaussianBlock>());
const _: () = assert!(size_of::<<ProjectedGaussian as InVectors>::Vectors>() == size_of::<ProjectedGaussian>());
const _: () = assert!(size_of::<<SplatGradient as InVectors>::Vectors>() == size_of::<SplatGradient>());
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

#[inline(always)]
fn pairs(words: UVec4) -> [[f32; 2]; 2] {
    let [a, b, c, d] = floats(words);
    [[a, b], [c, d]]
}

#[inline(always)]
fn words([a, b]: [f32; 2], [c, d]: [f32; 2]) -> UVec4 {
    UVec4::new(a.to_bits(), b.to_bits(), c.to_bits(), d.to_bits())
}
