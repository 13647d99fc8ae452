//! Calls what firmware calls, and every function of the C interface, on memory of exactly the size that is asked for.
//!
//! `tests/embedded/miri.rs` runs it as it is and under Miri, where that is. The numbers that it prints are those of the
//! host.

use std::ffi::CStr;
use viewfuse_capi_linked::fuse::viewfuse_fuse_views;
use viewfuse_capi_linked::ray::{self, Pixel, Ray};
use viewfuse_capi_linked::schedule::{self, Preconditioning, Step};
use viewfuse_capi_linked::status::{Status, viewfuse_status_text};
use viewfuse_capi_linked::weigh::{self, ATTENTION_PARAMETERS, Scheme};
use viewfuse_list::Inputs;
use viewfuse_list::attended::attention;
use viewfuse_list::formulas::formulas;
use viewfuse_list::quantised::quantised;
use viewfuse_list::sampled::sampling;

/// A number that depends on all bits of all numbers of a list.
fn digest(list: impl Fn(&mut dyn FnMut(&str, f32))) -> u64 {
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    list(&mut |_, value| digest = (digest ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3));
    digest
}

fn main() {
    let inputs = Inputs::STANDARD;
    println!("formulas {:016x}", digest(|emit| formulas(inputs, emit)));
    println!("samplers {:016x}", digest(|emit| sampling(inputs, emit)));
    println!("quantised {:016x}", digest(|emit| quantised(inputs, emit)));
    // Interpreting hundreds of thousands of products takes minutes.
    if std::env::args().any(|argument| argument == "all") {
        println!("attention {:016x}", digest(|emit| attention(inputs, emit)));
    }
    weights();
    fusion();
    rays();
    pictures();
    println!("C interface done");
}

/// Poses on the x axis, `[count][4][4]`.
fn poses(count: usize) -> Vec<f32> {
    let pose = |x: f32| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    (0..count).flat_map(|view| pose(view as f32)).collect()
}

fn weights() {
    let scheme = Scheme { formula: 3, choice: 0, parameter: 1.0 };
    for (most, function) in [
        (8, weigh::viewfuse_weigh_8 as unsafe extern "C" fn(_, _, _, _, _) -> _),
        (16, weigh::viewfuse_weigh_16),
        (32, weigh::viewfuse_weigh_32),
    ] {
        for count in [0, 1, most, most + 1] {
            let (sources, target) = (poses(count.min(most)), poses(1));
            let mut weights = vec![f32::NAN; count.min(most)];
            // SAFETY: the arrays have the shapes that the function asks for.
            let status: Status =
                unsafe { function(&scheme, sources.as_ptr(), count as u32, target.as_ptr(), weights.as_mut_ptr()) };
            match status {
                Status::Ok => assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1.0e-6),
                status => assert!(status == Status::Count && (count == 0 || count > most)),
            }
        }
    }
    let parameters = vec![0.01_f32; ATTENTION_PARAMETERS as usize];
    let (sources, mut weights) = (poses(2), [0.0; 2]);
    let at = sources.as_ptr();
    // SAFETY: as above.
    let status = unsafe { weigh::viewfuse_attend_8(parameters.as_ptr(), at, 2, at, weights.as_mut_ptr()) };
    assert_eq!(status, Status::Ok);
    // SAFETY: a pointer that is null or not aligned is refused.
    let wrong = unsafe {
        [
            weigh::viewfuse_weigh_8(&scheme, std::ptr::null(), 2, at, weights.as_mut_ptr()),
            weigh::viewfuse_weigh_8(&scheme, at.wrapping_byte_add(1), 2, at, weights.as_mut_ptr()),
        ]
    };
    assert_eq!(wrong, [Status::Pointer; 2]);
}

fn fusion() {
    let weights = vec![0.25_f32; 4];
    let mut latents: Vec<f32> = (0..12).map(|index| index as f32).collect();
    let mut fused = vec![0.0; 3];
    // SAFETY: the arrays have the shapes that the function asks for.
    let status = unsafe { viewfuse_fuse_views(weights.as_ptr(), latents.as_ptr(), 4, 3, fused.as_mut_ptr()) };
    assert_eq!((status, fused.as_slice()), (Status::Ok, [4.5, 5.5, 6.5].as_slice()));
    // Over the first view's latents, which the function allows.
    let first = latents.as_mut_ptr();
    // SAFETY: as above; both pointers come from the same one.
    let status = unsafe { viewfuse_fuse_views(weights.as_ptr(), first, 4, 3, first) };
    assert_eq!((status, &latents[..3]), (Status::Ok, fused.as_slice()));
}

fn rays() {
    let mut ray = Ray { accumulated: [0.0; 3], weighted_depth: 0.0, optical_depth: 0.0, transmittance: 0.0 };
    let mut pixel = Pixel { rgb: [0.0; 3], depth: 0.0, opacity: 0.0 };
    let colour = [0.5_f32, 0.25, 1.0];
    // SAFETY: pointers to values that live.
    let statuses = unsafe {
        [
            ray::viewfuse_ray_start(&mut ray),
            ray::viewfuse_ray_add(&mut ray, colour.as_ptr(), 0.7, 1.0),
            ray::viewfuse_ray_add(&mut ray, colour.as_ptr(), f32::INFINITY, 2.0),
            ray::viewfuse_ray_finish(&ray, colour.as_ptr(), 9.0, &mut pixel),
            ray::viewfuse_ray_start(&mut ray),
            ray::viewfuse_ray_add_solid(&mut ray, colour.as_ptr(), 0.5, 1.0),
        ]
    };
    assert_eq!(statuses, [Status::Ok; 6]);
    assert!((pixel.rgb[0] - 0.5).abs() < 1.0e-6 && pixel.opacity == 1.0);
    // SAFETY: a static text.
    assert!(!unsafe { CStr::from_ptr(viewfuse_status_text(7)) }.is_empty());
}

fn pictures() {
    let mut factors = Preconditioning { skip: 0.0, output: 0.0, input: 0.0, noise: 0.0 };
    let mut step = Step { remaining: 0.0, correction: 0.0 };
    let (mut level, mut picture, other) = (0.0, vec![1.0_f32; 5], vec![0.5_f32; 5]);
    let (at, there) = (picture.as_mut_ptr(), other.as_ptr());
    // SAFETY: arrays of 5 numbers; the output may be the noisy picture.
    let statuses = unsafe {
        [
            schedule::viewfuse_noise_level(0.002, 80.0, 3, 25, &mut level),
            schedule::viewfuse_preconditioning_at(level, &mut factors),
            schedule::viewfuse_step_between(level, 0.5 * level, &mut step),
            schedule::viewfuse_network_input(&factors, at, 5, at),
            schedule::viewfuse_denoised(&factors, at, there, 5, at),
            schedule::viewfuse_step_euler(&step, at, there, 5, at),
            schedule::viewfuse_step_correct(&step, at, there, there, 5, at),
        ]
    };
    assert_eq!(statuses, [Status::Ok; 7]);
    assert!(picture.iter().all(|value| value.is_finite()));
}
