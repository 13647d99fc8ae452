use super::*;
use candle_core::Device;
use learning::{Learning, train};
use network::{Network, Parts};

const BOTH: Parts =
    Parts { temperature: false, blend: true, planes: true, directions: true, position: true, pooled_weights: true };

/// A small garden's pictures from three sources.
fn some(seed: &str) -> Vec<Candidates> {
    let scratch = std::env::temp_dir().join(format!("viewfuse-refinement-test-{seed}-{}", std::process::id()));
    let scene = scenes::test_scene(&scratch.join("scene"), &format!("garden/arc/{seed}"), 40).unwrap();
    let pictures = pictures(seed, scene, &"nearest:3:2,6".parse().unwrap(), 40).unwrap();
    std::fs::remove_dir_all(&scratch).unwrap();
    pictures
}

/// Untrained, every variant is the field to rounding ([`Candidates::of`] compares its own sums with the field's picture), and
/// changed parameters change the picture.
#[test]
fn untrained_it_is_the_field() {
    let pictures = some("7");
    for variant in &VARIANTS {
        let network = Network::new(variant.parts, 3).unwrap();
        for picture in &pictures {
            let gain = picture.gain(&network.refine(&picture.pixels).unwrap().colours).unwrap();
            assert!(gain.abs() < 1.0e-4, "{}: {gain}", variant.name);
        }
        for variable in &network.variables {
            let ones = variable.ones_like().unwrap();
            variable.set(&((variable.as_tensor() + ones).unwrap() * 0.3).unwrap()).unwrap();
        }
        let gain = pictures[0].gain(&network.refine(&pictures[0].pixels).unwrap().colours).unwrap();
        assert!(gain.abs() > 1.0e-3, "{}: {gain}", variant.name);
    }
}

/// On the pictures that it is trained on it becomes better than the field.
#[test]
fn it_learns() {
    let pictures = some("8");
    let all: Vec<&Candidates> = pictures.iter().collect();
    let network = train(BOTH, &Learning { caution: 0.0, steps: 80, seed: 0 }, &all).unwrap();
    for picture in &pictures {
        let gain = picture.gain(&network.refine(&picture.pixels).unwrap().colours).unwrap();
        assert!(gain > 0.1, "{gain}");
    }
}

/// The order of the sources does not matter.
#[test]
fn sources_have_no_order() {
    let picture = some("9").remove(0);
    let network = Network::new(BOTH, 5).unwrap();
    for variable in &network.variables {
        variable.set(&(variable.as_tensor() + 0.05).unwrap()).unwrap();
    }
    let own = &picture.pixels;
    let order = candle_core::Tensor::new(&[2_u32, 0, 1], &Device::Cpu).unwrap();
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
