//! Generated scenes to train on, and with what photographs have besides: noise, exposures, zoom, poses that are a little off.

use anyhow::bail;
use glam::{Mat3, Vec3};
use image::{DynamicImage, Rgb};
use std::path::Path;
use viewfuse_core::pose::Pose;
use viewfuse_core::random::normal;
use viewfuse_job::progress::Silent;
use viewfuse_scene::Scene;
use viewfuse_synthetic::{Place, Rig, Shoot, generate, write_shoot};

/// Views of a scene.
const VIEWS: u32 = 9;
/// Rays of a pixel along each side.
const RAYS: u32 = 3;
/// Spread of the factors on exposures, and on focal lengths.
const EXPOSURES: f32 = 0.2;
const FOCALS: f32 = 0.1;
/// Standard deviation of the noise of a photograph, of 1.
const NOISE: f32 = 0.015;
/// Standard deviation of the error of a pose's rotation, in pixels in the middle of the picture.
const POSE_ERROR: f32 = 0.3;
/// Seed of the first scene to train on; scenes to test on have smaller ones.
const FIRST_SEED: u64 = 1000;

/// A scene to train on: number `index`, with pictures of the longest side `side`. With `as_photographs` it has noise, exposures,
/// zoom, and poses that are a little off.
pub(crate) fn training_scene(folder: &Path, index: u64, side: u32, as_photographs: bool) -> anyhow::Result<Scene> {
    let place = [Place::Room, Place::Garden][index as usize % 2];
    let rig = [Rig::Arc, Rig::Forward, Rig::Handheld, Rig::Turntable][index as usize / 2 % 4];
    let shoot = made(place, rig, FIRST_SEED + index, side)?;
    if !as_photographs {
        write_shoot(folder, &shoot, RAYS, &Silent)?;
        return Ok(Scene::open(folder)?);
    }
    write_shoot(folder, &shoot.with_exposures(EXPOSURES).with_focals(FOCALS)?, RAYS, &Silent)?;
    let mut scene = Scene::open(folder)?;
    for (view, own) in scene.views.iter_mut().enumerate() {
        let key = [(FIRST_SEED + index) as u32, view as u32];
        if let Some(path) = &own.image {
            noisy(image::open(path)?, key).save(path)?;
        }
        let focal = own.camera.pinhole.focal()[0];
        let turn = Vec3::from_array([0, 1, 2].map(|axis| POSE_ERROR / focal * normal(key, 0, axis)));
        own.camera.pose = turned(&own.camera.pose, turn)?;
    }
    Ok(scene)
}

/// `PLACE/RIG/SEED`, written to `folder`.
pub(crate) fn test_scene(folder: &Path, words: &str, side: u32) -> anyhow::Result<Scene> {
    let [place, rig, seed] = words.split('/').collect::<Vec<_>>()[..] else {
        bail!("'{words}': a generated scene is PLACE/RIG/SEED");
    };
    let seed: u64 = seed.parse()?;
    if seed >= FIRST_SEED {
        bail!("'{words}': scenes with seeds from {FIRST_SEED} are trained on");
    }
    write_shoot(folder, &made(place.parse()?, rig.parse()?, seed, side)?, RAYS, &Silent)?;
    Ok(Scene::open(folder)?)
}

fn made(place: Place, rig: Rig, seed: u64, side: u32) -> anyhow::Result<Shoot> {
    Ok(generate(place, rig, seed, [side, side * 3 / 4], VIEWS)?)
}

/// A photograph with noise, the same in its three channels by a half.
fn noisy(photograph: DynamicImage, key: [u32; 2]) -> DynamicImage {
    let mut photograph = photograph.to_rgb8();
    for (index, Rgb(levels)) in photograph.pixels_mut().enumerate() {
        let common = normal(key, index as u32, 4);
        for (channel, level) in levels.iter_mut().enumerate() {
            let noise = std::f32::consts::FRAC_1_SQRT_2 * (common + normal(key, index as u32, 5 + channel as u32));
            *level = (f32::from(*level) + 255.0 * NOISE * noise).round().clamp(0.0, 255.0) as u8;
        }
    }
    DynamicImage::ImageRgb8(photograph)
}

/// A pose turned about its own axes by a small rotation in radians.
fn turned(pose: &Pose, turn: Vec3) -> anyhow::Result<Pose> {
    let axes = Mat3::from_cols(pose.right_world(), pose.down_world(), pose.forward_world());
    let turn = Mat3::from_axis_angle(turn.try_normalize().unwrap_or(Vec3::X), turn.length());
    let axes = axes * turn;
    let rows = axes.transpose();
    let centre = pose.centre_world();
    let row = |row: Vec3, centre: f32| [row.x, row.y, row.z, centre];
    let last = [0.0, 0.0, 0.0, 1.0];
    let matrix = [row(rows.x_axis, centre.x), row(rows.y_axis, centre.y), row(rows.z_axis, centre.z), last];
    Ok(Pose::from_opencv(&matrix)?)
}
