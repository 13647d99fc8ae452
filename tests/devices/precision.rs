//! Products of rounded factors in whole pictures, by what stands in for matrix units: they change a picture by little,
//! are listed only where a device has them, are repeated exactly where numbers are too large for them, and a form that
//! is wrong is told.

use crate::candidate::{Candidate, said, tests};
use libtest_mimic::Failed;
use std::sync::Arc;
use viewfuse::check::rates::measure_rates;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Precision};
use viewfuse::field::budget::{Bound, Kept};
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::genvs::{self, Genvs, GenvsOptions};
use viewfuse::field::pixelnerf::{self, PixelNerf, PixelNerfOptions};
use viewfuse::field::render::{RenderOptions, Stage};
use viewfuse::field::{AnyOptions, Field, On, Record};
use viewfuse::job::progress::{Progress, Silent};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::few_shot::Target;
use viewfuse::weighting::Weighting;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;
use viewfuse_tests::checkpoints::multiplied;
use viewfuse_tests::devices::{exchanged_stand_ins, stand_ins, takes_stand_ins};
use viewfuse_tests::fields::{self, rms};
use viewfuse_tests::listener::Listener;
use viewfuse_tests::lorry::{photographs, target};
use viewfuse_vulkan::GpuOptions;
use viewfuse_vulkan::kernel::Form;

tests!(
    pixelnerfs_pictures_in_rounded_products,
    genvss_pictures_in_rounded_products,
    numbers_that_are_too_large_are_computed_exactly,
    efforts_round_where_a_device_does,
    little_work_is_exact,
    bounds_choose_among_precisions,
    a_form_that_is_wrong_is_told_once,
    fused_products_take_the_place_of_units,
    rates_of_rounded_products,
);

/// Side of the pictures.
const SIDE: u32 = 16;

/// The device with units that stand in for its own; `None` where they are not tested.
fn with_units(candidate: &Candidate) -> Result<Option<Vulkan>, Failed> {
    if !takes_stand_ins(&candidate.adapter) {
        return Ok(None);
    }
    let options = GpuOptions { stand_ins: Some(stand_ins()), min_rounded_work: 0, ..GpuOptions::default() };
    Ok(Some(candidate.vulkan(&options)?))
}

fn pixelnerf(checkpoint: &Checkpoint, precision: Precision) -> PixelNerf {
    let options = PixelNerfOptions { precision, ..PixelNerfOptions::default() };
    PixelNerf::new(checkpoint, options).expect("a made network")
}

fn body() -> Checkpoint {
    pixelnerf::test_networks::body(&pixelnerf::Architecture::small(16))
}

fn genvs(checkpoint: Checkpoint, precision: Precision) -> Genvs {
    let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count: 3 };
    let plan = Plan { steps, ..Plan::published(0) };
    Genvs::new(checkpoint, GenvsOptions { plan, precision, ..GenvsOptions::default() }).expect("a made network")
}

fn small_genvs() -> Checkpoint {
    genvs::test_networks::deterministic(&genvs::Architecture::small())
}

/// A picture from two sources, and what is recorded of it.
fn picture(
    device: &Vulkan,
    field: &(impl Field + Sync),
    progress: &dyn Progress,
) -> Result<(Vec<[f32; 4]>, Record), Failed> {
    let (sources, weights) = (photographs(2, 30), Weights::mean(2));
    let made = fields::picture(device, field, &sources, &weights, &target(SIDE), 0.0, progress);
    let (rendered, record) = made.map_err(said)?;
    Ok((rendered.colours, record))
}

