//! Options of targets along a path.

use super::parse::parse_count;
use clap::Args;
use std::path::PathBuf;
use viewfuse_scene::few_shot::PathChoice;
use viewfuse_scene::path::FORMS;

/// Heading of these options in the help.
const CAMERAS: &str = "Camera paths";

/// Targets along a path; at most one of them.
#[derive(Args, Default)]
pub(crate) struct PathOptions {
    /// This many targets on a circle around the object
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = CAMERAS)]
    orbit: Option<usize>,
    /// Targets on the way from a view to another, both included; how many: --frames
    #[arg(long, num_args = 2, value_names = ["A", "B"], requires = "frames", conflicts_with = "orbit", help_heading = CAMERAS)]
    between: Option<Vec<String>>,
    /// Number of targets of --between
    #[arg(long, value_name = "N", value_parser = parse_count, requires = "between", help_heading = CAMERAS)]
    frames: Option<usize>,
    /// This many targets on a spiral, for forward-facing cameras
    #[arg(long, value_name = "N", value_parser = parse_count, conflicts_with_all = ["orbit", "between"], help_heading = CAMERAS)]
    spiral: Option<usize>,
    #[arg(long, value_name = "FILE", conflicts_with_all = ["orbit", "between", "spiral"], help = file_help(), help_heading = CAMERAS)]
    camera_path: Option<PathBuf>,
}

fn file_help() -> String {
    format!("The cameras of a file as targets: {FORMS}")
}

impl PathOptions {
    pub(crate) fn choice(&self) -> Option<PathChoice> {
        let between = self.between.as_deref().and_then(|names| match names {
            [first, last] => {
                Some(PathChoice::Between { first: first.clone(), last: last.clone(), count: self.frames.unwrap_or(1) })
            }
            _ => None,
        });
        self.orbit
            .map(PathChoice::Orbit)
            .or(between)
            .or(self.spiral.map(PathChoice::Spiral))
            .or(self.camera_path.clone().map(PathChoice::File))
    }
}
