//! Arrays as entry points take them: structs as words, numbers by fours.

use bytemuck::{Pod, cast_slice};
use glam::{UVec4, Vec2, Vec4};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::frustum::SweptView;
use viewfuse_shaders::loads::InVectors;

/// Structs as `N` fours of words each.
fn words<T: Pod, const N: usize>(values: &[T]) -> Vec<[UVec4; N]> {
    let words: &[u32] = cast_slice(values);
    let fours = |four: usize| UVec4::from_slice(&words[4 * four..]);
    (0..values.len()).map(|value| std::array::from_fn(|four| fours(value * N + four))).collect()
}

pub(super) fn cameras(views: &[CameraBlock]) -> Vec<<CameraBlock as InVectors>::Vectors> {
    words(views)
}

pub(super) fn points(points: &[RayPoint]) -> Vec<<RayPoint as InVectors>::Vectors> {
    words(points)
}

pub(super) fn swept_views(views: &[SweptView]) -> Vec<<SweptView as InVectors>::Vectors> {
    words(views)
}

pub(super) fn fours(values: &[[f32; 4]]) -> Vec<Vec4> {
    values.iter().map(|four| Vec4::from_array(*four)).collect()
}

pub(super) fn arrays(values: &[Vec4]) -> Vec<[f32; 4]> {
    values.iter().map(|four| four.to_array()).collect()
}

pub(super) fn twos(values: &[[f32; 2]]) -> Vec<Vec2> {
    values.iter().map(|two| Vec2::from_array(*two)).collect()
}

pub(super) fn groups(values: &[Planes]) -> Vec<<Planes as InVectors>::Vectors> {
    let group = |planes: &Planes| std::array::from_fn(|four| Vec4::from_slice(&planes[4 * four..]));
    values.iter().map(group).collect()
}

pub(super) fn planes(values: &[<Planes as InVectors>::Vectors]) -> Vec<Planes> {
    let group = |group: &<Planes as InVectors>::Vectors| std::array::from_fn(|plane| group[plane / 4][plane % 4]);
    values.iter().map(group).collect()
}
