//! Pictures from noise on each device: for the same seed those of the CPU.

use crate::candidate::{Candidate, Test};
use libtest_mimic::Failed;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Memory};
use viewfuse::field::genvs::sampling::{Plan, Sampled, Start, Steps, sample};
use viewfuse::job::progress::Silent;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::churn::Churn;
use viewfuse_tests::mixture::Mixture;
use viewfuse_vulkan::GpuOptions;
use viewfuse_vulkan::kernel::Kernel;

pub(crate) const TESTS: &[Test] = &[Test::new("the_samples_are_the_cpus", the_samples_are_the_cpus)];

/// Values of a picture: more than a workgroup, and no multiple of one.
const COUNT: usize = 1000;

/// What devices may differ by: a tenth of what a level of 255 is. Noise agrees to 5e-6 of itself.
const TOLERANCE: f32 = 4.0e-4;

fn sampled<D: Device>(device: &D, plan: &Plan) -> Result<Sampled<D>, Failed> {
    let mixture = Mixture::new(3, &[0.2, 0.3, 0.25]);
    let denoise = |state: &_, sigma, denoised: &mut _| mixture.denoise(device, state, sigma, denoised);
    let sampled = sample(device, plan, COUNT, Start::Noise, &Silent, denoise);
    sampled.map_err(|error| format!("{error:?}").into())
}

fn the_samples_are_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let fixed = Sampler::ALL.map(|sampler| Steps::Fixed { sampler, level_count: 12 });
    let chosen = Steps::Chosen { tolerance: 1.0e-2, most_calls: 50 };
    for steps in fixed.into_iter().chain([chosen]) {
        for amount in [0.0, 10.0] {
            let plan = Plan { steps, churn: Churn { amount, ..Churn::NONE }, ..Plan::published(77) };
            let (own, cpus) = (sampled(&device, &plan)?, sampled(&Cpu, &plan)?);
            // Levels that are chosen depend on rounding, how many there are does not.
            assert_eq!(own.call_count(), cpus.call_count(), "{steps:?}");
            let pictures = device.download(&own.picture)?.into_iter().zip(cpus.picture);
            let largest = pictures.fold(0.0, |largest: f32, (own, cpu)| match (own - cpu).abs() {
                // Not the larger one: NaN is no agreement.
                difference if difference <= largest => largest,
                difference => difference,
            });
            println!("{steps:?}, churn {amount}: largest difference {largest:.1e}");
            assert!(largest <= TOLERANCE, "{steps:?}, churn {amount}: {largest}");
        }
    }
    assert!(device.tally(Kernel::MixPictures).dispatches > 100 && device.tally(Kernel::AddNoise).dispatches > 10);
    Ok(())
}
