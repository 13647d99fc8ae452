//! Times of GeNVS's parts on the CPU at full size: `cargo bench -p viewfuse-tests --bench genvs [-- ROUNDS]`.
//!
//! Encoder passes of three photographs of 128 x 128, and single calls of the denoiser: a run of eight levels less one
//! of two, by six, so that parameters are where they are needed and buffers are there. In turns, because what else a
//! machine does changes from second to second; medians of all rounds, as one line of JSON for programs
//! (`tests/compare_pytorch_genvs`).

use std::time::Instant;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::field::genvs::{Architecture, Genvs, GenvsOptions, test_networks};
use viewfuse::job::progress::Silent;
use viewfuse_core::sampler::Sampler;
use viewfuse_tests::lorry::photographs;

const SIDE: u32 = 128;
const SOURCES: u32 = 3;
const LEVELS: [u32; 2] = [2, 8];

fn main() {
    // Cargo hands over arguments of its own as well.
    let rounds = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(5);
    let field = Genvs::new(test_networks::deterministic(&Architecture::published()), GenvsOptions::default())
        .expect("a network");
    let photographs = photographs(SOURCES, SIDE);
    let pixels = (SIDE * SIDE) as usize;
    let features: Vec<f32> = (0..pixels * 16).map(|index| (index * 7919 % 1000) as f32 / 1000.0 - 0.5).collect();
    let latents: Vec<f32> = (0..pixels * 3).map(|index| (index * 6271 % 1000) as f32 / 250.0 - 2.0).collect();
    let (mut encoder, mut calls) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        // Anew in every round: volumes are kept.
        let mut reference = Reference::new(&field, &Cpu, &photographs, &Silent).expect("sources on the device");
        let start = Instant::now();
        for view in 0..SOURCES as usize {
            reference.encode(view).expect("a volume");
        }
        encoder.push(start.elapsed().as_secs_f64());
        let [short, long] = LEVELS.map(|level_count| {
            let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count };
            let plan = Plan { steps, ..Plan::published(0) };
            let start = Instant::now();
            reference.sampled(&latents, &features, [SIDE; 2], &plan).expect("a picture");
            start.elapsed().as_secs_f64()
        });
        calls.push((long - short) / f64::from(LEVELS[1] - LEVELS[0]));
    }
    let [encoder, call] = [encoder, calls].map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    println!("{}", serde_json::json!({ "encode": encoder, "call": call, "rounds": rounds }));
}
