//! Sources and targets by lists, and by distance from the target.

use super::photographed;
use viewfuse_field::held_out;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{SelectionError, SelectionFault, check_count, view_list};

/// The views of two lists; a source is never a target.
pub(super) fn fixed(
    scene: &Scene,
    sources: &str,
    targets: &str,
    least_sources: usize,
) -> Result<(Vec<usize>, Vec<usize>), SelectionError> {
    let (sources, mut targets) = (view_list(scene, sources)?, view_list(scene, targets)?);
    targets.retain(|target| !sources.contains(target));
    if let Some(&view) = sources.iter().chain(&targets).find(|&&view| scene.views[view].image.is_none()) {
        return Err(SelectionFault::NoPhotograph(scene.views[view].name.clone()).in_scene(scene));
    }
    check_count(scene, sources.len(), least_sources)?;
    if targets.is_empty() {
        return Err(SelectionFault::NoTargets.in_scene(scene));
    }
    Ok((sources, targets))
}

/// Each target of a list, or each view, with the `count` other views whose cameras are nearest to its own; the first of
/// equally near ones.
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
    let pose = |view: usize| &scene.views[view].camera.pose;
    let of_target = |target: usize| {
        let others = views.iter().copied().filter(|&view| view != target);
        let mut others = held_out::nearest(others, |view| pose(view).distance(pose(target)), count);
        others.sort_unstable();
        (others, target)
    };
    Ok(targets.into_iter().map(of_target).collect())
}
