//! Sources and targets by lists, and by distance from the target.

use super::photographed;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{SelectionError, view_list};
use viewfuse_weighting::sources::MAX_SOURCES;

/// The views of two lists; a source is never a target.
pub(super) fn fixed(
    scene: &Scene,
    sources: &str,
    targets: &str,
    least_sources: usize,
) -> Result<(Vec<usize>, Vec<usize>), SelectionError> {
    let scene_name = || scene.path.display().to_string();
    let (sources, mut targets) = (view_list(scene, sources)?, view_list(scene, targets)?);
    targets.retain(|target| !sources.contains(target));
    if let Some(&view) = sources.iter().chain(&targets).find(|&&view| scene.views[view].image.is_none()) {
        return Err(SelectionError::NoPhotograph { scene: scene_name(), name: scene.views[view].name.clone() });
    }
    let count = sources.len();
    if count < least_sources {
        return Err(SelectionError::TooFewSources { scene: scene_name(), count, least: least_sources });
    }
    if count > MAX_SOURCES {
        return Err(SelectionError::TooManySources { scene: scene_name(), count });
    }
    if targets.is_empty() {
        return Err(SelectionError::NoTargets { scene: scene_name() });
    }
    Ok((sources, targets))
}

/// Each target of a list, or each view, with the `count` other views whose cameras are nearest to its own; the first of
/// equally near ones.
///
/// # Errors
/// [`SelectionError`] for a list that does not fit the scene.
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
        let (scene_name, name) = (scene.path.display().to_string(), scene.views[view].name.clone());
        return Err(SelectionError::NoPhotograph { scene: scene_name, name });
    }
    let pose = |view: usize| &scene.views[view].camera.pose;
    let of_target = |target: usize| {
        let mut others: Vec<usize> = views.iter().copied().filter(|&view| view != target).collect();
        others.sort_by(|&a, &b| pose(a).distance(pose(target)).total_cmp(&pose(b).distance(pose(target))));
        others.truncate(count);
        others.sort_unstable();
        (others, target)
    };
    Ok(targets.into_iter().map(of_target).collect())
}
