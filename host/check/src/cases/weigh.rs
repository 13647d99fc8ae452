//! [`Kernel::Weigh`]: every scheme, from 1 to 32 sources, cameras anywhere.

use super::*;
use crate::oracle::{Arithmetic, evaluate, schemes};
use crate::poses::{looking_at_origin, ring};
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;

/// Weights below this may be 0: the exponential has no subnormal results, and devices may flush them.
const NEGLIGIBLE: f64 = 4.0e-38;

/// The arrangement of cameras with this number.
fn cameras(random: &mut Random, arrangement: u32, source_count: usize, target_count: usize) -> (Vec<Pose>, Vec<Pose>) {
    let scale = [1.0, 1.0e18, 1.0e-20, 1.0, 1.2, 1.0][arrangement as usize % 6];
    let mut sources: Vec<Pose> = (0..source_count).map(|_| random.pose(scale)).collect();
    let mut targets: Vec<Pose> = (0..target_count).map(|_| random.pose(scale)).collect();
    match arrangement % 6 {
        // Every other target is at a source's centre.
        3 => targets.iter_mut().step_by(2).enumerate().for_each(|(i, target)| *target = sources[i % source_count]),
        4 => {
            sources = ring(source_count, scale, 0.5, random.range(0.0, 1.0));
            let place =
                |random: &mut Random| [random.range(0.5, 1.0), random.range(-1.0, 1.0), random.range(-0.7, 0.7)];
            targets = (0..target_count).map(|_| looking_at_origin(place(random), random.range(0.0, 3.0))).collect();
        }
        // Some sources are a hundred million times as far as others.
        5 => sources.iter_mut().for_each(|source| {
            let distance = random.log_range(1.0e-3, 1.0e5);
            *source = random.pose(distance);
        }),
        _ => {}
    }
    (sources, targets)
}

impl Case for Weigh {
    // As many as give every scheme every number of sources.
    const SEED_COUNT: u64 = 32;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "relative, counted for each scheme: roundings on the way to an error and its quotients, \
        divisions as 2.5 ULP, roots as 4.5 ULP";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("sources", |own| move_camera(&mut own.sources[0])),
        ("targets", |own| own.targets.iter_mut().for_each(move_camera)),
        ("parameters", |own| own.block.scheme.parameter *= 1.01),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<Weigh> {
        let random = &mut random(0, seed, size);
        // So that neighbouring seeds give every scheme every number of sources.
        let schemes = schemes();
        let first = seed as usize * schemes.len() + size as usize;
        let dispatch = |(index, scheme): (usize, Scheme)| {
            let source_count = (first + index) % MAX_WEIGHED + 1;
            let arrangement = (first + index + seed as usize) as u32;
            let (sources, targets) = cameras(random, arrangement, source_count, size as usize);
            Weigh {
                block: WeighBlock { scheme: scheme.block(), source_count: source_count as u32 },
                target_count: size,
                sources: sources.iter().map(Pose::block).collect(),
                targets: targets.iter().map(Pose::block).collect(),
                weights: Output::Zeros(size as usize * MAX_WEIGHED),
            }
        };
        schemes.into_iter().enumerate().map(dispatch).collect()
    }

    /// Each target's weights, and zeros beyond the sources.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let sources: Vec<Pose> = self.sources.iter().map(PoseBlock::pose).collect();
        let is_own = |scheme: &Scheme| scheme.block() == self.block.scheme;
        let scheme = schemes().into_iter().find(is_own).expect("inputs are of these schemes");
        let row = |target: usize| {
            let (weights, units) = evaluate(scheme, &sources, &self.targets[target].pose(), Arithmetic::VULKAN);
            let mut row = [Bounded::ZERO; MAX_WEIGHED];
            for ((bounded, value), units) in row.iter_mut().zip(weights).zip(units) {
                *bounded = Bounded { value, error: value * units / 16_777_216.0 + NEGLIGIBLE };
            }
            row
        };
        decided(map(self.targets.len(), 1, row).into_iter().flatten(), 0)
    }
}

fn move_camera(pose: &mut PoseBlock) {
    pose.right[3] *= 1.01;
    pose.forward[0] *= 1.01;
}
