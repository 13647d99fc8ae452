//! Arguments that are not a kernel's own, devices that lack something or are not there.

use crate::candidate::{Candidate, assert_works, tests};
use bytemuck::bytes_of;
use libtest_mimic::Failed;
use std::time::Duration;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Adapter, Gpu, GpuOptions, Limits, Missing, VulkanError};

tests!(
    wrong_arguments_are_refused,
    arrays_of_other_elements_are_refused,
    arrays_of_another_device_are_refused,
    nothing_to_do_is_done,
    more_elements_than_numbers_count_are_refused,
    what_is_changed_of_an_adapter_changes_no_device,
    no_time_limit_is_the_longest,
    a_device_that_lacks_something_is_not_opened,
    devices_are_chosen_by_number_and_name
);

const BLOCK: FuseBlock = FuseBlock { view_count: 2, stride: 3, channel_count: 1, weight_stride: 0 };

fn detail(outcome: Result<(), VulkanError>) -> Result<String, Failed> {
    match outcome {
        Err(VulkanError::Arguments("fuse_views" | "hull_entry" | "linear", detail)) => Ok(detail),
        other => Err(format!("{other:?}").into()),
    }
}

fn wrong_arguments_are_refused(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    let (weights, latents) = (gpu.upload(&[0.25_f32, 0.75])?, gpu.upload(&[1.0_f32, 2.0, 3.0, 5.0, 6.0, 7.0])?);
    let fused = gpu.zeros::<f32>(3)?;
    let right = [weights.bind(), latents.bind(), fused.bind()];
    let parameters = bytes_of(&BLOCK);
    let run = |parameters: &[u8], arrays: &[_]| gpu.dispatch(Kernel::FuseViews, parameters, 0..3, arrays);

    assert_eq!(detail(run(&parameters[1..], &right))?, "15 bytes of parameters instead of 16");
    assert_eq!(detail(run(&[0; 24], &right))?, "24 bytes of parameters instead of 16");
    assert_eq!(detail(run(&[], &right))?, "0 bytes of parameters instead of 16");
    assert_eq!(detail(run(parameters, &right[1..]))?, "2 arrays instead of 3");
    let twice = [weights.bind(), fused.bind(), fused.bind()];
    assert_eq!(detail(run(parameters, &twice))?, "fused is written, and bound a second time");
    assert_eq!(detail(run(parameters, &[right[0]; 4]))?, "4 arrays instead of 3");
    assert_eq!(detail(run(parameters, &[]))?, "0 arrays instead of 3");
    let wide = gpu.zeros::<[f32; 4]>(3)?;
    assert_eq!(
        detail(run(parameters, &[right[0], wide.bind(), right[2]]))?,
        "latents of 16 bytes an element instead of 4"
    );
    // None of them ran; the right ones do.
    assert_eq!(gpu.tally(Kernel::FuseViews).dispatches, 0);
    run(parameters, &right)?;
    assert_eq!(gpu.download(&fused)?, [4.0, 5.0, 6.0]);
    assert_eq!(gpu.tally(Kernel::FuseViews).dispatches, 1);
    Ok(())
}

/// Flat numbers may be bound where a kernel wants rows of them, but not in pages, which are counted in elements.
fn arrays_of_other_elements_are_refused(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    let listed = Kernel::HullEntry.arrays();
    let [object, views] = [listed[0].stride, listed[1].stride].map(|stride| gpu.zeros::<u32>(stride / 4));
    let (texels, entries) = (gpu.zeros::<u32>(4)?, gpu.zeros::<u32>(1)?);
    let arrays = [object?, views?, texels, entries];
    let outcome = gpu.dispatch(Kernel::HullEntry, &[0; 4], 0..1, &arrays.each_ref().map(|array| array.bind()));
    assert_eq!(detail(outcome)?, "texels of 4 bytes an element instead of 16");
    // A struct that is read without looking at its length.
    let short = gpu.zeros::<u32>(1)?;
    let arrays = [short.bind(), arrays[1].bind(), arrays[2].bind(), arrays[3].bind()];
    let outcome = gpu.dispatch(Kernel::HullEntry, &[0; 4], 0..1, &arrays);
    assert_eq!(detail(outcome)?, "object has 4 bytes instead of 48");
    // A number that is read if there is nothing else to read.
    let (block, [one, none, half]) = (LinearBlock::default(), [4_usize, 0, 2].map(|bytes| gpu.zeros::<u8>(bytes)));
    let (one, none, half) = (one?, none?, half?);
    for (short, bytes) in [(&none, 0), (&half, 2)] {
        let arrays = [one.bind(), short.bind(), one.bind(), one.bind(), one.bind()];
        let outcome = gpu.dispatch(Kernel::Linear, bytes_of(&block), 0..64, &arrays);
        assert_eq!(detail(outcome)?, format!("weights has {bytes} bytes instead of 4"));
    }
    Ok(())
}

