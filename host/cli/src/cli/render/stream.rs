//! `viewfuse render -o -`: the pictures as y4m on standard output, one after the other, and no files.

use anyhow::Context;
use image::RgbImage;
use std::io::{self, BufWriter, StdoutLock, Write};
use viewfuse_field::Renderer;
use viewfuse_field::auto;
use viewfuse_field::render::{Frame, RenderOptions, render};
use viewfuse_job::progress::Progress;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::y4m::Y4m;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_weighting::Weighting;

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
                let video = Y4m::begin(BufWriter::new(io::stdout().lock()), size.into(), self.rate)?;
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

/// Renders the targets; no scheme stands for the best one.
pub(super) fn render_to_stdout(
    scene: &Scene,
    job: &FewShot,
    weighting: Option<&Weighting>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    rate: FrameRate,
    progress: &dyn Progress,
) -> anyhow::Result<()> {
    let mut stream = Stream { rate, video: None };
    match weighting {
        Some(weighting) => {
            let write = |_: &_, frame: Frame| stream.write(&frame.picture);
            render(scene, job, weighting, renderer, options, progress, write)?;
        }
        None => {
            let write = |_: &_, frame: Frame, _: &auto::Chosen| stream.write(&frame.picture);
            auto::render(scene, job, renderer, options, progress, write)?;
        }
    }
    match stream.video {
        Some((video, _)) => Ok(video.finish().and_then(|mut output| output.flush()).context("standard output")?),
        None => Ok(()),
    }
}
