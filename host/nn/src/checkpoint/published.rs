//! What published checkpoints do not say of themselves: the settings of the experiment that a folder is named after.

use std::path::Path;

/// Experiments of pixelNeRF whose networks have no max pool and are for 64 pixels (`conf/exp/sn64.conf`,
/// `sn64_unseen.conf`), and those whose networks have one and are for 128 (`conf/default.conf`).
const EXPERIMENTS: [(&[&str], [&str; 2]); 2] =
    [(&["sn64", "sn64_unseen"], ["0", "64"]), (&["srn_car", "srn_chair", "dtu"], ["1", "128"])];

/// Metadata for a file where its authors' archive has it: `checkpoints/EXPERIMENT/pixel_nerf_latest`, and
/// `pixel_nerf_backup` beside it.
pub(super) fn metadata(path: &Path) -> impl Iterator<Item = (String, String)> {
    let named = |part: Option<&std::ffi::OsStr>, names: &[&str]| {
        part.is_some_and(|part| names.iter().any(|name| part == *name))
    };
    let is_published = named(path.file_name(), &["pixel_nerf_latest", "pixel_nerf_backup"]);
    let folder = path.canonicalize().ok();
    let folder = folder.as_deref().and_then(Path::parent).and_then(Path::file_name);
    let known = EXPERIMENTS.into_iter().find(|(names, _)| is_published && named(folder, names));
    let settings = |(_, values)| ["viewfuse.first_pool", "viewfuse.source_side"].into_iter().zip(values);
    known.into_iter().flat_map(settings).map(|(key, value)| (key.to_owned(), value.to_owned()))
}
