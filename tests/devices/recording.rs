//! Work that is recorded and submitted again: what it computes, what it costs, and what is not recorded.

use crate::candidate::{Candidate, tests};
use libtest_mimic::Failed;
use std::thread;
use viewfuse::device::vulkan::Vulkan;
use viewfuse::device::{Device, DeviceError, Memory};
use viewfuse_core::sampler::Mix;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, GpuOptions, Limits, VulkanError};

tests!(
    recorded_work_is_done_again,
    what_is_not_the_same_again_is_not_recorded,
    work_may_be_submitted_again_while_it_is_in_flight,
    a_recording_gives_its_memory_back,
    another_devices_recording_is_refused,
);

const COUNT: usize = 1000;
/// More dispatches than one command buffer has, each of which depends on the one before; odd.
const STEPS: usize = 301;

/// Arrays that work goes on in.
struct Arrays {
    input: Buffer<f32>,
    now: Buffer<f32>,
    next: Buffer<f32>,
}

impl Arrays {
    fn new(device: &Vulkan) -> Result<Arrays, DeviceError> {
        Ok(Arrays { input: device.zeros(COUNT)?, now: device.zeros(COUNT)?, next: device.zeros(COUNT)? })
    }

    /// Other numbers for the next round, which the host has.
    fn write_input(&mut self, device: &Vulkan, round: usize) -> Result<(), DeviceError> {
        let values: Vec<f32> = (0..COUNT).map(|index| ((index + 7) * (round + 1) % 101) as f32 / 50.0 - 1.0).collect();
        mix(device, 1.0, 0.0, &device.upload(&values)?, &self.now, &mut self.input)
    }

    /// The work: each step takes the other array's numbers a little nearer to the input's.
    fn work(&mut self, device: &Vulkan) -> Result<(), DeviceError> {
        for step in 0..STEPS {
            let (from, to) = if step % 2 == 0 { (&self.now, &mut self.next) } else { (&self.next, &mut self.now) };
            mix(device, 0.97, 0.03, from, &self.input, to)?;
        }
        Ok(())
    }
}

fn mix(
    device: &Vulkan,
    state: f32,
    newest: f32,
    a: &Buffer<f32>,
    b: &Buffer<f32>,
    out: &mut Buffer<f32>,
) -> Result<(), DeviceError> {
    device.mix_pictures(&Mix { state, results: [newest, 0.0, 0.0, 0.0] }, COUNT as u32, a, b, b, b, b, out)
}

/// The bits after each round of work that is recorded whenever it runs.
fn reference(device: &Vulkan, rounds: usize) -> Result<Vec<Vec<f32>>, DeviceError> {
    let mut arrays = Arrays::new(device)?;
    (0..rounds)
        .map(|round| {
            arrays.write_input(device, round)?;
            arrays.work(device)?;
            device.download(&arrays.next)
        })
        .collect()
}

fn recorded_work_is_done_again(candidate: &Candidate) -> Result<(), Failed> {
    let expected = reference(&candidate.vulkan(&GpuOptions::default())?, 5)?;
    let device = candidate.vulkan(&GpuOptions::default())?;
    let mut arrays = Arrays::new(&device)?;
    let dispatched = || (device.tally(Kernel::MixPictures).dispatches, device.tally(Kernel::MixPictures).elements);
    // The first round tells how long a step takes: later ones are expected to be short.
    arrays.write_input(&device, 0)?;
    arrays.work(&device)?;
    assert!(device.download(&arrays.next)? == expected[0], "round 0");
    arrays.write_input(&device, 1)?;
    let ((), layers) = device.recorded(|| arrays.work(&device))?;
    let layers = layers.ok_or("it is not recorded")?;
    assert!(device.download(&arrays.next)? == expected[1], "round 1");
    for (round, expected) in expected.iter().enumerate().skip(2) {
        let (submissions, (dispatches, elements)) = (device.submission_count(), dispatched());
        arrays.write_input(&device, round)?;
        layers.again()?;
        assert!(device.download(&arrays.next)? == *expected, "round {round}");
        assert_eq!(device.submission_count() - submissions, 1, "round {round}");
        let steps = STEPS as u64 + 1;
        assert_eq!(dispatched(), (dispatches + steps, elements + steps * COUNT as u64), "round {round}");
    }
    Ok(())
}

