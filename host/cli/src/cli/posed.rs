//! `--pose` of commands that open a scene: where a folder has photographs and no poses, they are found on the way.
//!
//! The scene is written beside the photographs, and used again as long as the photographs are the same.

use super::options::MaskOption;
use super::pose::find_with_defaults;
use super::printing::complain;
use anyhow::bail;
use clap::Args;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_pose::is_current;
use viewfuse_scene::{Scene, SceneError, SceneFault};

#[derive(Args)]
pub(crate) struct PoseOption {
    /// Photographs without poses: find the poses first, as `viewfuse pose` does, and write them beside the folder, as
    /// FOLDER-posed, where the next command finds them
    #[arg(long)]
    pose: bool,
}

impl PoseOption {
    /// Opens a scene, or the one of the poses found where `--pose` is given and it has none; and the folder of it.
    pub(crate) fn open(&self, scene: &Path, masks: &MaskOption) -> anyhow::Result<(PathBuf, Scene)> {
        let folder = if self.pose { posed(scene)? } else { scene.to_path_buf() };
        let scene = masks.open(&folder)?;
        Ok((folder, scene))
    }
}

fn posed(scene: &Path) -> anyhow::Result<PathBuf> {
    // All other errors are those of the command itself.
    let is_bare =
        |error: SceneError| matches!(*error.fault, SceneFault::BarePhotographs(_) | SceneFault::PosesElsewhere(..));
    if !Scene::open(scene).is_err_and(is_bare) {
        return Ok(scene.to_path_buf());
    }
    let folder = beside(scene)?;
    if folder.exists() {
        if !is_current(&folder, scene)? {
            bail!(
                "{}: exists already and is not of the photographs in {}; remove it, or find poses with `viewfuse pose`",
                folder.display(),
                scene.display()
            );
        }
        complain(format_args!("{}: the poses found before", folder.display()));
        return Ok(folder);
    }
    complain(format_args!("{}", find_with_defaults(scene, &folder)?));
    Ok(folder)
}

/// `FOLDER-posed`, also where the folder is called `.`.
fn beside(scene: &Path) -> anyhow::Result<PathBuf> {
    let scene = match scene.file_name() {
        Some(_) => scene.to_path_buf(),
        None => fs::canonicalize(scene)?,
    };
    let mut name = OsString::from(scene.file_name().unwrap_or_default());
    name.push("-posed");
    Ok(scene.with_file_name(name))
}
