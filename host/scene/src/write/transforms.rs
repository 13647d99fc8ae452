//! `transforms.json`: intrinsics and lens of each frame, masks, splits.

use serde_json::{Map, Value, json};

use super::{Draft, WriteSceneError};
use crate::Split;
use crate::scene::camera_models::KeyedLens;

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let mut frames = Vec::new();
    let mut lists: Map<String, Value> = Map::new();
    for (index, view) in out.scene.views.iter().enumerate() {
        let keyed = view.lens.as_ref().map(|lens| KeyedLens::of(lens).map(|keyed| (keyed, lens.coefficients())));
        let (photograph, mask) = match keyed {
            Some(None) => out.pinhole_photograph_and_ignore_mask(index)?,
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
        if let Some(Some((keyed, coefficients))) = keyed {
            frame["camera_model"] = keyed.models[0].into();
            for (key, index) in keyed.keys.iter().filter(|(_, index)| coefficients[*index] != 0.0) {
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
