//! What identifies a run: everything that its frames depend on. An interrupted run is continued only if it is the same.

use anyhow::Context;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::io;
use std::path::Path;
use std::time::UNIX_EPOCH;
use viewfuse_device::parallel::try_map;
use viewfuse_job::digest::{sha256, sha256_of_part};
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::{Scene, View};

/// Bytes of a file that a core looks at at once.
const PIECE: u64 = 4 << 20;

/// Options that change no frame.
const NO_CHANGE: [&str; 6] = ["output", "replace", "threads", "time-limit", "video", "fps"];

/// Options that say which targets and sources there are: these themselves count.
const OF_VIEWS: [&str; 8] = ["targets", "orbit", "between", "frames", "spiral", "camera-path", "sources", "views"];

/// The digest of all that frames depend on but their targets: the program's version, the options' values, the device,
/// cameras and photographs (by length and time of change), the sources, and the content of other files.
pub(super) fn settings(
    options: &BTreeMap<String, String>,
    device: &str,
    scene: &Scene,
    sources: &[usize],
    files: &[&Path],
) -> anyhow::Result<String> {
    let mut text = format!("{} {device}\n", env!("CARGO_PKG_VERSION"));
    let counts = |name: &String| !NO_CHANGE.contains(&name.as_str()) && !OF_VIEWS.contains(&name.as_str());
    for (name, value) in options.iter().filter(|(name, _)| counts(name)) {
        writeln!(text, "{name} {value}")?;
    }
    for view in &scene.views {
        writeln!(text, "{} {:?} {:?} {:?}", view.name, view.camera, view.lens, view.near_far)?;
        let View { image, mask, .. } = view;
        for file in image.iter().chain(mask) {
            let about = std::fs::metadata(file).with_context(|| file.display().to_string())?;
            let changed = about.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
            writeln!(text, "{} {} {changed:?}", file.display(), about.len())?;
        }
    }
    writeln!(text, "{sources:?} {}", scene.points.len())?;
    for file in files {
        writeln!(text, "{}", content(file).with_context(|| file.display().to_string())?)?;
    }
    Ok(sha256(text.as_bytes()))
}

/// The digest of a file's length and of the digests of its pieces, which all cores find: of a network's file of
/// hundreds of megabytes one core would need longer than a GPU for its pictures.
fn content(path: &Path) -> io::Result<String> {
    let length = std::fs::metadata(path)?.len();
    let pieces = try_map(length.div_ceil(PIECE) as usize, |piece| sha256_of_part(path, piece as u64 * PIECE, PIECE))?;
    Ok(sha256(format!("{length} {}", pieces.concat()).as_bytes()))
}

/// The digest of a run of these settings.
pub(super) fn run_identity(settings: &str, targets: &[Target]) -> anyhow::Result<String> {
    let mut text = settings.to_owned();
    for target in targets {
        writeln!(text, "{} {:?} {:?}", target.name, target.camera, target.truth)?;
    }
    Ok(sha256(text.as_bytes()))
}