/// Pictures in f16 and in two parts are a little off the exact one. On a device without units all are the same.
fn assert_close<F: Field + Sync>(candidate: &Candidate, field: impl Fn(Precision) -> F) -> Result<(), Failed> {
    let without = candidate.vulkan(&GpuOptions { min_fused_gain: f64::INFINITY, ..GpuOptions::default() })?;
    let (exact, _) = picture(&without, &field(Precision::Exact), &Silent)?;
    if !candidate.adapter.has_matrices {
        assert!(without.precisions().is_empty());
        assert!(picture(&without, &field(Precision::Half), &Silent)?.0 == exact, "a device without units rounded");
    }
    let Some(device) = with_units(candidate)? else { return Ok(()) };
    assert_eq!(device.precisions(), Precision::ROUNDED);
    assert!(picture(&device, &field(Precision::Exact), &Silent)?.0 == exact, "exact products are others beside units");
    for (precision, expected) in Precision::ROUNDED.into_iter().zip([1e-6..3e-3, 1e-9..1e-5]) {
        let (rounded, record) = picture(&device, &field(precision), &Silent)?;
        let difference = rms(&rounded, &exact);
        println!("{}: {difference:.1e}", precision.name());
        assert!(record.notes.is_empty(), "{:?}", record.notes);
        assert!(expected.contains(&difference), "{}: {difference}", precision.name());
    }
    Ok(())
}

fn pixelnerfs_pictures_in_rounded_products(candidate: &Candidate) -> Result<(), Failed> {
    let checkpoint = body();
    assert_close(candidate, |precision| pixelnerf(&checkpoint, precision))
}

fn genvss_pictures_in_rounded_products(candidate: &Candidate) -> Result<(), Failed> {
    assert_close(candidate, |precision| genvs(small_genvs(), precision))
}

/// The picture is that of the exact products, bit for bit, and the run says so once.
fn assert_repeated<F: Field + Sync>(device: &Vulkan, field: impl Fn(Precision) -> F) -> Result<(), Failed> {
    let (exact, record) = picture(device, &field(Precision::Exact), &Silent)?;
    assert!(record.notes.is_empty());
    for precision in Precision::ROUNDED {
        let heard = Listener::default();
        let (repeated, record) = picture(device, &field(precision), &heard)?;
        assert!(repeated == exact, "{}: not the exact picture", precision.name());
        let warnings: Vec<String> =
            heard.warnings().into_iter().filter(|warning| warning.contains("too large")).collect();
        assert_eq!((warnings.len(), &warnings), (1, &record.notes));
    }
    Ok(())
}

fn numbers_that_are_too_large_are_computed_exactly(candidate: &Candidate) -> Result<(), Failed> {
    let Some(device) = with_units(candidate)? else { return Ok(()) };
    // What the first layer of a block makes larger the second one makes smaller.
    let larger = multiplied(&body(), |name| name.ends_with("fc_0.weight"), 1e9);
    let checkpoint = multiplied(&larger, |name| name.ends_with("fc_1.weight"), 1e-9);
    assert_repeated(&device, |precision| pixelnerf(&checkpoint, precision))?;
    // A group norm takes back what the layer before it makes larger.
    let larger = |made: &Checkpoint| multiplied(made, |name| name.ends_with("conv0.weight"), 1e9);
    assert_repeated(&device, |precision| genvs(larger(&small_genvs()), precision))
}

/// Labels of the efforts of a field on a device, and whether one that is not exact serves what is encoded exactly.
fn labels<F: Field + Sync>(device: &Vulkan, field: &F) -> Result<Vec<String>, Failed> {
    let renderer = On { device, field };
    let options = RenderOptions::default();
    let stage = Stage::of_sources(Arc::new(photographs(2, 30)), &renderer, &options, &Silent).map_err(said)?;
    let efforts = stage.efforts();
    let exact: &AnyOptions = &efforts.last().expect("efforts").options;
    assert!(efforts.iter().all(|effort| effort.options.encodes_alike(exact)), "an effort encodes again");
    assert!(efforts.windows(2).all(|pair| pair[0].typical_share < pair[1].typical_share), "not the cheapest first");
    assert!(efforts.windows(2).all(|pair| pair[0].typical_error > pair[1].typical_error), "not the best last");
    Ok(efforts.into_iter().map(|effort| effort.label).collect())
}

