//! Options of what a render writes.

use crate::cli::printing::complain;
use crate::cli::wrong::{not_built, wrong};
use anyhow::Context;
use clap::Args;
use std::path::Path;
use viewfuse_field::About;
use viewfuse_output::depth::DepthFormat;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::run::Outputs;
use viewfuse_output::video::VideoFormat;

/// What a rate may be.
const RATES: &str = "from 0.1 to 240";

/// Heading of these options in the help.
const FILES: &str = "Files";

/// What is written.
#[derive(Args)]
pub(crate) struct OutputOptions {
    /// Write the opacity as the pictures' alpha channel, without the background
    #[arg(long, help_heading = FILES)]
    alpha: bool,
    /// Formats of depth maps: png (16 bit), exr, npy (both 32-bit floating point); units are in run.json
    /// [default: png]
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = parse_depth,
        help_heading = FILES)]
    depth: Option<Vec<DepthFormat>>,
    /// Write no contact sheets
    #[arg(long, help_heading = FILES)]
    no_sheets: bool,
    /// Write nothing beside the pictures: no depth maps, no confidences, no contact sheets
    #[arg(long, conflicts_with = "depth", help_heading = FILES)]
    pictures_only: bool,
    /// Remove what an earlier run wrote to the folder and this one does not replace
    #[arg(long, help_heading = FILES)]
    pub(crate) replace: bool,
    /// Write all pictures, in order, also as video.FORMAT: webp and gif (animated), y4m (not compressed), mp4
    /// (by the ffmpeg on the path; without one y4m)
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', help_heading = FILES)]
    pub(crate) video: Vec<VideoFormat>,
    /// Frames per second of a video [default: those of the camera path's file, else 30]
    #[arg(long, value_name = "N", value_parser = parse_rate, help_heading = FILES)]
    fps: Option<FrameRate>,
}

impl OutputOptions {
    /// Refuses what is asked for and a field's pictures do not come with.
    pub(crate) fn check(&self, about: &About) -> anyhow::Result<()> {
        let asked = [(self.alpha, "--alpha", "opacity"), (self.depth.is_some(), "--depth", "depths")];
        match asked.into_iter().find(|(is_asked, ..)| *is_asked && !about.has_surfaces) {
            Some((_, option, what)) => Err(wrong(format_args!("{option}: pictures of {} have no {what}", about.name))),
            None => Ok(()),
        }
    }

    /// Refuses what is asked for and standard output, which takes the pictures alone, does not get.
    pub(crate) fn check_stream(&self) -> anyhow::Result<()> {
        let asked = [(!self.video.is_empty(), "--video"), (self.depth.is_some(), "--depth"), (self.alpha, "--alpha")];
        match asked.into_iter().find(|(is_asked, _)| *is_asked) {
            Some((_, option)) => Err(wrong(format_args!(
                "{option}: with --output - the pictures go to standard output as y4m, which has no alpha, and no files \
                 are written; leave it out, or give a folder"
            ))),
            None => Ok(()),
        }
    }

    pub(crate) fn outputs(&self) -> Outputs {
        let depths = match &self.depth {
            _ if self.pictures_only => Vec::new(),
            None => vec![DepthFormat::Png],
            Some(formats) => formats.clone(),
        };
        Outputs {
            alpha: self.alpha,
            depths,
            confidence: !self.pictures_only,
            sheet: !self.no_sheets && !self.pictures_only,
        }
    }

    /// The rate of a video. `stated` is what the camera path's file says.
    pub(crate) fn rate(&self, stated: Option<f64>) -> anyhow::Result<FrameRate> {
        let of_file = |stated: f64| {
            let said = || format!("the camera path's file states {stated} frames per second; give --fps, {RATES}");
            FrameRate::new(stated).with_context(said)
        };
        match (self.fps, stated) {
            (Some(given), _) => Ok(given),
            (None, Some(stated)) => of_file(stated),
            (None, None) => Ok(FrameRate::DEFAULT),
        }
    }

    /// The formats of videos, y4m in place of MP4 where there is no ffmpeg, of which a line about `folder` is printed.
    pub(crate) fn video_formats(&self, folder: &Path) -> Vec<VideoFormat> {
        let mut formats = Vec::new();
        for format in &self.video {
            let format = if format.is_possible() {
                *format
            } else {
                let path = folder.join("video.y4m");
                complain(format_args!("{}, not mp4, is written: there is no ffmpeg on the path", path.display()));
                VideoFormat::Y4m
            };
            if !formats.contains(&format) {
                formats.push(format);
            }
        }
        formats
    }
}

fn parse_depth(text: &str) -> Result<DepthFormat, String> {
    text.parse::<DepthFormat>().map_err(|error| match text {
        "exr" => not_built("OpenEXR", "formats"),
        _ => error.to_string(),
    })
}

fn parse_rate(text: &str) -> Result<FrameRate, String> {
    let rate = text.parse().ok().and_then(FrameRate::new);
    rate.ok_or_else(|| format!("frames per second {RATES}"))
}
