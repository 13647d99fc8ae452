//! Answers of a solver, kept until the scene is written: work that was stopped, or killed, goes on behind the attempts
//! that it had finished.
//!
//! An answer is kept under a digest of all that it depends on: the photographs' pixels, the cameras, the features, the
//! seed, the program that is asked, and this crate's version.

use crate::intake::file_name;
use crate::solution::{Features, MAX_ANSWER, PoseJob, Solution, Solver, SolverError};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use viewfuse_job::digest::{SEAL, sealed, sha256, sha256_of, unsealed};
use viewfuse_job::files::{is_ordinary, read_at_most, remove_unfinished, write_whole};
use viewfuse_job::progress::Progress;

/// What the name of an answer's file ends in, behind its digest.
const SUFFIX: &str = ".json";

/// A solver whose answers are kept in a folder.
pub struct Kept<'a> {
    solver: &'a dyn Solver,
    folder: &'a Path,
    identity: OnceLock<Option<String>>,
    was_asked: AtomicBool,
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
    fn fits(&self, job: &PoseJob) -> bool {
        match self {
            Answer::Solution(solution) => solution.fits(job),
            Answer::Nothing(_) => true,
        }
    }
}

impl<'a> Kept<'a> {
    /// Of a solver, in a folder that need not be there; the one that it is in must be, otherwise nothing is kept.
    pub fn new(solver: &'a dyn Solver, folder: &'a Path) -> Kept<'a> {
        Kept { solver, folder, identity: OnceLock::new(), was_asked: AtomicBool::new(false) }
    }

    /// Whether it was asked for a solution: work has begun.
    pub fn was_asked(&self) -> bool {
        self.was_asked.load(Ordering::Relaxed)
    }

    /// The folder for the answers while a scene is made: hidden, beside it. `None` for a path that ends in no name.
    pub fn folder_beside(scene: &Path) -> Option<PathBuf> {
        let name = scene.file_name()?.to_string_lossy();
        Some(scene.with_file_name(format!(".{name}.attempts")))
    }

    /// That answers can be kept in a folder: it is none yet, or a folder, and no link to a place elsewhere.
    ///
    /// # Errors
    /// If it is anything else, or what the system says.
    pub fn check(folder: &Path) -> io::Result<()> {
        match fs::symlink_metadata(folder) {
            Err(cause) if cause.kind() == ErrorKind::NotFound => Ok(()),
            Err(cause) => Err(cause),
            Ok(about) if about.is_dir() => Ok(()),
            Ok(_) => {
                Err(io::Error::other("it is a link or a file, and is left alone; move it, or give another output"))
            }
        }
    }

    /// Removes the answers in a folder, and the folder if nothing else is in it: its scene is written, or will not be.
    /// What is no answer by its name and its content stays.
    ///
    /// # Errors
    /// What the system says; that the folder is not there is none.
    pub fn remove(folder: &Path) -> io::Result<()> {
        if !fs::symlink_metadata(folder).is_ok_and(|about| about.is_dir()) {
            return Ok(());
        }
        remove_unfinished(folder);
        for entry in fs::read_dir(folder)? {
            let file = entry?.path();
            if answer_in(&file).is_some() {
                fs::remove_file(&file)?;
            }
        }
        match fs::remove_dir(folder) {
            Err(error) if error.kind() != ErrorKind::DirectoryNotEmpty => Err(error),
            _ => Ok(()),
        }
    }

    /// The file of a job's answer; `None` if a photograph cannot be read or the solver does not say what it is.
    fn file(&self, job: &PoseJob, progress: &dyn Progress) -> Option<PathBuf> {
        let identity = self.identity.get_or_init(|| self.solver.identity(progress)).as_ref()?;
        let mut job = job.clone();
        for photograph in &mut job.photographs {
            photograph.path = sha256_of(&photograph.path).ok()?.into();
        }
        let question = (env!("CARGO_PKG_VERSION"), self.solver.name(), identity, job);
        let digest = sha256(&serde_json::to_vec(&question).ok()?);
        Some(self.folder.join(digest + SUFFIX))
    }

    /// Keeps a text. A disk that cannot be written to costs no more than that: the scene's own files will tell.
    fn keep(&self, file: &Path, text: &[u8]) {
        if Kept::check(self.folder).is_ok() && (fs::create_dir(self.folder).is_ok() || self.folder.is_dir()) {
            let _ = write_whole(file, &sealed(&file_name(file), text));
        }
    }

    /// The answer that is kept in a file, if it may be one to this job.
    fn earlier(&self, file: &Path, job: &PoseJob, progress: &dyn Progress) -> Option<Answer> {
        if Kept::check(self.folder).is_err() || fs::symlink_metadata(file).is_err() {
            return None;
        }
        let answer = answer_in(file).filter(|answer| answer.fits(job));
        if answer.is_none() {
            let folder = self.folder.display();
            progress.warn(&format!("{folder}: holds answers that are not as they were kept; they are found anew"));
        }
        answer
    }
}