fn arrays_of_another_device_are_refused(candidate: &Candidate) -> Result<(), Failed> {
    let (gpu, other) = (candidate.gpu(&GpuOptions::default())?, candidate.gpu(&GpuOptions::default())?);
    let [ours, foreign] = [gpu.zeros::<f32>(6)?, other.zeros::<f32>(6)?];
    let (downloaded, arrays) = (gpu.download(&foreign), [ours.bind(), foreign.bind(), ours.bind()]);
    let dispatched = gpu.dispatch(Kernel::FuseViews, bytes_of(&BLOCK), 0..3, &arrays);
    for outcome in [downloaded.map(|_| ()), dispatched] {
        let is_refused = matches!(&outcome, Err(VulkanError::OtherDevice(_, owner)) if *owner == other.name());
        assert!(is_refused, "{outcome:?}");
    }
    assert_works(&gpu)?;
    assert_works(&other)?;
    Ok(())
}

fn nothing_to_do_is_done(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    let (nothing, written) = (gpu.upload::<f32>(&[])?, gpu.zeros::<f32>(0)?);
    let arrays = [nothing.bind(), nothing.bind(), written.bind()];
    // No element; one element of arrays that have none.
    for elements in [0..0, 7..7, 0..1] {
        gpu.dispatch(Kernel::FuseViews, bytes_of(&FuseBlock::default()), elements, &arrays)?;
    }
    assert!(gpu.download(&nothing)?.is_empty());
    assert_eq!(gpu.tally(Kernel::FuseViews).dispatches, 1);
    // Limits of nothing are those of one workgroup.
    let limits = Limits { workgroup_count: 0, ..GpuOptions::default().limits };
    assert_works(&candidate.gpu(&GpuOptions { limits, ..GpuOptions::default() })?)?;
    Ok(())
}

/// Elements whose invocations are more than 32 bits count.
fn more_elements_than_numbers_count_are_refused(candidate: &Candidate) -> Result<(), Failed> {
    let gpu = candidate.gpu(&GpuOptions::default())?;
    let (scores, outputs) = (gpu.upload(&[1.0_f32; 4])?, gpu.zeros::<f32>(4)?);
    let arrays = [scores.bind(), outputs.bind()];
    for elements in [0..1 << 26, 1 << 26..(1 << 26) + 2] {
        let outcome = gpu.dispatch(Kernel::SoftmaxRows, bytes_of(&2_u32), elements, &arrays);
        assert!(matches!(&outcome, Err(VulkanError::Arguments("softmax_rows", _))), "{outcome:?}");
    }
    assert_eq!((gpu.tally(Kernel::SoftmaxRows).elements, gpu.download(&outputs)?), (0, vec![0.0; 4]));
    Ok(())
}

/// A device is what its driver says when it is opened.
fn what_is_changed_of_an_adapter_changes_no_device(candidate: &Candidate) -> Result<(), Failed> {
    let mut adapter = candidate.adapter.clone();
    (adapter.subgroup_size, adapter.has_matrices) = (Some(3), true);
    adapter.limits.workgroup_count = u32::MAX;
    let gpu = Gpu::open(&candidate.instance, &adapter, &GpuOptions::default())?;
    assert_eq!(gpu.limits(), candidate.gpu(&GpuOptions::default())?.limits());
    Ok(assert_works(&gpu)?)
}

