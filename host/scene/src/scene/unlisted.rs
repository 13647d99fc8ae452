//! What lies beside the files of a scene and is not read: photographs that no list names, and any other file.

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::View;
use super::files::{self, IMAGE_EXTENSIONS, IMAGE_FOLDERS};

/// What programs put behind a photograph's name, or before it, for pictures that belong to it.
const COMPANIONS: [&str; 5] = ["_depth", "_normal", "_disp", "_mask", "."];
const COMPANION_PREFIXES: [&str; 2] = ["dynamic_mask_", "mask_"];

/// A warning that counts the photographs in the folders of the views' photographs that are no view's. Folders in
/// `images` and the like are looked into together.
pub(super) fn photographs(views: &[View]) -> Option<String> {
    let pictures: HashSet<&Path> =
        views.iter().flat_map(|view| view.image.iter().chain(&view.mask)).map(PathBuf::as_path).collect();
    let stems: HashSet<String> = views.iter().filter_map(|view| view.image.as_deref()).map(files::stem).collect();
    let mut folders: BTreeSet<PathBuf> = BTreeSet::new();
    for folder in views.iter().filter_map(|view| view.image.as_deref()?.parent()) {
        let is_new = folders.insert(folder.to_path_buf());
        let above = folder.parent().filter(|above| is_new && is_image_folder(above));
        folders.extend(above.into_iter().flat_map(|above| entries(above).chain([above.to_path_buf()])));
    }
    let belongs = |stem: &str| {
        let behind = COMPANIONS.iter().filter_map(|mark| stem.find(mark)).any(|at| stems.contains(&stem[..at]));
        behind || COMPANION_PREFIXES.iter().any(|mark| stem.strip_prefix(mark).is_some_and(|rest| stems.contains(rest)))
    };
    let is_unlisted = |path: &PathBuf| {
        files::has_extension(path, &IMAGE_EXTENSIONS)
            && !pictures.contains(path.as_path())
            && !belongs(&files::stem(path))
    };
    let mut unlisted: Vec<PathBuf> = folders.iter().flat_map(|folder| entries(folder)).filter(is_unlisted).collect();
    unlisted.sort_by(|a, b| files::natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    let first = unlisted.first()?;
    let (count, used) = (unlisted.len(), views.iter().filter(|view| view.image.is_some()).count());
    let (have, are) = if count == 1 { ("photograph has", "is") } else { ("photographs have", "are") };
    let folder = first.parent().unwrap_or(first).display();
    Some(format!(
        "{folder}: {count} {have} no pose and {are} not used, {used} have one (without is {})",
        file_name(first)
    ))
}

/// A warning of alpha channels in files of their own, as instant-ngp reads them (`000.alpha.png` beside `000.png`).
pub(super) fn alphas(views: &[View]) -> Option<String> {
    let images = || views.iter().filter_map(|view| view.image.as_deref());
    let alpha = |image: &Path| {
        let mut candidates = IMAGE_EXTENSIONS.iter().map(|extension| {
            let name = format!("{}.alpha.{extension}", files::stem(image));
            image.with_file_name(name)
        });
        candidates.find(|candidate| candidate.is_file())
    };
    let found: Vec<PathBuf> = images().filter_map(alpha).collect();
    let (first, count) = (found.first()?, found.len());
    let (files, are) = if count == 1 { ("file", "is") } else { ("files", "are") };
    Some(format!(
        "{}: {count} {files} with alpha channels of photographs {are} not read (instant-ngp's): they are masks, put them \
         into a folder masks/ under the photographs' names",
        first.display()
    ))
}

/// A line with the files and folders beside the lists of a scene, that hold neither a list that was read nor a picture.
pub(super) fn files(found: &Path, views: &[View], lists: &BTreeSet<PathBuf>) -> Option<String> {
    let root = if found.is_dir() { found } else { found.parent()? };
    let pictures = views.iter().flat_map(|view| view.image.iter().chain(&view.mask));
    let used: HashSet<&Path> = lists.iter().chain(pictures).flat_map(|path| path.ancestors()).collect();
    let is_unused = |path: &PathBuf| !used.contains(path.as_path()) && !files::has_extension(path, &IMAGE_EXTENSIONS);
    let names = entries(root).filter(is_unused).map(|path| file_name(&path));
    let names: BTreeSet<String> = names.collect();
    let list = names.into_iter().collect::<Vec<_>>().join(", ");
    (!list.is_empty()).then(|| format!("{}: {list}", root.display()))
}

fn is_image_folder(folder: &Path) -> bool {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    IMAGE_FOLDERS.contains(&name.as_ref()) || files::is_images_folder(&name)
}

fn file_name(path: &Path) -> String {
    files::exact(path.file_name().unwrap_or_default())
}

/// What is in a folder and not hidden; nothing of a folder that cannot be listed.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    // The folder of a bare file name is the current one.
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let names = fs::read_dir(here).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let folder = folder.to_path_buf();
    names.filter(|name| !name.as_encoded_bytes().starts_with(b".")).map(move |name| folder.join(name))
}