/// A picture that keeps a bound, or the exact one.
fn bounded<D: Device + Sync>(
    device: &D,
    field: &(impl Field + Sync),
    most: Option<f32>,
) -> Result<(Vec<[f32; 4]>, Option<Kept>), Failed> {
    let (renderer, bound) = (On { device, field }, most.map(Bound::Error));
    let early_termination = 0.0;
    let options = RenderOptions { bound, leave_out: 0.0, early_termination, ..RenderOptions::default() };
    let mut stage = Stage::of_sources(Arc::new(photographs(2, 30)), &renderer, &options, &Silent).map_err(said)?;
    if most.is_none() {
        stage.set_effort(stage.efforts().len() - 1, &Silent).map_err(said)?;
    }
    let weighting = Weighting::open("error:alpha=1").expect("a scheme");
    stage.weigh(&weighting, &Silent).map_err(said)?;
    let target = Target { name: String::new(), camera: target(SIDE), truth: None };
    let frame = stage.frame(&weighting, &target, &Silent).map_err(said)?;
    Ok((frame.colours, frame.kept))
}

fn bounds_choose_among_precisions(candidate: &Candidate) -> Result<(), Failed> {
    let Some(device) = with_units(candidate)? else { return Ok(()) };
    let field = pixelnerf(&body(), Precision::Exact);
    let (exact, _) = bounded(&device, &field, None)?;
    // A single pixel of so small a picture may have all of the smaller errors: nothing is omitted for them.
    for (most, effort) in [(0.02, ", products in f16"), (2e-3, "products in two parts"), (1e-6, "exact")] {
        let (picture, kept) = bounded(&device, &field, Some(most))?;
        let (kept, error) = (kept.expect("a bound"), rms(&picture, &exact));
        assert!(kept.is_kept && kept.effort.ends_with(effort), "{most}: {kept:?}");
        assert!(error <= f64::from(most) && (error == 0.0) == (effort == "exact"), "{effort}: {error}");
    }
    let field = genvs(small_genvs(), Precision::Exact);
    // Sums of the CPU run in another order, which is far below the bound.
    let ((exact, _), most) = (bounded(&Cpu, &field, None)?, 0.02);
    let (picture, kept) = bounded(&device, &field, Some(most))?;
    let (kept, error) = (kept.expect("a bound"), rms(&picture, &exact));
    assert!(kept.is_kept && kept.effort.ends_with("products in f16"), "{kept:?}");
    assert!(error <= f64::from(most), "{error}, {kept:?}");
    Ok(())
}

fn efforts_round_where_a_device_does(candidate: &Candidate) -> Result<(), Failed> {
    let Some(device) = with_units(candidate)? else { return Ok(()) };
    let without = candidate.vulkan(&GpuOptions { min_rounded_work: u64::MAX, ..GpuOptions::default() })?;
    let network = pixelnerf(&body(), Precision::Exact);
    let denoising = genvs(small_genvs(), Precision::Exact);
    for (with, without) in [
        (labels(&device, &network)?, labels(&without, &network)?),
        (labels(&device, &denoising)?, labels(&without, &denoising)?),
    ] {
        let (cheaper, exact) = with.split_at(with.len() - 3);
        assert_eq!(exact, ["products in f16", "products in two parts", "exact"]);
        let expected = without[..without.len() - 1].iter().map(|label| format!("{label}, products in f16"));
        assert!(cheaper.iter().cloned().eq(expected), "{cheaper:?}");
        assert!(without.iter().all(|label| !label.contains("products")), "{without:?}");
    }
    Ok(())
}

/// A device without units has efforts of fused products where these gain something, and pictures that differ from the
/// exact one by as little as two roundings do.
fn fused_products_take_the_place_of_units(candidate: &Candidate) -> Result<(), Failed> {
    let open = |stand_ins, min_fused_gain| {
        candidate.vulkan(&GpuOptions { stand_ins, min_fused_gain, min_rounded_work: 0, ..GpuOptions::default() })
    };
    if candidate.adapter.has_matrices {
        assert!(!open(None, 0.0)?.precisions().contains(&Precision::Fused), "beside units");
        return Ok(());
    }
    if takes_stand_ins(&candidate.adapter) {
        assert_eq!(open(Some(stand_ins()), 0.0)?.precisions(), Precision::ROUNDED);
    }
    assert!(open(None, f64::INFINITY)?.precisions().is_empty());
    let (device, checkpoint) = (open(None, 0.0)?, body());
    assert_eq!(device.precisions(), [Precision::Fused]);
    let labels = labels(&device, &pixelnerf(&checkpoint, Precision::Exact))?;
    let (exact, fused) = labels.split_last().expect("efforts");
    assert!(exact == "exact" && fused.iter().all(|label| label.ends_with("fused products")), "{labels:?}");
    let (exact, _) = picture(&device, &pixelnerf(&checkpoint, Precision::Exact), &Silent)?;
    let (fused, record) = picture(&device, &pixelnerf(&checkpoint, Precision::Fused), &Silent)?;
    assert!(record.notes.is_empty() && rms(&fused, &exact) < 1e-5, "{}", rms(&fused, &exact));
    Ok(())
}

