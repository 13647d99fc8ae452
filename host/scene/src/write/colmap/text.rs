//! COLMAP's text files.

use std::fmt::Write;

use super::super::words;
use super::{ModelName, ModelView, WrittenPoint};

// Writing to a text cannot fail.

pub(super) fn cameras(views: &[ModelView]) -> String {
    let mut text = String::from("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n");
    for ModelView { id, model: ModelName(model, _), size: [width, height], parameters, .. } in views {
        let _ = writeln!(text, "{id} {model} {width} {height} {}", words(parameters.iter().copied()));
    }
    text
}

pub(super) fn images(views: &[ModelView]) -> String {
    let mut text = String::from("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# X Y POINT3D_ID of each point\n");
    for ModelView { id, rotation, translation, name, observations, .. } in views {
        let pose = words(rotation.iter().chain(translation).copied());
        let points: Vec<String> = observations.iter().map(|([x, y], point)| format!("{x} {y} {point}")).collect();
        let _ = writeln!(text, "{id} {pose} {id} {name}\n{}", points.join(" "));
    }
    text
}

pub(super) fn points(points: &[WrittenPoint]) -> String {
    let mut text = String::from("# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n");
    for WrittenPoint { id, position, colour: [red, green, blue], error, track } in points {
        let _ = write!(text, "{id} {} {red} {green} {blue} {error}", words(position.iter().copied()));
        for [image, place] in track {
            let _ = write!(text, " {image} {place}");
        }
        text.push('\n');
    }
    text
}
