//! Scenes of Gaussians, and their files.
//!
//! A file in the layout of "3D Gaussian Splatting" (Kerbl et al. 2023) is a binary little-endian PLY file with an
//! element `vertex` and the properties `x y z` (mean), `f_dc_0..2` and `f_rest_*` (spherical harmonics of the colour),
//! `opacity` (logit), `scale_0..2` (natural logarithms of the standard deviations) and `rot_0..3` (quaternion `w, x, y,
//! z`), in any order. Its coordinates are those of the photographs' cameras, that is of the scene's files
//! ([`SceneFrame`]), unless it lies beside nerfstudio's record of another world.
//!
//! ```text
//! harmonics   spherical harmonics in other worlds and of other degrees
//! place       where a file's Gaussians are in the scene's world
//! comments    what the comments of a PLY file say
//! splat       .splat
//! spz         .spz
//! compressed  the compressed .ply of PlayCanvas
//! ply         the .ply of the published code
//! file        which of them a file is: GaussianFile
//! write       writing
//! ```

mod comments;
mod compressed;
mod file;
mod harmonics;
mod place;
mod ply;
mod splat;
mod spz;
mod write;

use rayon::prelude::*;
use std::path::Path;

use viewfuse_core::gaussian::{GaussianBlock, SH_0};

use crate::{FilePlace, SceneError, SceneFault, SceneFrame};

pub use file::GaussianFile;

/// Greatest degree of spherical harmonics.
pub const MAX_DEGREE: u32 = 3;
/// Greatest magnitude of a logit and of a logarithm: files say "opaque" and "flat" with infinities, which are limited
/// to it.
pub const MAX_LOGARITHM: f32 = 80.0;

/// A Gaussian of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// The mean in world coordinates.
    pub position: [f32; 3],
    /// Natural logarithms of the standard deviations along its own axes, in world units.
    pub log_scales: [f32; 3],
    /// Rotation from its own axes to the world's: a quaternion `w, x, y, z` of any length; zero counts as none.
    pub rotation: [f32; 4],
    /// Logit of the opacity.
    pub opacity: f32,
    /// Coefficients of the spherical harmonic of degree 0, red, green, blue: the colour is `0.5 + 0.2821 f_dc`.
    pub f_dc: [f32; 3],
}

/// The Gaussians of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GaussianScene {
    /// The Gaussians.
    pub gaussians: Vec<Gaussian>,
    /// Degree of the spherical harmonics, 0 to [`MAX_DEGREE`].
    pub degree: u32,
    /// Coefficients of the degrees above 0: `[gaussian][channel][coefficient]`, with
    /// [`REST_COUNTS`](viewfuse_core::gaussian::REST_COUNTS)`[degree]` coefficients a channel.
    pub f_rest: Vec<f32>,
    /// Whether they were trained for splats that keep their integral when they are dilated to a pixel: each is fainter
    /// by as much as its dilation widens it (mip-splatting's 2D filter).
    pub is_antialiased: bool,
}

impl GaussianScene {
    /// Reads a file in the coordinates of the scene's files, of any format that is read: `frame` is the scene's.
    ///
    /// # Errors
    /// [`SceneError`] with the path and the line of the header or the property: no such file, another format, a
    /// property that is missing, twice or no `float` or `double`, a comment that changes the picture in an unknown way,
    /// rows that the file has no room for, NaN, coordinates beyond [`viewfuse_core::pose::MAX_COORDINATE`]. Infinite
    /// opacities, and scales of zero, are limited to [`MAX_LOGARITHM`].
    pub fn read(path: &Path, frame: &SceneFrame) -> Result<GaussianScene, SceneError> {
        Ok(GaussianFile::read(path, frame)?.scene)
    }

    /// The Gaussians as a kernel reads them, with their colours of degree 0: at least 0 where these are all, since what
    /// higher degrees add may bring a colour above it.
    pub fn blocks(&self) -> Vec<GaussianBlock> {
        let least = if self.degree == 0 { 0.0 } else { f32::MIN };
        let block = |gaussian: &Gaussian| GaussianBlock {
            position: gaussian.position,
            opacity: gaussian.opacity,
            log_scales: gaussian.log_scales,
            rotation: gaussian.rotation,
            colour: gaussian.f_dc.map(|value| (0.5 + SH_0 * value).max(least)),
            ..GaussianBlock::default()
        };
        self.gaussians.par_iter().map(block).collect()
    }
}

/// The error of a file that is none of Gaussians, or none that is read.
fn refused(path: &Path, problem: &str) -> SceneError {
    FilePlace::file(path).fault(SceneFault::Gaussians(problem.to_owned()))
}
