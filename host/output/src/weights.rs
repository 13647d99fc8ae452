//! The weights of many targets under several schemes, for other programs: as JSON, one object a target, and as an array
//! for NumPy.

use serde::Serialize;
use std::collections::BTreeMap;
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::SourcesError;
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::numpy::npy;
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourcePoses;

use crate::record::view_names;

/// Weights `[scheme][target][source]`; those of a scheme for a target sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightTable {
    /// The scene's path.
    pub scene: String,
    /// Names of the schemes.
    pub schemes: Vec<String>,
    /// Names of the targets.
    pub targets: Vec<String>,
    /// Their camera-to-world matrices in the coordinates of the scene's files, OpenCV axes, row-major.
    pub poses: Vec<[[f64; 4]; 4]>,
    /// Names of the sources.
    pub sources: Vec<String>,
    values: Vec<f32>,
}

/// A target's weights, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TargetWeights {
    /// The scene's path.
    pub scene: String,
    /// The target's name.
    pub target: String,
    /// Its camera-to-world matrix in the coordinates of the scene's files, OpenCV axes, row-major.
    pub world_from_camera: [[f64; 4]; 4],
    /// Names of the sources.
    pub sources: Vec<String>,
    /// For each scheme the weight of each source, in their order.
    pub weights: BTreeMap<String, Vec<f32>>,
}

/// Why sources were not weighed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// There are too few or too many of them.
    #[error(transparent)]
    Sources(#[from] SourcesError),
    /// The work was cancelled.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl WeightTable {
    /// Weighs a job's sources for each of its targets.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn of(
        scene: &Scene,
        job: &FewShot,
        weightings: &[Weighting],
        progress: &dyn Progress,
    ) -> Result<WeightTable, TableError> {
        let unit = RigUnit::of_scene(scene);
        let poses: Vec<Pose> = job.sources.iter().map(|&view| unit.pose(&scene.views[view].camera.pose)).collect();
        let sources = SourcePoses::new(&poses)?;
        let mut values = Vec::with_capacity(weightings.len() * job.targets.len() * poses.len());
        for weighting in weightings {
            for target in &job.targets {
                progress.check()?;
                let weights = weighting.weigh(&sources, &unit.pose(&target.camera.pose));
                values.extend_from_slice(&weights.values()[..poses.len()]);
            }
        }
        Ok(WeightTable {
            scene: scene.path.display().to_string(),
            schemes: weightings.iter().map(Weighting::to_string).collect(),
            targets: job.targets.iter().map(|target| target.name.clone()).collect(),
            poses: job.targets.iter().map(|target| scene.frame.file_from_camera(&target.camera.pose)).collect(),
            sources: view_names(scene, &job.sources),
            values,
        })
    }

    /// The weights of a scheme for a target, by their indices, in the order of the sources.
    pub fn weights(&self, scheme: usize, target: usize) -> &[f32] {
        let first = (scheme * self.targets.len() + target) * self.sources.len();
        &self.values[first..first + self.sources.len()]
    }

    /// One object a target, for JSON. Of two schemes of one name, the last one.
    pub fn documents(&self) -> Vec<TargetWeights> {
        let document = |(target, (name, pose)): (usize, (&String, &[[f64; 4]; 4]))| {
            let of = |(scheme, name): (usize, &String)| (name.clone(), self.weights(scheme, target).to_vec());
            TargetWeights {
                scene: self.scene.clone(),
                target: name.clone(),
                world_from_camera: *pose,
                sources: self.sources.clone(),
                weights: self.schemes.iter().enumerate().map(of).collect(),
            }
        };
        self.targets.iter().zip(&self.poses).enumerate().map(document).collect()
    }

    /// The shape of [`WeightTable::npy`]: schemes, targets, sources.
    pub fn shape(&self) -> [usize; 3] {
        [self.schemes.len(), self.targets.len(), self.sources.len()]
    }

    /// A `.npy` file of `f32`, `[scheme][target][source]`.
    pub fn npy(&self) -> Vec<u8> {
        npy(&self.shape(), &self.values)
    }
}
