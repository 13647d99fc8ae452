//! The person's own pycolmap: COLMAP's steps by a script that a Python interpreter runs.

use crate::colmap::MAX_SEED;
use crate::colmap_folder::{ColmapFolder, FolderCamera};
use crate::process::run;
use crate::solution::{Features, PoseJob, Solution, Solver, SolverError};
use serde::Serialize;
use std::path::PathBuf;
use std::process::Command;
use viewfuse_job::files::Scratch;
use viewfuse_job::progress::Progress;

/// The solver's name.
const NAME: &str = "pycolmap";

/// The script; its argument is the file of a [`Task`].
const SCRIPT: &str = include_str!("pycolmap/solve.py");

/// The script's exit code where pycolmap cannot be imported.
const NO_MODULE: i32 = 3;

/// A Python interpreter that has pycolmap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PyColmap {
    /// Its file, or its name where the system finds it.
    pub python: PathBuf,
}

/// What the script is to do.
#[derive(Serialize)]
struct Task<'a> {
    database: PathBuf,
    images: PathBuf,
    sparse: PathBuf,
    seed: u64,
    max_side: u32,
    dsp: bool,
    cameras: &'a [FolderCamera],
}

impl Solver for PyColmap {
    fn name(&self) -> &'static str {
        NAME
    }

    fn features(&self) -> &'static [Features] {
        &[Features::Sift, Features::DspSift]
    }

    fn identity(&self, progress: &dyn Progress) -> Option<String> {
        let folder = Scratch::new().ok()?;
        let mut command = Command::new(&self.python);
        command.arg("-c").arg("import pycolmap; print(pycolmap.__version__)");
        let ended = run(&mut command, NAME, &folder.path().join("log.txt"), progress).ok()?;
        ended.status.success().then(|| ended.last_line().to_owned())
    }

    fn solve(&self, job: &PoseJob, progress: &dyn Progress) -> Result<Solution, SolverError> {
        let broken = |problem: String| SolverError::Broken(self.python.clone(), problem);
        let folder = ColmapFolder::of(job).map_err(|error| broken(error.to_string()))?;
        let at = |name: &str| folder.path().join(name);
        let task = Task {
            database: at("database.db"),
            images: at("images"),
            sparse: at("sparse"),
            seed: job.seed & MAX_SEED,
            max_side: job.max_side,
            dsp: job.features == Features::DspSift,
            cameras: &folder.cameras,
        };
        let text = serde_json::to_vec(&task).map_err(|error| broken(error.to_string()))?;
        std::fs::write(at("task.json"), text).map_err(|error| broken(error.to_string()))?;
        progress.stage("features, matching and poses", 0..1, 1);
        let mut command = Command::new(&self.python);
        command.arg("-c").arg(SCRIPT).arg(at("task.json"));
        let ended = run(&mut command, NAME, &at("log.txt"), progress)?;
        if ended.status.code() == Some(NO_MODULE) {
            let problem = format!("cannot import pycolmap: {}", ended.last_line());
            return Err(SolverError::Missing(self.python.clone(), problem, NAME));
        }
        if !ended.status.success() {
            return Err(broken(format!("pycolmap failed ({}): {}", ended.status, ended.last_line())));
        }
        // Written last: what stands before it is COLMAP's log.
        let version = ended.last_line().strip_prefix("solved by COLMAP ");
        let version = version.ok_or_else(|| broken(format!("ended without an answer: {}", ended.last_line())))?;
        folder.solution(job, format!("COLMAP {version} (pycolmap)"), &self.python)
    }
}
