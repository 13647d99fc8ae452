//! What published checkpoints do not say of themselves: the settings of the experiment that a folder is named after.

use std::path::Path;

/// Experiments of pixelNeRF: whether their networks have a max pool (`use_first_pool` of `conf/default.conf` and
/// `conf/exp/sn64.conf`, `sn64_unseen.conf`), and the longest side of the photographs of their data, of which those of
/// DTU are 400x300.
const EXPERIMENTS: [(&[&str], [&str; 2]); 3] =
    [(&["sn64", "sn64_unseen"], ["0", "64"]), (&["srn_car", "srn_chair"], ["1", "128"]), (&["dtu"], ["1", "400"])];
/// Where all of them have a pixel's centre.
const PIXEL_CENTRE: &str = "0";

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
    let settings = |(_, [pool, side]): (_, [&'static str; 2])| {
        [("viewfuse.first_pool", pool), ("viewfuse.source_side", side), ("viewfuse.pixel_centre", PIXEL_CENTRE)]
    };
    known.into_iter().flat_map(settings).map(|(key, value)| (key.to_owned(), value.to_owned()))
}
