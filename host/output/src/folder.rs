//! Checks of an output folder before work begins: what a run would destroy there, and targets whose files have one name.

use crate::run::{RECORD, SUFFIXES};
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use viewfuse_job::files::read_at_most;
use viewfuse_scene::few_shot::Target;

/// Most bytes of a run record. Larger ones are no records of this program.
const LONGEST_RECORD: u64 = 256 << 20;

/// Why pictures cannot be written to a folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder belongs to something else.
    #[error("{}: is not the record of a render and would be replaced; give another folder", path.display())]
    OtherRecord {
        /// The file in the way.
        path: PathBuf,
    },
    /// Two targets have files of one name.
    #[error("the targets '{first}' and '{second}' would both be written to {file}; render them to different folders")]
    SameFile {
        /// A target.
        first: String,
        /// Another one.
        second: String,
        /// The file's name.
        file: String,
    },
}

/// Checks that the pictures of these targets can be written to a folder: no two files have one name, and there is no record
/// of anything but an earlier render.
///
/// # Errors
/// [`OutputError`].
pub fn check_folder(folder: &Path, targets: &[Target]) -> Result<(), OutputError> {
    let mut owners: HashMap<String, &str> = HashMap::new();
    for Target { name, .. } in targets {
        for suffix in SUFFIXES {
            let file = format!("{name}{suffix}.png");
            if let Some(first) = owners.insert(file.clone(), name) {
                return Err(OutputError::SameFile { first: first.to_owned(), second: name.clone(), file });
            }
        }
    }
    let path = folder.join(RECORD);
    if path.exists() && !is_record(&path) { Err(OutputError::OtherRecord { path }) } else { Ok(()) }
}

/// Whether a file is the record of a render. An empty one is: of a machine that lost its power.
fn is_record(path: &Path) -> bool {
    let Ok(bytes) = read_at_most(path, LONGEST_RECORD) else { return false };
    let is_of_render = |record: &Value| record.get("viewfuse").is_some() && record.get("frames").is_some();
    bytes.is_empty() || serde_json::from_slice(&bytes).is_ok_and(|record| is_of_render(&record))
}
