//! Error against run time: one scene rendered under a list of settings, each compared with the first one, the exact
//! one, which leaves nothing out.
//!
//! [`settings`] lists the settings of each field; [`Subject::measure`] renders, [`front`] marks the Pareto-optimal
//! settings, [`plot`] and [`record`] show the results. Only the lists depend on a particular field.
//!
//! Times are medians over rounds. A round runs every setting once, so that other load on the machine affects all of
//! them; still, times on a shared machine are noisy, and differences of a few percent are not significant.

pub mod difference;
pub mod front;
pub mod plot;
pub mod record;
pub mod settings;

use difference::Difference;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;
use viewfuse_device::choice::AnyDevice;
use viewfuse_field::render::{Frame, RenderError, RenderOptions, Stage, working_side};
use viewfuse_field::row::Drawn;
use viewfuse_field::{Record, Renderer};
use viewfuse_job::medians::median;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{FewShot, Target};
use viewfuse_scene::photographs::{Album, SourceImages};
use viewfuse_weighting::Weighting;

/// The result of a setting.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// The setting's short name.
    pub setting: String,
    /// Seconds for a target, encoding included: the median over the rounds.
    pub seconds: f64,
    /// Least and greatest time of the rounds.
    pub seconds_range: [f64; 2],
    /// Seconds of that for encoding the sources: the median over the rounds.
    pub encode_seconds: f64,
    /// How the pictures differ from the first setting's.
    pub difference: Difference,
    /// Peak signal to noise ratio against the photographs in decibels, of 8-bit values, the mean over the targets that
    /// have one.
    pub truth_psnr: Option<f64>,
    /// The work that the field did and skipped in one round.
    pub record: Record,
    /// Whether every round rendered the same pictures, bit for bit.
    pub is_repeatable: bool,
}

/// The results of all settings on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// One for each setting, in their order.
    pub points: Vec<Point>,
    /// The first setting's pictures, `[target][pixel]` of red, green, blue and opacity, not rounded.
    pub exact: Vec<Vec<[f32; 4]>>,
    /// Width and height of the first target's pictures; zeros without settings.
    pub size: [u32; 2],
}

impl Measured {
    /// How the exact pictures differ from those of another device.
    pub fn exact_versus(&self, other: &Measured) -> Difference {
        let mut difference = Difference::default();
        self.exact.iter().zip(&other.exact).for_each(|(picture, others)| difference.add(picture, others));
        difference
    }
}

/// What is rendered.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its photographs.
    pub album: &'a Album<'a>,
    /// Sources and targets.
    pub job: &'a FewShot,
    /// The weighting scheme.
    pub weighting: &'a Weighting,
}

