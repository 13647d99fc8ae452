//! Where a file's Gaussians are in the scene's world.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use viewfuse_core::pose::MAX_COORDINATE;

use super::{Gaussian, MAX_LOGARITHM};
use crate::SceneFrame;
use crate::parser_world::ParserWorld;
use crate::scene::{FileFault, FilePlace, SceneError, SceneFault};

/// A Gaussian as a file states it.
pub(super) struct RawGaussian {
    pub(super) position: DVec3,
    pub(super) log_scales: [f64; 3],
    /// `w, x, y, z`.
    pub(super) rotation: [f32; 4],
    /// A logit.
    pub(super) opacity: f64,
    pub(super) f_dc: [f32; 3],
}

/// How a file's coordinates become the world's.
pub(super) struct GaussianPlace<'a> {
    path: &'a Path,
    frame: &'a SceneFrame,
    world: Option<&'a ParserWorld>,
    /// What the file's positions are about.
    pub(super) origin: DVec3,
    /// The rotation from the file's axes, for where there is another world.
    turned: Option<(DMat3, DQuat)>,
    log_unit: f64,
}

impl<'a> GaussianPlace<'a> {
    pub(super) fn new(path: &'a Path, frame: &'a SceneFrame, world: Option<&'a ParserWorld>) -> GaussianPlace<'a> {
        let turned = world.map(ParserWorld::file_from_parser).map(|axes| (axes, DQuat::from_mat3(&axes).normalize()));
        let log_unit = frame.scale.ln() + world.map_or(0.0, |world| world.scale.ln());
        GaussianPlace { path, frame, world, origin: DVec3::ZERO, turned, log_unit }
    }

    /// The rotation of the file's axes to the world's, if there is one.
    pub(super) fn rotation(&self) -> Option<DMat3> {
        self.turned.map(|(axes, _)| axes)
    }

    /// The Gaussian in the world. Opacities and scales beyond [`MAX_LOGARITHM`] are limited to it.
    pub(super) fn gaussian(&self, index: usize, raw: &RawGaussian) -> Result<Gaussian, SceneError> {
        let RawGaussian { position: stated, log_scales, rotation, opacity, f_dc } = raw;
        let mut position = *stated;
        if let Some(world) = self.world {
            position = world.point(position);
        }
        if self.origin != DVec3::ZERO {
            position += self.origin;
        }
        if *self.frame != SceneFrame::FILE {
            position = self.frame.world(position);
        }
        let place = || FilePlace::key(self.path, format!("vertex[{index}]"));
        let limit = f64::from(MAX_COORDINATE);
        if !position.to_array().iter().all(|coordinate| coordinate.abs() <= limit) {
            return Err(place().fault(SceneFault::Point(stated.to_array())));
        }
        let values = rotation.iter().chain(f_dc).map(|value| f64::from(*value));
        let logarithms = log_scales.iter().copied().filter(|value| *value != f64::NEG_INFINITY);
        if let Some(value) = values.chain(logarithms).find(|value| !value.is_finite()) {
            return Err(place().fault(FileFault::NotFinite(value.to_string())));
        }
        let mut rotation = *rotation;
        if let Some((_, turn)) = self.turned {
            let [w, x, y, z] = if rotation == [0.0; 4] { [1.0, 0.0, 0.0, 0.0] } else { rotation.map(f64::from) };
            let product = turn * DQuat::from_xyzw(x, y, z, w);
            rotation = [product.w, product.x, product.y, product.z].map(|value| value as f32);
        }
        Ok(Gaussian {
            position: position.as_vec3().to_array(),
            log_scales: log_scales.map(|value| limited(value - self.log_unit)),
            rotation,
            opacity: limited(*opacity),
            f_dc: *f_dc,
        })
    }
}

fn limited(logarithm: f64) -> f32 {
    let most = f64::from(MAX_LOGARITHM);
    logarithm.clamp(-most, most) as f32
}
