//! The person's own COLMAP, as the program `colmap`: features, exhaustive matching and incremental mapping on the
//! processor.
//!
//! Every step works on one thread, because matches and models depend on the order in which threads finish. Version 3.8
//! does not seed all of its random draws: its answers differ a little from run to run, also on one thread.
//!
//! Names of options differ between versions (3.8 to 4.2); each step's help says which it has.

use crate::colmap_folder::{ColmapFolder, FolderCamera};
use crate::process::{Ended, run};
use crate::solution::{Features, PoseJob, Solution, Solver, SolverError};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use viewfuse_job::files::Scratch;
use viewfuse_job::progress::Progress;

/// The solver's name.
const NAME: &str = "colmap";

/// Seeds are whole numbers of 31 bits.
pub(crate) const MAX_SEED: u64 = (1 << 31) - 1;

/// The program `colmap`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Colmap {
    /// Its file, or its name where the system finds it.
    pub program: PathBuf,
}

/// An option of a step: its names in one version or another, without the dashes before them, and its value.
type StepOption = (&'static [&'static str], String);

impl Solver for Colmap {
    fn name(&self) -> &'static str {
        NAME
    }

    fn features(&self) -> &'static [Features] {
        &[Features::Sift, Features::DspSift]
    }

    fn identity(&self, progress: &dyn Progress) -> Option<String> {
        self.version(Scratch::new().ok()?.path(), progress).ok()
    }

    fn solve(&self, job: &PoseJob, progress: &dyn Progress) -> Result<Solution, SolverError> {
        let folder = ColmapFolder::of(job).map_err(|error| self.broken(error.to_string()))?;
        let version = self.version(folder.path(), progress)?;
        let at = |name: &str| folder.path().join(name).display().to_string();
        let [database, images, sparse] = ["database.db", "images", "sparse"].map(at);
        progress.stage("features", 0..1, 3);
        progress.expect(folder.cameras.len());
        for camera in &folder.cameras {
            let options = extraction(job, camera, &database, &images);
            self.step(&folder, "feature_extractor", options, progress)?;
            progress.step();
        }
        progress.stage("matching", 1..2, 3);
        let options = vec![
            (&["database_path"][..], database.clone()),
            (&["random_seed"], seed(job)),
            (&["TwoViewGeometry.random_seed"], seed(job)),
            (&["FeatureMatching.use_gpu", "SiftMatching.use_gpu"], "0".to_owned()),
            (&["FeatureMatching.num_threads", "SiftMatching.num_threads"], "1".to_owned()),
        ];
        self.step(&folder, "exhaustive_matcher", options, progress)?;
        progress.stage("poses", 2..3, 3);
        let options = vec![
            (&["database_path"][..], database),
            (&["image_path"], images),
            (&["output_path"], sparse),
            (&["random_seed"], seed(job)),
            (&["Mapper.random_seed"], seed(job)),
            (&["Mapper.num_threads"], "1".to_owned()),
            (&["Mapper.min_model_size"], "3".to_owned()),
        ];
        match self.step(&folder, "mapper", options, progress) {
            // Without a model it fails with words of its own.
            Err(SolverError::Broken(_, problem)) if problem.contains("failed to create") => {
                return Err(SolverError::Nothing(problem));
            }
            ended => ended?,
        };
        folder.solution(job, version, &self.program)
    }
}

fn seed(job: &PoseJob) -> String {
    (job.seed & MAX_SEED).to_string()
}

fn extraction(job: &PoseJob, camera: &FolderCamera, database: &str, images: &str) -> Vec<StepOption> {
    let dsp = u8::from(job.features == Features::DspSift).to_string();
    let mut options: Vec<StepOption> = vec![
        (&["database_path"], database.to_owned()),
        (&["image_path"], images.to_owned()),
        (&["image_list_path"], camera.list.display().to_string()),
        (&["random_seed"], seed(job)),
        (&["ImageReader.single_camera"], "1".to_owned()),
        (&["ImageReader.camera_model"], "SIMPLE_RADIAL".to_owned()),
        (&["FeatureExtraction.use_gpu", "SiftExtraction.use_gpu"], "0".to_owned()),
        (&["FeatureExtraction.num_threads", "SiftExtraction.num_threads"], "1".to_owned()),
        (&["FeatureExtraction.max_image_size", "SiftExtraction.max_image_size"], job.max_side.to_string()),
        (&["SiftExtraction.estimate_affine_shape"], dsp.clone()),
        (&["SiftExtraction.domain_size_pooling"], dsp),
    ];
    options.push(match &camera.parameters {
        Some(parameters) => (&["ImageReader.camera_params"], parameters.clone()),
        None => (&["ImageReader.default_focal_length_factor"], camera.factor.to_string()),
    });
    options
}

impl Colmap {
    fn broken(&self, problem: String) -> SolverError {
        SolverError::Broken(self.program.clone(), problem)
    }

    /// Runs it with these words.
    fn run(&self, folder: &Path, words: &[impl AsRef<OsStr>], progress: &dyn Progress) -> Result<Ended, SolverError> {
        let mut command = Command::new(&self.program);
        // It has a graphical interface, which asks for a display.
        command.args(words).env("QT_QPA_PLATFORM", "offscreen");
        run(&mut command, NAME, &folder.join("log.txt"), progress)
    }

    /// `COLMAP 3.8`.
    fn version(&self, folder: &Path, progress: &dyn Progress) -> Result<String, SolverError> {
        let said = self.run(folder, &["-h"], progress)?.said;
        let words: Vec<&str> = said.split_whitespace().collect();
        let at =
            words.windows(2).position(|pair| pair[0] == "COLMAP" && pair[1].starts_with(|c: char| c.is_ascii_digit()));
        let version = at.map(|at| words[at..at + 2].join(" "));
        version.ok_or_else(|| self.broken("does not say that it is COLMAP".to_owned()))
    }

    /// Runs a step with the options that it has.
    fn step(
        &self,
        folder: &ColmapFolder,
        step: &str,
        options: Vec<StepOption>,
        progress: &dyn Progress,
    ) -> Result<Ended, SolverError> {
        let help = self.run(folder.path(), &[step, "-h"], progress)?.said;
        let offered: Vec<&str> = help.split_whitespace().filter_map(|word| word.strip_prefix("--")).collect();
        let mut words = vec![step.to_owned()];
        for (names, value) in options {
            // Versions without random draws in a step have no seed there.
            if let Some(name) = names.iter().find(|name| offered.contains(name)) {
                words.extend([format!("--{name}"), value]);
            }
        }
        let ended = self.run(folder.path(), &words, progress)?;
        if ended.status.success() {
            return Ok(ended);
        }
        Err(self.broken(format!("{step} failed ({}): {}", ended.status, ended.last_line())))
    }
}
