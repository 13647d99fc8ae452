//! Options of targets along a path.

use super::parse::parse_count;
use super::printing::complain;
use clap::Args;
use std::path::PathBuf;
use viewfuse_core::camera::Camera;
use viewfuse_scene::few_shot::PathChoice;
use viewfuse_scene::path::FORMS;
use viewfuse_scene::path::arc::Arc;

/// Heading of these options in the help.
const CAMERAS: &str = "Camera paths";

/// Targets along a path; at most one of them.
#[derive(Args, Default)]
pub(crate) struct PathOptions {
    /// This many targets on a circle around the object, on the arc from photograph to photograph; N,full: on the whole
    /// circle
    #[arg(long, value_name = "N[,full]", value_parser = parse_orbit, help_heading = CAMERAS)]
    orbit: Option<PathChoice>,
    /// Targets on the way from a view to another, both included; how many: --frames
    #[arg(long, num_args = 2, value_names = ["A", "B"], requires = "frames", conflicts_with = "orbit",
        help_heading = CAMERAS)]
    between: Option<Vec<String>>,
    /// Number of targets of --between
    #[arg(long, value_name = "N", value_parser = parse_count, requires = "between", help_heading = CAMERAS)]
    frames: Option<usize>,
    /// This many targets on a spiral, for forward-facing cameras
    #[arg(long, value_name = "N", value_parser = parse_count, conflicts_with_all = ["orbit", "between"],
        help_heading = CAMERAS)]
    spiral: Option<usize>,
    #[arg(long, value_name = "FILE", conflicts_with_all = ["orbit", "between", "spiral"], help = file_help(),
        help_heading = CAMERAS)]
    camera_path: Option<PathBuf>,
}

fn file_help() -> String {
    format!("The cameras of a file as targets: {FORMS}")
}

/// A number of targets on an orbit.
fn parse_orbit(text: &str) -> Result<PathChoice, String> {
    match text.split_once(',') {
        None => parse_count(text).map(PathChoice::Orbit),
        Some((count, "full")) => parse_count(count).map(PathChoice::FullOrbit),
        Some(_) => Err("a whole number from 1 to 10000, or one with `,full` behind it".to_owned()),
    }
}

impl PathOptions {
    /// Says it if an orbit is not the whole circle. `cameras` are those of the sources.
    pub(crate) fn tell_arc(&self, cameras: &[Camera]) {
        if let Some(PathChoice::Orbit(count)) = &self.orbit
            && let arc = Arc::covered(cameras)
            && !arc.is_full()
        {
            let degrees = arc.width.to_degrees();
            complain(format_args!(
                "--orbit: the {degrees:.0} degrees on which there are photographs; `--orbit {count},full` is the whole \
                    circle"
            ));
        }
    }

    pub(crate) fn choice(&self) -> Option<PathChoice> {
        let between = self.between.as_deref().and_then(|names| match names {
            [first, last] => {
                Some(PathChoice::Between { first: first.clone(), last: last.clone(), count: self.frames.unwrap_or(1) })
            }
            _ => None,
        });
        self.orbit
            .clone()
            .or(between)
            .or(self.spiral.map(PathChoice::Spiral))
            .or(self.camera_path.clone().map(PathChoice::File))
    }
}
