//! A scene of Gaussians as one page: a file that any browser with WebGL 2 shows, on a phone too, without a server and
//! without the network.
//!
//! It has the Gaussians (means as `f32`, scales and rotations in 16 bits, colours and opacities in 8; of the spherical
//! harmonics degree 0), the source cameras, gsplat.js (`vendor/gsplat.md`), which draws, and the scripts of `page/`.
//! The weights that it shows are those of `distance:power=2`, which a script computes for the view on the screen: pages
//! have no server to ask for another scheme.

use std::collections::HashMap;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::gaussian::{SH_0, opacity};
use viewfuse_field::optimise::EndedOptimisation;
use viewfuse_job::files::{WriteError, write_whole};
use viewfuse_scene::Scene;
use viewfuse_scene::gaussians::{Gaussian, GaussianScene};
use viewfuse_scene::reader::has_extension;
use viewfuse_scene::rig::Rig;

use crate::ring::{RingPlace, ring};
use crate::scripts::{BASE_STYLE, COLOURS, HANDS, ORBITS, OUTLINES, POSES, SEEN, SHARES, Script, VECTORS, joined};

/// Scripts in the order of their imports.
const SCRIPTS: [Script; 12] = [
    VECTORS,
    POSES,
    COLOURS,
    OUTLINES,
    SHARES,
    ORBITS,
    HANDS,
    SEEN,
    Script { name: "weights.js", text: include_str!("../page/weights.js") },
    Script { name: "gaussians.js", text: include_str!("../page/gaussians.js") },
    Script { name: "stage.js", text: include_str!("../page/stage.js") },
    Script { name: "page.js", text: include_str!("../page/page.js") },
];
const TEMPLATE: &str = include_str!("../page/index.html");
const STYLE: &str = include_str!("../page/page.css");
const VIEWER: &str = include_str!("../vendor/gsplat.js");
const LICENCE: &str = include_str!("../vendor/gsplat.LICENSE");

/// What a page shows.
#[derive(Clone, Copy, Debug)]
pub struct GaussianPage<'a> {
    /// Its title, usually the scene's name.
    pub title: &'a str,
    /// The Gaussians, in world coordinates.
    pub scene: &'a GaussianScene,
    /// The source cameras with their names: at least one, in world coordinates.
    pub cameras: &'a [(String, Camera)],
    /// What lies behind the Gaussians: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
}

/// The formats that Gaussians are written in, by extension.
const FORMATS: [&str; 4] = ["ply", "splat", "spz", "html"];

/// Whether a file of this name can be written.
///
/// # Errors
/// For a format that is none.
pub fn check_name(path: &Path) -> Result<(), &'static str> {
    match has_extension(path, &FORMATS) {
        true => Ok(()),
        false => Err("scenes of Gaussians are written as .ply or .html, and smaller as .splat or .spz"),
    }
}

/// Whether a file of this name is a page.
pub fn is_page(path: &Path) -> bool {
    has_extension(path, &["html"])
}

/// Whether a file of this name holds colours that depend on the direction: pages and `.splat` have one for all.
pub fn holds_harmonics(path: &Path) -> bool {
    !is_page(path) && !has_extension(path, &["splat"])
}

/// Writes what an optimisation of a scene from these sources ended with: as a page if the file is called so, otherwise
/// as [`GaussianScene::write`] does.
///
/// # Errors
/// [`WriteError`].
pub fn write_optimised(
    path: &Path,
    scene: &Scene,
    sources: &[usize],
    ended: &EndedOptimisation,
) -> Result<(), WriteError> {
    let EndedOptimisation { gaussians, background, .. } = ended;
    if !is_page(path) {
        return gaussians.write(path, &scene.frame);
    }
    let views = sources.iter().map(|view| &scene.views[*view]);
    let cameras: Vec<(String, Camera)> = views.map(|view| (view.name.clone(), view.camera)).collect();
    let page = GaussianPage { title: &scene.name(), scene: gaussians, cameras: &cameras, background: *background };
    write_html(path, &page)
}

/// Writes the page, completely or not at all. Of 40 thousand Gaussians it has 1.8 MB.
///
/// # Errors
/// [`WriteError`].
pub fn write_html(path: &Path, page: &GaussianPage<'_>) -> Result<(), WriteError> {
    let told = serde_json::to_string(&Told::of(page))
        .map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: Box::new(cause) })?;
    // The first picture is that of the camera in the middle, and the frame has its shape.
    let shape = page.cameras.get(start(page.cameras)).map_or([1; 2], |(_, camera)| sides(camera));
    let [red, green, blue] = page.background.map(level);
    let mut values = HashMap::from([
        ("title", escaped(page.title)),
        ("style", format!("{BASE_STYLE}{STYLE}")),
        ("count", page.scene.gaussians.len().to_string()),
        ("source_count", page.cameras.len().to_string()),
        ("background", format!("rgb({red} {green} {blue})")),
        ("aspect", format!("{} / {}", shape[0], shape[1])),
        ("licence", LICENCE.trim().replace("--", "- -")),
        ("viewer", VIEWER.to_owned()),
        ("script", joined(&SCRIPTS)),
        // No text of a file ends the element that it is in.
        ("scene", told.replace('<', "\\u003c")),
    ]);
    // The page says its own size, to a tenth of a megabyte.
    let length = filled(TEMPLATE, &values).len();
    values.insert("size", format!("{:.1}", length as f64 / 1.0e6));
    write_whole(path, filled(TEMPLATE, &values).as_bytes())
}

