//! `transforms.json`: intrinsics and lens of each frame, masks, splits.

use serde_json::{Map, Value, json};
use viewfuse_core::lens::{Lens, Projection};

use super::{Draft, WriteSceneError};
use crate::Split;

pub(super) fn write(out: &mut Draft) -> Result<usize, WriteSceneError> {
    let mut frames = Vec::new();
    let mut lists: Map<String, Value> = Map::new();
    for (index, view) in out.scene.views.iter().enumerate() {
        let (photograph, mask) = out.stored_photograph_and_mask(index)?;
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
        if let Some(lens) = &view.lens {
            frame["camera_model"] = model(lens).into();
            let names = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];
            for (name, coefficient) in names.into_iter().zip(lens.coefficients()).filter(|(_, value)| *value != 0.0) {
                frame[name] = coefficient.into();
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

fn model(lens: &Lens) -> &'static str {
    let [_, _, k3, k4, k5, k6, _, _] = lens.coefficients();
    match (lens.projection(), [k3, k4, k5, k6] == [0.0; 4]) {
        (Projection::Fisheye, _) => "OPENCV_FISHEYE",
        (Projection::Perspective, true) => "OPENCV",
        (Projection::Perspective, false) => "FULL_OPENCV",
    }
}
