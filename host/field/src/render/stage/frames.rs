//! Frames: targets weighed, rendered and compared with their photographs.

use super::{SceneSources, Stage, timed};
use crate::budget::View;
use crate::render::compared::comparable;
use crate::render::most_views::weight_beyond;
use crate::render::options::size_at;
use crate::render::seen::seen;
use crate::render::{Frame, RenderError, Truth};
use crate::{DepthMap, Drawing, Encoding, Rendered, Rounded};
use image::RgbImage;
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_core::weights::Omission;
use viewfuse_job::progress::Progress;
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::to_rgb8;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

impl<'a> Stage<'a> {
    /// Weighs the sources for a target, leaves out those of least weight, renders, and compares with the ground truth.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn frame(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let camera = self.at_working_size(&target.camera)?;
        let mut frame = self.frame_at(weighting, target, &camera, progress)?;
        if !frame.depths.is_empty() {
            let maps = self.source_depths()?;
            let is_used = |(source, _): &(usize, DepthMap)| frame.omission.weights.get(*source as u32) > 0.0;
            let used: Vec<DepthMap> = maps.into_iter().enumerate().filter(is_used).map(|(_, map)| map).collect();
            frame.seen = seen(&camera, frame.picture.dimensions().into(), &frame.depths, &used);
        }
        Ok(frame)
    }

    /// The picture of [`Stage::frame`] alone, begun where it has no bound.
    pub(crate) fn draw(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        progress: &dyn Progress,
    ) -> Result<Drawing<'a>, RenderError> {
        let camera = self.at_working_size(&target.camera)?;
        if self.controller.is_some() {
            let frame = self.frame_at(weighting, target, &camera, progress)?;
            let (width, height) = frame.picture.dimensions();
            let Frame { colours, depths, confidences, .. } = frame;
            return Ok(Box::new(move || Ok(Rendered { colours, depths, confidences, width, height })));
        }
        let (_, [omission, _]) = self.weighed(weighting, target);
        let early_termination = self.options.early_termination;
        let drawn = self.session.draw(&camera, &omission.weights, early_termination, progress);
        drawn.map_err(|error| self.error(error))
    }

    /// Goes on towards the picture of [`Stage::draw`]; returns whether there is nothing more to ask for.
    pub(crate) fn advance(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        progress: &dyn Progress,
    ) -> Result<bool, RenderError> {
        if self.controller.is_some() {
            return Ok(true);
        }
        let camera = self.at_working_size(&target.camera)?;
        let (_, [omission, _]) = self.weighed(weighting, target);
        let early_termination = self.options.early_termination;
        let advanced = self.session.advance(&camera, &omission.weights, early_termination, progress);
        advanced.map_err(|error| self.error(error))
    }

    /// The weights of the sources for a target, what the options omit of them, and what may be omitted by any.
    fn weighed(&self, weighting: &Weighting, target: &Target) -> (SourceWeights, [Omission<MAX_SOURCES>; 2]) {
        let pose = self.unit.pose(&target.camera.pose);
        let weights = weighting.weigh(&self.sources, &pose);
        let compares = matches!(self.session.prepared.encoding(), Encoding::Greatest(_));
        let omitting = |total: f32| match weights.without_least(total) {
            omission if compares => comparable(&weights, omission, &self.sources, &pose),
            omission => omission,
        };
        let omissions = [omitting(self.left_out_total(&weights)), omitting(0.0)];
        (weights, omissions)
    }

    /// As [`Stage::frame`] without a truth, with a picture of another size than the options': for coarse pictures.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn frame_of_size(
        &mut self,
        weighting: &Weighting,
        camera: &Camera,
        [width, height]: [u32; 2],
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let pinhole =
            camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        let target = Target { name: String::new(), camera: *camera, truth: None };
        self.frame_at(weighting, &target, &Camera { pinhole, ..*camera }, progress)
    }

    /// `camera` is the target's, of the picture's size.
    fn frame_at(
        &mut self,
        weighting: &Weighting,
        target: &Target,
        camera: &Camera,
        progress: &dyn Progress,
    ) -> Result<Frame, RenderError> {
        let start = Instant::now();
        let (weights, [mut omission, least]) = self.weighed(weighting, target);
        let early_termination = self.options.early_termination;
        let is_rounded = self.options.is_rounded;
        let (pixels, kept, encode) = match &mut self.controller {
            Some(controller) => {
                let view = View { camera, all: &least.weights, used: &omission.weights, early_termination };
                let bounded = controller.render(&mut self.session, view, progress);
                bounded.map(|(rendered, kept, encode, has_all)| {
                    if has_all {
                        omission = least;
                    }
                    (rendered.into(), Some(kept), encode)
                })
            }
            None => {
                let (session, used) = (&mut self.session, &omission.weights);
                let mut encode = Duration::ZERO;
                timed(&mut encode, || session.encode(used, progress))
                    .and_then(|()| match is_rounded {
                        true => session.render_rounded(camera, used, early_termination, progress),
                        false => Ok(None),
                    })
                    .and_then(|rounded| match rounded {
                        Some(rounded) => Ok(rounded.into()),
                        None => session.render(camera, used, early_termination, progress).map(Pixels::from),
                    })
                    .map(|pixels| (pixels, None, encode))
            }
        }
        .map_err(|error| self.error(error))?;
        let time = start.elapsed();
        let Pixels { colours, picture, depths, confidences } = pixels;
        let (width, height) = picture.dimensions();
        let truth = match (target.truth, &self.scene) {
            (Some(view), Some(SceneSources { album, .. })) => {
                let truth = Truth::compare(&picture, album.truth(view, [width, height], self.background())?);
                if truth.is_none() {
                    progress.warn(&format!(
                        "'{}' is not compared with its photograph, of which nothing counts: its mask or its alpha \
                         channel hides all",
                        target.name
                    ));
                }
                truth
            }
            _ => None,
        };
        let target = target.clone();
        let background = self.session.prepared.background().unwrap_or(self.images.background);
        Ok(Frame {
            target,
            weights,
            omission,
            colours,
            picture,
            depths,
            confidences,
            seen: None,
            shares: self.session.shares.clone(),
            truth,
            background,
            time,
            encode,
            kept,
            counts_gaps: self.counts_gaps,
        })
    }

    /// The total weight of the sources that may be left out of a picture: that of the options, or of all that are
    /// beyond the number that the field uses. Where nothing may be left out, it uses all.
    fn left_out_total(&self, weights: &SourceWeights) -> f32 {
        let asked = self.options.leave_out;
        match self.session.prepared.encoding() {
            Encoding::Greatest(count) if asked > 0.0 => asked.max(weight_beyond(weights, count)),
            _ => asked,
        }
    }

    /// Width and height of the picture that is rendered at a camera.
    ///
    /// # Errors
    /// [`RenderError::Size`].
    pub fn size_at(&self, camera: &Camera) -> Result<[u32; 2], RenderError> {
        let camera = self.at_working_size(camera)?;
        Ok([camera.pinhole.width(), camera.pinhole.height()])
    }

    /// A camera with the size of the picture that is rendered at it.
    ///
    /// # Errors
    /// [`RenderError::Size`].
    pub fn at_working_size(&self, camera: &Camera) -> Result<Camera, RenderError> {
        let [width, height] = size_at(camera, self.options.size, self.side);
        let pinhole =
            camera.pinhole.resized(width, height).map_err(|error| RenderError::Size { width, height, error })?;
        Ok(Camera { pinhole, ..*camera })
    }
}

/// The pixels of a frame; see [`Frame`].
struct Pixels {
    colours: Vec<[f32; 4]>,
    picture: RgbImage,
    depths: Vec<f32>,
    confidences: Vec<f32>,
}

impl From<Rendered> for Pixels {
    fn from(Rendered { colours, depths, confidences, width, height }: Rendered) -> Pixels {
        Pixels { picture: to_rgb8(&colours, [width, height]), colours, depths, confidences }
    }
}

impl From<Rounded> for Pixels {
    fn from(Rounded { pixels, depths, width, height }: Rounded) -> Pixels {
        let mut bytes = vec![0; 3 * pixels.len()];
        for (colour, pixel) in bytes.as_chunks_mut::<3>().0.iter_mut().zip(&pixels) {
            *colour = [pixel[0], pixel[1], pixel[2]];
        }
        let picture = RgbImage::from_raw(width, height, bytes).unwrap_or_default();
        let confidences = pixels.iter().map(|[.., confidence]| f32::from(*confidence) / 255.0).collect();
        Pixels { colours: Vec::new(), picture, depths, confidences }
    }
}