/// The greatest duration is as long as one likes, also while a device is closed.
fn no_time_limit_is_the_longest(candidate: &Candidate) -> Result<(), Failed> {
    let longest = Some(Duration::MAX);
    let gpu = candidate.gpu(&GpuOptions { time_limit: longest, closing: Duration::MAX, ..GpuOptions::default() })?;
    Ok(assert_works(&gpu)?)
}

fn named(candidate: &Candidate, index: usize, name: &str) -> Adapter {
    let mut adapter = candidate.adapter.clone();
    (adapter.index, adapter.name) = (index, name.to_owned());
    adapter
}

fn lacking(candidate: &Candidate) -> Adapter {
    let missing = vec![
        Missing::Feature("vulkanMemoryModel"),
        Missing::Limit { name: "maxPushConstantsSize", needed: 112, found: 64 },
        Missing::ComputeQueue,
    ];
    let mut adapter = candidate.adapter.clone();
    (adapter.index, adapter.missing) = (0, missing);
    adapter
}

fn a_device_that_lacks_something_is_not_opened(candidate: &Candidate) -> Result<(), Failed> {
    let lacking = lacking(candidate);
    let expected = VulkanError::Missing(lacking.name.clone(), lacking.missing.clone());
    let opened = Gpu::open(&candidate.instance, &lacking, &GpuOptions::default()).err();
    assert_eq!(opened.as_ref(), Some(&expected));
    let text = expected.to_string();
    for part in ["the feature vulkanMemoryModel", "maxPushConstantsSize of 112 (it has 64)", "a compute queue"] {
        assert!(text.contains(part) && text.contains(&lacking.name), "{text}");
    }
    // Asked for, it is an error; otherwise the next one is taken.
    let able = named(candidate, 1, "able");
    let both = [lacking, able];
    assert_eq!(Adapter::choose(&both, "0").err(), Some(expected.clone()));
    assert_eq!(Adapter::choose(&both[..1], "").err(), Some(expected));
    assert_eq!(Adapter::choose(&both, "")?.index, 1);
    Ok(())
}

fn devices_are_chosen_by_number_and_name(candidate: &Candidate) -> Result<(), Failed> {
    let adapters =
        [named(candidate, 0, "Voodoo 3 (AGP)"), named(candidate, 1, "Parhelia 512"), named(candidate, 2, "Voodoo 5")];
    for (wanted, index) in [
        ("0", 0),
        ("2", 2),
        ("voodoo 5", 2),
        ("VOODOO", 0),
        ("parhelia", 1),
        ("a 512", usize::MAX),
        ("(agp)", 0),
        ("", 0),
    ] {
        match Adapter::choose(&adapters, wanted) {
            Ok(chosen) => assert_eq!(chosen.index, index, "{wanted}"),
            Err(VulkanError::NoSuchDevice { .. }) if index == usize::MAX => {}
            Err(error) => return Err(format!("{wanted}: {error}").into()),
        }
    }
    // A number is an index, also where it stands in a name; a part of a word is no name.
    let all = "there are: 0 Voodoo 3 (AGP), 1 Parhelia 512, 2 Voodoo 5";
    for (wanted, shown) in
        [("5", "5"), ("512", "512"), ("7", "7"), ("-1", "'-1'"), ("hel", "'hel'"), ("voodoo 51", "'voodoo 51'")]
    {
        let error = Adapter::choose(&adapters, wanted).err().map(|error| error.to_string());
        assert_eq!(error, Some(format!("no Vulkan device {shown}; {all}")));
    }
    let one = Adapter::choose(&adapters[..1], "3").err().map(|error| error.to_string());
    assert_eq!(one.as_deref(), Some("no Vulkan device 3; there is: 0 Voodoo 3 (AGP)"));
    assert!(matches!(Adapter::choose(&[], ""), Err(VulkanError::NoSuchDevice { .. })));
    Ok(())
}
