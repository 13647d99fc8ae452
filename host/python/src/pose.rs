//! From bare photographs to a scene, with the defaults of the command.

use crate::error::Failure;
use crate::interrupt::watched;
use crate::scene::PyScene;
use crate::whole::Whole;
use image::DynamicImage;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use viewfuse::job::progress::Progress;
use viewfuse::output::camera_map::camera_map;
use viewfuse::pose::{Colmap, Kept, OpenMvg, Options, PyColmap, Solver, find, has_record, write};
use viewfuse::scene::encode_png;
use viewfuse::scene::inspect::inspect;
use viewfuse::scene::photographs::BackgroundChoice;
use viewfuse::scene::write::Layout;

/// What finds poses: the names of solvers, or each with the program that it is to be.
#[derive(FromPyObject)]
pub(crate) enum Solvers {
    One(String),
    Programs(BTreeMap<String, PathBuf>),
    Several(Vec<String>),
}

/// What [`pose`] is asked for.
struct Order {
    photographs: PathBuf,
    output: PathBuf,
    solvers: Vec<Box<dyn Solver>>,
    options: Options,
    layout: Layout,
}

/// Finds the poses of a folder's photographs, and writes them as a scene to a folder that is not there yet, or empty. A
/// call that was ended goes on behind the attempts that it had finished.
#[pyfunction]
#[pyo3(signature = (photographs, output, *, focal=None, solvers=None, every=Whole(1), layout="colmap", seed=Whole(0), progress=None))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn pose(
    py: Python<'_>,
    photographs: PathBuf,
    output: PathBuf,
    focal: Option<f64>,
    solvers: Option<Solvers>,
    every: Whole<usize>,
    layout: &str,
    seed: Whole<u64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<PyScene> {
    if let Some(focal) = focal.filter(|focal| !(1.0..=1.0e6).contains(focal)) {
        return Err(Failure::Input(format!("focal: {focal} is not a number of pixels from 1")).into());
    }
    let (every, seed) = (every.0, seed.0);
    if every == 0 {
        return Err(Failure::Input("every: 0 is not a whole number from 1".to_owned()).into());
    }
    let options = Options { focal, seed, every };
    let (solvers, layout) = (opened(solvers)?, known_layout(layout)?);
    let order = Order { photographs, output, solvers, options, layout };
    watched(py, progress, |progress| order.carry_out(progress))?;
    PyScene::open(py, order.output, "auto")
}

/// The layouts that hold lenses.
fn known_layout(text: &str) -> Result<Layout, Failure> {
    let layouts = [Layout::Colmap, Layout::ColmapBinary, Layout::Transforms];
    let layout = layouts.into_iter().find(|layout| layout.to_string() == text);
    layout.ok_or_else(|| {
        Failure::Input(format!("layout: '{text}': the layout must be colmap, colmap-binary or transforms"))
    })
}

/// The solvers, each with its program: the one that is given, or the one that the system finds.
fn opened(solvers: Option<Solvers>) -> Result<Vec<Box<dyn Solver>>, Failure> {
    let named: Vec<(String, Option<PathBuf>)> = match solvers {
        None => vec![("openmvg".to_owned(), None)],
        Some(Solvers::One(name)) => vec![(name, None)],
        Some(Solvers::Several(names)) => names.into_iter().map(|name| (name, None)).collect(),
        Some(Solvers::Programs(all)) => all.into_iter().map(|(name, program)| (name, Some(program))).collect(),
    };
    let solver = |(name, program): (String, Option<PathBuf>)| -> Result<Box<dyn Solver>, Failure> {
        let program = |usual: &str| program.unwrap_or_else(|| usual.into());
        match name.as_str() {
            "openmvg" => Ok(Box::new(OpenMvg::new(program("viewfuse-openmvg")))),
            "colmap" => Ok(Box::new(Colmap { program: program("colmap") })),
            "pycolmap" => Ok(Box::new(PyColmap { python: program("python3") })),
            _ => Err(Failure::Input(format!("solvers: '{name}' is none of openmvg, colmap and pycolmap"))),
        }
    };
    named.into_iter().map(solver).collect()
}

impl Order {
    /// Finds poses and writes the scene. Finished attempts of a call that is ended are kept beside the output for the
    /// next one, also for one of the command.
    fn carry_out(&self, progress: &dyn Progress) -> Result<(), Failure> {
        let output = self.output.as_path();
        let is_empty = || std::fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_none());
        if output.is_symlink() || output.exists() && !is_empty() {
            // A kill may have come between the scene and the end of what was kept for it.
            if let Some(folder) = Kept::folder_beside(output).filter(|_| has_record(output)) {
                let _ = Kept::remove(&folder);
            }
            let text = format!("{}: exists already and is not an empty folder; give another name", output.display());
            return Err(Failure::Input(text));
        }
        let solvers = || self.solvers.iter().map(|solver| solver.as_ref() as &dyn Solver);
        let Some(folder) = Kept::folder_beside(output) else {
            return self.written(&solvers().collect::<Vec<_>>(), progress);
        };
        let failed = |cause: std::io::Error| Failure::File(format!("{}: {cause}", folder.display()));
        Kept::check(&folder).map_err(failed)?;
        let kept: Vec<Kept<'_>> = solvers().map(|solver| Kept::new(solver, &folder)).collect();
        let written = self.written(&kept.iter().map(|solver| solver as &dyn Solver).collect::<Vec<_>>(), progress);
        let is_stopped = matches!(written, Err(Failure::Interrupted));
        // Before the first question there is nothing of this call; what is there is of one that was ended.
        if kept.iter().any(Kept::was_asked) && !is_stopped {
            Kept::remove(&folder).map_err(failed)?;
        }
        written
    }

    /// As [`Order::carry_out`], and nothing is kept.
    fn written(&self, solvers: &[&dyn Solver], progress: &dyn Progress) -> Result<(), Failure> {
        let Order { photographs, output, options, layout, .. } = self;
        let found = find(photographs, solvers, options, progress)?;
        let verdict = match &found.verdict {
            Ok(verdict) => verdict,
            Err(refusal) => {
                return Err(Failure::Input(format!(
                    "{}: no poses that can be trusted ({}); photograph with textured surfaces in view, neighbouring \
                     views not more than 15 degrees apart and the camera moved, not only turned{}",
                    photographs.display(),
                    refusal.main(),
                    if found.cameras.are_known() { "" } else { ", or give the focal length" }
                )));
            }
        };
        if verdict.scene.reads_folder(output) {
            let (output, scene) = (output.display(), verdict.scene.path.display());
            let text = format!("{output}: the scene {scene} is read from this folder; give another folder");
            return Err(Failure::Input(text));
        }
        for (name, reason) in found.excluded(Some(verdict)) {
            progress.warn(&format!("{name}: {reason}"));
        }
        let picture = camera_map(&verdict.scene, &inspect(&verdict.scene, BackgroundChoice::None, progress)?);
        let encoded =
            encode_png(&DynamicImage::ImageRgb8(picture)).map_err(|error| Failure::Other(error.to_string()))?;
        let files = [("cameras.png", encoded)];
        progress.stage("writing the scene", 9..10, 10);
        write(&found, verdict, options, (*layout, Path::new(output)), &files, progress)?;
        Ok(())
    }
}
