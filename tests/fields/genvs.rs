//! GeNVS as a whole, on the CPU, with the small made network.

mod extremes;
mod finite;
mod omissions;
mod sizes;
mod values;

use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::genvs::{Architecture, Estimate, Genvs, GenvsOptions, Omissions, test_networks};
use viewfuse::field::{FieldError, Record, Rendered};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::SourceImages;
use viewfuse::weighting::sources::SourceWeights;
use viewfuse_core::camera::Camera;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{self, largest_difference};
use viewfuse_tests::listener::Listener;
use viewfuse_tests::lorry::{photographs, target};

/// Everything is computed, in three calls of the denoiser.
pub(super) fn exact() -> GenvsOptions {
    let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count: 3 };
    let plan = Plan { steps, ..Plan::published(0) };
    GenvsOptions { plan, omissions: Omissions::NONE, ..GenvsOptions::default() }
}

fn omitting(omissions: Omissions) -> GenvsOptions {
    GenvsOptions { omissions, ..exact() }
}

pub(super) fn made(options: GenvsOptions) -> Genvs {
    Genvs::new(test_networks::deterministic(&Architecture::small()), options).expect("a made network")
}

pub(super) fn without_denoiser(options: GenvsOptions) -> Genvs {
    let architecture = Architecture { denoiser: None, ..Architecture::small() };
    Genvs::new(test_networks::deterministic(&architecture), options).expect("a made network")
}

/// The lorry from some sides, on white.
fn sources(count: u32) -> SourceImages {
    photographs(count, 32)
}

fn try_picture(
    field: &Genvs,
    sources: &SourceImages,
    weights: &SourceWeights,
    target: &Camera,
) -> Result<Rendered, FieldError> {
    Ok(fields::picture(&Cpu, field, sources, weights, target, 0.0, &Silent)?.0)
}

/// A picture, and what the field says of it.
fn recorded(field: &Genvs, sources: &SourceImages, weights: &SourceWeights, target: &Camera) -> (Rendered, Record) {
    fields::picture(&Cpu, field, sources, weights, target, 0.0, &Silent).expect("a picture")
}

fn picture_with(field: &Genvs, sources: &SourceImages, weights: &SourceWeights, target: &Camera) -> Rendered {
    try_picture(field, sources, weights, target).expect("a picture")
}

fn picture(field: &Genvs, sources: &SourceImages, target: &Camera) -> Rendered {
    picture_with(field, sources, &Weights::mean(sources.images.len() as u32), target)
}

/// Colours are colours, everything is opaque, and there are no depths: a picture that was denoised has none.
fn assert_sound(picture: &Rendered) {
    assert_eq!(picture.colours.len(), (picture.width * picture.height) as usize);
    assert!(picture.colours.iter().flatten().all(|value| (0.0..=1.0).contains(value)), "a colour out of range");
    assert!(picture.colours.iter().all(|colour| colour[3] == 1.0), "not opaque");
    assert!(picture.depths.is_empty());
}

#[test]
fn an_estimate_from_colours_adds_what_noise_hides() {
    let made = |estimate| {
        let mut architecture = Architecture::small();
        architecture.denoiser.iter_mut().for_each(|denoiser| denoiser.estimate = estimate);
        Genvs::new(test_networks::deterministic(&architecture), exact()).expect("a made network")
    };
    let (published, ours) = (made(Estimate::Published), made(Estimate::FromColours));
    assert_eq!(ours.architecture().denoiser.as_ref().map(|denoiser| denoiser.estimate), Some(Estimate::FromColours));
    let sources = sources(1);
    let feature_count = ours.architecture().encoder.feature_count;
    let wave = |scale: f32| move |index: usize| scale * (0.7 * index as f32).sin();
    let noisy: Vec<f32> = (0..16 * 16 * 3).map(wave(3.0)).collect();
    let features: Vec<f32> = (0..16 * 16 * feature_count).map(wave(0.4)).collect();
    for level in [0.1, 1.0, 80.0] {
        let denoised = |field: &Genvs| {
            let reference = Reference::new(field, &Cpu, &sources, &Silent).expect("sources");
            reference.denoised(&noisy, &features, [16, 16], level).expect("a picture")
        };
        let share = f64::from(level).powi(2) / (f64::from(level).powi(2) + 0.25);
        for (index, (ours, published)) in denoised(&ours).iter().zip(denoised(&published)).enumerate() {
            let shown = 1.0 - f64::from(features[index / 3 * feature_count + index % 3]);
            let difference = f64::from(*ours) - f64::from(published);
            // Two sums of numbers of at most 4, each rounded three times.
            assert!((difference - share * shown).abs() < 2.0e-6, "{index} at {level}: {difference}");
        }
    }
}

#[test]
fn samples_stray_where_they_may() {
    let sources = sources(2);
    let with_jitter = |jitter| {
        let mut options = exact();
        options.rays.jitter = jitter;
        picture(&without_denoiser(options), &sources, &target(32))
    };
    let difference = largest_difference(&with_jitter(0.0).colours, &with_jitter(1.0).colours);
    assert!(difference > 1.0e-4 && difference < 0.2, "{difference}");
    assert_eq!(with_jitter(1.0), with_jitter(1.0));
}

/// Of so many calls that the picture would take a minute and more, none follows the wish to stop.
#[test]
fn a_person_need_not_wait_for_the_picture() {
    let plan = Plan {
        early_termination: None,
        steps: Steps::Fixed { sampler: Sampler::Ipndm, level_count: 100_000 },
        ..Plan::published(0)
    };
    let field = made(GenvsOptions { plan, ..exact() });
    for times in [0, 1, 40] {
        let progress = Listener::stops_after(times);
        let outcome = fields::picture(&Cpu, &field, &sources(1), &Weights::mean(1), &target(32), 0.0, &progress);
        assert!(matches!(outcome, Err(FieldError::Interrupted(_))), "{:?}", outcome.map(|_| ()));
        // The first answer ends it: nothing asks again between further pieces.
        assert_eq!(progress.asked(), times + 1);
    }
}
