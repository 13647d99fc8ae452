//! A whole picture on a device compared with the CPU's.
//!
//! The scene is a given one, or the synthetic lorry, written to a temporary folder: an installed program has no
//! sample scene. The last view is rendered from up to [`MAX_SOURCES`] others.

use super::measure::Role;
use super::report::{CheckError, PictureReport, PictureVersusCpu};
use image::RgbImage;
use std::path::Path;
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_core::metrics::psnr;
use viewfuse_device::choice::AnyDevice;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::render::{Frame, RenderError, RenderOptions, RenderRun, render};
use viewfuse_field::{AnyField, Renderer};
use viewfuse_job::files::Scratch;
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{FewShot, Selection};
use viewfuse_scene::photographs::longest_side;
use viewfuse_weighting::Weighting;

/// The most sources of the picture.
pub const MAX_SOURCES: usize = 12;
/// Longest side of the picture.
pub const LONGEST_SIDE: u32 = 160;
/// The photographs of the synthetic lorry, one below the other, and their poses, one a line: every other training view
/// of the sample scene and one of its test views, half as large. A test compares them with what the laboratory makes.
const LORRY: (&[u8], &str) = (include_bytes!("picture/lorry.png"), include_str!("picture/lorry.txt"));
/// Width and height of these photographs.
const LORRY_SIDE: u32 = 64;
/// Their intrinsics, in the layout of SRN.
const LORRY_INTRINSICS: &str = "65.625 32. 32. 0.\n0. 0. 0.\n1.\n64 64\n";
/// Largest difference of a channel that passes, in steps of 1/255: rounding to 8 bits may fall to either side.
pub const MAX_DIFFERENCE: u8 = 1;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// A picture to be rendered on every device, and the CPU's.
pub struct Picture {
    scene: Scene,
    name: String,
    job: FewShot,
    options: RenderOptions,
    reference: RgbImage,
    reference_time: Duration,
    /// Keeps the temporary folder of the synthetic photographs.
    _folder: Option<Scratch>,
}

impl Picture {
    /// The picture of a scene, or of the synthetic one; renders it on the CPU.
    ///
    /// # Errors
    /// [`CheckError::Picture`].
    pub fn new(path: Option<&Path>, progress: &dyn Progress) -> Result<Picture, CheckError> {
        let name = path.map_or_else(|| "the synthetic lorry".to_owned(), |path| path.display().to_string());
        Picture::prepare(path, name.clone(), progress).map_err(|source| CheckError::Picture { scene: name, source })
    }

    fn prepare(path: Option<&Path>, name: String, progress: &dyn Progress) -> Result<Picture, AnyError> {
        let (folder, scene) = match path {
            Some(path) => (None, Scene::open(path)?),
            None => {
                let folder = lorry()?;
                let scene = Scene::open(folder.path())?;
                (Some(folder), scene)
            }
        };
        let selection = Selection {
            targets: scene.views.last().map(|view| view.name.clone()),
            view_count: Some(MAX_SOURCES),
            ..Selection::default()
        };
        let job = selection.resolve(&scene, AnyField::default().about().least_sources)?;
        let options =
            RenderOptions { size: job.targets.first().and_then(|t| size(&t.camera)), ..RenderOptions::default() };
        let (reference, reference_time) =
            rendered(AnyField::default().on(&AnyDevice::Cpu(Cpu)).as_ref(), &scene, &job, &options, progress)?;
        Ok(Picture { scene, name, job, options, reference, reference_time, _folder: folder })
    }

    /// Renders it with the training-free field on a device and compares it with the CPU's.
    ///
    /// # Errors
    /// [`CheckError::Picture`].
    pub fn check(
        &self,
        renderer: &dyn Renderer,
        role: Role,
        progress: &dyn Progress,
    ) -> Result<PictureReport, CheckError> {
        let mut report = PictureReport {
            scene: self.name.clone(),
            target: self.job.targets.first().map_or_else(String::new, |target| target.name.clone()),
            source_count: self.job.sources.len(),
            size: [self.reference.width(), self.reference.height()],
            seconds: self.reference_time.as_secs_f64(),
            versus_cpu: None,
            breach: None,
        };
        // The CPU's picture is not compared with itself.
        if role == Role::Other {
            let failed = |source| CheckError::Picture { scene: self.name.clone(), source };
            let (picture, time) =
                rendered(renderer, &self.scene, &self.job, &self.options, progress).map_err(failed)?;
            report.seconds = time.as_secs_f64();
            let (versus, breach) = compare(&picture, &self.reference);
            (report.versus_cpu, report.breach) = (versus, breach);
        }
        Ok(report)
    }
}

/// Width and height with a longest side of at most [`LONGEST_SIDE`].
fn size(camera: &Camera) -> Option<[u32; 2]> {
    let longest = longest_side(camera);
    let side = |length: u32| {
        let scaled = f64::from(length) * f64::from(LONGEST_SIDE) / f64::from(longest);
        (scaled.round() as u32).max(1)
    };
    (longest > LONGEST_SIDE).then(|| [side(camera.pinhole.width()), side(camera.pinhole.height())])
}

/// A temporary folder with the synthetic lorry.
fn lorry() -> Result<Scratch, AnyError> {
    let folder = Scratch::new()?;
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir(path("rgb"))?;
    std::fs::create_dir(path("pose"))?;
    std::fs::write(path("intrinsics.txt"), LORRY_INTRINSICS)?;
    let photographs = image::load_from_memory(LORRY.0)?;
    for (view, pose) in (0..).zip(LORRY.1.lines()) {
        std::fs::write(path(&format!("pose/{view:06}.txt")), pose)?;
        let photograph = photographs.crop_imm(0, view * LORRY_SIDE, LORRY_SIDE, LORRY_SIDE);
        photograph.save(path(&format!("rgb/{view:06}.png")))?;
    }
    Ok(folder)
}

/// The picture of a job's only target, and the time from the photographs to it.
fn rendered(
    renderer: &dyn Renderer,
    scene: &Scene,
    job: &FewShot,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<(RgbImage, Duration), AnyError> {
    let weighting = Weighting::default_scheme();
    let mut picture = None;
    let start = Instant::now();
    let keep = |_: &_, frame: Frame| -> Result<(), RenderError> {
        picture = Some(frame.picture);
        Ok(())
    };
    render(&RenderRun { scene, job, renderer, options, progress }, &weighting, keep)?;
    let time = start.elapsed();
    Ok((picture.ok_or("the scene has no view to render")?, time))
}

/// The difference of two pictures of the same size, and whether it exceeds the tolerance.
pub fn compare(picture: &RgbImage, reference: &RgbImage) -> (Option<PictureVersusCpu>, Option<String>) {
    if picture.dimensions() != reference.dimensions() || picture.is_empty() {
        return (None, Some("the pictures do not have the same size".to_owned()));
    }
    let worst = picture.iter().zip(reference.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(u8::MAX);
    let differing = picture.pixels().zip(reference.pixels()).filter(|(a, b)| a != b).count();
    let decibels = psnr(picture, reference);
    let versus = PictureVersusCpu { worst, differing, psnr: decibels.is_finite().then_some(decibels) };
    let breach = if picture.iter().all(|value| *value == picture.as_raw()[0]) {
        Some("every pixel is the same".to_owned())
    } else if worst > MAX_DIFFERENCE {
        Some(format!("a pixel differs by {worst}/255"))
    } else {
        None
    };
    (Some(versus), breach)
}
