//! What was written is opened before it appears: it gives back the same views at the same places, or is not written.

use std::path::Path;

use glam::DVec3;

use super::{Layout, neus};
use crate::{Scene, View};

/// Most that a centre may move, as a share of the rig and of the coordinates: they are rounded to f32.
const MAX_SHARES: [f64; 2] = [1.0e-3, 1.0e-5];
/// Most radians that a principal axis may turn.
const MAX_TURN: f32 = 1.0e-2;

/// Checks that the files in `draft` are the scene, whose views have these names there; the scene that was read.
pub(super) fn check(scene: &Scene, layout: Layout, draft: &Path, names: &[String]) -> Result<Scene, String> {
    let read = Scene::open(draft).map_err(|error| {
        let place = format!("{}{}", draft.display(), std::path::MAIN_SEPARATOR);
        format!("read back, {}", error.to_string().replace(&place, ""))
    })?;
    if read.views.len() != scene.views.len() {
        return Err(format!("of {} views, {} are read back", scene.views.len(), read.views.len()));
    }
    let place = |scene: &Scene, view: &View| scene.frame.file(view.camera.pose.centre_world().as_dvec3());
    let centres: Vec<DVec3> = scene.views.iter().map(|view| place(scene, view)).collect();
    let greatest = |lengths: &dyn Fn(&DVec3) -> f64| centres.iter().map(lengths).fold(0.0, f64::max);
    let sizes = [greatest(&|centre| centre.distance(centres[0])), greatest(&|centre| centre.length())];
    let most = MAX_SHARES[0] * sizes[0] + MAX_SHARES[1] * sizes[1].max(1.0e-9);
    // NeuS's world is the unit sphere.
    let (origin, unit) = if layout == Layout::Neus { neus::sphere(scene) } else { (DVec3::ZERO, 1.0) };
    for ((view, name), centre) in scene.views.iter().zip(names).zip(&centres) {
        let Some(back) = read.views.iter().find(|back| back.name == *name) else {
            return Err(format!("the name {name:?} is not read back"));
        };
        let moved = (origin + unit * place(&read, back)).distance(*centre);
        if moved > most || view.camera.pose.axis_angle(&back.camera.pose) > MAX_TURN {
            return Err(format!("view {:?} is read back with the pose of another", view.name));
        }
    }
    Ok(read)
}
