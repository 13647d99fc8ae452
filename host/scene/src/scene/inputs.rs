//! What a scene is read from: outputs must not be written there.

use std::collections::HashSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use super::Scene;
use super::files::{IMAGE_FOLDERS, has_extension, is_images_folder};

/// Folders of layouts, besides those of photographs: an output in one of them would be taken for a part of the scene.
const FOLDERS: [&str; 9] = ["mask", "masks", "pose", "target_pose", "sparse", "dense", "train", "val", "test"];
/// Extensions of lists of cameras, depths and points beside the folders.
const LISTS: [&str; 6] = ["json", "txt", "npy", "npz", "bin", "ply"];
/// Names by which layouts are recognised, besides `NAME_par.txt`: a new file of such a name would make another scene of
/// it.
const RECOGNISED: &str = "transforms.json transforms_train.json transforms_val.json transforms_test.json \
                          poses_bounds.npy cameras_sphere.npz cameras.npz cameras_large.npz intrinsics.txt \
                          cameras.txt cameras.bin images.txt images.bin";

impl Scene {
    /// Whether pictures written into `folder`, which need not exist, would replace files of the scene or be read as
    /// some: it is the scene's own folder, one with its photographs or masks, or one below it that layouts read.
    pub fn reads_folder(&self, folder: &Path) -> bool {
        reads_below(&self.root(), folder) || self.picture_folders().contains(&absolute(folder))
    }

    /// Whether writing the file `path`, which need not exist, would replace a file of the scene or be read as one.
    pub fn reads_file(&self, path: &Path) -> bool {
        let (root, path) = (self.root(), absolute(path));
        let pictures = self.views.iter().flat_map(|view| view.image.iter().chain(&view.mask));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_recognised = RECOGNISED.split(' ').any(|known| known == name) || name.ends_with("_par.txt");
        let is_list = path.parent() == Some(&root) && (is_recognised || path.is_file() && has_extension(&path, &LISTS));
        is_list
            || path.parent().is_some_and(|folder| folder != root && is_inside(&root, folder))
            || pictures.map(|picture| absolute(picture)).any(|picture| picture == path)
    }

    /// Its folder.
    fn root(&self) -> PathBuf {
        let path = absolute(&self.path);
        if path.is_file() { path.parent().map(Path::to_path_buf).unwrap_or(path) } else { path }
    }

    /// The folders of photographs and masks.
    fn picture_folders(&self) -> HashSet<PathBuf> {
        let pictures = self.views.iter().flat_map(|view| view.image.iter().chain(&view.mask));
        let folders: HashSet<&Path> = pictures.filter_map(|picture| picture.parent()).collect();
        folders.into_iter().map(absolute).collect()
    }
}

/// Whether pictures written into `folder`, which need not exist, would be read as some of the scene in `root`, whatever
/// its layout: it is `root` itself, or a folder below it that layouts read.
pub fn reads_below(root: &Path, folder: &Path) -> bool {
    let (root, folder) = (absolute(root), absolute(folder));
    folder == root || is_inside(&root, &folder)
}

/// Whether a folder is one below the scene's that layouts read.
fn is_inside(root: &Path, folder: &Path) -> bool {
    let Some(Component::Normal(first)) = folder.strip_prefix(root).ok().and_then(|inside| inside.components().next())
    else {
        return false;
    };
    let first = first.to_string_lossy();
    FOLDERS.contains(&first.as_ref()) || IMAGE_FOLDERS.contains(&first.as_ref()) || is_images_folder(&first)
}

/// The path without links and `..`, as far as it exists.
fn absolute(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    for known in path.ancestors() {
        if let (Ok(whole), Ok(rest)) = (fs::canonicalize(known), path.strip_prefix(known)) {
            // Joining an empty path would append a separator.
            return if rest.as_os_str().is_empty() { whole } else { whole.join(rest) };
        }
    }
    path
}
