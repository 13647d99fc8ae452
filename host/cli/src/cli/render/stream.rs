//! `viewfuse render -o -`: the pictures as y4m on standard output, one after the other, and no files.

use super::Arguments;
use super::prepare::Prepared;
use crate::cli::printing::data_out;
use crate::cli::threads::on_threads;
use anyhow::Context;
use image::RgbImage;
use std::io::{BufWriter, StdoutLock, Write};
use viewfuse_field::auto;
use viewfuse_field::render::Frame;
use viewfuse_job::progress::Progress;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::y4m::Y4m;

/// What is written, and the size of its frames.
type Video = (Y4m<BufWriter<StdoutLock<'static>>>, (u32, u32));

/// A video on standard output, which begins with its first frame.
struct Stream {
    rate: FrameRate,
    video: Option<Video>,
}

impl Stream {
    fn write(&mut self, picture: &RgbImage) -> anyhow::Result<()> {
        let size = picture.dimensions();
        let (video, first) = match &mut self.video {
            Some(video) => video,
            None => {
                let video = Y4m::begin(BufWriter::new(data_out()), size.into(), self.rate)?;
                self.video.insert((video, size))
            }
        };
        anyhow::ensure!(
            *first == size,
            "the frames of a video have one size: {}x{} after {}x{}",
            size.0,
            size.1,
            first.0,
            first.1
        );
        video.frame(picture).context("standard output")
    }
}

/// Renders the targets, and writes nothing else.
pub(super) fn to_stdout(arguments: &Arguments, prepared: &Prepared, progress: &dyn Progress) -> anyhow::Result<()> {
    let stream = || {
        let renderer = prepared.field.on(&prepared.device.device);
        let mut stream = Stream { rate: prepared.rate, video: None };
        let write = |_: &_, frame: Frame, _: Option<&_>| stream.write(&frame.picture);
        auto::render(&prepared.run(renderer.as_ref(), progress), prepared.weighting.as_ref(), write)?;
        match stream.video {
            Some((video, _)) => Ok(video.finish().and_then(|mut output| output.flush()).context("standard output")?),
            None => Ok(()),
        }
    };
    on_threads(arguments.picture.threads, stream)?
}
