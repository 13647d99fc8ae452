//! COLMAP's binary files: little endian, a count of 64 bits first.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::super::bytes::{self, Bytes};
use super::super::camera_models::CameraModel;
use super::super::error::SceneError;
use super::super::fault::FilePlace;
use super::{ModelCamera, ModelImage, ModelPoint, camera, known};

/// `cameras.bin`: number, model, width, height, parameters.
pub(super) fn cameras(path: &Path) -> Result<Vec<(u32, ModelCamera)>, SceneError> {
    let contents = bytes::read(path)?;
    let mut bytes = Bytes::new(path, &contents);
    let count = bytes.count(24, "cameras")?;
    let mut all = Vec::with_capacity(count);
    for _ in 0..count {
        let place = FilePlace { path: path.to_path_buf(), location: bytes.location() };
        let id = bytes.u32("a camera")?;
        let number = bytes.u32("a camera")?;
        let model = known(&place, CameraModel::numbered(number).ok_or_else(|| CameraModel::title(number)))?;
        let size = [bytes.u64("a camera")? as f64, bytes.u64("a camera")? as f64];
        let parameters = (0..model.parameter_count())
            .map(|_| bytes.f64("the parameters of a camera"))
            .collect::<Result<Vec<_>, _>>()?;
        all.push((id, camera(place, Ok(model), size, &parameters)?));
    }
    bytes.end()?;
    Ok(all)
}

/// How many images an `images.bin` announces.
pub(super) fn image_count(path: &Path) -> io::Result<u64> {
    let mut count = [0; 8];
    File::open(path)?.read_exact(&mut count)?;
    Ok(u64::from_le_bytes(count))
}

/// `images.bin`: number, rotation, translation, camera, name, then the points found in the image, which are skipped.
pub(super) fn images(path: &Path) -> Result<Vec<ModelImage>, SceneError> {
    let contents = bytes::read(path)?;
    let mut bytes = Bytes::new(path, &contents);
    let count = bytes.count(73, "images")?;
    let mut all = Vec::with_capacity(count);
    for _ in 0..count {
        let place = FilePlace { path: path.to_path_buf(), location: bytes.location() };
        let id = bytes.u32("an image")?;
        let rotation = bytes.f64s("the rotation of an image")?;
        let translation = bytes.f64s("the translation of an image")?;
        let camera = bytes.u32("an image")?;
        let name = bytes.text("the name of an image")?;
        let found = bytes.count(24, "points in an image")?;
        bytes.take(24 * found, "the points in an image")?;
        all.push(ModelImage { id, rotation, translation, camera, name, place });
    }
    bytes.end()?;
    Ok(all)
}

/// `points3D.bin`: number, position, colour, error, then which image saw it as which of its points.
pub(super) fn points(path: &Path) -> Result<Vec<ModelPoint>, SceneError> {
    let contents = bytes::read(path)?;
    let mut bytes = Bytes::new(path, &contents);
    let count = bytes.count(51, "points")?;
    let mut all = Vec::with_capacity(count);
    for _ in 0..count {
        let location = bytes.location();
        bytes.u64("a point")?;
        let position = bytes.f64s("the position of a point")?;
        let colour = [bytes.u8("a point")?, bytes.u8("a point")?, bytes.u8("a point")?];
        // -1 before COLMAP has computed it.
        let error = bytes.f64("the error of a point")?;
        let length = bytes.count(8, "images that saw a point")?;
        let mut images = Vec::with_capacity(length);
        for _ in 0..length {
            images.push(bytes.u32("the images that saw a point")?);
            bytes.u32("the images that saw a point")?;
        }
        all.push(ModelPoint { position, colour, error, images, location });
    }
    bytes.end()?;
    Ok(all)
}
