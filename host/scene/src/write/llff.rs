//! LLFF's `poses_bounds.npy`: one focal length for each view, the principal point in the centre, near and far.

use super::{Draft, WriteSceneError};
use crate::Scene;
use crate::numpy::npy;

/// Largest distance of a principal point from the centre of the photograph, in pixels.
const CENTRED: f32 = 1.0e-3;

pub(super) fn fits(scene: &Scene) -> Result<(), String> {
    // The layout is read in the order of the files' names: a dot is behind each.
    if !scene.views.is_sorted_by_key(|view| format!("{}.", view.name)) {
        return Err("its views are not in the order of their names, which the layout is read in".to_owned());
    }
    for view in &scene.views {
        let pinhole = &view.camera.pinhole;
        let ([fx, fy], [cx, cy]) = (pinhole.focal(), pinhole.principal());
        let reason = if fx != fy {
            format!("two focal lengths, {fx} and {fy}")
        } else if (cx - pinhole.width() as f32 / 2.0).abs() > CENTRED
            || (cy - pinhole.height() as f32 / 2.0).abs() > CENTRED
        {
            format!("its principal point at ({cx}, {cy}), not in the centre of the photograph")
        } else if view.near_far.is_none() {
            "no near and far depth".to_owned()
        } else {
            continue;
        };
        return Err(format!("view {:?} has {reason}", view.name));
    }
    Ok(())
}

/// The focal lengths of the photographs, the least and the greatest, if they differ: programs that take the first
/// one's for all, as NeRF's own does, see others.
pub(super) fn differing_focals(scene: &Scene) -> Option<[f32; 2]> {
    let focals = || scene.views.iter().map(|view| view.camera.pinhole.focal()[0]);
    let (least, greatest) = (focals().fold(f32::INFINITY, f32::min), focals().fold(0.0, f32::max));
    (greatest > 1.0001 * least).then_some([least, greatest])
}

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let count = out.scene.views.len();
    let mut numbers: Vec<f64> = Vec::with_capacity(17 * count);
    for (index, view) in out.scene.views.iter().enumerate() {
        out.pinhole_photograph(index, "images")?;
        let matrix = out.scene.frame.file_from_camera(&view.camera.pose);
        let pinhole = &view.camera.pinhole;
        let size_and_focal = [pinhole.height().into(), pinhole.width().into(), pinhole.focal()[0].into()];
        for (row, last) in matrix.iter().zip(size_and_focal) {
            let [right, down, forward, centre] = *row;
            numbers.extend([down, right, -forward, centre, last]);
        }
        let [near, far] = view.near_far.unwrap_or_default();
        numbers.extend([near, far].map(|depth| f64::from(depth) * out.scene.frame.scale));
    }
    out.put("poses_bounds.npy", npy(&[count, 17], &numbers))?;
    Ok(count)
}
