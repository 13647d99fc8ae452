//! Weights of the source views.

use crate::lent::{Input, Output, checked, read};
use crate::status::Status;
use viewfuse_core::attention::{FourierEmbedding, cross_attention};
use viewfuse_core::fetch::{Fetch, StartingAt};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{self, AngleKind};
use viewfuse_core::weights::Weights;

/// The angle between two cameras that error weighting uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Angle {
    /// Between the principal axes.
    PrincipalAxis = 0,
    /// Of the full relative rotation, roll included.
    FullRotation = 1,
}

const _: () = assert!(
    Angle::PrincipalAxis as u32 == AngleKind::PrincipalAxis as u32
        && Angle::FullRotation as u32 == AngleKind::FullRotation as u32
);

/// A weighting scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Scheme {
    /// A viewfuse_formula.
    pub formula: u32,
    /// What the formula says.
    pub choice: u32,
    /// What the formula says.
    pub parameter: f32,
}

impl Scheme {
    /// The header's viewfuse_formula is made from the schemes' rows, so its numbers are those of core.
    fn checked(self) -> Result<weighting::Scheme, Status> {
        Ok(weighting::Scheme::numbered(self.formula, self.choice, self.parameter)?)
    }
}

/// How many parameters the attention's embedding has.
pub const ATTENTION_PARAMETERS: u32 = 15232;

const _: () = assert!(ATTENTION_PARAMETERS as usize == FourierEmbedding::PARAMETERS);

/// The weights of up to 8 sources for a target, by formula: finite, at least 0, with the sum 1.
///
/// `source_poses` is `[source_count][4][4]`, `target_pose` is `[4][4]`, `weights` is `[source_count]`.
///
/// # Safety
/// Pointers are null or valid for these shapes.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_weigh_8(
    scheme: *const Scheme,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { weigh::<8>(scheme, source_poses, source_count, target_pose, weights) })
}

/// As viewfuse_weigh_8, for up to 16 sources.
///
/// # Safety
/// As viewfuse_weigh_8.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_weigh_16(
    scheme: *const Scheme,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { weigh::<16>(scheme, source_poses, source_count, target_pose, weights) })
}

/// As viewfuse_weigh_8, for up to 32 sources.
///
/// # Safety
/// As viewfuse_weigh_8.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_weigh_32(
    scheme: *const Scheme,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { weigh::<32>(scheme, source_poses, source_count, target_pose, weights) })
}

/// The weights of up to 8 sources for a target, by learned attention: finite, at least 0, with the sum 1.
///
/// `parameters` is `[VIEWFUSE_ATTENTION_PARAMETERS]`: of each of the three layers (42 to 64, 64 to 64, 64 to 128) the
/// weights `[output][input]`, then the biases `[output]`. They are read in place, for example from flash.
/// `source_poses` is `[source_count][4][4]`, `target_pose` is `[4][4]`, `weights` is `[source_count]`.
///
/// # Safety
/// Pointers are null or valid for these shapes; the parameters do not change during the call.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_attend_8(
    parameters: *const f32,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { attend::<8>(parameters, source_poses, source_count, target_pose, weights) })
}

/// As viewfuse_attend_8, for up to 16 sources.
///
/// # Safety
/// As viewfuse_attend_8.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_attend_16(
    parameters: *const f32,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { attend::<16>(parameters, source_poses, source_count, target_pose, weights) })
}

/// As viewfuse_attend_8, for up to 32 sources.
///
/// # Safety
/// As viewfuse_attend_8.
// SAFETY: no other symbol has this name; it begins with the name of the library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn viewfuse_attend_32(
    parameters: *const f32,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Status {
    // SAFETY: the caller's promise is the same.
    Status::of(unsafe { attend::<32>(parameters, source_poses, source_count, target_pose, weights) })
}

/// # Safety
/// As [`viewfuse_weigh_8`].
unsafe fn weigh<const S: usize>(
    scheme: *const Scheme,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Result<(), Status> {
    // SAFETY: the caller's promise; every bit pattern is a scheme.
    let scheme = unsafe { read(scheme) }?;
    // SAFETY: the caller's promise.
    let views = unsafe { SchemeInputs::<S>::new(source_poses, source_count, target_pose, weights) }?;
    let scheme = scheme.checked()?;
    views.weigh(|sources, target| weighting::weigh(scheme, sources, target))
}

/// # Safety
/// As [`viewfuse_attend_8`].
unsafe fn attend<const S: usize>(
    parameters: *const f32,
    source_poses: *const f32,
    source_count: u32,
    target_pose: *const f32,
    weights: *mut f32,
) -> Result<(), Status> {
    checked(parameters, FourierEmbedding::PARAMETERS)?;
    // SAFETY: the caller's promise.
    let views = unsafe { SchemeInputs::<S>::new(source_poses, source_count, target_pose, weights) }?;
    views.weigh(|sources, target| {
        // SAFETY: aligned, and of that many floats, which is all that the struct is made of (C's layout, no padding);
        // it is not used any more when the weights are written.
        let embedding = unsafe { &*parameters.cast::<FourierEmbedding>() };
        cross_attention(embedding, sources, target)
    })
}

/// The cameras of a call and the destination of their weights.
struct SchemeInputs<const S: usize> {
    sources: Input,
    count: u32,
    target: Input,
    weights: Output,
}

impl<const S: usize> SchemeInputs<S> {
    /// # Safety
    /// Pointers are null or valid for as many poses and weights as there are sources.
    unsafe fn new(
        source_poses: *const f32,
        source_count: u32,
        target_pose: *const f32,
        weights: *mut f32,
    ) -> Result<SchemeInputs<S>, Status> {
        if source_count == 0 || source_count as usize > S {
            return Err(Status::Count);
        }
        let count = source_count as usize;
        // SAFETY: the caller's promise, for each of the three.
        let (sources, target, weights) = unsafe {
            (Input::new(source_poses, 16 * count)?, Input::new(target_pose, 16)?, Output::new(weights, count)?)
        };
        Ok(SchemeInputs { sources, count: source_count, target, weights })
    }

    #[inline(always)]
    fn weigh(mut self, weigh: impl FnOnce(&Sources<S>, &Pose) -> Weights<S>) -> Result<(), Status> {
        let mut poses = [Pose::IDENTITY; S];
        let mut view = 0;
        while view < (self.count as usize).min(S) {
            poses[view] = pose(&self.sources, 16 * view)?;
            view += 1;
        }
        let target = pose(&self.target, 0)?;
        let weights = weigh(&Sources::from_array(poses, self.count), &target);
        for (view, weight) in weights.values().iter().enumerate() {
            // Nothing is stored beyond the count.
            self.weights.store(view, *weight);
        }
        Ok(())
    }
}

/// The pose whose 16 entries start at `first`.
fn pose(entries: &Input, first: usize) -> Result<Pose, Status> {
    let entries = StartingAt { all: entries, first };
    let mut matrix = [[0.0; 4]; 4];
    for (row, numbers) in matrix.iter_mut().enumerate() {
        for (column, number) in numbers.iter_mut().enumerate() {
            *number = entries.fetch(4 * row + column);
        }
    }
    Ok(Pose::from_opencv(&matrix)?)
}
