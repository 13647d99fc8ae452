//! A whole picture of the sample scene on each device.

use crate::candidate::{Candidate, tests};
use image::RgbImage;
use libtest_mimic::Failed;
use std::sync::OnceLock;
use viewfuse::check::picture::compare;
use viewfuse::device::Device;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::field::On;
use viewfuse::field::render::{RenderError, RenderOptions, render_all};
use viewfuse::field::training_free::TrainingFree;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::weighting::Weighting;
use viewfuse_tests::places::data;
use viewfuse_vulkan::Tally;
use viewfuse_vulkan::kernel::Kernel;

tests!(the_picture_is_the_cpus);

/// Width and height; software devices take a second for so much.
pub(crate) const SIDE: u32 = 48;
/// How many views it is made from.
pub(crate) const SOURCE_COUNT: usize = 6;
/// Kernels that a picture takes.
pub(crate) const KERNELS: [Kernel; 6] =
    [Kernel::HullEntry, Kernel::MatchCost, Kernel::SumRow, Kernel::MeanColumn, Kernel::PickDepth, Kernel::MarchRays];

/// A picture with its depths, and what the device did for it.
pub(crate) struct Rendering {
    pub(crate) pictures: Vec<RgbImage>,
    pub(crate) depths: Vec<Vec<f32>>,
    tallies: Vec<Tally>,
}

impl Rendering {
    /// On a device that did nothing else before.
    pub(crate) fn on_vulkan(device: &Vulkan) -> Result<Rendering, RenderError> {
        let rendering = Rendering::on(device)?;
        Ok(Rendering { tallies: KERNELS.map(|kernel| device.tally(kernel)).to_vec(), ..rendering })
    }

    fn on<D: Device + Sync>(device: &D) -> Result<Rendering, RenderError> {
        let scene = Scene::open(data("toy"))?;
        let (targets, view_count) = (Some("20,22".to_owned()), Some(SOURCE_COUNT));
        let job = Selection { targets, view_count, ..Selection::default() }.resolve(&scene, 2).expect("views of it");
        let options = RenderOptions { size: Some([SIDE, SIDE]), ..RenderOptions::default() };
        let weighting = Weighting::open("error:alpha=1").expect("a scheme");
        let renderer = On { device, field: &TrainingFree::default() };
        let frames = render_all(&scene, &job, &weighting, &renderer, &options)?;
        let (pictures, depths) = frames.into_iter().map(|frame| (frame.picture, frame.depths)).unzip();
        Ok(Rendering { pictures, depths, tallies: Vec::new() })
    }

    /// What a kernel did for it.
    pub(crate) fn tally(&self, kernel: Kernel) -> Tally {
        let place = KERNELS.iter().position(|other| *other == kernel);
        place.and_then(|place| self.tallies.get(place).copied()).unwrap_or_default()
    }

    /// Every bit.
    pub(crate) fn is_the_same_as(&self, other: &Rendering) -> bool {
        let bits = |depths: &Vec<Vec<f32>>| depths.concat().iter().map(|depth| depth.to_bits()).collect::<Vec<_>>();
        self.pictures == other.pictures && bits(&self.depths) == bits(&other.depths)
    }

    /// Every pixel to 1/255.
    pub(crate) fn assert_is_the_cpus(&self) -> Result<(), Failed> {
        static CPU: OnceLock<Rendering> = OnceLock::new();
        let cpu = CPU.get_or_init(|| Rendering::on(&Cpu).expect("a picture on the CPU"));
        assert_eq!((self.pictures.len(), cpu.pictures.len()), (2, 2));
        for (picture, reference) in self.pictures.iter().zip(&cpu.pictures) {
            let (versus, breach) = compare(picture, reference);
            if let Some(breach) = breach {
                let differing = versus.map_or(0, |versus| versus.differing);
                return Err(format!("{breach}; {differing} of {} pixels differ", SIDE * SIDE).into());
            }
        }
        Ok(())
    }
}

fn the_picture_is_the_cpus(candidate: &Candidate) -> Result<(), Failed> {
    let rendering = candidate.rendering()?;
    rendering.assert_is_the_cpus()?;
    // Two targets, and neither is empty.
    assert!(rendering.pictures[0] != rendering.pictures[1]);
    let seen = rendering.depths.iter().map(|depths| depths.iter().filter(|depth| **depth > 0.0).count());
    assert!(seen.into_iter().all(|seen| seen > 200));
    // The device did the work.
    for kernel in KERNELS {
        let tally = rendering.tally(kernel);
        assert!(tally.dispatches > 0 && tally.elements >= u64::from(SIDE * SIDE), "{}: {tally:?}", kernel.name());
    }
    Ok(())
}
