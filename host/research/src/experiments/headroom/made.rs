//! Generated scenes with exact depths.

use super::oracle::Depths;
use anyhow::{Context, bail};
use std::path::Path;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_job::progress::Silent;
use viewfuse_synthetic::cameras::{sphere, spiral_views};
use viewfuse_synthetic::{Kind, Object, Place, Rig, Shoot, generate, trace, write_scene, write_shoot};

/// Views of a room or a garden.
const SHOOT_VIEWS: u32 = 9;
/// Views of an object.
const OBJECT_VIEWS: u32 = 60;
/// Seed of the objects: none that a shipped network was trained on.
const OBJECT_SEED: u64 = 1;
/// Index of the first object: from here on they are for tests.
const FIRST_TEST_OBJECT: u32 = 2_000_000;
/// Rays of a pixel along each side.
const RAYS: u32 = 3;

/// A scene that was made.
pub(crate) enum Made {
    /// With a background.
    Shoot(Box<Shoot>),
    /// Cut out.
    Object(Box<Object>, Vec<Camera>),
}

impl Made {
    /// `PLACE/RIG/SEED`, or `KIND/INDEX`; pictures have a longest side of `side` pixels.
    pub(crate) fn parse(text: &str, side: u32) -> anyhow::Result<Made> {
        let words: Vec<&str> = text.split('/').collect();
        match words.as_slice() {
            [place, rig, seed] => {
                let (place, rig): (Place, Rig) = (place.parse()?, rig.parse()?);
                let shoot = generate(place, rig, seed.parse()?, [side, side * 3 / 4], SHOOT_VIEWS)?;
                Ok(Made::Shoot(Box::new(shoot)))
            }
            [kind, index] => {
                let kind: Kind = kind.parse()?;
                let object = kind.object(OBJECT_SEED, FIRST_TEST_OBJECT + index.parse::<u32>()?)?;
                Ok(Made::Object(Box::new(object), spiral_views(&sphere(side)?, OBJECT_VIEWS)?))
            }
            _ => bail!("'{text}': a generated scene is PLACE/RIG/SEED or KIND/INDEX"),
        }
    }

    /// Writes its photographs.
    pub(crate) fn write(&self, folder: &Path) -> anyhow::Result<()> {
        match self {
            Made::Shoot(shoot) => write_shoot(folder, shoot, RAYS, &Silent)?,
            Made::Object(object, cameras) => write_scene(folder, object, cameras, RAYS, &Silent)?,
        }
        Ok(())
    }

    /// Exact depths of views. `scale` is the length of a world unit of the opened scene in the generator's units.
    pub(crate) fn depths(&self, sources: &[usize], target: usize, scale: f64) -> anyhow::Result<Depths> {
        let of = |view: usize| -> anyhow::Result<Vec<f32>> {
            let own = match self {
                Made::Shoot(shoot) => shoot.depth(view).context("no such view")?,
                Made::Object(object, cameras) => object_depth(object, &cameras[view]),
            };
            Ok(own.into_iter().map(|depth| (f64::from(depth) / scale) as f32).collect())
        };
        let sources: Vec<Vec<f32>> = sources.iter().map(|&view| of(view)).collect::<anyhow::Result<_>>()?;
        Ok(Depths { target: of(target)?, sources })
    }
}

/// Depth of each pixel's centre along the principal axis; infinite beside the object.
fn object_depth(object: &Object, camera: &Camera) -> Vec<f32> {
    let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
    let forward = Pose::forward_world(&camera.pose);
    let depth = |pixel: u32| {
        let ray = camera.ray((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        trace(object, &ray).map_or(f32::INFINITY, |hit| hit.distance * ray.direction_world.dot(forward))
    };
    (0..width * height).map(depth).collect()
}
