//! Where the poses of photographs are that no reader found: in the folder above, in a COLMAP model at another place, or
//! in a file of another program.

use std::path::{Path, PathBuf};

use super::files::{self, IMAGE_FOLDERS};
use super::reader::Reader;

/// Files of other programs with poses, and whose they are: names, of which some begin with anything.
const FILES: [(&str, &str); 12] = [
    ("sfm_data.json", "OpenMVG"),
    ("reconstruction.json", "OpenSfM"),
    ("cameras.xml", "Metashape"),
    ("cameras.sfm", "Meshroom"),
    ("bundle.out", "Bundler"),
    ("bundle.rd.out", "Bundler"),
    ("*.nvm", "VisualSFM"),
    ("cameras.json", "3D Gaussian Splatting"),
    ("meta_data.json", "SDFStudio"),
    ("*_SfM.log", "Tanks and Temples"),
    ("00000000_cam.txt", "MVSNet"),
    ("groundtruth.txt", "TUM"),
];

/// Folders in which such files lie, beside the scene's own.
const FOLDERS: [&str; 4] = ["", "cams", "images", "sparse"];

/// Places of COLMAP models that are not looked into: other programs fill them, too.
const MODELS: [&str; 5] = ["colmap", "0", "sparse/aligned", "distorted/sparse/0", "colmap/0"];

/// In a sentence, where the poses of the photographs in a folder may be; `None` if nothing is found.
pub(super) fn poses(root: &Path, readers: &[&dyn Reader]) -> Option<String> {
    // A folder that a reader recognises may lack what it needs.
    let is_scene = |path: &Path| {
        let found = readers.iter().find_map(|reader| Some((reader, reader.recognise(path).ok()??)));
        found.is_some_and(|(reader, found)| reader.read(&found).is_ok())
    };
    if let Some(model) = MODELS.iter().map(|place| root.join(place)).find(|place| is_scene(place)) {
        return Some(format!("{} is a scene: give that", model.display()));
    }
    let is_images = root.file_name().is_some_and(|name| {
        let name = name.to_string_lossy();
        IMAGE_FOLDERS.contains(&name.as_ref()) || files::is_images_folder(&name)
    });
    if let Some(above) = root.parent().filter(|above| is_images && is_scene(above)) {
        let above = if above.as_os_str().is_empty() { Path::new(".") } else { above };
        return Some(format!("{} is a scene: give that", above.display()));
    }
    let (file, program) = FOLDERS.iter().find_map(|folder| file_of(&root.join(folder)))?;
    Some(format!(
        "{} is {program}'s, which is not read: export the cameras as a COLMAP model (text or binary) or as transforms.json",
        file.display()
    ))
}

fn file_of(folder: &Path) -> Option<(PathBuf, &'static str)> {
    let all = files::list(folder, |_| true).ok()?;
    all.into_iter().find_map(|path| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        let is_it = |pattern: &str| match pattern.strip_prefix('*') {
            Some(end) => name.ends_with(end),
            None => name.eq_ignore_ascii_case(pattern),
        };
        let (_, program) = FILES.iter().find(|(pattern, _)| is_it(pattern))?;
        Some((path, *program))
    })
}
