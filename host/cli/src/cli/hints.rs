//! Hints at the command's options for errors of the library, printed behind the error.

use image::error::ImageFormatHint;
use image::{ImageError, ImageFormat};
use viewfuse_evaluate::EvaluateError;
use viewfuse_evaluate::protocol::ProtocolError;
use viewfuse_evaluate::run_folder::FolderError;
use viewfuse_field::render::RenderError;
use viewfuse_field::training_free::NoObject;
use viewfuse_output::folder::OutputError;
use viewfuse_scene::SceneError;
use viewfuse_scene::few_shot::SelectionError;
use viewfuse_scene::photographs::PhotographsError;

/// The hint, if there is one, for an error or one of its causes.
pub(crate) fn hint(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| {
        let few_shot = cause.downcast_ref::<SelectionError>().and_then(of_few_shot);
        let photographs = cause.downcast_ref::<PhotographsError>().and_then(of_photographs);
        let folder = cause.downcast_ref::<FolderError>().and_then(of_run_folder);
        let render = cause.downcast_ref::<RenderError>().and_then(of_render);
        let evaluation = cause.downcast_ref::<EvaluateError>().and_then(of_evaluation);
        let output = cause.downcast_ref::<OutputError>().and_then(of_output);
        let others =
            || of_viewer(cause).or_else(|| of_tiff(cause)).or_else(|| of_bare(cause)).or_else(|| of_pose(cause));
        few_shot.or(photographs).or(output).or(folder).or(render).or(evaluation).or_else(others)
    })
}

/// Whether an error, or one of its causes, is of what an option says, whatever the scene is.
pub(crate) fn is_of_arguments(error: &anyhow::Error) -> bool {
    let selection = |cause: &(dyn std::error::Error + 'static)| {
        let of_evaluation = match cause.downcast_ref::<EvaluateError>() {
            Some(EvaluateError::Selection(error)) => Some(error),
            _ => None,
        };
        let of_protocol = match cause.downcast_ref::<ProtocolError>() {
            Some(ProtocolError::Selection(error)) => Some(error),
            _ => None,
        };
        of_evaluation.or(of_protocol).or_else(|| cause.downcast_ref::<SelectionError>()).is_some_and(is_of_list)
    };
    error.chain().any(selection)
}

/// Whether a list of views is written wrongly.
fn is_of_list(error: &SelectionError) -> bool {
    matches!(error, SelectionError::BadStep { .. } | SelectionError::BadRange { .. })
}

fn of_few_shot(error: &SelectionError) -> Option<&'static str> {
    match error {
        SelectionError::TargetIsSource { .. } => Some("remove it from --sources or from --targets"),
        SelectionError::TooManySources { .. } => Some("choose with --sources or --views"),
        SelectionError::NoTargets { .. } => {
            Some("give --targets NAMES, --orbit N, --between A B, --spiral N or --camera-path FILE")
        }
        SelectionError::NoOrbit { .. } => Some("give --targets"),
        SelectionError::NoSpiral { .. } => Some("give --orbit or --between"),
        _ => None,
    }
}

fn of_photographs(error: &PhotographsError) -> Option<&'static str> {
    match error {
        PhotographsError::NoSilhouette { .. } => Some("set the colour with --background"),
        _ => None,
    }
}

fn of_output(error: &OutputError) -> Option<&'static str> {
    match error {
        OutputError::OtherRun { .. } => Some("give another folder, or --replace to remove them"),
        _ => None,
    }
}

fn of_run_folder(error: &FolderError) -> Option<&'static str> {
    match error {
        FolderError::Busy { .. } => Some("give each its own --shard"),
        _ => None,
    }
}

fn of_render(error: &RenderError) -> Option<&'static str> {
    match error {
        RenderError::Shape { .. } | RenderError::Size { .. } => Some("give another --size"),
        RenderError::Unsuitable { reason, .. } if reason.is::<NoObject>() => {
            Some("`viewfuse inspect` shows the poses; --background sets the background")
        }
        RenderError::Photographs(error) => of_photographs(error),
        _ => None,
    }
}

/// A transparent error replaces its cause, which is then not part of the chain.
fn of_evaluation(error: &EvaluateError) -> Option<&'static str> {
    match error {
        EvaluateError::Selection(error) => of_few_shot(error),
        EvaluateError::Render(error) => of_render(error),
        _ => None,
    }
}

/// A photograph in a format that is a feature.
fn of_tiff(cause: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    match cause.downcast_ref::<SceneError>() {
        Some(SceneError::Image { cause: ImageError::Unsupported(problem), .. })
            if problem.format_hint() == ImageFormatHint::Exact(ImageFormat::Tiff) =>
        {
            Some("a build with `--features formats` reads it: `cargo install --path host/cli --features formats`")
        }
        _ => None,
    }
}

/// A folder of photographs without poses.
fn of_bare(cause: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    match cause.downcast_ref::<SceneError>() {
        Some(SceneError::BarePhotographs { .. }) => Some(
            "`viewfuse pose FOLDER -o posed` finds poses and writes a scene, and so does --pose on the way of `render`, `view` and \
             `inspect`; `viewfuse --help` lists the layouts of posed photographs",
        ),
        _ => None,
    }
}

/// A transparent error replaces its cause, which is then not part of the chain.
fn of_pose(cause: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    use viewfuse_pose::{IntakeError, PoseError, SolverError};
    match cause.downcast_ref::<PoseError>() {
        Some(PoseError::Solver(SolverError::Missing { solver, .. })) => Some(match *solver {
            "colmap" => {
                "install COLMAP (Debian and Ubuntu: `apt install colmap`, macOS: `brew install colmap`, or conda-forge's `colmap`); \
                 VIEWFUSE_COLMAP names the program where it lies elsewhere"
            }
            "pycolmap" => {
                "`python3 -m pip install pycolmap` installs it; VIEWFUSE_PYTHON names the Python that has it, for example that of a \
                 virtual environment"
            }
            _ => {
                "in the repository `cargo openmvg` builds it, and `cargo install --path host/pose/openmvg \
                 --ignore-rust-version` installs it; VIEWFUSE_OPENMVG names it where it lies elsewhere"
            }
        }),
        Some(PoseError::Intake(IntakeError::Many { .. })) => Some("--every N takes every Nth"),
        _ => None,
    }
}

fn of_viewer(cause: &(dyn std::error::Error + 'static)) -> Option<&'static str> {
    match cause.downcast_ref::<viewfuse_view::ListenError>() {
        Some(viewfuse_view::ListenError::Port { .. }) => Some("give another --port, or none"),
        _ => None,
    }
}
