//! Middlebury's list: `K R t` of each photograph, pixel centres at whole numbers.

use super::{Draft, WriteSceneError, camera_from_world, words};

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let mut list = format!("{}\n", out.scene.views.len());
    for (index, view) in out.scene.views.iter().enumerate() {
        let photograph = out.pinhole_photograph(index, ".")?;
        let pinhole = &view.camera.pinhole;
        let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
        let k = [fx, 0.0, cx - 0.5, 0.0, fy, cy - 0.5, 0.0, 0.0, 1.0];
        let rows = camera_from_world(out.scene, view);
        let rotation = rows.into_iter().flat_map(|[a, b, c, _]| [a, b, c]);
        let numbers = k.into_iter().chain(rotation).chain(rows.map(|row| row[3]));
        list.push_str(&format!("{photograph} {}\n", words(numbers)));
    }
    out.put("scene_par.txt", list)?;
    Ok(out.scene.views.len())
}
