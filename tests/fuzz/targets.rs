//! What is fed with broken input: everything that reads what somebody else may have written, and the C interface.

mod capi;
mod checkpoints;
mod fall;
mod files;
mod gaussians;
mod guarded;
mod images;
mod journals;
mod parsers;
mod paths;
mod records;
mod requests;
mod scenes;
mod shell;
mod state;

use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use viewfuse_tests::scenes as made;

/// What a reader made of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It was read.
    Read,
    /// It was refused with this message.
    Refused(String),
}

/// A reader.
pub(crate) trait Target {
    /// Inputs that are read, and that changes start from.
    fn seeds(&self) -> Vec<Vec<u8>>;

    /// Words of its format.
    fn words(&self) -> &'static [&'static str] {
        &[]
    }

    /// An input with its checksums renewed, so that a change gets past them.
    fn repaired(&self, bytes: Vec<u8>) -> Vec<u8> {
        bytes
    }

    /// Reads an input.
    ///
    /// # Errors
    /// What is wrong with the way in which it was read or refused.
    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String>;
}

/// The name of a target and what makes it.
type Row = (&'static str, fn() -> Box<dyn Target>);

/// All targets.
pub(crate) const ALL: [Row; 26] = [
    ("images", || Box::new(images::Images(OneFile::new("photograph")))),
    ("transforms", || Box::new(scenes::transforms())),
    ("srn", || Box::new(scenes::Broken::of(&made::srn()))),
    ("middlebury", || Box::new(scenes::Broken::of(&made::middlebury()))),
    ("llff", || Box::new(scenes::llff())),
    ("neus", || Box::new(scenes::neus())),
    ("neus-array", || Box::new(scenes::neus_array())),
    ("colmap-text", || Box::new(scenes::colmap_text())),
    ("colmap-binary", || Box::new(scenes::colmap_binary())),
    ("safetensors", || Box::new(checkpoints::Checkpoints::safetensors())),
    ("pickles", || Box::new(checkpoints::Checkpoints::pickles())),
    ("pytorch", || Box::new(checkpoints::Checkpoints::files())),
    ("attention", || Box::new(checkpoints::Attention(OneFile::new("attention.safetensors")))),
    ("evaluation", || Box::new(records::evaluation())),
    ("pareto", || Box::new(records::sweep())),
    ("training", || Box::new(records::training())),
    ("state", || Box::new(state::State(OneFile::new("state.safetensors")))),
    ("requests", || Box::new(requests::Requests)),
    ("journals", || Box::new(journals::Journals::new())),
    ("path-tables", || Box::new(paths::Paths::tables())),
    ("path-json", || Box::new(paths::Paths::json())),
    ("gaussians", || Box::new(gaussians::Gaussians(OneFile::new("scene.ply")))),
    ("shell", || Box::new(shell::Shell)),
    ("specs", || Box::new(parsers::Specs)),
    ("views", || Box::new(parsers::ViewLists::new())),
    ("capi", || Box::new(capi::Face::new())),
];

/// The targets that only fall, to see that it is noticed.
const FALLING: [Row; 5] = [
    ("fall-panics", || Box::new(fall::Fall("panics"))),
    ("fall-hangs", || Box::new(fall::Fall("hangs"))),
    ("fall-aborts", || Box::new(fall::Fall("aborts"))),
    ("fall-devours", || Box::new(fall::Fall("devours"))),
    ("fall-lies", || Box::new(fall::Fall("lies"))),
];

/// The target of this name.
pub(crate) fn named(name: &str) -> Box<dyn Target> {
    let row = ALL.iter().chain(&FALLING).find(|(known, _)| *known == name);
    row.map_or_else(|| panic!("there is no target {name}"), |(_, make)| make())
}

/// A folder in memory, where the system has such folders.
pub(crate) fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    let made = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    made.expect("a folder")
}

/// A file in a folder of its own, written anew for every input.
pub(crate) struct OneFile {
    _folder: TempDir,
    path: PathBuf,
}

impl OneFile {
    fn new(name: &str) -> OneFile {
        let folder = folder();
        let path = folder.path().join(name);
        OneFile { _folder: folder, path }
    }

    fn write(&self, bytes: &[u8]) -> &Path {
        fs::write(&self.path, bytes).expect("a file");
        &self.path
    }
}

/// The verdict of a reader of a file: a message is one line, not too long, and begins with the path or one below it.
fn verdict<T, E: std::fmt::Display>(outcome: Result<T, E>, path: &Path) -> Result<Verdict, String> {
    match outcome {
        Ok(_) => Ok(Verdict::Read),
        Err(error) => {
            let message = error.to_string();
            let begins = message.starts_with(&path.display().to_string());
            match begins && !message.contains('\n') && message.len() < 4000 {
                true => Ok(Verdict::Refused(message.replace(&path.display().to_string(), ""))),
                false => Err(format!("the message does not name the file in one line: {message:?}")),
            }
        }
    }
}
