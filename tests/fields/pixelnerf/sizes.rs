//! Other members of the family: sizes are read off the tensors.

use super::{assert_sound, exact, picture, sources, target};
use std::collections::BTreeMap;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::pixelnerf::reference::Reference;
use viewfuse::field::pixelnerf::{Architecture, Level, PixelNerf, test_networks};
use viewfuse::nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse_tests::checkpoints::changed;

fn with_changes(change: impl FnOnce(&mut Vec<(TensorShape, Vec<f32>)>)) -> Checkpoint {
    changed(&test_networks::deterministic(&Architecture::small(16)), change)
}

fn refusal(checkpoint: &Checkpoint) -> String {
    match PixelNerf::new(checkpoint, exact()) {
        Ok(_) => panic!("is taken for a PixelNeRF"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn sizes_come_from_the_checkpoint() {
    let level = |channels, block_count| Level { channels, block_count };
    let small = Architecture::small(16);
    for architecture in [
        Architecture::published(),
        small.clone(),
        Architecture { levels: vec![level(4, 2)], ..small.clone() },
        Architecture { levels: vec![level(8, 1), level(4, 1), level(12, 2), level(4, 1)], ..small.clone() },
        Architecture { has_pool: false, source_side: 64, ..small.clone() },
        Architecture { width: 40, block_count: 2, injected_count: 2, ..small.clone() },
        Architecture { block_count: 1, injected_count: 1, frequency_count: 1, has_fine: false, ..small },
    ] {
        let checkpoint = test_networks::deterministic(&architecture);
        let field = PixelNerf::new(&checkpoint, exact()).expect("a member of the family");
        assert_eq!(*field.architecture(), architecture);
        if architecture.width < 512 {
            assert_sound(&picture(&field, &sources(2), &target(6)));
        }
    }
}

#[test]
fn a_trunk_without_a_pool_keeps_the_stem_s_size() {
    // Level 1 as the identity: its block adds nothing to its input, which the stem's rectifier made positive.
    let latents = |has_pool: bool| {
        let architecture = Architecture { has_pool, ..Architecture::small(16) };
        let checkpoint = changed(&test_networks::deterministic(&architecture), |tensors| {
            let block = "encoder.model.layer1.0.";
            tensors.iter_mut().filter(|(tensor, _)| tensor.name.starts_with(block)).for_each(|(tensor, values)| {
                let rest = if tensor.name.ends_with("running_var") { 1.0 } else { 0.0 };
                values.fill(rest);
            });
        });
        let field = PixelNerf::new(&checkpoint, exact()).expect("a member of the family");
        let latents = Reference::new(&field, &Cpu, &sources(1)).expect("sources").latents().expect("latents");
        let channels = architecture.latent_channels();
        latents.chunks_exact(channels).map(|node| (node[..4].to_vec(), node[4..8].to_vec())).collect::<Vec<_>>()
    };
    let [with, without] = [true, false].map(latents);
    assert!(without.iter().all(|(stem, level)| stem == level));
    assert!(with.iter().any(|(stem, level)| stem != level) && with.len() == without.len());
    assert!(with.iter().zip(&without).all(|((a, _), (b, _))| a == b), "the stem is the same");
}

#[test]
fn what_official_checkpoints_have_besides_is_accepted() {
    let tensor = |name: &str, shape: &[usize]| {
        let count = shape.iter().product();
        (TensorShape { name: name.to_owned(), shape: shape.to_vec() }, vec![0.5; count])
    };
    let checkpoint = with_changes(|tensors| {
        tensors.push(tensor("encoder.model.layer3.0.conv1.weight", &[16, 8, 3, 3]));
        tensors.push(tensor("encoder.model.bn1.num_batches_tracked", &[]));
        let frequencies = (0..12).map(|index| 1.5 * 2.0_f32.powi(index / 2)).collect();
        let shape = TensorShape { name: "code._freqs".to_owned(), shape: vec![1, 12, 1] };
        tensors.push((shape, frequencies));
        let phases = (0..12).map(|index| std::f32::consts::FRAC_PI_2 * (index % 2) as f32).collect();
        tensors.push((TensorShape { name: "code._phases".to_owned(), shape: vec![1, 12, 1] }, phases));
    });
    assert!(PixelNerf::new(&checkpoint, exact()).is_ok());
}

#[test]
fn what_is_no_member_is_refused_with_the_reason() {
    let renamed = with_changes(|tensors| tensors[0].0.name.push('x'));
    let text = refusal(&renamed);
    let name = renamed.shapes().keys().find(|name| name.ends_with('x')).expect("the renamed tensor");
    assert!(text.contains("changed") && text.contains(name) && text.contains(&name[..name.len() - 1]), "{text}");
    let text = refusal(&Checkpoint::in_memory("nothing", [], BTreeMap::new()));
    assert!(text.contains("nothing") && text.contains("encoder.model.conv1.weight"), "{text}");
}
