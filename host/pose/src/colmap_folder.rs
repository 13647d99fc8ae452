//! The folder in which COLMAP works on a job, and the model that it leaves there as a solution.
//!
//! ```text
//! images/00000.png ...   the job's photographs by their indices
//! camera_0.txt ...       the images of each camera
//! database.db            features and matches
//! sparse/0 ...           models: parts of the scene that were not joined
//! ```

use crate::solution::{PoseJob, Solution, SolvedCamera, SolvedPhotograph, SolvedPoint, SolverError};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_job::files::Scratch;
use viewfuse_scene::READERS;
use viewfuse_scene::reader::{PoseForm, RawScene, RawView, Reader};

/// A camera before the work, as COLMAP takes it.
#[derive(Debug, Serialize)]
pub(crate) struct FolderCamera {
    /// The images that it took, names in `images`.
    pub(crate) images: Vec<String>,
    /// The file that lists them.
    pub(crate) list: PathBuf,
    /// Parameters of the model SIMPLE_RADIAL, `f,cx,cy,k`, where the focal length is known.
    pub(crate) parameters: Option<String>,
    /// Focal length in longest sides.
    pub(crate) factor: f64,
}

pub(crate) struct ColmapFolder {
    scratch: Scratch,
    pub(crate) cameras: Vec<FolderCamera>,
}

fn image_name(photograph: usize) -> String {
    format!("{photograph:05}.png")
}

impl ColmapFolder {
    /// Lays a job out.
    pub(crate) fn of(job: &PoseJob) -> std::io::Result<ColmapFolder> {
        let scratch = Scratch::new()?;
        let folder = scratch.path();
        fs::create_dir(folder.join("images"))?;
        fs::create_dir(folder.join("sparse"))?;
        for (index, photograph) in job.photographs.iter().enumerate() {
            fs::copy(&photograph.path, folder.join("images").join(image_name(index)))?;
        }
        let mut cameras = Vec::new();
        for (index, guess) in job.cameras.iter().enumerate() {
            let all = job.photographs.iter().enumerate().filter(|(_, photograph)| photograph.camera == index);
            let images: Vec<String> = all.clone().map(|(photograph, _)| image_name(photograph)).collect();
            let Some(size) = all.map(|(_, photograph)| photograph.size).next() else { continue };
            let [width, height] = size.map(f64::from);
            let list = folder.join(format!("camera_{index}.txt"));
            fs::write(&list, images.join("\n") + "\n")?;
            let known = format!("{},{},{},0", guess.focal, 0.5 * width, 0.5 * height);
            let parameters = (!guess.is_guess).then_some(known);
            cameras.push(FolderCamera { images, list, parameters, factor: guess.focal / width.max(height) });
        }
        Ok(ColmapFolder { scratch, cameras })
    }

    pub(crate) fn path(&self) -> &Path {
        self.scratch.path()
    }

    /// The model with the most images as a solution, by a solver of this name and version; `program` is named in
    /// errors.
    ///
    /// # Errors
    /// [`SolverError::Nothing`] without a model, [`SolverError::Broken`] if none can be read or it does not fit the
    /// job.
    pub(crate) fn solution(&self, job: &PoseJob, solver: String, program: &Path) -> Result<Solution, SolverError> {
        let broken = |problem: String| SolverError::Broken(program.to_path_buf(), problem);
        let reader = READERS.iter().find(|reader| reader.name() == "colmap");
        let Some(reader) = reader else { return Err(broken("there is no reader of its models".to_owned())) };
        let entries = fs::read_dir(self.path().join("sparse")).map_err(|error| broken(error.to_string()))?;
        let mut folders: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        folders.sort();
        let mut best: Option<RawScene> = None;
        for folder in &folders {
            let model = read(*reader, folder).map_err(&broken)?;
            if best.as_ref().is_none_or(|best| model.views.len() > best.views.len()) {
                best = Some(model);
            }
        }
        let model = best.ok_or_else(|| SolverError::Nothing("no two photographs with a common geometry".to_owned()))?;
        let solution = solution_of(job, &model, solver);
        let solution = solution.filter(|solution| solution.fits(job));
        solution.ok_or_else(|| broken("its model does not fit the photographs".to_owned()))
    }
}

fn read(reader: &dyn Reader, folder: &Path) -> Result<RawScene, String> {
    reader.read(folder).map_err(|error| format!("its model cannot be read: {error}"))
}

/// `None` if an image is none of the job's, or a camera has no intrinsics.
fn solution_of(job: &PoseJob, model: &RawScene, solver: String) -> Option<Solution> {
    let unregistered = SolvedPhotograph { camera_from_world: None, reason: Some("not registered".to_owned()) };
    let mut photographs = vec![unregistered; job.photographs.len()];
    let mut cameras: Vec<SolvedCamera> = (0..job.cameras.len()).map(|camera| unsolved(job, camera)).collect();
    let mut photograph_of = Vec::with_capacity(model.views.len());
    for view in &model.views {
        let photograph: usize = view.name.parse().ok().filter(|index| *index < job.photographs.len())?;
        let [x, y, z, _] = Some(view.pose.matrix).filter(|_| view.pose.form == PoseForm::OpenCvFromWorld)?;
        photographs[photograph] = SolvedPhotograph { camera_from_world: Some([x, y, z]), reason: None };
        cameras[job.photographs[photograph].camera] = solved(view)?;
        photograph_of.push(photograph);
    }
    let points = model.points.iter().map(|point| {
        let seen = point.views.iter().filter_map(|view| {
            let photograph = photograph_of[*view as usize];
            let camera = &cameras[job.photographs[photograph].camera];
            Some((photograph, project(camera, photographs[photograph].camera_from_world?, point.position)?))
        });
        SolvedPoint { position: point.position, error: point.error.max(0.0), seen: seen.collect() }
    });
    let points = points.collect();
    Some(Solution { solver, cameras, photographs, points, pairs: Vec::new(), apart: None })
}

/// A camera none of whose photographs has a pose: as it was before.
fn unsolved(job: &PoseJob, camera: usize) -> SolvedCamera {
    let size = job
        .photographs
        .iter()
        .find(|photograph| photograph.camera == camera)
        .map_or([1, 1], |photograph| photograph.size);
    SolvedCamera { focal: job.cameras[camera].focal, principal: size.map(|side| 0.5 * f64::from(side)), k1: 0.0 }
}

fn solved(view: &RawView) -> Option<SolvedCamera> {
    let intrinsics = view.intrinsics.as_ref()?;
    let k1 = intrinsics.lens.as_ref().map_or(0.0, |lens| lens.coefficients()[0]);
    Some(SolvedCamera { focal: intrinsics.focal[0], principal: intrinsics.principal, k1 })
}

/// Where a camera sees a point, in pixels; `None` behind it.
fn project(camera: &SolvedCamera, pose: [[f64; 4]; 3], point: [f64; 3]) -> Option<[f64; 2]> {
    let [x, y, z] = pose.map(|row| row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]);
    let radial = 1.0 + camera.k1 * (x * x + y * y) / (z * z);
    let place = |axis: usize, across: f64| camera.principal[axis] + camera.focal * radial * across / z;
    (z > 0.0).then(|| [place(0, x), place(1, y)])
}
