//! Gaussians, projected, sorted and composited.

use crate::{Emit, Inputs, emit_all, wave};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, colour_along, composite_row, nearest_first, project};
use viewfuse_core::pose::Pose;

/// Columns and rows of the pictures.
pub const SIDE: usize = 64;
/// Depth before which nothing is drawn.
pub const NEAR: f32 = 0.2;
/// What lies behind everything.
const BACKGROUND: [f32; 3] = [0.25, 0.5, 0.75];

/// A camera in front of the scene.
pub fn camera(inputs: Inputs) -> CameraBlock {
    let centre = Vec3::new(0.5 * wave(inputs, 900), -0.5, -3.0);
    let pose = Pose::look_at(centre, Vec3::ZERO, Vec3::NEG_Y);
    let pinhole = Pinhole::new([80.0; 2], [32.0; 2], SIDE as u32, SIDE as u32);
    let (Ok(pose), Ok(pinhole)) = (pose, pinhole) else { panic!("no camera") };
    Camera { pose, pinhole }.block(0)
}

/// `N` Gaussians of a ball of radius 1, of the size that covers it.
pub fn scene<const N: usize>(inputs: Inputs) -> [GaussianBlock; N] {
    let mut gaussians = [GaussianBlock::default(); N];
    for (index, gaussian) in gaussians.iter_mut().enumerate() {
        let number = |offset: u32| wave(inputs, 16 * index as u32 + offset);
        let f_rest =
            [number(0), number(1), number(2), number(3), number(4), number(5), number(6), number(7), number(8)];
        let position = [number(9), number(10), number(11)];
        *gaussian = GaussianBlock {
            position,
            opacity: 2.0 * number(12),
            log_scales: [number(13) - 3.0, number(14) - 3.0, number(15) - 3.0],
            rotation: [number(3), number(5), number(7), number(9)],
            colour: colour_along([number(1), number(4), number(6)], &f_rest, 1, Vec3::from_array(position)),
            ..GaussianBlock::default()
        };
    }
    gaussians
}

/// The Gaussians in the image, and their order.
pub fn projected<const N: usize>(
    gaussians: &[GaussianBlock; N],
    camera: &CameraBlock,
    projected: &mut [ProjectedGaussian; N],
    order: &mut [u32; N],
) {
    for (gaussian, splat) in gaussians.iter().zip(projected.iter_mut()) {
        *splat = project(gaussian, camera, NEAR);
    }
    nearest_first(projected, order);
}

/// A row of the picture.
pub fn row<const N: usize>(projected: &[ProjectedGaussian; N], order: &[u32; N], row: u32) -> [Composite<3>; SIDE] {
    let pixels: [Compositor<3>; SIDE] = composite_row(projected, order, N as u32, row);
    pixels.map(|pixel| pixel.finish(&BACKGROUND, 0.0))
}

/// The list of Gaussians: what a few look like in the image, and two rows of the picture.
pub fn splatting(inputs: Inputs, emit: Emit) {
    const COUNT: usize = 32;
    let gaussians = scene::<COUNT>(inputs);
    let (mut seen, mut order) = ([ProjectedGaussian::default(); COUNT], [0; COUNT]);
    projected(&gaussians, &camera(inputs), &mut seen, &mut order);
    for splat in &seen {
        emit_all("conic", &splat.conic, emit);
        emit_all("place", &splat.mean, emit);
        emit_all("extent", &splat.extent, emit);
        emit_all("colour", &splat.colour, emit);
    }
    for y in [20, 33] {
        for pixel in row(&seen, &order, y) {
            emit_all("pixel", &pixel.channels, emit);
        }
    }
}
