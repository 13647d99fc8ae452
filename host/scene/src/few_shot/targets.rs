//! Checks of the targets of a run: their names, and whether the sources show anything of them.

use super::{FewShot, SelectionError, SelectionFault, Target};
use crate::Scene;
use crate::rig::{Rig, half_diagonal_slope};
use std::collections::HashMap;
use unicode_normalization::UnicodeNormalization;
use viewfuse_core::camera::Camera;

/// Refuses targets whose files would be the same: file systems ignore case (Windows, macOS), and some give names back
/// in another Unicode form (macOS).
pub(super) fn check_names(scene: &Scene, targets: &[Target]) -> Result<(), SelectionError> {
    let mut seen: HashMap<String, &str> = HashMap::new();
    for Target { name, .. } in targets {
        let key = name.to_lowercase().as_str().nfc().collect::<String>();
        if let Some(first) = seen.insert(key, name) {
            let fault = match first == name {
                true => SelectionFault::SameName(name.clone()),
                false => SelectionFault::AlikeNames(first.to_owned(), name.clone()),
            };
            return Err(fault.in_scene(scene));
        }
    }
    Ok(())
}

/// A warning about targets that look where no source looks: neither at what the sources look at, nor in any direction
/// that a source shows. Nothing is said of sources that the scene does not have.
pub fn away_warning(scene: &Scene, job: &FewShot) -> Option<String> {
    let sources: Vec<Camera> =
        job.sources.iter().map(|&view| Some(scene.views.get(view)?.camera)).collect::<Option<_>>()?;
    let focus = Rig::of(&sources).focus;
    let reach = |camera: &Camera| half_diagonal_slope(&camera.pinhole).atan();
    let faces_away = |target: &&Target| {
        let camera = &target.camera;
        let sees_focus = camera.pose.forward_world().angle_between(focus - camera.pose.centre_world()) <= reach(camera);
        let shares = |source: &Camera| source.pose.axis_angle(&camera.pose) <= reach(source) + reach(camera);
        !sees_focus && !sources.iter().any(shares)
    };
    let away: Vec<&Target> = job.targets.iter().filter(faces_away).collect();
    let first = away.first()?;
    let more = if away.len() > 1 { format!(" and {} more", away.len() - 1) } else { String::new() };
    Some(format!(
        "{}: target '{}'{more} faces away from everything that the sources show: nothing of its picture can be known",
        scene.path.display(),
        first.name
    ))
}
