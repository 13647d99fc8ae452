//! Targets near the sources of an object with silhouettes, whose picture is only partly a mixture with Gaussians: the
//! hull's depths can be right there where those of held-out sources, which are farther from the others, are not
//! (`host/results/gaussians.md`).

use crate::standing::Measure;
use viewfuse_core::pose::Pose;

/// Up to this gap to its sources ([`Standing`](crate::auto::Standing)) a target is mixed by half...
const NEAR_GAP: f64 = 0.35;
/// ... and from this one on in full.
const FAR_GAP: f64 = 0.4;
/// The share of the mixture in the picture of a near target, the rest that of the picture under the chosen settings.
const NEAR_SHARE: f64 = 0.5;

/// Tells near targets from others.
#[derive(Clone, Debug, PartialEq)]
pub struct NearTargets {
    measure: Measure,
    sources: Vec<Pose>,
}

impl NearTargets {
    /// Those that are near to one of these sources.
    pub(crate) fn of(measure: Measure, sources: Vec<Pose>) -> NearTargets {
        NearTargets { measure, sources }
    }

    /// The share of a mixture in a target's picture.
    pub(super) fn share_at(&self, target: &Pose) -> f32 {
        share_at_gap(self.measure.standing(target, self.sources.iter()).gap)
    }
}

fn share_at_gap(gap: f64) -> f32 {
    let far = ((gap - NEAR_GAP) / (FAR_GAP - NEAR_GAP)).clamp(0.0, 1.0);
    (NEAR_SHARE + (1.0 - NEAR_SHARE) * far) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;

    #[test]
    fn near_targets_are_mixed_by_half() {
        assert_eq!([0.1, 0.35, 0.4, 2.0].map(share_at_gap), [0.5, 0.5, 1.0, 1.0]);
        assert!((share_at_gap(0.375) - 0.75).abs() < 1.0e-6);
    }

    #[test]
    fn a_gap_is_that_to_the_sources() {
        let at = |x: f32| Pose::look_at(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 1.0), -Vec3::Y).expect("a pose");
        let pinhole = viewfuse_core::camera::Pinhole::new([8.0; 2], [4.0; 2], 8, 8).expect("a pinhole");
        let camera = |x: f32| viewfuse_core::camera::Camera { pose: at(x), pinhole };
        let measure = Measure::of(&[camera(-1.0), camera(1.0)]);
        let near = NearTargets::of(measure, vec![at(-1.0), at(1.0)]);
        assert_eq!(near.share_at(&at(1.0)), 0.5);
        assert_eq!(near.share_at(&at(1.0e3)), 1.0);
    }
}
