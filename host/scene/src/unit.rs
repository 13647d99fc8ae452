//! The unit of length that weightings and networks measure in, so that they give the same at every scale of a scene.
//!
//! Published formulas and networks have lengths in their parameters (`exp(-beta d^2)`, Fourier features of a centre,
//! densities per length) and were made for the scenes of SRN, whose cameras are 1.3 units from their object. A scene of
//! another size, or in other units, is therefore measured by its cameras' distance from what they look at.

use crate::Scene;
use crate::rig::Rig;
pub use crate::scene::SRN_DISTANCE;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;

/// Scenes whose cameras are so near to [`SRN_DISTANCE`], relatively, keep their numbers bit for bit.
const MAX_DEVIATION: f32 = 1.0e-4;

/// Networks are used in world units where the cameras' distance is within this factor of [`SRN_DISTANCE`]: they may
/// have been trained there. The scenes of SRN, NMR (2.7), DTU as published (about 2) and Blender (4) are.
const MAX_TRAINED_FACTOR: f32 = 4.0;

/// A unit of length, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigUnit {
    length: f32,
}

impl RigUnit {
    /// The world's own unit.
    pub const WORLD: RigUnit = RigUnit { length: 1.0 };

    /// The unit in which these cameras are [`SRN_DISTANCE`] from the point that they look at (the mean distance). The
    /// world's own where they are not anywhere: none, a single one, or all in one place, looking one way.
    pub fn of(cameras: &[Camera]) -> RigUnit {
        let apart = |camera: &Camera| camera.pose.centre_world() != cameras[0].pose.centre_world();
        if !cameras.iter().any(apart) {
            return RigUnit::WORLD;
        }
        RigUnit::of_distance(Rig::of(cameras).distance)
    }

    /// The unit in which this distance is [`SRN_DISTANCE`]; the world's own for one that is no distance.
    pub fn of_distance(distance: f32) -> RigUnit {
        let length = distance / SRN_DISTANCE;
        if length.is_normal() && (length - 1.0).abs() > MAX_DEVIATION { RigUnit { length } } else { RigUnit::WORLD }
    }

    /// The unit of weightings: of a scene's photographs, whichever of them are sources.
    pub fn of_scene(scene: &Scene) -> RigUnit {
        let photographs = scene.views.iter().filter(|view| view.image.is_some());
        RigUnit::of(&photographs.map(|view| view.camera).collect::<Vec<_>>())
    }

    /// The unit of networks for these sources: the world's own where networks are trained, [`RigUnit::of`] elsewhere.
    pub fn of_network(sources: &[Camera]) -> RigUnit {
        RigUnit::of(sources).unless_trained()
    }

    /// The world's own where networks are trained in world units, this one elsewhere.
    pub fn unless_trained(self) -> RigUnit {
        let usual = 1.0 / MAX_TRAINED_FACTOR..=MAX_TRAINED_FACTOR;
        if usual.contains(&self.length) { RigUnit::WORLD } else { self }
    }

    /// Its length in world units.
    pub fn length(&self) -> f32 {
        self.length
    }

    /// Whether it is the world's own unit.
    pub fn is_world(&self) -> bool {
        *self == RigUnit::WORLD
    }

    /// A pose with its centre in this unit.
    pub fn pose(&self, pose: &Pose) -> Pose {
        if self.is_world() {
            return *pose;
        }
        let mut block = pose.block();
        [&mut block.right, &mut block.down, &mut block.forward].into_iter().for_each(|axis| axis[3] /= self.length);
        block.pose()
    }

    /// A camera with its centre in this unit.
    pub fn camera(&self, camera: &Camera) -> Camera {
        Camera { pose: self.pose(&camera.pose), ..*camera }
    }
}
