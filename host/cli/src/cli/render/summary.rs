//! What is printed of a run.

use crate::cli::printing::{counted, say};
use crate::cli::verdict::of_two;
use std::path::Path;
use viewfuse_field::auto::{Beyond, Candidate, Expected};
use viewfuse_field::budget::{Estimate, Kept};
use viewfuse_field::gaussians::GIVEN;
use viewfuse_field::render::Seen;
use viewfuse_output::record::{ChosenRecord, FrameRecord, RunRecord};
use viewfuse_output::run::RECORD;

/// From which share on a picture that few photographs show is said to be one.
const MIN_FEW: f32 = 0.2;
/// From which share on of what no photograph shows: that is invented.
const MIN_UNSEEN: f32 = 0.05;
/// Decibels of exposure from which a picture's line says what it has without.
const MIN_EXPOSURE: f64 = 0.5;

/// Prints the summary of a run.
pub(super) fn print(record: &RunRecord, folder: &Path) -> std::io::Result<()> {
    let is_of_sources = record.field != GIVEN;
    for frame in &record.frames {
        say(format_args!("{}", summary(frame, &record.sources, is_of_sources, folder)))?;
    }
    let (views, sources) = (counted(record.frames.len(), "view"), counted(record.sources.len(), "source"));
    let RunRecord { weighting, field, device, .. } = record;
    let seconds = record.times.total;
    if is_of_sources {
        say(format_args!("{views} from {sources}, {weighting}, {field} on {device}: {seconds:.2} s"))?;
    } else {
        say(format_args!("{views} of the file's Gaussians on {device}: {seconds:.2} s"))?;
    }
    if !is_of_sources && record.frames.iter().any(|frame| frame.psnr.is_some()) {
        say(
            "the file does not say which photographs it was made from: PSNR is a score of new views only where it was \
             made without these (`optimise --left-out VIEWS`)",
        )?;
    }
    if record.earlier > 0 {
        say(format_args!("added to {} of an earlier run with the same settings and sources", record.earlier))?;
    }
    if record.continued > 0 {
        say(format_args!("continued: {} of them were there", record.continued))?;
    }
    if let Some(chosen) = &record.chosen {
        say(format_args!("{}", choice(chosen, &record.weighting)))?;
    }
    if let Some(largest) = record.kernels.iter().max_by(|a, b| a.share.total_cmp(&b.share)) {
        let seconds: f64 = record.kernels.iter().map(|kernel| kernel.seconds).sum();
        let (name, share) = (largest.kernel, 100.0 * largest.share);
        say(format_args!("kernels took {seconds:.2} s, {share:.0} % of it {name}; all in {RECORD}"))?;
    }
    say(format_args!("device: {}, {}", record.device, record.device_reason))
}

/// What was chosen for the scene, and what it gained.
fn choice(chosen: &ChosenRecord, weighting: &str) -> String {
    let ChosenRecord { settings, mixture, candidates, left_out, pair, .. } = chosen;
    if left_out.is_empty() {
        let two = pair.as_ref().map_or_else(String::new, |pair| format!("; {}", of_two(pair)));
        return format!("chosen: {weighting}, the default: too few sources to leave one out{two}");
    }
    let is_chosen =
        |candidate: &Candidate| candidate.weighting == weighting && candidate.options.settings() == settings;
    // A mixture is tried last.
    let candidate = match mixture {
        Some(_) => candidates.last(),
        None => candidates.iter().find(|candidate| is_chosen(candidate)),
    };
    let psnr = candidate.and_then(|candidate| candidate.psnr).unwrap_or(0.0);
    let gain = psnr - candidates.first().and_then(|first| first.psnr).unwrap_or(psnr);
    let with = match mixture {
        Some(mixture) if mixture.parts.len() == 1 => ", one picture under other settings".to_owned(),
        Some(mixture) => format!(", {} pictures under different settings mixed by region", mixture.parts.len()),
        None if settings.is_empty() => String::new(),
        None => " with settings for these photographs".to_owned(),
    };
    let more = if gain > 0.0 { format!(", {gain:.2} dB more than by default") } else { String::new() };
    let count = left_out.len();
    format!(
        "chosen: {weighting}{with}: {count} photographs that were held out have {psnr:.1} dB{more} (what was tried: \
            {RECORD})"
    )
}