/// The answer in a file of this program.
fn answer_in(file: &Path) -> Option<Answer> {
    let name = file_name(file);
    let digest = name.strip_suffix(SUFFIX)?;
    let is_digest = digest.len() == SEAL && digest.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !is_digest || !is_ordinary(file).ok()? {
        return None;
    }
    let kept = read_at_most(file, MAX_ANSWER).ok()?;
    serde_json::from_slice(unsealed(&name, &kept)?).ok()
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

    fn solve(&self, job: &PoseJob, progress: &dyn Progress) -> Result<Solution, SolverError> {
        self.was_asked.store(true, Ordering::Relaxed);
        let Some(file) = self.file(job, progress) else { return self.solver.solve(job, progress) };
        if let Some(answer) = self.earlier(&file, job, progress) {
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

    fn rest(&self) {
        self.solver.rest();
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

        fn solve(&self, job: &PoseJob, _: &dyn Progress) -> Result<Solution, SolverError> {
            let count = self.0.fetch_add(1, Ordering::Relaxed) + 1;
            match job.seed {
                7 => Err(SolverError::Nothing("nothing".to_owned())),
                8 => Err(SolverError::Broken(PathBuf::new(), "broken".to_owned())),
                _ => Ok(Solution {
                    cameras: vec![SolvedCamera { focal: count as f64, principal: [0.1; 2], k1: 0.0 }],
                    photographs: vec![SolvedPhotograph { camera_from_world: None, reason: None }],
                    ..Solution::default()
                }),
            }
        }
    }

    fn job(path: &Path, seed: u64) -> PoseJob {
        PoseJob {
            seed,
            features: Features::Sift,
            max_side: 100,
            cameras: vec![CameraGuess { focal: 90.0, is_guess: true }],
            photographs: vec![JobPhotograph { path: path.to_path_buf(), size: [100, 80], camera: 0 }],
        }
    }

    fn folder_with_photograph() -> (tempfile::TempDir, PathBuf) {
        let scratch = tempfile::tempdir().expect("a folder");
        let photograph = scratch.path().join("a.png");
        fs::write(&photograph, "pixels").expect("a file");
        (scratch, photograph)
    }

    /// The focal length that is found for a photograph with seed 0, and kept in a folder.
    fn focal(solver: &Counting, folder: &Path, photograph: &Path) -> Option<f64> {
        let solution = Kept::new(solver, folder).solve(&job(photograph, 0), &Silent);
        solution.ok().map(|solution| solution.cameras[0].focal)
    }

    #[test]
    fn the_same_question_is_asked_once() {
        let (scratch, photograph) = folder_with_photograph();
        let moved = scratch.path().join("b.png");
        fs::copy(&photograph, &moved).expect("a file");
        let folder = Kept::folder_beside(&scratch.path().join("posed")).expect("a name");
        let solver = Counting::default();
        let focal = |path: &Path, seed| {
            let kept = Kept::new(&solver, &folder);
            kept.solve(&job(path, seed), &Silent)
                .map(|solution| solution.cameras[0].focal)
                .map_err(|error| error.to_string())
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
        // An answer to another question, whole, under this one's name.
        let answers = || fs::read_dir(&folder).expect("the folder").map(|entry| entry.expect("an entry").path());
        let file = answers().find(|path| fs::read_to_string(path).expect("text").contains("\"focal\":1.0"));
        let other = answers().find(|path| fs::read_to_string(path).expect("text").contains("\"focal\":2.0"));
        let (file, other) = (file.expect("the first answer"), other.expect("the second one"));
        fs::copy(&other, &file).expect("a copy");
        assert_eq!(focal(&moved, 0), Ok(7.0), "found anew");
        assert_eq!(focal(&moved, 0), Ok(7.0), "and kept");
        // Files that were cut or changed.
        for path in answers() {
            let text = fs::read_to_string(&path).expect("text");
            fs::write(path, text.replace("7.0", "9.5")).expect("a file");
        }
        assert_eq!(focal(&moved, 0), Ok(8.0));
        Kept::remove(&folder).expect("removed");
        Kept::remove(&folder).expect("nothing to remove");
        assert!(!folder.exists());
        assert_eq!(focal(&moved, 0), Ok(9.0));
    }

    /// A folder of the right name, with answers and with what is no answer by its name, its content or its kind.
    #[test]
    fn only_answers_are_removed() {
        let (scratch, photograph) = folder_with_photograph();
        let folder = scratch.path().join(".posed.attempts");
        let solver = Counting::default();
        let kept = Kept::new(&solver, &folder);
        assert!(!kept.was_asked() && kept.solve(&job(&photograph, 0), &Silent).is_ok() && kept.was_asked());
        let answer = fs::read_dir(&folder).expect("a folder").next().expect("an answer").expect("an entry").path();
        let mine = ["notes.txt".to_owned(), format!("{}.json", "0".repeat(64)), "inner/a.json".to_owned()];
        fs::create_dir(folder.join("inner")).expect("a folder");
        mine.iter().for_each(|name| fs::write(folder.join(name), "{}").expect("a file"));
        // An answer under another name is a person's copy.
        fs::copy(&answer, folder.join(format!("{}.json", "1".repeat(64)))).expect("a copy");
        Kept::remove(&folder).expect("removed");
        let left = fs::read_dir(&folder).expect("a person's folder").count();
        assert_eq!((answer.exists(), left, mine.map(|name| folder.join(name).exists())), (false, 4, [true; 3]));
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_kept_or_removed_through_a_link() {
        let (scratch, photograph) = folder_with_photograph();
        let [folder, target] = [".posed.attempts", "elsewhere"].map(|name| scratch.path().join(name));
        fs::create_dir(&target).expect("a folder");
        let solver = Counting::default();
        assert!(Kept::new(&solver, &target).solve(&job(&photograph, 0), &Silent).is_ok());
        std::os::unix::fs::symlink(&target, &folder).expect("a link");
        assert!(Kept::check(&folder).is_err() && Kept::check(&target).is_ok());
        let focal = || focal(&solver, &folder, &photograph);
        assert_eq!((focal(), focal()), (Some(2.0), Some(3.0)), "asked each time");
        Kept::remove(&folder).expect("left alone");
        assert_eq!((fs::read_dir(&target).expect("a folder").count(), folder.is_symlink()), (1, true));
    }

    #[test]
    fn without_a_place_nothing_is_kept() {
        let (scratch, photograph) = folder_with_photograph();
        let (solver, folder) = (Counting::default(), scratch.path().join("not/there/.posed.attempts"));
        let focal = || focal(&solver, &folder, &photograph);
        assert_eq!((focal(), focal()), (Some(1.0), Some(2.0)));
        assert!(!scratch.path().join("not").exists());
        assert_eq!(Kept::folder_beside(Path::new("..")), None);
    }
}
