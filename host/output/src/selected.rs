//! The few sources that targets need, by their weights: for systems that take a list of views.

use serde::Serialize;
use serde_json::{Value, json};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::SourcesError;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::select::select_sources;
use viewfuse_weighting::sources::{SourcePoses, SourceWeights};

/// The sources that were selected for a scene. Indices are those of the scene's photographs in their order, from 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelectedSources {
    /// The scene's name.
    pub scene: String,
    /// The weighting scheme.
    pub weighting: String,
    /// Names of the scene's photographs: what indices mean.
    pub views: Vec<String>,
    /// The sources that serve all targets together.
    pub together: SourceSet,
    /// For each target the sources that serve it alone.
    pub targets: Vec<ForTarget>,
}

/// Some sources.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourceSet {
    /// Their indices, ascending.
    pub indices: Vec<usize>,
    /// Their names.
    pub sources: Vec<String>,
    /// The weight of these sources among all, mean and least over the targets: what is missing to 1 bounds the change
    /// of a fusion by leaving the others out, as a share of the range of its inputs.
    pub share: [f32; 2],
}

/// The sources of a target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ForTarget {
    /// The target's name.
    pub target: String,
    /// Its index, if it is a photograph of the scene.
    pub index: Option<usize>,
    /// Indices of its sources, the greatest weight first.
    pub indices: Vec<usize>,
    /// Their names.
    pub sources: Vec<String>,
    /// Their weights for the target, the scheme applied to them alone; they sum to 1.
    pub weights: Vec<f32>,
    /// Their weight among all sources.
    pub share: f32,
}

impl SelectedSources {
    /// Chooses `count` of a job's sources (all of them if there are fewer) for each target, and for all together.
    ///
    /// # Errors
    /// [`SourcesError`] if there are too few or too many sources.
    pub fn of(
        scene: &Scene,
        job: &FewShot,
        weighting: &Weighting,
        count: usize,
    ) -> Result<SelectedSources, SourcesError> {
        let unit = RigUnit::of_scene(scene);
        let poses: Vec<Pose> = job.sources.iter().map(|&view| unit.pose(&scene.views[view].camera.pose)).collect();
        let all = SourcePoses::new(&poses)?;
        let weights: Vec<SourceWeights> =
            job.targets.iter().map(|target| weighting.weigh(&all, &unit.pose(&target.camera.pose))).collect();
        let share =
            |weights: &SourceWeights, chosen: &[usize]| chosen.iter().map(|&one| weights.get(one as u32)).sum::<f32>();
        let name = |&view: &usize| scene.views[view].name.clone();
        let mut targets = Vec::with_capacity(job.targets.len());
        for (target, relevance) in job.targets.iter().zip(&weights) {
            let chosen = select_sources(std::slice::from_ref(relevance), count);
            let few = SourcePoses::new(&chosen.iter().map(|&one| poses[one]).collect::<Vec<_>>())?;
            let few_weights = weighting.weigh(&few, &unit.pose(&target.camera.pose));
            let mut order: Vec<(usize, f32)> =
                chosen.iter().copied().zip(few_weights.values().iter().copied()).collect();
            order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            let indices: Vec<usize> = order.iter().map(|(one, _)| job.sources[*one]).collect();
            targets.push(ForTarget {
                target: target.name.clone(),
                index: target.truth,
                sources: indices.iter().map(name).collect(),
                indices,
                weights: order.iter().map(|(_, weight)| *weight).collect(),
                share: share(relevance, &chosen),
            });
        }
        let chosen = select_sources(&weights, count);
        let shares: Vec<f32> = weights.iter().map(|relevance| share(relevance, &chosen)).collect();
        let mean = shares.iter().sum::<f32>() / shares.len().max(1) as f32;
        let indices: Vec<usize> = chosen.iter().map(|&one| job.sources[one]).collect();
        let together = SourceSet {
            sources: indices.iter().map(name).collect(),
            indices,
            share: [mean, shares.into_iter().fold(1.0, f32::min)],
        };
        let views = scene.views.iter().filter(|view| view.image.is_some()).map(|view| view.name.clone()).collect();
        Ok(SelectedSources { scene: scene.name(), weighting: weighting.to_string(), views, together, targets })
    }

    /// A line a target: its name and the indices of its sources, the greatest weight first, separated by blanks.
    pub fn lines(&self) -> String {
        let line = |target: &ForTarget| {
            let indices: String = target.indices.iter().map(|index| format!(" {index}")).collect();
            format!("{}{indices}\n", target.target)
        };
        self.targets.iter().map(line).collect()
    }

    /// The index file of pixelSplat, MVSplat and their successors: `{scene: {"context": [...], "target": [...]}}`, with
    /// the sources that serve all targets together. `None` if a target is no photograph of the scene.
    pub fn index(&self) -> Option<Value> {
        let targets: Vec<usize> = self.targets.iter().map(|target| target.index).collect::<Option<_>>()?;
        Some(json!({ &self.scene: { "context": self.together.indices, "target": targets } }))
    }
}
