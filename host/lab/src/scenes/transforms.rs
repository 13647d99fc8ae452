//! A scene folder in NeRF's layout, as nerfstudio writes it.
//!
//! ```text
//! transforms.json        intrinsics; for each frame its file and its pose, camera-to-world in OpenGL axes
//! images/000.jpg         photographs
//! ```
//!
//! Numbers are written with the fewest digits that read back as the same `f32`. The folder appears whole or not at all.

use crate::scenes::folder::{MAX_VIEW_COUNT, WriteError, create_whole, io_error, write_text};
use crate::scenes::shoot::Shoot;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;
use std::fs;
use std::path::Path;
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;

/// Quality of the photographs, of 100.
pub const JPEG_QUALITY: u8 = 88;

#[derive(Serialize)]
struct Transforms {
    camera_model: &'static str,
    w: u32,
    h: u32,
    fl_x: f32,
    fl_y: f32,
    cx: f32,
    cy: f32,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    file_path: String,
    transform_matrix: [[f32; 4]; 4],
}

/// Takes all photographs of a shoot and writes them to `folder`, which must not exist. A pixel is the mean of
/// `rays_per_side` squared rays. It checks `progress` between the views and stops if it says so.
pub fn write_shoot(
    folder: &Path,
    shoot: &Shoot,
    rays_per_side: u32,
    progress: &dyn Progress,
) -> Result<(), WriteError> {
    let count = shoot.cameras().len();
    if count > MAX_VIEW_COUNT {
        return Err(WriteError::ViewCount { path: folder.to_owned(), count });
    }
    let text = transforms(shoot.cameras()).ok_or_else(|| WriteError::ViewCount { path: folder.to_owned(), count })?;
    create_whole(folder, |unfinished| {
        let path = unfinished.join("transforms.json");
        let json = serde_json::to_string_pretty(&text).map_err(|source| io_error(&path)(source.into()))?;
        write_text(&path, &(with_short_rows(&json) + "\n"))?;
        let images = unfinished.join("images");
        fs::create_dir(&images).map_err(io_error(&images))?;
        progress.expect(count);
        for view in 0..count {
            progress.check()?;
            if let Some(photograph) = shoot.photograph(view, rays_per_side) {
                let path = unfinished.join(file_name(view));
                let bytes = jpeg(&photograph).map_err(|source| WriteError::Jpeg { path: path.clone(), source })?;
                fs::write(&path, bytes).map_err(io_error(&path))?;
            }
            progress.step();
        }
        Ok(())
    })
}

/// A photograph as the bytes of a JPEG file of [`JPEG_QUALITY`].
pub fn jpeg(photograph: &RgbImage) -> Result<Vec<u8>, image::ImageError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(photograph)?;
    Ok(bytes)
}

/// Of a view's photograph, from the scene's folder.
pub fn file_name(view: usize) -> String {
    format!("images/{view:03}.jpg")
}

/// What the file says; `None` without cameras, which share one pinhole.
fn transforms(cameras: &[Camera]) -> Option<Transforms> {
    let pinhole = cameras.first()?.pinhole;
    let frame = |(view, camera): (usize, &Camera)| Frame {
        file_path: file_name(view),
        transform_matrix: camera.pose.to_opengl(),
    };
    let ([fl_x, fl_y], [cx, cy]) = (pinhole.focal(), pinhole.principal());
    Some(Transforms {
        camera_model: "PINHOLE",
        w: pinhole.width(),
        h: pinhole.height(),
        fl_x,
        fl_y,
        cx,
        cy,
        frames: cameras.iter().enumerate().map(frame).collect(),
    })
}

/// The same JSON with each row of a matrix on one line: lists of numbers are joined.
fn with_short_rows(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    let mut in_row = false;
    for line in json.lines() {
        let content = line.trim();
        let number = content.starts_with(|first: char| first == '-' || first.is_ascii_digit());
        if number || (in_row && content.starts_with(']')) {
            text.push_str(if in_row && number { " " } else { "" });
            text.push_str(content);
            in_row = number;
        } else {
            text.push_str(if text.is_empty() { "" } else { "\n" });
            text.push_str(line);
            in_row = false;
        }
    }
    text
}
