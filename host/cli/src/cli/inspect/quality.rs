//! The quality to expect, from photographs that are held out, one at a time, and rendered from the others.

use crate::cli::printing::say;
use crate::cli::verdict::{in_words, of_two};
use serde::Serialize;
use std::time::Instant;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::auto::{self, Chosen, Expected, HeldOutSource, Pair};
use viewfuse_field::render::{RenderError, RenderOptions, Stage};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_field::{Field, On};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, SelectionError};
use viewfuse_scene::photographs::{Album, BackgroundChoice};

/// What was measured of the training-free field on a scene.
#[derive(Debug, Serialize)]
pub(super) struct Quality {
    /// The photographs that were held out; none if there are too few.
    left_out: Vec<HeldOutSource>,
    /// The score to expect between two neighbouring photographs.
    expected: Option<Expected>,
    /// What two photographs are good for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pair: Option<Pair>,
    /// Why nothing could be measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
    /// How long it took.
    seconds: f64,
}

impl Quality {
    /// Of all photographs. That the field can do nothing with them is a result, too.
    pub(super) fn of(scene: &Scene, background: BackgroundChoice, progress: &dyn Progress) -> anyhow::Result<Quality> {
        let start = Instant::now();
        let measured = measure(scene, background, progress);
        let seconds = start.elapsed().as_secs_f64();
        match measured {
            Ok(chosen) => {
                let expected = chosen.expected_between();
                Ok(Quality { left_out: chosen.held_out, expected, pair: chosen.pair, problem: None, seconds })
            }
            Err(error) if is_of_scene(&error) => {
                let problem = Some(error.to_string());
                Ok(Quality { left_out: Vec::new(), expected: None, pair: None, problem, seconds })
            }
            Err(error) => Err(error),
        }
    }

    /// Prints it as a person reads it.
    pub(super) fn print(&self) -> std::io::Result<()> {
        let order = |a: &&HeldOutSource, b: &&HeldOutSource| a.psnr.total_cmp(&b.psnr);
        let (least, most) = (self.left_out.iter().min_by(order), self.left_out.iter().max_by(order));
        let (Some(least), Some(most), Some(expected)) = (least, most, self.expected) else {
            let two = self.pair.as_ref().map_or_else(String::new, |pair| format!("; {}", of_two(pair)));
            let problem = self.problem.as_deref().unwrap_or("too few photographs to leave one out");
            return say(format_args!("expected   not measured: {problem}{two}"));
        };
        let count = self.left_out.len() as f64;
        let mean = |value: &dyn Fn(&HeldOutSource) -> f64| self.left_out.iter().map(value).sum::<f64>() / count;
        say(format_args!(
            "held out   {count} photographs, rendered from the others: PSNR {:.1} dB, from {:.1} ({}) to {:.1} ({}); a \
             copy of the nearest photograph {:.1} dB",
            mean(&|source| source.psnr),
            least.psnr,
            least.source,
            most.psnr,
            most.source,
            mean(&|source| source.copy_psnr)
        ))?;
        let Expected { psnr, interval: [low, high], .. } = expected;
        say(format_args!(
            "expected   PSNR {psnr:.1} dB half-way between neighbours (80 %: {low:.1} to {high:.1}), {}; measured in \
                {:.1} s",
            in_words(psnr),
            self.seconds
        ))
    }
}

/// Leaves photographs out.
fn measure(scene: &Scene, background: BackgroundChoice, progress: &dyn Progress) -> anyhow::Result<Chosen> {
    let field = TrainingFree::default();
    let renderer = On { device: &Cpu, field: &field };
    let sources = Selection::default().sources_without(scene, &[], field.about().least_sources)?;
    let options = RenderOptions { background, ..RenderOptions::default() };
    progress.stage("reading the photographs", 0..1, 4);
    let album = Album::open_at(scene, sources.iter().copied(), field.about().longest_side, progress)?;
    progress.stage("preparing the photographs", 1..2, 4);
    let stage = Stage::prepare(scene, &album, &sources, &renderer, &options, progress)?;
    progress.stage("leaving photographs out", 2..4, 4);
    Ok(auto::estimate(&stage, &renderer, &options, progress)?)
}

/// Whether it is the scene that cannot be rendered, and not this run.
fn is_of_scene(error: &anyhow::Error) -> bool {
    error.is::<SelectionError>() || matches!(error.downcast_ref(), Some(RenderError::Unsuitable { .. }))
}
