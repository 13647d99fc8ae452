use super::*;
use candle_core::{Device, Tensor};
use learning::{Learning, train};
use network::{Network, Parts};
use viewfuse_core::random::normal;

const BOTH: Parts =
    Parts { temperature: false, blend: true, planes: true, directions: true, position: true, pooled_weights: true };

/// A small garden's picture from three sources.
fn some(seed: &str) -> Candidates {
    let scratch = std::env::temp_dir().join(format!("viewfuse-refinement-test-{seed}-{}", std::process::id()));
    let scene = scenes::test_scene(&scratch.join("scene"), &format!("garden/arc/{seed}"), 32).unwrap();
    let mut pictures = pictures(seed, scene, &"nearest:3:4".parse().unwrap(), 32).unwrap();
    std::fs::remove_dir_all(&scratch).unwrap();
    pictures.remove(0)
}

/// Changes all parameters.
fn disturb(network: &Network) {
    for (index, variable) in network.variables.iter().enumerate() {
        let noise = (0..variable.elem_count()).map(|place| 0.3 * normal([1, index as u32], place as u32, 0));
        let noise = Tensor::from_vec(noise.collect(), variable.shape(), &Device::Cpu).unwrap();
        variable.set(&(variable.as_tensor() + noise).unwrap()).unwrap();
    }
}

/// Untrained, every variant is the field to rounding ([`Candidates::of`] compares its own sums with the field's picture), and
/// changed parameters change the picture.
#[test]
fn untrained_it_is_the_field() {
    let picture = some("7");
    let gain = |network: &Network| picture.gain(&network.refine(&picture.pixels).unwrap().colours).unwrap();
    for variant in &VARIANTS {
        let network = Network::new(variant.parts, 3).unwrap();
        assert!(gain(&network).abs() < 1.0e-4, "{}: {}", variant.name, gain(&network));
        disturb(&network);
        assert!(gain(&network).abs() > 1.0e-3, "{}: {}", variant.name, gain(&network));
    }
}

/// On the picture that it is trained on it becomes better than the field.
#[test]
fn it_learns() {
    let picture = some("8");
    let network = train(BOTH, &Learning { caution: 0.0, steps: 60, seed: 0 }, &[&picture]).unwrap();
    let gain = picture.gain(&network.refine(&picture.pixels).unwrap().colours).unwrap();
    assert!(gain > 0.1, "{gain}");
}

/// The order of the sources does not matter.
#[test]
fn sources_have_no_order() {
    let picture = some("9");
    let network = Network::new(BOTH, 5).unwrap();
    disturb(&network);
    let own = &picture.pixels;
    let order = Tensor::new(&[2_u32, 0, 1], &Device::Cpu).unwrap();
    let other = candidates::Pixels {
        source: own.source.index_select(&order, 2).unwrap(),
        colour: own.colour.index_select(&order, 2).unwrap(),
        part: own.part.index_select(&order, 2).unwrap(),
        ..own.clone()
    };
    let [a, b] = [own, &other].map(|pixels| network.refine(pixels).unwrap().colours);
    let most = (a - b).unwrap().abs().unwrap().max_all().unwrap().to_scalar::<f32>().unwrap();
    assert!(most < 1.0e-4, "{most}");
}
