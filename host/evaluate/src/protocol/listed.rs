//! Sources and targets by lists, and by distance from the target.

use super::photographed;
use viewfuse_field::held_out;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{SelectionError, SelectionFault, check_count, view_list};

/// Views of two lists.
pub(super) struct Listed {
    pub(super) sources: Vec<usize>,
    /// None of them is a source.
    pub(super) targets: Vec<usize>,
    /// What is said of views that are in both.
    pub(super) notes: Vec<String>,
}

/// The views of two lists; a source is never a target.
pub(super) fn fixed(
    scene: &Scene,
    sources: &str,
    targets: &str,
    least_sources: usize,
) -> Result<Listed, SelectionError> {
    let (sources, targets) = (view_list(scene, sources)?, view_list(scene, targets)?);
    let (both, targets): (Vec<usize>, Vec<usize>) = targets.into_iter().partition(|target| sources.contains(target));
    let names: Vec<&str> = both.iter().map(|view| scene.views[*view].name.as_str()).collect();
    let notes = match names.is_empty() {
        true => Vec::new(),
        false => vec![format!("{}: no targets, since they are sources: {}", scene.name(), names.join(", "))],
    };
    if let Some(&view) = sources.iter().chain(&targets).find(|&&view| scene.views[view].image.is_none()) {
        return Err(SelectionFault::NoPhotograph(scene.views[view].name.clone()).in_scene(scene));
    }
    check_count(scene, sources.len(), least_sources)?;
    if targets.is_empty() {
        return Err(SelectionFault::NoTargets.in_scene(scene));
    }
    Ok(Listed { sources, targets, notes })
}

/// Each target of a list, or each view, with the `count` other views whose cameras are nearest to its own; the first of
/// equally near ones, one of each pose.
pub(super) fn nearest(
    scene: &Scene,
    count: usize,
    targets: Option<&str>,
) -> Result<Vec<(Vec<usize>, usize)>, SelectionError> {
    let views: Vec<usize> = photographed(scene).collect();
    let targets = match targets {
        Some(list) => view_list(scene, list)?,
        None => views.clone(),
    };
    if let Some(&view) = targets.iter().find(|target| !views.contains(target)) {
        return Err(SelectionFault::NoPhotograph(scene.views[view].name.clone()).in_scene(scene));
    }
    let (pose, poses) = (|view: usize| &scene.views[view].camera.pose, scene.same_poses());
    let of_target = |target: usize| {
        let others = poses.sources(views.iter().copied(), &[target]).into_iter();
        let mut others = held_out::nearest(others, |view| pose(view).distance(pose(target)), count);
        others.sort_unstable();
        (others, target)
    };
    Ok(targets.into_iter().map(of_target).collect())
}
