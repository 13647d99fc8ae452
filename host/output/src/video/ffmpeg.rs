//! MP4 by the person's own `ffmpeg`.

use super::{VideoError, io_error};
use crate::rate::FrameRate;
use crate::y4m::Y4m;
use image::RgbImage;
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};
use std::process::{ChildStderr, ChildStdin, Command, Stdio};
use viewfuse_job::files::WholeFile;
use viewfuse_job::process::Process;

/// The program that compresses videos, where a person has it.
pub(crate) const FFMPEG: &str = "ffmpeg";

/// Most bytes of what it says that are read.
const MAX_SAID: u64 = 1 << 16;

/// A program that gets frames as y4m on its standard input and writes the file, which is named otherwise until it is
/// whole. Dropped before it is finished, it ends and leaves no file.
pub(crate) struct Ffmpeg {
    path: PathBuf,
    draft: WholeFile,
    process: Process,
    /// `None` once it failed.
    video: Option<Y4m<BufWriter<ChildStdin>>>,
    errors: Option<ChildStderr>,
}

impl Ffmpeg {
    /// Starts it.
    pub(crate) fn begin(path: &Path, size: [u32; 2], rate: FrameRate) -> Result<Ffmpeg, VideoError> {
        let draft = WholeFile::create(path)?;
        let mut command = Command::new(FFMPEG);
        command.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "yuv4mpegpipe", "-i", "-"]);
        // Half the resolution of colours, as every player expects, needs even sides.
        command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]);
        // Players would guess by the size which matrix the colours were made with.
        command.args(["-colorspace", "smpte170m", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1"]);
        command.args(["-color_range", "tv", "-f", "mp4"]).arg(draft.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let process = Process::start(&mut command).map_err(|cause| match cause.kind() {
            io::ErrorKind::NotFound => VideoError::NoProgram,
            _ => io_error(path, cause),
        })?;
        let (input, _, errors) = process.pipes();
        let begin = |input| Y4m::begin(BufWriter::new(input), size, rate);
        let video = input.map(begin).transpose().map_err(|cause| io_error(path, cause))?;
        Ok(Ffmpeg { path: path.to_path_buf(), draft, process, video, errors })
    }

    /// Gives it a frame.
    pub(crate) fn frame(&mut self, picture: &RgbImage) -> Result<(), VideoError> {
        let sent = self.video.as_mut().map_or(Ok(()), |video| video.frame(picture));
        sent.or_else(|cause| self.end(Err(cause)))
    }

    /// Waits until it has written the file, which appears then.
    pub(crate) fn finish(mut self) -> Result<(), VideoError> {
        let sent = self.video.take().map_or(Ok(()), |video| video.finish().map(drop));
        self.end(sent)?;
        Ok(self.draft.finish()?)
    }

    /// Waits for its end: an error is what it said, or why it did not get all frames.
    fn end(&mut self, sent: io::Result<()>) -> Result<(), VideoError> {
        // Nothing more comes.
        self.video = None;
        let mut said = String::new();
        if let Some(errors) = self.errors.take() {
            errors.take(MAX_SAID).read_to_string(&mut said).ok();
        }
        let status = self.process.wait().map_err(|cause| io_error(&self.path, cause))?;
        if status.success() {
            return sent.map_err(|cause| io_error(&self.path, cause));
        }
        let said = if said.trim().is_empty() { status.to_string() } else { said.trim().replace('\n', "; ") };
        Err(VideoError::Program(self.path.clone(), said))
    }
}
