//! A scene folder in NeRF's layout, as nerfstudio writes it.
//!
//! ```text
//! transforms.json        intrinsics and lens; for each frame its file, its focal lengths if they differ, and its pose, camera-to-world in OpenGL axes
//! images/000.jpg         photographs
//! ```
//!
//! Numbers are written with the fewest digits that read back as the same `f32`. The folder appears whole or not at all.

use crate::folder::{MAX_VIEW_COUNT, WriteError, create_whole, io_error, write_text};
use crate::shoot::Shoot;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use viewfuse_core::camera::Camera;
use viewfuse_core::lens::{Lens, Projection};
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
    #[serde(flatten)]
    lens: BTreeMap<&'static str, f64>,
    frames: Vec<Frame>,
}

#[derive(Serialize)]
struct Frame {
    file_path: String,
    #[serde(flatten)]
    focal: BTreeMap<&'static str, f32>,
    transform_matrix: [[f32; 4]; 4],
}

/// Takes all photographs of a shoot and writes them to `folder`, which must not exist. A pixel is the mean of
/// `rays_per_side` squared rays. It checks `progress` between the views and stops if it says so.
///
/// # Errors
/// [`WriteError`], always with the path.
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
    let text = transforms(shoot.cameras(), shoot.lens())
        .ok_or_else(|| WriteError::ViewCount { path: folder.to_owned(), count })?;
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
///
/// # Errors
/// What the encoder says.
pub fn jpeg(photograph: &RgbImage) -> Result<Vec<u8>, image::ImageError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(photograph)?;
    Ok(bytes)
}

/// Of a view's photograph, from the scene's folder.
pub fn file_name(view: usize) -> String {
    format!("images/{view:03}.jpg")
}

/// Names of a lens's coefficients, in their order.
const COEFFICIENTS: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

/// What the file says; `None` without cameras. The cameras of a shoot share everything but their focal lengths.
fn transforms(cameras: &[Camera], lens: Option<&Lens>) -> Option<Transforms> {
    let pinhole = cameras.first()?.pinhole;
    let frame = |(view, camera): (usize, &Camera)| {
        let [fl_x, fl_y] = camera.pinhole.focal();
        let is_own = camera.pinhole.focal() != pinhole.focal();
        Frame {
            file_path: file_name(view),
            focal: if is_own { BTreeMap::from([("fl_x", fl_x), ("fl_y", fl_y)]) } else { BTreeMap::new() },
            transform_matrix: camera.pose.to_opengl(),
        }
    };
    let ([fl_x, fl_y], [cx, cy]) = (pinhole.focal(), pinhole.principal());
    Some(Transforms {
        camera_model: match lens.map(Lens::projection) {
            None => "PINHOLE",
            Some(Projection::Perspective) => "FULL_OPENCV",
            Some(Projection::Fisheye) => "OPENCV_FISHEYE",
        },
        w: pinhole.width(),
        h: pinhole.height(),
        fl_x,
        fl_y,
        cx,
        cy,
        lens: lens.map_or_else(BTreeMap::new, coefficients),
        frames: cameras.iter().enumerate().map(frame).collect(),
    })
}

/// A lens's coefficients that are not 0, by name; a fisheye has the first four.
fn coefficients(lens: &Lens) -> BTreeMap<&'static str, f64> {
    let count = if lens.projection() == Projection::Fisheye { 4 } else { COEFFICIENTS.len() };
    let named = COEFFICIENTS.into_iter().zip(lens.coefficients()).take(count);
    named.filter(|(_, value)| *value != 0.0).collect()
}

/// The same JSON with each row of a matrix on one line: lists of numbers are joined.
pub(crate) fn with_short_rows(json: &str) -> String {
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
