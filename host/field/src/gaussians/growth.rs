//! More Gaussians where the photographs ask for them: what is nearly transparent is pruned, and those that the loss
//! moves most are split, so that the number rises to its limit by equal factors.
//!
//! A Gaussian's score is the mean, over the pictures that it was in, of the derivative of the loss by its place in the
//! picture, as in "3D Gaussian Splatting" (Kerbl et al. 2023, section 5.2); the number is stated, as in "3D Gaussian
//! Splatting as Markov Chain Monte Carlo" (Kheradmand et al. 2024), in place of a threshold of the score.

use super::particles::{Particle, halves, longest_axis};
use viewfuse_core::gaussian::opacity;

/// How many times the number grows.
pub(super) const GROWTHS: u32 = 14;
/// Share of the finest level's iterations in which it grows.
const GROWING: f32 = 0.6;
/// Opacity below which a Gaussian is pruned.
const PRUNE_OPACITY: f32 = 0.01;

/// Whether the number grows before iteration `done` of `count` at the finest level, and how many times it has grown
/// then.
pub(super) fn growth_at(done: u32, count: u32) -> Option<u32> {
    let growths = |done: u32| (done as f32 * GROWTHS as f32 / (GROWING * count as f32)) as u32;
    let now = growths(done).min(GROWTHS);
    (done > 0 && now > growths(done - 1)).then_some(now)
}

/// Grows for the `growth`-th time, from `first` Gaussians at the beginning to `max_count` at last. Scores begin anew.
pub(super) fn grow(particles: &mut Vec<Particle>, growth: u32, first: usize, max_count: usize) {
    let factor = max_count as f64 / first.max(1) as f64;
    let target = (first as f64 * factor.max(1.0).powf(f64::from(growth) / f64::from(GROWTHS))) as usize;
    particles.retain(|particle| opacity(particle.gaussian.opacity) >= PRUNE_OPACITY);
    let count = target.min(max_count).saturating_sub(particles.len()).min(particles.len());
    let mut order: Vec<usize> = (0..particles.len()).collect();
    order.sort_by(|a, b| particles[*b].score().total_cmp(&particles[*a].score()));
    for index in order.into_iter().take(count) {
        let split = &particles[index];
        let parts = halves(&split.gaussian, longest_axis(&split.gaussian));
        let [first, second] = parts.map(|half| Particle::begun(half, split.harmonics.begun_anew()));
        particles[index] = first;
        particles.push(second);
    }
    particles.iter_mut().for_each(Particle::reset_score);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussians::harmonics::Harmonics;
    use viewfuse_kernels::rows::GaussianBlock;

    fn particle(place: f32, logit: f32) -> Particle {
        let gaussian = GaussianBlock {
            position: [place, 0.0, 0.0],
            opacity: logit,
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..GaussianBlock::default()
        };
        Particle::begun(gaussian, Harmonics::default())
    }

    #[test]
    fn it_grows_so_many_times_and_then_no_more() {
        for count in [GROWTHS * 2, 100, 3000] {
            let grown: Vec<u32> = (0..count).filter_map(|done| growth_at(done, count)).collect();
            assert_eq!(grown, (1..=GROWTHS).collect::<Vec<u32>>(), "{count} iterations");
            let last = (0..count).rfind(|done| growth_at(*done, count).is_some()).expect("a growth");
            assert!((last as f32) < (GROWING + 0.05) * count as f32);
        }
        assert_eq!((0..4).rev().find_map(|done| growth_at(done, 4)), Some(GROWTHS), "of few iterations, fewer times");
    }

    #[test]
    fn the_number_is_the_stated_one_and_the_transparent_go() {
        let mut particles: Vec<Particle> = (0..100).map(|index| particle(4.0 * index as f32, 0.0)).collect();
        particles[3].gaussian.opacity = -9.0;
        for (index, moved) in [(7, 5.0), (8, 9.0)] {
            (particles[index].state.moved, particles[index].state.moved_count) = (moved, 1);
        }
        grow(&mut particles, 1, 100, 103);
        assert_eq!(particles.len(), 100, "one went, and one came for it");
        let near = |index: f32| {
            particles.iter().filter(|particle| (particle.gaussian.position[0] - 4.0 * index).abs() < 1.0).count()
        };
        assert_eq!((near(8.0), near(7.0), near(3.0)), (2, 1, 0), "the greatest score is split");
        assert!(particles.iter().all(|particle| particle.score() == 0.0));
        grow(&mut particles, GROWTHS, 100, 150);
        assert_eq!(particles.len(), 150);
        grow(&mut particles, GROWTHS, 100, 90);
        assert_eq!(particles.len(), 150, "none that is seen goes");
    }
}