impl Subject<'_> {
    /// Renders all targets under every setting, `round_count` times after a first round that is not timed. In each
    /// round a setting starts with nothing encoded; uploading photographs and parameters to the device is not counted.
    ///
    /// `progress` gets a step for every picture.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn measure(
        &self,
        device: &AnyDevice,
        settings: &[Drawn],
        round_count: u32,
        progress: &dyn Progress,
    ) -> Result<Measured, RenderError> {
        let parts = settings.len() * (round_count as usize + 1);
        let begin = |round: usize, index: usize| {
            let place = round * settings.len() + index;
            let label = &settings[index].label;
            let name = if round == 0 { label.clone() } else { format!("{label}, round {round} of {round_count}") };
            progress.stage(&name, place..place + 1, parts);
            progress.expect(self.job.targets.len());
        };
        let images = self.images(settings, progress)?;
        // Later rounds are only timed, not compared with the truth.
        let mut without_truth = self.job.targets.clone();
        without_truth.iter_mut().for_each(|target| target.truth = None);
        let mut exact: Vec<Vec<[f32; 4]>> = Vec::new();
        let mut size = [0; 2];
        let mut firsts: Vec<First> = Vec::new();
        for (index, (setting, images)) in settings.iter().zip(&images).enumerate() {
            begin(0, index);
            let (field, options) = &setting.options;
            let renderer = field.on(device);
            let Round { frames, record, .. } =
                self.round(renderer.as_ref(), options, images, &self.job.targets, progress)?;
            if exact.is_empty() {
                exact = frames.iter().map(|frame| frame.colours.clone()).collect();
                size = frames.first().map_or(size, |frame| frame.picture.dimensions().into());
            }
            firsts.push(First::of(&frames, &exact, record));
        }
        let mut times: Vec<Vec<[f64; 2]>> = vec![Vec::new(); settings.len()];
        for round in 1..=round_count as usize {
            for (index, (setting, images)) in settings.iter().zip(&images).enumerate() {
                begin(round, index);
                let (field, options) = &setting.options;
                let renderer = field.on(device);
                let round = self.round(renderer.as_ref(), options, images, &without_truth, progress)?;
                times[index].push(round.seconds_a_target());
                firsts[index].is_repeatable &= fingerprint(&round.frames) == firsts[index].fingerprint;
            }
        }
        let points = settings.iter().zip(firsts).zip(&times);
        let points = points.map(|((setting, first), times)| first.point(&setting.label, times)).collect();
        Ok(Measured { points, exact, size })
    }

    /// The sources for each setting; sources of the same size are prepared once.
    fn images(&self, settings: &[Drawn], progress: &dyn Progress) -> Result<Vec<Arc<SourceImages>>, RenderError> {
        let Subject { scene, album, job, .. } = self;
        let mut known: Vec<(u32, Arc<SourceImages>)> = Vec::new();
        let mut images = Vec::new();
        for (field, options) in settings.iter().map(|setting| &setting.options) {
            let about = field.about();
            let side = about.source_side.of(working_side(scene, options, about.longest_side)?);
            if !known.iter().any(|(known_side, _)| *known_side == side) {
                let prepared = album.sources(&job.sources, side, options.background, progress)?;
                for warning in &prepared.warnings {
                    progress.warn(&format!("{}: {warning}", scene.path.display()));
                }
                known.push((side, Arc::new(prepared)));
            }
            images.extend(known.iter().find(|(known_side, _)| *known_side == side).map(|(_, images)| images.clone()));
        }
        Ok(images)
    }

    fn round(
        &self,
        renderer: &dyn Renderer,
        options: &RenderOptions,
        images: &Arc<SourceImages>,
        targets: &[Target],
        progress: &dyn Progress,
    ) -> Result<Round, RenderError> {
        let (images, sources, quiet) = (Arc::clone(images), &self.job.sources, Quiet(progress));
        let mut stage = Stage::of_images(self.scene, self.album, sources, images, renderer, options, &quiet)?;
        // Uploads to the device must end before the first measurement.
        renderer.finish().map_err(viewfuse_field::FieldError::Device)?;
        stage.weigh(self.weighting, &quiet)?;
        let mut frames = Vec::new();
        for target in targets {
            frames.push(stage.frame(self.weighting, target, &quiet)?);
            progress.step();
        }
        Ok(Round { encode: stage.costs.encode, record: stage.record(), frames })
    }
}

/// All targets rendered once under a setting.
struct Round {
    /// The state that the targets share.
    encode: Duration,
    record: Record,
    frames: Vec<Frame>,
}

impl Round {
    /// In total, and for encoding alone.
    fn seconds_a_target(&self) -> [f64; 2] {
        let encode = self.encode + self.frames.iter().map(|frame| frame.encode).sum::<Duration>();
        let all = self.encode + self.frames.iter().map(|frame| frame.time).sum::<Duration>();
        [all, encode].map(|time| time.as_secs_f64() / self.frames.len().max(1) as f64)
    }
}

/// The results kept from a setting's first round.
struct First {
    difference: Difference,
    truth_psnr: Option<f64>,
    record: Record,
    fingerprint: u64,
    is_repeatable: bool,
}

impl First {
    fn of(frames: &[Frame], exact: &[Vec<[f32; 4]>], record: Record) -> First {
        let mut difference = Difference::default();
        for (frame, exact) in frames.iter().zip(exact) {
            difference.add(&frame.colours, exact);
        }
        let scores: Vec<f64> = frames.iter().filter_map(|frame| Some(frame.truth.as_ref()?.psnr)).collect();
        let truth_psnr = (!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64);
        First { difference, truth_psnr, record, fingerprint: fingerprint(frames), is_repeatable: true }
    }

    /// `times[round]`: in total and for encoding.
    fn point(self, label: &str, times: &[[f64; 2]]) -> Point {
        let First { difference, truth_psnr, record, is_repeatable, .. } = self;
        let all = || times.iter().map(|[all, _]| *all);
        let encode = times.iter().map(|[_, encode]| *encode);
        let known = |time: Option<f64>| time.unwrap_or(f64::NAN);
        Point {
            setting: label.to_owned(),
            seconds: known(median(all())),
            seconds_range: [known(all().min_by(f64::total_cmp)), known(all().max_by(f64::total_cmp))],
            encode_seconds: known(median(encode)),
            difference,
            truth_psnr,
            record,
            is_repeatable,
        }
    }
}

/// A hash of a set of pictures: equal for equal pictures; different pictures collide with probability 2^-64.
fn fingerprint(frames: &[Frame]) -> u64 {
    let mut hasher = DefaultHasher::new();
    for frame in frames {
        bytemuck::cast_slice::<[f32; 4], u32>(&frame.colours).hash(&mut hasher);
    }
    hasher.finish()
}
