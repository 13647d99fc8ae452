//! Answers of a solver, kept until the scene is written: work that was stopped, or killed, goes on behind the attempts
//! that it had finished.
//!
//! An answer is kept under a digest of all that it depends on: the photographs' pixels, the cameras, the features, the
//! seed, the program that is asked, and this crate's version.

use crate::solution::{Features, Job, Solution, Solver, SolverError};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use viewfuse_job::digest::{sha256, sha256_of};
use viewfuse_job::files::write_whole;
use viewfuse_job::progress::Progress;

/// A solver whose answers are kept in a folder.
pub struct Kept<'a> {
    solver: &'a dyn Solver,
    folder: &'a Path,
    identity: OnceLock<Option<String>>,
}

/// An answer in its file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    Solution(Solution),
    Nothing(String),
}

impl Answer {
    /// Whether it may be one to this job: somebody may have changed the file.
    fn fits(&self, job: &Job) -> bool {
        match self {
            Answer::Solution(solution) => solution.fits(job),
            Answer::Nothing(_) => true,
        }
    }
}

impl<'a> Kept<'a> {
    /// Of a solver, in a folder that need not be there; the one that it is in must be, otherwise nothing is kept.
    pub fn new(solver: &'a dyn Solver, folder: &'a Path) -> Kept<'a> {
        Kept { solver, folder, identity: OnceLock::new() }
    }

    /// The folder for the answers while a scene is made: hidden, beside it. `None` for a path that ends in no name.
    pub fn folder_beside(scene: &Path) -> Option<PathBuf> {
        let name = scene.file_name()?.to_string_lossy();
        Some(scene.with_file_name(format!(".{name}.attempts")))
    }

    /// Removes the folder: its scene is written, or will not be.
    ///
    /// # Errors
    /// What the system says; that it is not there is none.
    pub fn remove(folder: &Path) -> std::io::Result<()> {
        match fs::remove_dir_all(folder) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    /// The file of a job's answer; `None` if a photograph cannot be read or the solver does not say what it is.
    fn file(&self, job: &Job, progress: &dyn Progress) -> Option<PathBuf> {
        let identity = self.identity.get_or_init(|| self.solver.identity(progress)).as_ref()?;
        let mut job = job.clone();
        for photograph in &mut job.photographs {
            photograph.path = sha256_of(&photograph.path).ok()?.into();
        }
        let own = (env!("CARGO_PKG_VERSION"), self.solver.name(), identity, job);
        let digest = sha256(&serde_json::to_vec(&own).ok()?);
        Some(self.folder.join(format!("{digest}.json")))
    }

    /// Keeps a text. A disk that cannot be written to costs no more than that: the scene's own files will tell.
    fn keep(&self, file: &Path, text: &[u8]) {
        if fs::create_dir(self.folder).is_ok() || self.folder.is_dir() {
            let _ = write_whole(file, text);
        }
    }
}

impl Solver for Kept<'_> {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn features(&self) -> &'static [Features] {
        self.solver.features()
    }

    fn identity(&self, progress: &dyn Progress) -> Option<String> {
        self.solver.identity(progress)
    }

    fn solve(&self, job: &Job, progress: &dyn Progress) -> Result<Solution, SolverError> {
        let Some(file) = self.file(job, progress) else { return self.solver.solve(job, progress) };
        let earlier = fs::read(&file).ok().and_then(|text| serde_json::from_slice::<Answer>(&text).ok());
        if let Some(answer) = earlier.filter(|answer| answer.fits(job)) {
            return answer.into();
        }
        let answer = match self.solver.solve(job, progress) {
            Ok(solution) => Answer::Solution(solution),
            Err(SolverError::Nothing(reason)) => Answer::Nothing(reason),
            Err(error) => return Err(error),
        };
        let Ok(text) = serde_json::to_vec(&answer) else { return answer.into() };
        self.keep(&file, &text);
        // As a run that goes on reads it: numbers as text may differ from their own in the last bit.
        serde_json::from_slice(&text).unwrap_or(answer).into()
    }
}

