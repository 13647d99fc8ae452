//! [`Kernel::ProjectParticles`] and [`Kernel::GatherGradients`]: Gaussians before a camera and beside it, with and
//! without spherical harmonics, in the lists of the tiles that show them.

use super::gaussians::{NEAR, blocks, gaussians, splats, tile_sums};
use super::*;
use crate::gaussian_oracle;
use crate::list_oracle::{is_reached, lists};
use crate::step_oracle::harmonics;
use crate::world::{Numbers, World};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_kernels::gaussians::SPLAT_TILE;
use viewfuse_kernels::gaussians::steps::PARAMETERS;

/// Terms of a Gaussian in the array of all: those of degree 2.
pub(super) const TERMS: u32 = 8;

/// The target of a seed's world.
pub(super) fn camera(seed: u64) -> CameraBlock {
    CameraBlock { first_texel: 0, ..World::new(seed).target }
}

/// The state of a Gaussian after up to five steps, with its terms.
pub(super) fn state(numbers: &mut Numbers) -> ParticleState {
    let step_count = numbers.between(0.0, 6.0) as u32;
    // Squares are at least those of the means.
    let moments = |_| match step_count {
        0 => [0.0; 2],
        _ => [numbers.between(-0.5, 0.5), numbers.between(0.3, 0.6)],
    };
    let moments = [0; PARAMETERS].map(moments);
    let rest_count = REST_COUNTS[numbers.between(0.0, 3.0) as usize];
    ParticleState { moments, step_count, moved: numbers.between(0.0, 2.0), moved_count: step_count, rest_count }
}

/// So many terms.
pub(super) fn terms(numbers: &mut Numbers, count: u32) -> Vec<HarmonicTerm> {
    (0..count).map(|_| HarmonicTerm { value: [0; 3].map(|_| numbers.between(-0.3, 0.3)), padding: 0.0 }).collect()
}

/// The states of so many terms.
pub(super) fn term_states(numbers: &mut Numbers, count: u32) -> Vec<TermState> {
    let mut moments = || [numbers.between(-0.5, 0.5), numbers.between(0.3, 0.6)];
    (0..count).map(|_| TermState { moments: [0; 3].map(|_| moments()), padding: [0.0; 2] }).collect()
}

impl Case for ProjectParticles {
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-3 };
    const REASON: &'static str = "as project_gaussians, with a sum over spherical harmonics";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.log_scales))),
        ("terms", |case| increase(case.terms.iter_mut().flat_map(|term| &mut term.value))),
        ("states", |case| case.states.iter_mut().flatten().for_each(|state| state.rest_count ^= 3)),
        ("parameters", |case| case.block.camera.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ProjectParticles> {
        let numbers = &mut Numbers::new(seed);
        // The first one is seen in any case.
        let mut gaussians = gaussians(numbers, size.max(24));
        (gaussians[0].position, gaussians[0].opacity) = ([0.1, 0.2, 0.1], 2.0);
        let mut states: Vec<ParticleState> = gaussians.iter().map(|_| state(numbers)).collect();
        states[0].rest_count = TERMS;
        let count = gaussians.len() as u32;
        let (camera, near) = (camera(seed), NEAR);
        let dispatch = |(term_count, is_antialiased, has_states): (u32, u32, bool)| ProjectParticles {
            block: ParticleBlock { camera, near, gaussian_count: count, term_count, is_antialiased, has_states: 0 },
            gaussians: gaussians.clone(),
            terms: terms(numbers, (count * term_count).max(1)),
            states: has_states.then(|| states.clone()),
            splats: Output::Zeros(gaussians.len()),
        };
        [(TERMS, 0, true), (0, 0, true), (TERMS, 1, true), (TERMS, 0, false)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ProjectParticles { block, gaussians, states, terms, .. } = self;
        let project = |index: usize| {
            let gaussian = &gaussians[index];
            let ParticleBlock { camera, near, is_antialiased, .. } = *block;
            let seen = SplatBlock { camera, near, is_antialiased, ..SplatBlock::default() };
            let Some(mut splat) = gaussian_oracle::project(&seen, gaussian) else {
                return [None; 16];
            };
            let there = states.as_ref().map_or(block.term_count, |states| states[index].rest_count);
            let count = there.min(block.term_count) as usize;
            if splat[3].value > 0.0 && count > 0 {
                let basis = harmonics(gaussian, &block.camera);
                let terms = &terms[index * block.term_count as usize..][..count];
                for channel in 0..3 {
                    let sum =
                        terms.iter().zip(basis).fold(Bounded::from(gaussian.colour[channel]), |sum, (term, basis)| {
                            sum + basis * term.value[channel].into()
                        });
                    splat[8 + channel] = sum.greater(Bounded::ZERO);
                }
            }
            splat.map(Some)
        };
        map(gaussians.len(), 16, project).into_iter().flatten().collect()
    }
}

impl Case for GatherGradients {
    const LIMITS: Limits = Limits { tolerance: 1.0, least: 1.0 };
    const REASON: &'static str =
        "as project_gradients; undecided where it depends on rounding in which tiles a splat is";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.log_scales))),
        ("splats", |case| increase(case.splats.iter_mut().flat_map(|splat| &mut splat.conic))),
        ("starts", |case| case.starts.fill(0)),
        ("entries", |case| case.entries.fill(0)),
        ("sums", |case| increase(case.sums.iter_mut().map(|sums| &mut sums.opacity))),
        ("parameters", |case| case.block.camera.intrinsics[0] *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GatherGradients> {
        let numbers = &mut Numbers::new(seed);
        let gaussians = gaussians(numbers, size.max(24));
        let dispatch = |block: SplatBlock| {
            let splats = splats(&block, &gaussians);
            let CameraBlock { width, height, .. } = block.camera;
            let listed = ListBlock { width, height, splat_count: block.gaussian_count, capacity: 0 };
            let (starts, mut entries) = lists(&listed, &splats);
            entries.push(0);
            let sums = (0..entries.len()).map(|_| tile_sums(numbers)).collect();
            let gradients = Output::Zeros(gaussians.len());
            GatherGradients { block, gaussians: gaussians.clone(), splats, starts, entries, sums, gradients }
        };
        blocks(camera(seed), size.max(24)).map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GatherGradients { block, gaussians, splats, starts, entries, sums, .. } = self;
        let side = SPLAT_TILE as u32;
        let CameraBlock { width, height, .. } = block.camera;
        let columns = width.div_ceil(side);
        let gradient = |index: usize| {
            let mut parts = Vec::new();
            for tile in 0..columns * height.div_ceil(side) {
                let is_shown = is_reached(&splats[index], [width, height], tile % columns, tile / columns)?;
                let (first, end) = (starts[tile as usize] as usize, starts[tile as usize + 1] as usize);
                let entry = entries[first..end].iter().position(|entry| *entry as usize == index);
                match (is_shown, entry) {
                    (true, Some(entry)) => parts.push(sums[first + entry]),
                    (false, None) => {}
                    // What depends on rounding was decided otherwise when the lists were made.
                    _ => return None,
                }
            }
            let sums = gaussian_oracle::sums_of(&parts);
            gaussian_oracle::project_gradient(block, &gaussians[index], &splats[index], &sums)
        };
        let all = map(gaussians.len(), 16, |index| gradient(index).map_or([None; 16], |gradient| gradient.map(Some)));
        all.into_iter().flatten().collect()
    }
}
