//! The experiments, each a program over the public interface of the libraries that prints its result.
//!
//! ```text
//! planes                                      a target's planes, for two of them
//! efforts, gaussians, headroom, mixture,
//! paper_question, poses (posed_pictures,
//! refined_poses), refinement, self_knowledge,
//! sweep_time                                  the experiments
//! ```

mod efforts;
mod gaussians;
mod headroom;
mod mixture;
mod paper_question;
mod planes;
mod poses;
mod refinement;
mod self_knowledge;
mod sweep_time;

use anyhow::Context;

/// Takes what stands behind the experiment's name.
type Experiment = fn(&[String]) -> anyhow::Result<()>;

const EXPERIMENTS: [(&str, Experiment); 13] = [
    ("efforts", efforts::run),
    ("gaussian_frames", gaussians::frames::run),
    ("gaussian_recipe", gaussians::recipe::run),
    ("gaussian_weights", gaussians::weights::run),
    ("headroom", headroom::run),
    ("mixture", mixture::run),
    ("paper_question", paper_question::run),
    ("posed_pictures", poses::pictures::run),
    ("poses", poses::run),
    ("refined_poses", poses::refined::run),
    ("refinement", refinement::run),
    ("self_knowledge", self_knowledge::run),
    ("sweep_time", sweep_time::run),
];

/// What there is.
pub(crate) fn names() -> Vec<&'static str> {
    EXPERIMENTS.iter().map(|(name, _)| *name).collect()
}

/// Runs one.
pub(crate) fn run(name: &str, arguments: &[String]) -> anyhow::Result<()> {
    let experiment = EXPERIMENTS.iter().find(|(own, _)| *own == name);
    let (_, experiment) = experiment.with_context(|| {
        format!("neither plan, run nor an experiment: {name}; experiments are {}", names().join(", "))
    })?;
    experiment(arguments)
}
