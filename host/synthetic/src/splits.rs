//! A scene folder in the layout of NeRF's synthetic scenes: an object cut out, its views in splits.
//!
//! ```text
//! transforms_train.json    opening angle; for each frame its file and its pose, camera-to-world in OpenGL axes
//! train/r_0.png            straight RGBA
//! transforms_test.json     the same for the other splits
//! test/r_0.png
//! ```
//!
//! The folder appears whole or not at all.

use crate::folder::{WriteError, create_whole, io_error, shared_pinhole, write_picture, write_text};
use crate::object::Object;
use crate::render::render_with;
use crate::transforms::with_short_rows;
use serde::Serialize;
use std::fs;
use std::path::Path;
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;

#[derive(Serialize)]
struct Transforms {
    camera_angle_x: f64,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    file_path: String,
    transform_matrix: [[f32; 4]; 4],
}

/// The views of a split: its name (`train`, `val`, `test`), and of each view its number and its camera.
pub type SplitViews<'a> = (&'a str, Vec<(u32, Camera)>);

/// Renders `object` from every camera and writes the scene to `folder`, which must not exist. All cameras share one pinhole with
/// one focal length and its principal point in the centre: the layout states an opening angle alone. A pixel is the mean of
/// `rays_per_side` squared rays. It checks `progress` between the views and stops if it says so.
///
/// # Errors
/// [`WriteError`], always with the path.
pub fn write_splits(
    folder: &Path,
    object: &Object,
    splits: &[SplitViews<'_>],
    rays_per_side: u32,
    progress: &dyn Progress,
) -> Result<(), WriteError> {
    let cameras: Vec<Camera> = splits.iter().flat_map(|(_, views)| views.iter().map(|(_, camera)| *camera)).collect();
    let pinhole = shared_pinhole(folder, &cameras)?;
    let centre = [pinhole.width(), pinhole.height()].map(|side| side as f32 / 2.0);
    if pinhole.principal() != centre {
        return Err(WriteError::Intrinsics { path: folder.to_owned(), view: 0 });
    }
    let slope = f64::from(pinhole.width()) / 2.0 / f64::from(pinhole.focal()[0]);
    progress.expect(cameras.len());
    create_whole(folder, |unfinished| {
        for (split, views) in splits {
            let pictures = unfinished.join(split);
            fs::create_dir(&pictures).map_err(io_error(&pictures))?;
            let frame = |(number, camera): &(u32, Camera)| Frame {
                file_path: format!("./{split}/r_{number}"),
                transform_matrix: camera.pose.to_opengl(),
            };
            let frames = views.iter().map(frame).collect();
            let text = Transforms { camera_angle_x: 2.0 * slope.atan(), frames };
            let path = unfinished.join(format!("transforms_{split}.json"));
            let json = serde_json::to_string_pretty(&text).map_err(|source| io_error(&path)(source.into()))?;
            write_text(&path, &(with_short_rows(&json) + "\n"))?;
            for (number, camera) in views {
                progress.check()?;
                let picture = render_with(object, camera, rays_per_side);
                write_picture(&pictures.join(format!("r_{number}.png")), &picture)?;
                progress.step();
            }
        }
        Ok(())
    })
}
