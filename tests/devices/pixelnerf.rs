//! A small PixelNeRF on each device: the reference values, and whole pictures with everything and with nothing left
//! out.

use crate::candidate::{Candidate, tests};
use libtest_mimic::Failed;
use viewfuse::check::verify::verify;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Memory, Transfers};
use viewfuse::field::On;
use viewfuse::field::pixelnerf::{Architecture, Omissions, PixelNerf, PixelNerfOptions, Sampling, test_networks};
use viewfuse::field::render::{RenderError, RenderOptions, render_all};
use viewfuse::job::progress::Silent;
use viewfuse::weighting::Weighting;
use viewfuse_core::camera::CameraBlock;
use viewfuse_tests::fields::{job, largest_difference, sample};
use viewfuse_tests::places::data;
use viewfuse_vulkan::{GpuOptions, Limits};

tests!(
    pixelnerf_has_the_reference_values,
    pixelnerfs_pictures_are_the_cpus,
    pixelnerfs_sample_lists_stay_on_the_device
);

const SIDE: u32 = 20;
const COARSE_COUNT: u32 = 32;
/// Largest difference of a channel, whose range is 1. Sums of products run in another order than the CPU's; a fine
/// sample that falls into the next part of a ray for it moves by a 64th of the ray, which changes a pixel by little.
const MAX_DIFFERENCE: f32 = 4.0e-3;

fn pixelnerf_has_the_reference_values(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let report = verify(&data("pixelnerf_small.safetensors"), &device, &Silent)?;
    assert_eq!(report.quantities.len(), 39);
    match report.quantities.iter().find(|quantity| !quantity.passes()) {
        Some(worst) => Err(format!("{worst:?}").into()),
        None => Ok(()),
    }
}

/// The colours of the last of some targets.
fn picture<D: Device + Sync>(device: &D, omissions: Omissions, targets: &str) -> Result<Vec<[f32; 4]>, RenderError> {
    let scene = sample("toy");
    let job = job(&scene, "1,7,13", targets);
    let options = RenderOptions { size: Some([SIDE, SIDE]), ..RenderOptions::default() };
    let sampling = Sampling { coarse_count: COARSE_COUNT, importance_count: 8, depth_count: 8, ..Sampling::default() };
    let body = test_networks::body(&Architecture::small(16));
    let of_field = PixelNerfOptions { sampling, omissions, ..PixelNerfOptions::default() };
    let field = PixelNerf::new(&body, of_field).expect("a made network");
    let weighting = Weighting::open("error:alpha=1").expect("a scheme");
    let mut frames = render_all(&scene, &job, &weighting, &On { device, field: &field }, &options)?;
    Ok(frames.pop().expect("a target").colours)
}

fn pixelnerfs_pictures_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    // With its own limits, and with buffers so short that rays and points are taken in several pieces.
    let usual = GpuOptions::default();
    let short = GpuOptions { limits: Limits { buffer_range: 260 << 10, ..usual.limits }, ..usual };
    for omissions in [Omissions::NONE, Omissions::default()] {
        let reference = picture(&Cpu, omissions, "20").expect("a picture on the CPU");
        let opaque = reference.iter().filter(|colour| colour[3] > 0.9).count();
        assert!(opaque > 20 && opaque < reference.len() / 2, "a body before nothing: {opaque}");
        for options in if omissions == Omissions::NONE { vec![usual] } else { vec![usual, short] } {
            let device = candidate.vulkan(&options)?;
            let ours = picture(&device, omissions, "20").map_err(|error| format!("{error:?}"))?;
            let worst = largest_difference(&ours, &reference);
            if !(worst <= MAX_DIFFERENCE) {
                return Err(format!("{omissions:?}: a channel differs by {worst}").into());
            }
        }
    }
    Ok(())
}

/// What a further picture takes over the border of the device's memory: its pixels, its views and their weights; the
/// picture, the probes' samples, how many samples each list has, and an index for every 256 numbers that are checked.
fn pixelnerfs_sample_lists_stay_on_the_device(candidate: &Candidate) -> Result<(), Failed> {
    let transfers = |targets: &str| -> Result<Transfers, Failed> {
        let device = candidate.vulkan(&GpuOptions::default())?;
        picture(&device, Omissions::default(), targets).map_err(|error| format!("{error:?}"))?;
        Ok(device.transfers())
    };
    let (one, two) = (transfers("20")?, transfers("20,21")?);
    let pixel_count = u64::from(SIDE * SIDE);
    let probe_count = u64::from(SIDE.div_ceil(Omissions::default().empty_space) + 1).pow(2);
    let (few, view) = (512, size_of::<CameraBlock>() as u64 + 4);
    let uploaded = two.uploaded_bytes - one.uploaded_bytes;
    let most = 4 * (pixel_count + probe_count) + 3 * view + few;
    assert!(uploaded > 0 && uploaded <= most, "{uploaded} bytes uploaded, of at most {most}");
    let downloaded = two.downloaded_bytes - one.downloaded_bytes;
    let most = pixel_count * (16 + 4) + probe_count * u64::from(COARSE_COUNT) * 16 + few;
    assert!(downloaded > 20 * pixel_count && downloaded <= most, "{downloaded} bytes downloaded, of at most {most}");
    Ok(())
}
