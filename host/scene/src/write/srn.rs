//! SRN's folders: one pinhole with one focal length for all views.

use super::{Draft, WriteSceneError, words};
use crate::Scene;

pub(super) fn fits(scene: &Scene) -> Result<(), String> {
    let Some(first) = scene.views.first() else { return Ok(()) };
    let pinhole = first.camera.pinhole;
    let [x, y] = pinhole.focal();
    if x != y {
        return Err(format!("view {:?} has two focal lengths, {x} and {y}", first.name));
    }
    match scene.views.iter().find(|view| view.camera.pinhole != pinhole) {
        Some(view) => {
            Err(format!("view {:?} has another size, focal length or principal point than the first", view.name))
        }
        None => Ok(()),
    }
}

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let mut photograph_count = 0;
    for (index, view) in out.scene.views.iter().enumerate() {
        let pose = words(out.scene.frame.file_from_camera(&view.camera.pose).into_iter().flatten());
        let name = &view.name;
        if view.image.is_some() {
            out.pinhole_photograph(index, "rgb")?;
            out.put(&format!("pose/{name}.txt"), pose + "\n")?;
            photograph_count += 1;
        } else {
            // The reader adds the prefix.
            out.put(&format!("target_pose/{}.txt", name.strip_prefix("target_").unwrap_or(name)), pose + "\n")?;
        }
    }
    if let Some(view) = out.scene.views.first() {
        let pinhole = &view.camera.pinhole;
        let ([focal, _], [x, y]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
        let text = format!("{focal} {x} {y} 0\n0 0 0\n1\n{} {}\n", pinhole.height(), pinhole.width());
        out.put("intrinsics.txt", text)?;
    }
    Ok(photograph_count)
}