fn summary(frame: &FrameRecord, sources: &[String], is_of_sources: bool, folder: &Path) -> String {
    let corrected = match (frame.psnr, frame.corrected_psnr) {
        (Some(psnr), Some(corrected)) if corrected - psnr >= MIN_EXPOSURE => {
            format!(" ({corrected:.2} colour-corrected)")
        }
        _ => String::new(),
    };
    let score = match (frame.psnr, frame.ssim) {
        (Some(psnr), Some(ssim)) => format!("  PSNR {psnr:.2} dB{corrected}  SSIM {ssim:.3}"),
        (Some(psnr), None) => format!("  PSNR {psnr:.2} dB{corrected}"),
        _ => String::new(),
    };
    let expected = match (frame.expected, frame.beyond) {
        (Some(Expected { psnr, interval: [low, high], .. }), _) => {
            format!("  expected PSNR {psnr:.1} dB (80 %: {low:.1} to {high:.1})")
        }
        (None, Some(Beyond::Far(times))) => format!(
            "  no PSNR to expect: the camera is {times:.1} times as far from the photographs as the farthest of these \
             is from the others"
        ),
        (None, Some(Beyond::Unseen(_))) => "  no PSNR to expect: too much of it is invented".to_owned(),
        (None, None) => String::new(),
    };
    let left_out = match frame.left_out.len() {
        _ if !is_of_sources => String::new(),
        0 => String::new(),
        1 => format!("  1 source dropped (weight {:.4})", frame.left_out_weight),
        count => format!("  {count} sources dropped (weight {:.4})", frame.left_out_weight),
    };
    let kept = frame.kept.as_ref().map_or_else(String::new, kept);
    let few = few_photographs(frame, sources).unwrap_or_default();
    format!("{}{score}{expected}{few}{left_out}{kept}", folder.join(format!("{}.png", frame.target)).display())
}

/// What a picture lacks, and where to photograph: between the two sources that matter most to it.
fn few_photographs(frame: &FrameRecord, sources: &[String]) -> Option<String> {
    let Seen { by_none, by_one } = frame.seen_by?;
    let percent = |share: f32| (100.0 * share).round();
    let lacks = if by_none + by_one >= MIN_FEW {
        format!(
            "{} % of it seen by fewer than two photographs, {} % by none",
            percent(by_none + by_one),
            percent(by_none)
        )
    } else if by_none >= MIN_UNSEEN {
        format!("{} % of it seen by no photograph", percent(by_none))
    } else {
        return None;
    };
    let mut order: Vec<usize> = (0..sources.len().min(frame.weights.len())).collect();
    order.sort_by(|a, b| frame.weights[*b].total_cmp(&frame.weights[*a]));
    let [first, second, ..] = order[..] else { return None };
    Some(format!("  {lacks}: photograph from between {} and {}", sources[first], sources[second]))
}

/// How a frame keeps its bound.
fn kept(kept: &Kept) -> String {
    let decibels = |error: f64| -20.0 * error.max(1.0e-6).log10();
    let error = match kept.error {
        Some(Estimate { value: 0.0, .. }) | None => String::new(),
        Some(Estimate { value, upper, .. }) => {
            format!(", about {:.1} dB from exact (likely at least {:.1})", decibels(value), decibels(upper))
        }
    };
    let missed = match (kept.is_kept, kept.most_seconds) {
        (false, Some(most)) => format!("; MORE than the {most} s that were asked for"),
        (false, None) => "; MORE error than was asked for".to_owned(),
        (true, _) => String::new(),
    };
    format!("  {}{error}, {:.2} s{missed}", kept.effort, kept.seconds)
}
