//! The frames of a run as one file: an animated picture, or a video.

use crate::gif::{self, Gif};
use crate::rate::FrameRate;
use crate::webp::{self, Animation};
use crate::y4m::Y4m;
use image::{DynamicImage, ImageError, Rgb, RgbImage};
use std::fmt;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::sync::Arc;
use viewfuse_device::queue::{Queue, width};
use viewfuse_job::files::{WholeFile, WriteError, write_whole};
use viewfuse_job::process::Process;
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_scene::{SceneError, picture_size, read_picture};

/// The program that compresses videos, where a person has it.
const FFMPEG: &str = "ffmpeg";

/// Most bytes of what it says that are read.
const MAX_SAID: u64 = 1 << 16;

/// A format of moving pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VideoFormat {
    /// Animated WebP without loss, for pages and messages.
    Webp,
    /// Animated GIF of 256 colours a frame, for those that take no WebP.
    Gif,
    /// YUV4MPEG2, without compression, for video programs.
    Y4m,
    /// MP4, by the person's own `ffmpeg`.
    Mp4,
}

impl VideoFormat {
    /// All of them.
    pub const ALL: &[VideoFormat] = &[VideoFormat::Webp, VideoFormat::Gif, VideoFormat::Y4m, VideoFormat::Mp4];

    /// Whether this machine can write it: MP4 needs an `ffmpeg` on the path.
    pub fn is_possible(self) -> bool {
        let starts =
            || Command::new(FFMPEG).arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
        self != VideoFormat::Mp4 || starts()
    }
}

impl fmt::Display for VideoFormat {
    /// The extension of its files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            VideoFormat::Webp => "webp",
            VideoFormat::Gif => "gif",
            VideoFormat::Y4m => "y4m",
            VideoFormat::Mp4 => "mp4",
        })
    }
}

/// The name is not that of a format of moving pictures.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a format of moving pictures: {all}",
    all = VideoFormat::ALL.iter().map(|one| one.to_string()).collect::<Vec<_>>().join(", "))]
pub struct UnknownVideoFormat(String);

impl FromStr for VideoFormat {
    type Err = UnknownVideoFormat;

    fn from_str(name: &str) -> Result<VideoFormat, UnknownVideoFormat> {
        let found = VideoFormat::ALL.iter().find(|format| format.to_string() == name);
        found.copied().ok_or_else(|| UnknownVideoFormat(name.to_owned()))
    }
}

/// Why no video was written.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A frame could not be read.
    #[error(transparent)]
    Frame(#[from] SceneError),
    /// The frames differ in size: a frame's file, its width and height, and those of the first frame.
    #[error(
        "{}: has {}x{} pixels, the first frame {}x{}; the frames of a video have one size",
        .0.display(), .1[0], .1[1], .2[0], .2[1]
    )]
    Sizes(PathBuf, [u32; 2], [u32; 2]),
    /// There is no frame.
    #[error("a video needs at least one frame")]
    NoFrames,
    /// There is no `ffmpeg` on this machine.
    #[error("there is no {FFMPEG} on the path, which mp4 needs")]
    NoProgram,
    /// `ffmpeg` failed: the file to write, and what it said.
    #[error("{0}: {FFMPEG} could not write it: {1}")]
    Program(PathBuf, String),
    /// The person stopped the work.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Writes pictures that are there as files, all of one size, as a moving picture, completely or not at all.
/// Transparency is kept in WebP, and laid over `background` in the others.
///
/// # Errors
/// [`VideoError`]; [`VideoError::NoProgram`] if the format is MP4 and there is no `ffmpeg`.
pub fn write_video(
    path: &Path,
    format: VideoFormat,
    frames: &[PathBuf],
    rate: FrameRate,
    background: [u8; 3],
    progress: &dyn Progress,
) -> Result<(), VideoError> {
    let first = frames.first().ok_or(VideoError::NoFrames)?;
    let frames = Frames { files: frames, size: picture_size(first)?, background, progress };
    match format {
        VideoFormat::Webp => {
            let mut animation = Animation::new(frames.size, rate);
            let encode = |cause: ImageError| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() };
            frames.each(
                |frame| webp::encoded(&frame),
                |frame| {
                    animation.add(&frame.map_err(encode)?);
                    Ok(())
                },
            )?;
            Ok(write_whole(path, &animation.finish())?)
        }
        VideoFormat::Gif => {
            let encode =
                |cause: gif::EncodingError| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() };
            let mut file = WholeFile::create(path)?;
            let mut output = Unfailing(&mut file);
            let mut animation = Gif::begin(&mut output, frames.size, rate).map_err(encode)?;
            frames.each(
                move |frame| gif::frame(&over(frame, background)),
                |frame| Ok(frame.and_then(|frame| animation.add(frame)).map_err(encode)?),
            )?;
            // The end of the file is written when the encoder goes.
            drop(animation);
            Ok(file.finish()?)
        }
        VideoFormat::Y4m => {
            let mut file = WholeFile::create(path)?;
            frames.stream(&mut Unfailing(&mut file), rate, |cause| io_error(path, cause))?;
            Ok(file.finish()?)
        }
        VideoFormat::Mp4 => compress(path, &frames, rate),
    }
}

