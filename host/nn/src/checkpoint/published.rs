//! What published checkpoints do not say of themselves: the settings of the experiment that a folder is named after.

use std::path::Path;

/// Experiments of pixelNeRF whose networks have no max pool and are for 64 pixels (`conf/exp/sn64.conf`,
/// `sn64_unseen.conf`).
const FOR_64_PIXELS: [&str; 2] = ["sn64", "sn64_unseen"];

/// Metadata for a file where its authors' archive has it: `checkpoints/EXPERIMENT/pixel_nerf_latest`, and
/// `pixel_nerf_backup` beside it.
pub(super) fn metadata(path: &Path) -> impl Iterator<Item = (String, String)> {
    let named = |part: Option<&std::ffi::OsStr>, names: &[&str]| {
        part.is_some_and(|part| names.iter().any(|name| part == *name))
    };
    let is_published = named(path.file_name(), &["pixel_nerf_latest", "pixel_nerf_backup"]);
    let folder = path.canonicalize().ok();
    let folder = folder.as_deref().and_then(Path::parent).and_then(Path::file_name);
    let is_for_64 = is_published && named(folder, &FOR_64_PIXELS);
    let settings = [("viewfuse.first_pool", "0"), ("viewfuse.source_side", "64")];
    settings.into_iter().filter(move |_| is_for_64).map(|(key, value)| (key.to_owned(), value.to_owned()))
}
