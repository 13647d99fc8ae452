//! A picture of 64 x 64 of a thousand Gaussians, measured as the calls of `calls`, for a processor with an FPU, and
//! memory. Of the picture one row is made, through the middle, where most of them are: a trace of all takes minutes.
#![no_std]
#![no_main]

use core::hint::black_box;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::composite::Composite;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, nearest_first, project};
use viewfuse_firmware::finish;
use viewfuse_list::Inputs;
use viewfuse_list::splatted::{NEAR, SIDE, camera, row, scene};

/// Gaussians of the scene.
const COUNT: usize = 1000;

viewfuse_firmware::measured! {
    fn measured_project(gaussian: &GaussianBlock, camera: &CameraBlock) -> ProjectedGaussian {
        project(gaussian, camera, NEAR)
    }

    fn measured_sort(projected: &[ProjectedGaussian; COUNT], order: &mut [u32; COUNT]) {
        nearest_first(projected, order);
    }

    fn measured_row(projected: &[ProjectedGaussian; COUNT], order: &[u32; COUNT], number: u32) -> [Composite<3>; SIDE] {
        row(projected, order, number)
    }
}

#[viewfuse_firmware::entry]
fn main() -> ! {
    let inputs = black_box(Inputs::STANDARD);
    let camera = camera(inputs);
    let gaussians = scene::<COUNT>(inputs);
    let (mut projected, mut order) = ([ProjectedGaussian::default(); COUNT], [0; COUNT]);
    black_box(measured_project(&gaussians[0], &camera));
    for (gaussian, splat) in gaussians.iter().zip(projected.iter_mut()) {
        *splat = project(gaussian, &camera, NEAR);
    }
    measured_sort(&projected, &mut order);
    black_box(measured_row(&projected, &order, SIDE as u32 / 2));
    finish()
}
