//! Eight source cameras and a target.

use crate::Inputs;
use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{AngleKind, Scheme, SchemeError};

/// How many sources there are.
pub const VIEWS: usize = 8;

/// Sources and a target.
pub struct Rig {
    /// The sources.
    pub sources: Sources<VIEWS>,
    /// The target.
    pub target: Pose,
}

impl Rig {
    /// Cameras on a winding way around the origin at a distance of about `scale`.
    pub fn around(inputs: Inputs, scale: f32) -> Rig {
        let mut poses = [Pose::IDENTITY; VIEWS];
        for (view, pose) in poses.iter_mut().enumerate() {
            *pose = camera(inputs.phase + 0.8 * view as f32, scale);
        }
        Rig { sources: Sources::from_array(poses, VIEWS as u32), target: camera(inputs.phase + 1.1, scale) }
    }

    /// The same with the target at one of the sources, where the published weights are NaN.
    pub fn at_a_source(inputs: Inputs) -> Rig {
        let rig = Rig::around(inputs, 2.0);
        let target = *rig.sources.pose(2);
        Rig { target, ..rig }
    }
}

/// A camera that looks past the origin; no two angles give the same height or distance.
fn camera(angle: f32, scale: f32) -> Pose {
    let (sin, cos) = sin_cos(angle);
    let (rise, sway) = sin_cos(2.3 * angle);
    let away = scale * (1.0 + 0.2 * sway);
    let centre = Vec3::new(away * cos, away * sin, 0.4 * scale * rise);
    let Ok(pose) = Pose::look_at(centre, Vec3::new(0.1 * scale * sway, 0.0, 0.0), Vec3::Z) else {
        panic!("the camera stands beside the axis");
    };
    pose
}

/// How many schemes [`schemes`] has.
pub const SCHEMES: usize = 17;

/// Every formula with several parameters, the default first.
pub fn schemes() -> [(&'static str, Scheme); SCHEMES] {
    use AngleKind::{FullRotation, PrincipalAxis};
    [
        ("error:alpha=1", Scheme::ERROR),
        ("error:alpha=0.5", built(Scheme::error(0.5, PrincipalAxis))),
        ("error:alpha=0", built(Scheme::error(0.0, PrincipalAxis))),
        ("error:alpha=1,angle=full", built(Scheme::error(1.0, FullRotation))),
        ("error:alpha=0.25,angle=full", built(Scheme::error(0.25, FullRotation))),
        ("mean", Scheme::MEAN),
        ("l1", Scheme::L1),
        ("frobenius", Scheme::FROBENIUS),
        ("relative-frobenius", Scheme::RELATIVE_FROBENIUS),
        ("distance:power=1", built(Scheme::distance(1))),
        ("distance:power=2", built(Scheme::distance(2))),
        ("distance:power=3", built(Scheme::distance(3))),
        ("gaussian:beta=1", built(Scheme::gaussian(1.0))),
        ("gaussian:beta=0", built(Scheme::gaussian(0.0))),
        ("gaussian:beta=0.01", built(Scheme::gaussian(0.01))),
        ("gaussian:beta=30", built(Scheme::gaussian(30.0))),
        ("gaussian:beta=1e7", built(Scheme::gaussian(1.0e7))),
    ]
}

/// How many schemes [`measured_schemes`] has.
pub const MEASURED: usize = 8;

/// Every formula once, with both angles: those whose cost is measured.
pub fn measured_schemes() -> [(&'static str, Scheme); MEASURED] {
    let all = schemes();
    [0, 3, 5, 6, 7, 8, 9, 12].map(|index| all[index])
}

fn built(scheme: Result<Scheme, SchemeError>) -> Scheme {
    // Not `expect`: formatting the error would be a third of the firmware.
    let Ok(scheme) = scheme else { panic!("a parameter outside its range") };
    scheme
}