/// Pictures of so little work gain nothing: nothing is tried for them, not even on a device whose units are wrong.
fn little_work_is_exact(candidate: &Candidate) -> Result<(), Failed> {
    if !takes_stand_ins(&candidate.adapter) {
        return Ok(());
    }
    let wrong = GpuOptions { stand_ins: Some(exchanged_stand_ins()), ..GpuOptions::default() };
    let device = candidate.vulkan(&wrong)?;
    for labels in [
        labels(&device, &pixelnerf(&body(), Precision::Exact))?,
        labels(&device, &genvs(small_genvs(), Precision::Exact))?,
    ] {
        assert!(labels.len() > 1 && labels.iter().all(|label| !label.contains("products")), "{labels:?}");
    }
    assert!(device.precisions_for(0).is_empty() && device.faults().is_empty(), "{:?}", device.faults());
    assert!(device.precisions_for(u64::MAX).is_empty() && !device.faults().is_empty(), "it was tried");
    Ok(())
}

fn a_form_that_is_wrong_is_told_once(candidate: &Candidate) -> Result<(), Failed> {
    if !takes_stand_ins(&candidate.adapter) {
        return Ok(());
    }
    let wrong = GpuOptions { stand_ins: Some(exchanged_stand_ins()), min_rounded_work: 0, ..GpuOptions::default() };
    let device = candidate.vulkan(&wrong)?;
    assert!(device.precisions().is_empty(), "wrong products are used");
    let faults = device.faults();
    assert_eq!(faults.len(), 2, "{faults:?}");
    let is_named = |fault: &String| fault.contains("linear") && fault.contains(&candidate.adapter.name);
    assert!(faults.iter().all(is_named) && faults.iter().any(|fault| fault.contains("'half'")), "{faults:?}");
    let (heard, field) = (Listener::default(), pixelnerf(&body(), Precision::Half));
    let renderer = On { device: &device, field: &field };
    let options = RenderOptions::default();
    let stage = Stage::of_sources(Arc::new(photographs(2, 30)), &renderer, &options, &heard);
    let mut stage = stage.map_err(said)?;
    stage.weigh_by(&[], &heard).map_err(said)?;
    for _ in 0..2 {
        stage.picture(&target(SIDE), &Weights::mean(2), 0.0, &heard).map_err(said)?;
    }
    let told: Vec<String> = heard.warnings().into_iter().filter(|warning| faults.contains(warning)).collect();
    assert_eq!((&told, &stage.record().notes), (&faults, &faults));
    Ok(())
}

/// `bench` measures each form of a device beside its limits, and names none where there is none.
fn rates_of_rounded_products(candidate: &Candidate) -> Result<(), Failed> {
    let Some(device) = with_units(candidate)? else { return Ok(()) };
    let rates = measure_rates(&device, 1, &Silent)?;
    let forms = Precision::ROUNDED.map(|precision| precision.form().map_or("none", Form::name));
    assert_eq!((&rates.rounded_forms[..], &rates.faults[..]), (&forms[..], &[][..]));
    for (kernel, form) in ["linear", "convolve"].into_iter().flat_map(|kernel| forms.map(|form| (kernel, form))) {
        let rate = rates.kernels.iter().find(|rate| rate.kernel == kernel && rate.form == Some(form));
        let rate = rate.unwrap_or_else(|| panic!("no {kernel}, {form}"));
        assert!(rate.share > 0.0 && rate.share.is_finite() && rate.giga_operations > Some(0.0), "{rate:?}");
    }
    assert!(rates.kernels.iter().any(|rate| rate.kernel == "linear" && rate.form.is_none()));
    Ok(())
}
