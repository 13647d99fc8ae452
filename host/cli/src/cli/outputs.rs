//! Outputs that would replace inputs are refused before work begins.

use super::wrong::wrong;
use std::fs::canonicalize;
use std::path::Path;
use viewfuse_scene::Scene;

/// Refuses a folder for pictures that one of the scenes is read from.
pub(super) fn keep_folder_apart<'a>(scenes: impl IntoIterator<Item = &'a Scene>, folder: &Path) -> anyhow::Result<()> {
    match scenes.into_iter().find(|scene| scene.reads_folder(folder)) {
        Some(scene) => Err(inside(scene, folder, "folder")),
        None => Ok(()),
    }
}

/// Refuses a file that one of the scenes is read from, or would be.
pub(super) fn keep_file_apart<'a>(scenes: impl IntoIterator<Item = &'a Scene>, file: &Path) -> anyhow::Result<()> {
    match scenes.into_iter().find(|scene| scene.reads_file(file)) {
        Some(scene) => Err(inside(scene, file, "file")),
        None => Ok(()),
    }
}

fn inside(scene: &Scene, path: &Path, what: &str) -> anyhow::Error {
    let (path, scene) = (path.display(), scene.path.display());
    wrong(format_args!("--output {path}: the scene {scene} is read from this {what}; give another {what}"))
}

/// Refuses an output that is the input itself, under any spelling.
///
/// # Errors
/// That of wrong arguments.
pub fn keep_input(input: &Path, output: &Path) -> anyhow::Result<()> {
    match (canonicalize(input), canonicalize(output)) {
        (Ok(from), Ok(to)) if from == to => {
            let (input, output) = (input.display(), output.display());
            Err(wrong(format_args!("{output}: is the input {input} itself, which is not replaced; give another name")))
        }
        _ => Ok(()),
    }
}