/// Pictures that are there as files.
struct Frames<'a> {
    files: &'a [PathBuf],
    size: [u32; 2],
    background: [u8; 3],
    progress: &'a dyn Progress,
}

impl Frames<'_> {
    /// Reads each picture and gives it to `encode` on other threads; `deliver` gets what becomes of it, in order.
    fn each<T: Send + 'static>(
        &self,
        encode: impl Fn(DynamicImage) -> T + Send + Sync + 'static,
        mut deliver: impl FnMut(T) -> Result<(), VideoError>,
    ) -> Result<(), VideoError> {
        self.progress.expect(self.files.len());
        let (encode, first) = (Arc::new(encode), self.size);
        let mut queue: Queue<Result<T, VideoError>> = Queue::default();
        let mut paths = self.files.iter();
        for _ in self.files {
            self.progress.check()?;
            for path in paths.by_ref().take(width() - queue.len()) {
                let (path, encode) = (path.clone(), Arc::clone(&encode));
                queue.add(move || {
                    let frame = read_picture(&path)?;
                    let size = [frame.width(), frame.height()];
                    if size != first {
                        return Err(VideoError::Sizes(path, size, first));
                    }
                    Ok(encode(frame))
                });
            }
            queue.next_result().map_or(Ok(()), |frame| deliver(frame?))?;
            self.progress.step();
        }
        Ok(())
    }

    /// As y4m.
    fn stream(
        &self,
        writer: &mut dyn Write,
        rate: FrameRate,
        failed: impl Fn(io::Error) -> VideoError,
    ) -> Result<(), VideoError> {
        let mut video = Y4m::begin(writer, self.size, rate).map_err(&failed)?;
        let background = self.background;
        self.each(move |frame| over(frame, background), |frame| video.frame(&frame).map_err(&failed))?;
        video.finish().map_err(&failed).map(drop)
    }
}

/// A picture over a background of one colour.
fn over(picture: DynamicImage, background: [u8; 3]) -> RgbImage {
    if !picture.color().has_alpha() {
        return picture.into_rgb8();
    }
    let picture = picture.into_rgba8();
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let [r, g, b, a] = picture.get_pixel(x, y).0.map(u32::from);
        let mix = |colour: u32, behind: u8| ((colour * a + u32::from(behind) * (255 - a) + 127) / 255) as u8;
        Rgb([mix(r, background[0]), mix(g, background[1]), mix(b, background[2])])
    })
}

/// A file that appears when it is whole, as a writer.
struct Unfailing<'a>(&'a mut WholeFile);

impl Write for Unfailing<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map_err(|error| match error {
            WriteError::Io { cause, .. } => cause,
            error => io::Error::other(error),
        })?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn io_error(path: &Path, cause: io::Error) -> VideoError {
    WriteError::Io { path: path.to_path_buf(), cause }.into()
}

/// Frames as y4m to the standard input of `ffmpeg`, which writes the file. It is named otherwise until it is whole.
fn compress(path: &Path, frames: &Frames<'_>, rate: FrameRate) -> Result<(), VideoError> {
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
    let sent = match input {
        Some(input) => frames.stream(&mut BufWriter::new(input), rate, |cause| io_error(path, cause)),
        None => Ok(()),
    };
    if matches!(sent, Err(VideoError::Interrupted(_) | VideoError::Frame(_) | VideoError::Sizes { .. })) {
        // It would make a video of the frames that it got.
        process.end();
    }
    let mut said = String::new();
    if let Some(errors) = errors {
        errors.take(MAX_SAID).read_to_string(&mut said).ok();
    }
    let ended = process.wait().map_err(|cause| io_error(path, cause));
    let outcome = match (sent, ended) {
        (Err(error @ (VideoError::Interrupted(_) | VideoError::Frame(_) | VideoError::Sizes { .. })), _) => Err(error),
        (_, Err(error)) => Err(error),
        (sent, Ok(status)) if status.success() => sent,
        (_, Ok(status)) => {
            let said = if said.trim().is_empty() { status.to_string() } else { said.trim().replace('\n', "; ") };
            Err(VideoError::Program(path.to_path_buf(), said))
        }
    };
    outcome.and_then(|()| Ok(draft.finish()?))
}
