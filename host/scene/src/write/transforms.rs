//! `transforms.json`: intrinsics and coefficients of each frame, masks, splits. What the coefficients mean is said once
//! for all frames, where nerfstudio and instant-ngp look for it.

use serde_json::{Map, Value, json};
use viewfuse_core::lens::{Lens, Projection};

use super::{Draft, WriteSceneError};
use crate::scene::camera_models::{KEYED_LENSES, KeyedLens};
use crate::{Scene, Split};

/// The lens of all frames: the fisheye where all views have one, otherwise the polynomial, whose coefficients may be 0.
/// Other programs know no third one.
fn lens_of_all(scene: &Scene) -> &'static KeyedLens {
    let [polynomial, _, fisheye] = &KEYED_LENSES;
    let is_fisheye = |lens: Option<&Lens>| lens.is_some_and(|lens| lens.projection() == Projection::Fisheye);
    let all = !scene.views.is_empty() && scene.views.iter().all(|view| is_fisheye(view.lens.as_ref()));
    if all { fisheye } else { polynomial }
}

/// Whether the layout holds a lens of a scene.
pub(super) fn holds(scene: &Scene, lens: &Lens) -> bool {
    KeyedLens::of(lens).is_some_and(|keyed| keyed.models == lens_of_all(scene).models)
}

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let mut frames = Vec::new();
    let mut lists: Map<String, Value> = Map::new();
    let of_all = lens_of_all(out.scene);
    if out.scene.views.iter().filter_map(|view| view.lens.as_ref()).any(|lens| holds(out.scene, lens)) {
        lists.insert("camera_model".to_owned(), of_all.models[0].into());
        if of_all.projection == Projection::Fisheye {
            lists.insert("is_fisheye".to_owned(), true.into());
        }
    }
    for (index, view) in out.scene.views.iter().enumerate() {
        let kept = view.lens.as_ref().filter(|lens| holds(out.scene, lens));
        let (photograph, mask) = match (&view.lens, kept) {
            (Some(_), None) => out.pinhole_photograph_and_ignore_mask(index)?,
            _ => out.stored_photograph_and_mask(index)?,
        };
        let file_path = format!("images/{photograph}");
        let mut matrix = out.scene.frame.file_from_camera(&view.camera.pose);
        for row in &mut matrix[..3] {
            // OpenGL axes; -0 is written as 0.
            (row[1], row[2]) = (0.0 - row[1], 0.0 - row[2]);
        }
        let pinhole = &view.camera.pinhole;
        let ([fx, fy], [cx, cy]) = (pinhole.focal().map(f64::from), pinhole.principal().map(f64::from));
        let mut frame = json!({
            "file_path": file_path, "transform_matrix": matrix,
            "w": pinhole.width(), "h": pinhole.height(), "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy,
        });
        if let Some(lens) = kept {
            let coefficients = lens.coefficients();
            for (key, index) in of_all.keys.iter().filter(|(_, index)| coefficients[*index] != 0.0) {
                frame[*key] = coefficients[*index].into();
            }
        }
        if let Some(mask) = mask {
            frame["mask_path"] = format!("masks/{mask}").into();
        }
        let list = view.split.map(|split| match split {
            Split::Train => "train_filenames",
            Split::Validation => "val_filenames",
            Split::Test => "test_filenames",
        });
        if let Some(list) = list
            && let Value::Array(names) = lists.entry(list).or_insert_with(|| json!([]))
        {
            names.push(file_path.into());
        }
        frames.push(frame);
    }
    let count = frames.len();
    lists.insert("frames".to_owned(), frames.into());
    out.put("transforms.json", format!("{:#}\n", Value::Object(lists)))?;
    Ok(count)
}
