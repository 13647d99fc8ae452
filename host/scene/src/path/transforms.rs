//! A `transforms.json` as a camera path: the poses of `frames`, in its order, with the intrinsics that it states in any
//! of the ways of the layout. Photographs need not be there; the stem of `file_path`, if there is one, is the camera's
//! name.

use std::path::Path;

use viewfuse_core::camera::Pinhole;

use super::RawPath;
use crate::scene::SceneError;
use crate::scene::json::Object;
use crate::scene::transforms::frame::TransformsFrame;

/// The key by which such a file is recognised.
pub(super) const KEY: &str = "frames";

pub(super) fn read(path: &Path, top: &Object<'_>, pinhole: &Pinhole) -> Result<RawPath, SceneError> {
    let mut views = Vec::new();
    for (index, value) in top.array(KEY)?.iter().enumerate() {
        let key = format!("{KEY}[{index}]");
        let frame = TransformsFrame { path, scopes: [Object::new(path, &key, value)?, top.clone()], key };
        views.push(frame.camera_alone([pinhole.width(), pinhole.height()])?);
    }
    Ok(RawPath { views, frames_per_second: top.number("fps")?, warning: None })
}
