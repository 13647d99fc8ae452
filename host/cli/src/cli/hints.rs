//! Hints at the command's options for errors of the library, printed behind the error.

use std::error::Error;
use viewfuse_evaluate::EvaluateError;
use viewfuse_evaluate::protocol::ProtocolError;
use viewfuse_evaluate::run_folder::FolderError;
use viewfuse_field::optimise::OptimiseError;
use viewfuse_field::render::RenderError;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_output::folder::OutputError;
use viewfuse_pose::PoseError;
use viewfuse_scene::SceneError;
use viewfuse_scene::few_shot::SelectionError;
use viewfuse_scene::photographs::PhotographsError;
use viewfuse_scene::write::WriteSceneError;
use viewfuse_view::ListenError;

/// The hint, if there is one, for an error or one of its causes.
pub(crate) fn hint(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| hinted(cause).and_then(sentence))
}

/// Whether an error, or one of its causes, is of what an option says, whatever the scene is.
pub(crate) fn is_of_arguments(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| hinted(cause) == Some(Hint::ViewList))
}

/// The errors that may have hints, and that reach the command as they are.
const HINTED: [fn(&(dyn Error + 'static)) -> Option<Hint>; 12] = [
    of::<SelectionError>, of::<PhotographsError>, of::<SceneError>, of::<WriteSceneError>, of::<RenderError>,
    of::<OptimiseError>, of::<OutputError>, of::<FolderError>, of::<EvaluateError>, of::<ProtocolError>,
    of::<PoseError>, of::<ListenError>,
];

fn hinted(cause: &(dyn Error + 'static)) -> Option<Hint> {
    HINTED.iter().find_map(|hint| hint(cause))
}

fn of<E: Hinted + 'static>(cause: &(dyn Error + 'static)) -> Option<Hint> {
    cause.downcast_ref::<E>().and_then(Hinted::hint)
}

/// What a hint is in the words of this command.
fn sentence(hint: Hint) -> Option<&'static str> {
    Some(match hint {
        // The error says it all.
        Hint::ViewList => return None,
        Hint::SourceOrTarget => "remove it from --sources, or from --targets or --left-out",
        Hint::FewerSources => "choose with --sources or --views",
        Hint::Targets => "give --targets NAMES, --orbit N, --between A B, --spiral N or --camera-path FILE",
        Hint::NoOrbit => "give --targets",
        Hint::NoSpiral => "give --orbit or --between",
        Hint::Background => {
            "set the colour behind the object with --background, or --background none where photographs show no object"
        }
        Hint::Masks => "say it with --masks object or --masks ignore; --masks none does without them",
        Hint::NoObject => "`viewfuse inspect` shows the poses; --background sets the background",
        Hint::PictureSize => "give another --size",
        Hint::OtherRun => {
            "render all targets in one run or with the same options and --sources, give another folder, or --replace \
             to remove them"
        }
        Hint::Shard => "give each its own --shard",
        Hint::BuildWithTiff => {
            "a build with `--features formats` reads it: `cargo install --path host/cli --features formats`"
        }
        Hint::Poses => {
            "`viewfuse pose FOLDER -o posed` finds poses and writes a scene, and so does --pose on the way of \
             `render`, `view` and `inspect`; `viewfuse --help` lists the layouts of posed photographs"
        }
        Hint::FewerPhotographs => "--every N takes every Nth",
        Hint::Solver("colmap") => {
            "install COLMAP (Debian and Ubuntu: `apt install colmap`, macOS: `brew install colmap`, or conda-forge's \
             `colmap`); VIEWFUSE_COLMAP names the program where it lies elsewhere"
        }
        Hint::Solver("pycolmap") => {
            "`python3 -m pip install pycolmap` installs it; VIEWFUSE_PYTHON names the Python that has it, for \
             example that of a virtual environment"
        }
        Hint::Solver(_) => {
            "in the repository `cargo openmvg` builds it, and `cargo install --path host/pose/openmvg \
             --ignore-rust-version` installs it; VIEWFUSE_OPENMVG names it where it lies elsewhere"
        }
        Hint::Port => "give another --port, or none",
    })
}