impl From<Answer> for Result<Solution, SolverError> {
    fn from(answer: Answer) -> Result<Solution, SolverError> {
        match answer {
            Answer::Solution(solution) => Ok(solution),
            Answer::Nothing(reason) => Err(SolverError::Nothing(reason)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solution::{CameraGuess, JobPhotograph, SolvedCamera, SolvedPhotograph};
    use std::sync::atomic::{AtomicUsize, Ordering};
    use viewfuse_job::progress::Silent;

    /// Says how often it was asked, as a focal length; with seed 7 it finds nothing, with seed 8 it breaks.
    #[derive(Default)]
    struct Counting(AtomicUsize);

    impl Solver for Counting {
        fn name(&self) -> &'static str {
            "counting"
        }

        fn features(&self) -> &'static [Features] {
            &[Features::Sift]
        }

        fn identity(&self, _: &dyn Progress) -> Option<String> {
            Some("1".to_owned())
        }

        fn solve(&self, job: &Job, _: &dyn Progress) -> Result<Solution, SolverError> {
            let count = self.0.fetch_add(1, Ordering::Relaxed) + 1;
            match job.seed {
                7 => Err(SolverError::Nothing("nothing".to_owned())),
                8 => Err(SolverError::Broken { program: PathBuf::new(), problem: "broken".to_owned() }),
                _ => Ok(Solution {
                    cameras: vec![SolvedCamera { focal: count as f64, principal: [0.1; 2], k1: 0.0 }],
                    photographs: vec![SolvedPhotograph { camera_from_world: None, reason: None }],
                    ..Solution::default()
                }),
            }
        }
    }

    fn job(path: &Path, seed: u64) -> Job {
        Job {
            seed,
            features: Features::Sift,
            max_side: 100,
            cameras: vec![CameraGuess { focal: 90.0, is_guess: true }],
            photographs: vec![JobPhotograph { path: path.to_path_buf(), size: [100, 80], camera: 0 }],
        }
    }

    #[test]
    fn the_same_question_is_asked_once() {
        let scratch = tempfile::tempdir().expect("a folder");
        let [photograph, moved] = ["a.png", "b.png"].map(|name| scratch.path().join(name));
        fs::write(&photograph, "pixels").expect("a file");
        fs::write(&moved, "pixels").expect("a file");
        let folder = Kept::folder_beside(&scratch.path().join("posed")).expect("a name");
        let solver = Counting::default();
        let focal = |path: &Path, seed| {
            let kept = Kept::new(&solver, &folder);
            kept.solve(&job(path, seed), &Silent)
                .map(|solution| solution.cameras[0].focal)
                .map_err(|own| own.to_string())
        };
        assert_eq!((focal(&photograph, 0), focal(&photograph, 0)), (Ok(1.0), Ok(1.0)));
        assert_eq!(focal(&moved, 0), Ok(1.0), "the pixels count, not the place");
        assert_eq!(focal(&photograph, 1), Ok(2.0), "another seed");
        fs::write(&photograph, "other pixels").expect("a file");
        assert_eq!(focal(&photograph, 0), Ok(3.0), "another photograph");
        assert_eq!((focal(&moved, 7), focal(&moved, 7)), (Err("nothing".to_owned()), Err("nothing".to_owned())));
        assert_eq!(solver.0.load(Ordering::Relaxed), 4, "nothing was found, once");
        assert!(focal(&moved, 8).is_err() && focal(&moved, 8).is_err());
        assert_eq!(solver.0.load(Ordering::Relaxed), 6, "what broke is tried again");
        // Files that were cut or changed.
        for entry in fs::read_dir(&folder).expect("the folder").flatten() {
            fs::write(entry.path(), "{\"solution\"").expect("a file");
        }
        assert_eq!(focal(&moved, 0), Ok(7.0));
        Kept::remove(&folder).expect("removed");
        Kept::remove(&folder).expect("nothing to remove");
        assert_eq!(focal(&moved, 0), Ok(8.0));
    }

    #[test]
    fn without_a_place_nothing_is_kept() {
        let scratch = tempfile::tempdir().expect("a folder");
        let photograph = scratch.path().join("a.png");
        fs::write(&photograph, "pixels").expect("a file");
        let (solver, folder) = (Counting::default(), scratch.path().join("not/there/.posed.attempts"));
        let focal = || Kept::new(&solver, &folder).solve(&job(&photograph, 0), &Silent).map(|own| own.cameras[0].focal);
        assert_eq!((focal().ok(), focal().ok()), (Some(1.0), Some(2.0)));
        assert!(!scratch.path().join("not").exists());
        assert_eq!(Kept::folder_beside(Path::new("..")), None);
    }
}
