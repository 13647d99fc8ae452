//! The noise levels of the diffusion denoiser, and the steps between them.

use crate::lent::{Input, Output, read, write};
use crate::status::Status;
use viewfuse_core::schedule::{self, HeunStep, NoiseSchedule};

/// The factors around the network at a noise level, for data with the standard deviation 0.5.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Preconditioning {
    /// Factor of the noisy picture in the denoised one (the skip connection).
    pub skip: f32,
    /// Factor of the network's output.
    pub output: f32,
    /// Factor of the network's input.
    pub input: f32,
    /// The network's noise conditioning: a quarter of the level's natural logarithm.
    pub noise: f32,
}

/// The factors of a step between noise levels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Step {
    /// What remains of the noise: the level reached divided by the level before.
    pub remaining: f32,
    /// Factor of the second-order correction; 0 without a correction, as in the step to level 0.
    pub correction: f32,
}

/// Noise level `index` of `count` from `sigma_max` (the first) down to `sigma_min` (the last), evenly spaced in the
/// seventh root; level `count` and everything behind is 0. The published schedule runs from 80 to 0.002. Both levels
/// lie between 1e-30 and 1e30.
///
/// # Safety
/// The pointer is null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_noise_level(
    sigma_min: f32,
    sigma_max: f32,
    index: u32,
    count: u32,
    level: *mut f32,
) -> Status {
    if count == 0 {
        return Status::Count;
    }
    match NoiseSchedule::new(sigma_min, sigma_max) {
        // SAFETY: the caller's promise.
        Ok(schedule) => Status::of(unsafe { write(level, schedule.level(index, count)) }),
        Err(_) => Status::NoiseLevel,
    }
}

/// The factors at a noise level of at least 0. At 0 the network's output counts nothing; `noise` is then that of the
/// level 1.2e-38 instead of minus infinity.
///
/// # Safety
/// The pointer is null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_preconditioning_at(sigma: f32, factors: *mut Preconditioning) -> Status {
    if !is_level(sigma) {
        return Status::NoiseLevel;
    }
    let schedule::Preconditioning { skip, output, input, noise } = schedule::Preconditioning::at(sigma);
    // SAFETY: the caller's promise.
    Status::of(unsafe { write(factors, Preconditioning { skip, output, input, noise }) })
}

/// The factors of the step from level `sigma` to level `next`, both at least 0.
///
/// # Safety
/// The pointer is null or valid.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_step_between(sigma: f32, next: f32, step: *mut Step) -> Status {
    if !(is_level(sigma) && is_level(next)) {
        return Status::NoiseLevel;
    }
    let HeunStep { remaining, correction } = HeunStep::between(sigma, next);
    // SAFETY: the caller's promise.
    Status::of(unsafe { write(step, Step { remaining, correction }) })
}

/// The network's input: `input * noisy`, for `count` values.
///
/// `noisy` and `given` are `[count]`; they may be the same array, but may not overlap otherwise.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_network_input(
    factors: *const Preconditioning,
    noisy: *const f32,
    count: u32,
    given: *mut f32,
) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe {
        preconditioning(factors).and_then(|factors| each([noisy], count, given, |[noisy]| factors.network_input(noisy)))
    })
}

/// The denoised picture from the noisy one and the network's output: `skip * noisy + output * network_output`, for
/// `count` values.
///
/// All arrays are `[count]`; `denoised` may be one of the others, but may not overlap them otherwise.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_denoised(
    factors: *const Preconditioning,
    noisy: *const f32,
    network_output: *const f32,
    count: u32,
    denoised: *mut f32,
) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe {
        preconditioning(factors).and_then(|factors| {
            each([noisy, network_output], count, denoised, |[noisy, output]| factors.denoised(noisy, output))
        })
    })
}

/// The first-order step of a picture: from the noisy one and the denoised one at the level before to the level reached.
/// The step to level 0 gives the denoised picture.
///
/// All arrays are `[count]`; `stepped` may be one of the others, but may not overlap them otherwise. Keep the denoised
/// picture for the correction.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_step_euler(
    step: *const Step,
    noisy: *const f32,
    denoised: *const f32,
    count: u32,
    stepped: *mut f32,
) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe {
        heun(step)
            .and_then(|step| each([noisy, denoised], count, stepped, |[noisy, denoised]| step.euler(noisy, denoised)))
    })
}

/// The second-order step of a picture: from the first-order one, the denoised picture that led to it, and the denoised
/// picture there.
///
/// All arrays are `[count]`; `corrected` may be one of the others, but may not overlap them otherwise.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_step_correct(
    step: *const Step,
    stepped: *const f32,
    denoised: *const f32,
    denoised_there: *const f32,
    count: u32,
    corrected: *mut f32,
) -> Status {
    // SAFETY: the caller's promise.
    Status::of(unsafe {
        heun(step).and_then(|step| {
            each([stepped, denoised, denoised_there], count, corrected, |[stepped, denoised, there]| {
                step.correct(stepped, denoised, there)
            })
        })
    })
}

fn is_level(sigma: f32) -> bool {
    (0.0..=f32::MAX).contains(&sigma)
}

/// # Safety
/// The pointer is null or valid.
unsafe fn preconditioning(factors: *const Preconditioning) -> Result<schedule::Preconditioning, Status> {
    // SAFETY: the caller's promise; every bit pattern is a value.
    let Preconditioning { skip, output, input, noise } = unsafe { read(factors) }?;
    Ok(schedule::Preconditioning { skip, output, input, noise })
}

/// # Safety
/// The pointer is null or valid.
unsafe fn heun(step: *const Step) -> Result<HeunStep, Status> {
    // SAFETY: the caller's promise; every bit pattern is a value.
    let Step { remaining, correction } = unsafe { read(step) }?;
    Ok(HeunStep { remaining, correction })
}

/// `results[i] = of(inputs[..][i])`. Each element is read before it is written.
///
/// # Safety
/// Pointers are null or valid for `count` floats.
unsafe fn each<const N: usize>(
    inputs: [*const f32; N],
    count: u32,
    results: *mut f32,
    of: impl Fn([f32; N]) -> f32,
) -> Result<(), Status> {
    if count == 0 {
        return Err(Status::Count);
    }
    for input in inputs {
        // SAFETY: the caller's promise; only to check the pointer.
        unsafe { Input::new(input, count as usize) }?;
    }
    // SAFETY: the caller's promise.
    let mut results = unsafe { Output::new(results, count as usize) }?;
    let mut index = 0;
    while index < count as usize {
        // SAFETY: the pointers were checked above, and `index` is one of their floats.
        results.store(index, of(inputs.map(|input| unsafe { input.add(index).read() })));
        index += 1;
    }
    Ok(())
}
