//! Writing a file of Gaussians.

use std::path::Path;

use glam::DVec3;
use viewfuse_core::Vec3;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_core::pose::MAX_COORDINATE;
use viewfuse_job::files::{WriteError, write_whole};

use super::file::parser_files;
use super::harmonics::padded;
use super::{Gaussian, GaussianScene, MAX_DEGREE, comments, splat, spz};
use crate::ply::header;
use crate::scene::files::has_extension;
use crate::{Scene, SceneFrame};

impl GaussianScene {
    /// Writes a file in the coordinates of the scene's files, completely or not at all: a `.splat` or a `.spz` if it is
    /// called so, otherwise a PLY file as the strictest readers want it, of `float`, with normals (0) and all
    /// coefficients of degree 3. Where the scene was moved when it was opened, `float` would not hold the coordinates:
    /// they are about the origin that a comment states, and are read back with it.
    ///
    /// # Errors
    /// [`WriteError`]; also where a `.splat` or a `.spz` cannot hold the coordinates, and of Gaussians that no reader
    /// takes: with a number that is not finite, or harmonics beyond degree 3.
    pub fn write(&self, path: &Path, frame: &SceneFrame) -> Result<(), WriteError> {
        check_frame(path, frame)?;
        self.check(path, frame).map_err(|cause| unwritten(path, cause))?;
        let bytes = if has_extension(path, &["splat"]) {
            splat::bytes(self, frame)
        } else if has_extension(path, &["spz"]) {
            spz::bytes(self, frame).map_err(|cause| unwritten(path, cause))?
        } else {
            ply(self, frame)
        };
        write_whole(path, &bytes)
    }

    /// Whether a reader takes what is written.
    fn check(&self, path: &Path, frame: &SceneFrame) -> Result<(), String> {
        if self.degree > MAX_DEGREE {
            return Err(format!("harmonics of degree {}; at most {MAX_DEGREE} are possible", self.degree));
        }
        let rest_count = 3 * REST_COUNTS[self.degree as usize] as usize;
        if self.f_rest.len() != self.gaussians.len() * rest_count {
            let (count, degree) = (self.gaussians.len(), self.degree);
            return Err(format!("{} harmonics of degree {degree} for {count} Gaussians", self.f_rest.len()));
        }
        if self.gaussians.is_empty() && has_extension(path, &["splat"]) {
            return Err("there are no Gaussians, and an empty .splat is not read".to_owned());
        }
        let is_finite = |gaussian: &Gaussian| {
            let Gaussian { position, log_scales, rotation, opacity, f_dc } = gaussian;
            let shape = position.iter().chain(log_scales).chain(rotation);
            shape.chain(f_dc).chain([opacity]).all(|value| value.is_finite())
        };
        if let Some(index) = self.gaussians.iter().position(|gaussian| !is_finite(gaussian)) {
            return Err(format!("Gaussian {index} has a number that is not finite"));
        }
        let limit = f64::from(MAX_COORDINATE) / frame.scale;
        let is_near = |gaussian: &Gaussian| gaussian.position.iter().all(|value| f64::from(value.abs()) <= limit);
        if let Some(index) = self.gaussians.iter().position(|gaussian| !is_near(gaussian)) {
            return Err(format!("Gaussian {index} is further than {MAX_COORDINATE:e} from the origin"));
        }
        // A .splat has the scales themselves, where others have their logarithms.
        let has_size = |gaussian: &Gaussian| {
            let size = |value: &f32| (frame.scale * f64::from(*value).exp()) as f32;
            gaussian.log_scales.iter().all(|value| size(value).is_finite())
        };
        let too_large = self.gaussians.iter().position(|gaussian| !has_size(gaussian));
        if let Some(index) = too_large.filter(|_| has_extension(path, &["splat"])) {
            return Err(format!("Gaussian {index} is larger than a number of 32 bits"));
        }
        match self.f_rest.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(format!("coefficient {index} of f_rest is not finite")),
            None => Ok(()),
        }
    }

    /// Whether a file of this name can hold the coordinates of a scene's files, and is read back in them
    /// ([`GaussianFile::open`](super::GaussianFile::open)): before there are Gaussians to write.
    ///
    /// # Errors
    /// [`WriteError`] for a `.splat` or a `.spz` where the scene was moved when it was opened, and for a `.splat` where
    /// nerfstudio's `dataparser_transforms.json` says that such files are in another world.
    pub fn check_place(path: &Path, scene: &Scene) -> Result<(), WriteError> {
        check_frame(path, &scene.frame)?;
        let states_world = parser_files(path, scene).into_iter().find(|file| file.is_file());
        match states_world.filter(|_| has_extension(path, &["splat"])) {
            Some(file) => Err(unwritten(
                path,
                format!(
                    "a .splat does not say who wrote it, and would be read in the world that {} states; write a .ply",
                    file.display()
                ),
            )),
            None => Ok(()),
        }
    }
}

/// Whether a file of this name can hold the coordinates of a scene's files.
fn check_frame(path: &Path, frame: &SceneFrame) -> Result<(), WriteError> {
    if frame.origin == DVec3::ZERO || !has_extension(path, &["splat", "spz"]) {
        return Ok(());
    }
    // `float` and fixed point lose such coordinates, and no header states an origin.
    let [x, y, z] = frame.origin.to_array();
    let cause = format!(
        "the scene is around ({x}, {y}, {z}): .splat and .spz hold no such coordinates and state no origin; write a .ply"
    );
    Err(unwritten(path, cause))
}

fn unwritten(path: &Path, cause: String) -> WriteError {
    WriteError::Encode { path: path.to_path_buf(), cause: cause.into() }
}

fn ply(scene: &GaussianScene, frame: &SceneFrame) -> Vec<u8> {
    let rest_count = 3 * REST_COUNTS[scene.degree.min(MAX_DEGREE) as usize] as usize;
    let mut comments = vec!["viewfuse".to_owned()];
    if frame.origin != DVec3::ZERO {
        comments.push(comments::origin(frame.origin));
    }
    if scene.is_antialiased {
        comments.push("SplatRenderMode: mip".to_owned());
    }
    let mut bytes = header("vertex", scene.gaussians.len(), properties(), &comments);
    let log_scale = frame.scale.ln();
    for (index, gaussian) in scene.gaussians.iter().enumerate() {
        // About the origin, in the file's units.
        let position = match *frame == SceneFrame::FILE {
            true => gaussian.position,
            false => (frame.scale * Vec3::from(gaussian.position).as_dvec3()).as_vec3().to_array(),
        };
        let rest = scene.f_rest.get(index * rest_count..(index + 1) * rest_count).unwrap_or_default();
        let log_scales = gaussian.log_scales.map(|value| (f64::from(value) + log_scale) as f32);
        let place_and_colour = position.into_iter().chain([0.0; 3]).chain(gaussian.f_dc);
        let values = place_and_colour.chain(padded(rest, scene.degree.min(MAX_DEGREE))).chain([gaussian.opacity]);
        values.chain(log_scales).chain(gaussian.rotation).for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// Types and names, in the order of the published code.
fn properties() -> impl Iterator<Item = (&'static str, String)> {
    let numbered = |name: &'static str, count: usize| (0..count).map(move |index| format!("{name}_{index}"));
    ["x", "y", "z", "nx", "ny", "nz"]
        .into_iter()
        .map(str::to_owned)
        .chain(numbered("f_dc", 3))
        .chain(numbered("f_rest", 45))
        .chain(["opacity".to_owned()])
        .chain(numbered("scale", 3))
        .chain(numbered("rot", 4))
        .map(|name| ("float", name))
}