/// The template with its values, each put in once: what is in them is not looked at.
fn filled(template: &str, values: &HashMap<&str, String>) -> String {
    let mut parts = template.split("{{");
    let mut page = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, rest) = part.split_once("}}").unwrap_or((part, ""));
        page.push_str(values.get(name).map_or("", String::as_str));
        page.push_str(rest);
    }
    page
}

/// A text as it stands in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What the page's scripts know.
#[derive(Serialize)]
struct Told<'a> {
    gaussians: Stored,
    cameras: Vec<Row<'a>>,
    /// The camera that the page begins with.
    start: usize,
    focus: [f32; 3],
    up: [f32; 3],
    /// Mean distance of the cameras from the focus.
    distance: f32,
    ring: Vec<RingPlace>,
    /// The viewer's unit: the median standard deviation, because it keeps variances in half precision.
    unit: f32,
}

/// A source camera: world from camera, row-major, OpenCV axes; intrinsics in pixels of `size`.
#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    pose: [[f32; 4]; 4],
    lens: Lens,
}

#[derive(Serialize)]
struct Lens {
    focal: [f32; 2],
    size: [u32; 2],
    principal: [f32; 2],
}

/// The Gaussians as base64 of little-endian numbers, an array after the other.
#[derive(Serialize)]
struct Stored {
    count: usize,
    /// What 0 and 65535 of `scales` stand for, as natural logarithms.
    limits: [f32; 2],
    means: String,
    scales: String,
    rotations: String,
    colours: String,
}

impl<'a> Told<'a> {
    fn of(page: &GaussianPage<'a>) -> Told<'a> {
        let cameras: Vec<Camera> = page.cameras.iter().map(|(_, camera)| *camera).collect();
        let rig = Rig::of(&cameras);
        let mut deviations: Vec<f32> =
            log_scales(page.scene).map(f32::exp).filter(|deviation| *deviation > 0.0).collect();
        deviations.sort_unstable_by(f32::total_cmp);
        let row = |(name, camera): &'a (String, Camera)| Row {
            name,
            pose: camera.pose.to_opencv(),
            lens: Lens { focal: camera.pinhole.focal(), size: sides(camera), principal: camera.pinhole.principal() },
        };
        Told {
            gaussians: Stored::of(page.scene),
            cameras: page.cameras.iter().map(row).collect(),
            start: start(page.cameras),
            focus: rig.focus.to_array(),
            up: rig.up.to_array(),
            distance: rig.distance,
            ring: ring(&cameras),
            unit: deviations.get(deviations.len() / 2).copied().unwrap_or(1.0),
        }
    }
}

impl Stored {
    fn of(scene: &GaussianScene) -> Stored {
        let all = &scene.gaussians;
        let limits =
            log_scales(scene).fold([f32::MAX, f32::MIN], |[low, high], value| [low.min(value), high.max(value)]);
        let limits = if all.is_empty() { [0.0; 2] } else { limits };
        let span = (limits[1] - limits[0]).max(f32::MIN_POSITIVE);
        let scale = |value: f32| ((value - limits[0]) / span * 65_535.0).round() as u16;
        Stored {
            count: all.len(),
            limits,
            means: text(all.iter().flat_map(|gaussian| gaussian.position).flat_map(f32::to_le_bytes)),
            scales: text(log_scales(scene).flat_map(|value| scale(value).to_le_bytes())),
            rotations: text(all.iter().flat_map(|gaussian| turn(gaussian.rotation)).flat_map(i16::to_le_bytes)),
            colours: text(all.iter().flat_map(colour)),
        }
    }
}

fn log_scales(scene: &GaussianScene) -> impl Iterator<Item = f32> + '_ {
    scene.gaussians.iter().flat_map(|gaussian| gaussian.log_scales)
}

/// The index of the camera nearest to the middle of all.
fn start(cameras: &[(String, Camera)]) -> usize {
    let centre = |(_, camera): &(String, Camera)| camera.pose.centre_world();
    let middle = cameras.iter().map(centre).sum::<Vec3>() / cameras.len().max(1) as f32;
    let distance = |index: &usize| centre(&cameras[*index]).distance(middle);
    (0..cameras.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
}

fn sides(camera: &Camera) -> [u32; 2] {
    [camera.pinhole.width(), camera.pinhole.height()]
}

/// A quaternion of length 1, in units of 1 / 32767; no rotation for one that is none.
fn turn(rotation: [f32; 4]) -> [i16; 4] {
    let length = rotation.iter().map(|part| f64::from(*part).powi(2)).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return [i16::MAX, 0, 0, 0];
    }
    rotation.map(|part| (f64::from(part) / length * 32_767.0).round() as i16)
}

fn colour(gaussian: &Gaussian) -> [u8; 4] {
    let [red, green, blue] = gaussian.f_dc.map(|value| level(0.5 + SH_0 * value));
    [red, green, blue, level(opacity(gaussian.opacity))]
}

fn level(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

fn text(bytes: impl Iterator<Item = u8>) -> String {
    STANDARD.encode(bytes.collect::<Vec<u8>>())
}
