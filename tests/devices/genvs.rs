//! A small GeNVS on each device: whole pictures with everything and with nothing omitted. Its reference
//! values take minutes on a software driver: the CPU has them (`fields/genvs/values.rs`), and these pictures are the
//! CPU's.

use crate::candidate::{Candidate, said, tests};
use libtest_mimic::Failed;
use std::sync::Mutex;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, Memory};
use viewfuse::field::FieldError;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::genvs::{Architecture, Genvs, GenvsOptions, Omissions, test_networks};
use viewfuse::job::progress::{Progress, Silent};
use viewfuse_core::sampler::Sampler;
use viewfuse_tests::fields;
use viewfuse_tests::lorry::{photographs, target};
use viewfuse_vulkan::GpuOptions;
use viewfuse_vulkan::kernel::Kernel;

tests!(
    genvss_pictures_are_the_cpus,
    genvs_without_denoiser_runs_no_kernel_of_it,
    a_call_of_the_denoiser_is_one_submission,
    genvss_feature_image_stays_on_the_device
);

/// Largest difference of a channel, whose range is 1. Sums of products run in another order than the CPU's, through
/// three calls of the denoiser.
const MAX_DIFFERENCE: f32 = 1.0e-3;

/// What only the denoiser needs.
const DENOISERS: [Kernel; 4] = [Kernel::DenoiserInput, Kernel::GroupNorm, Kernel::MixPictures, Kernel::AddNoise];

/// A picture from three sources, of which one has no weight.
fn picture<D: Device + Sync>(
    device: &D,
    omissions: Omissions,
    has_denoiser: bool,
) -> Result<Vec<[f32; 4]>, FieldError> {
    picture_in(device, omissions, has_denoiser, 3, &Silent)
}

/// The same with so many calls of the denoiser.
fn picture_in<D: Device + Sync>(
    device: &D,
    omissions: Omissions,
    has_denoiser: bool,
    level_count: u32,
    progress: &dyn Progress,
) -> Result<Vec<[f32; 4]>, FieldError> {
    let small = Architecture::small();
    let architecture = Architecture { denoiser: small.denoiser.clone().filter(|_| has_denoiser), ..small };
    let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count };
    let plan = Plan { steps, ..Plan::published(0) };
    let options = GenvsOptions { plan, omissions, ..GenvsOptions::default() };
    let field = Genvs::new(test_networks::deterministic(&architecture), options)?;
    let weights = fields::weights([0.7, 0.0, 0.3], 3);
    let sources = photographs(3, 30);
    Ok(fields::picture(device, &field, &sources, &weights, &target(22), 0.0, progress)?.0.colours)
}

fn compare(ours: &[[f32; 4]], reference: &[[f32; 4]]) -> Result<(), Failed> {
    let worst = fields::largest_difference(ours, reference);
    println!("a channel differs by {worst:.1e}");
    if worst <= MAX_DIFFERENCE { Ok(()) } else { Err(format!("a channel differs by {worst}").into()) }
}

fn genvss_pictures_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let reference = picture(&Cpu, Omissions::NONE, true).expect("a picture on the CPU");
    for omissions in [Omissions::NONE, Omissions::EXACT] {
        compare(&picture(&device, omissions, true).map_err(said)?, &reference)?;
    }
    for kernel in DENOISERS {
        assert!(device.tally(kernel).dispatches > 0, "{} is not the denoiser's", kernel.name());
    }
    Ok(())
}

fn genvs_without_denoiser_runs_no_kernel_of_it(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let reference = picture(&Cpu, Omissions::EXACT, false).expect("a picture on the CPU");
    compare(&picture(&device, Omissions::EXACT, false).map_err(said)?, &reference)?;
    for kernel in DENOISERS {
        assert_eq!(device.tally(kernel).dispatches, 0, "{}", kernel.name());
    }
    Ok(())
}

/// From the third call on: the first makes the images between layers, the second is recorded.
fn a_call_of_the_denoiser_is_one_submission(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let seen = Submissions { device: &device, after_steps: Mutex::default() };
    let ours = picture_in(&device, Omissions::NONE, true, 8, &seen).map_err(said)?;
    let reference = picture_in(&Cpu, Omissions::NONE, true, 8, &Silent).expect("a picture on the CPU");
    compare(&ours, &reference)?;
    let after_steps = seen.after_steps.into_inner()?;
    // The last pieces of the work are the calls.
    let calls: Vec<u64> = after_steps[after_steps.len() - 7..].windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(calls, [1; 6], "{after_steps:?}");
    Ok(())
}

/// What was submitted by the end of each piece of work.
struct Submissions<'a> {
    device: &'a Vulkan,
    after_steps: Mutex<Vec<u64>>,
}

impl Progress for Submissions<'_> {
    fn step(&self) {
        self.after_steps.lock().expect("no panic").push(self.device.submission_count());
    }
}

/// What comes back from the device: the picture, with a denoiser once more for every call, and indices of numbers that
/// are not finite, one for some thousand numbers. The feature image alone would be more.
fn genvss_feature_image_stays_on_the_device(candidate: &Candidate) -> Result<(), Failed> {
    // Pictures of 22 pixels on a side are rendered with as many rows and columns as can be halved often enough. What
    // comes back of a buffer that was used before may be twice as long.
    for (has_denoiser, side, pictures, most) in [(false, 22, 1, 2), (true, 24, 4, 4)] {
        let device = candidate.vulkan(&GpuOptions::default())?;
        picture(&device, Omissions::default(), has_denoiser).map_err(said)?;
        // An index for every 256 of the 2^19 numbers of two volumes, and a few more.
        let (bytes, few) = (side * side * 3 * 4, 17 << 10);
        let downloaded = device.transfers().downloaded_bytes;
        if !(pictures * bytes..=most * bytes + few).contains(&downloaded) {
            return Err(format!("{downloaded} bytes downloaded, and {pictures} pictures have {bytes} each").into());
        }
    }
    Ok(())
}