fn what_is_not_the_same_again_is_not_recorded(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let mut arrays = Arrays::new(&device)?;
    let step = |arrays: &mut Arrays| mix(&device, 0.5, 0.5, &arrays.input, &arrays.now, &mut arrays.next);
    let mut is_recorded = |other: &dyn Fn() -> Result<(), DeviceError>| -> Result<bool, DeviceError> {
        let work = || step(&mut arrays).and_then(|()| other());
        Ok(device.recorded(work)?.1.is_some())
    };
    let another = Arrays::new(&device)?;
    assert!(is_recorded(&|| Ok(()))?, "a dispatch");
    assert!(!is_recorded(&|| device.upload(&[1.0_f32]).map(drop))?, "a short upload");
    assert!(!is_recorded(&|| device.upload(&vec![1.0_f32; 1 << 18]).map(drop))?, "a long upload");
    assert!(!is_recorded(&|| device.zeros::<f32>(3).map(drop))?, "a new array");
    assert!(!is_recorded(&|| device.download(&another.now).map(drop))?, "a download");
    assert!(!is_recorded(&|| device.download_later(&another.now).map(drop))?, "a later download");
    let elsewhere = || {
        let work = || another_step(&device);
        thread::scope(|scope| scope.spawn(work).join().expect("no panic"))
    };
    assert!(!is_recorded(&elsewhere)?, "another thread");
    // A part of what is recorded is not by itself, and does not keep the whole from being so.
    let inner = || match device.recorded(|| Ok(()))? {
        ((), None) => Ok(()),
        ((), Some(_)) => panic!("a part of a recording"),
    };
    assert!(is_recorded(&inner)?, "a part");
    assert!(device.recorded(|| Ok(()))?.1.is_none(), "nothing");
    let failed =
        device.recorded(|| device.upload(&[0.0_f32; 4]).and_then(|_| Err::<(), _>(DeviceError::from(refusal()))));
    assert!(failed.is_err(), "what fails");
    assert!(is_recorded(&|| Ok(()))?, "after all that");
    Ok(())
}

/// A dispatch in arrays that are there and in one that is made.
fn another_step(device: &Vulkan) -> Result<(), DeviceError> {
    let mut arrays = Arrays::new(device)?;
    mix(device, 0.5, 0.5, &arrays.input, &arrays.now, &mut arrays.next)
}

fn refusal() -> VulkanError {
    VulkanError::NoDevice("of a test".to_owned())
}

fn work_may_be_submitted_again_while_it_is_in_flight(candidate: &Candidate) -> Result<(), Failed> {
    let device = candidate.vulkan(&GpuOptions::default())?;
    let [mut once, mut again] = [Arrays::new(&device)?, Arrays::new(&device)?];
    for arrays in [&mut once, &mut again] {
        arrays.write_input(&device, 3)?;
    }
    // Nobody has waited: how long a step takes is not known, and what is recorded is many submissions.
    let ((), layers) = device.recorded(|| again.work(&device))?;
    let layers = layers.ok_or("it is not recorded")?;
    for _ in 0..3 {
        layers.again()?;
    }
    drop(layers);
    for _ in 0..4 {
        once.work(&device)?;
    }
    assert!(device.download(&again.next)? == device.download(&once.next)?);
    Ok(())
}

/// Of arrays that are there no more nothing stays, once the recording is gone, too.
fn a_recording_gives_its_memory_back(candidate: &Candidate) -> Result<(), Failed> {
    let limits = Limits { allocation: 1 << 18, memory: 3 << 18, ..GpuOptions::default().limits };
    let device = candidate.vulkan(&GpuOptions { limits, ..GpuOptions::default() })?;
    for round in 0..20 {
        let [input, now] = [device.zeros::<f32>(1 << 16)?, device.zeros::<f32>(1 << 15)?];
        let mut next = device.zeros::<f32>(1 << 15)?;
        let ((), layers) = device.recorded(|| mix(&device, 0.5, 0.5, &input, &now, &mut next))?;
        let layers = layers.ok_or("it is not recorded")?;
        layers.again()?;
        drop((input, now, next));
        // Its arrays are there as long as it is.
        layers.again()?;
        assert!(device.zeros::<f32>(1 << 17).is_err(), "round {round}");
    }
    Ok(())
}

fn another_devices_recording_is_refused(candidate: &Candidate) -> Result<(), Failed> {
    let [ours, others] = [candidate.gpu(&GpuOptions::default())?, candidate.gpu(&GpuOptions::default())?];
    let (input, next) = (others.zeros::<f32>(COUNT)?, others.zeros::<f32>(COUNT)?);
    let mix = Mix { state: 1.0, results: [0.0; 4] };
    let work = || {
        let all = [input.bind(), input.bind(), input.bind(), input.bind(), input.bind(), next.bind()];
        others.dispatch(Kernel::MixPictures, bytemuck::bytes_of(&mix), 0..COUNT as u32, &all)
    };
    let ((), recording) = others.recorded(work)?;
    let recording = recording.ok_or("it is not recorded")?;
    match ours.submit_again(&recording) {
        Err(VulkanError::OtherDevice(..)) => {}
        other => return Err(format!("{other:?}").into()),
    }
    Ok(others.submit_again(&recording)?)
}
