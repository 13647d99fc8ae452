//! The graph says what the renderer says, and its gradients are difference quotients.

use super::super::average::Average;
use super::super::draw::Draw;
use super::super::genvs_learner::loss;
use super::super::gradient_check::{
    assert_close, assert_gradients, mixed, noise, numbers, orbit, photographs, tensor, variable,
};
use super::super::operations::{
    Apply, Convolution, MarchSizes, MarchVolumes, Normalise, Operation, SampledRays, Window,
};
use super::super::parameters::Parameters;
use super::{Genvs, ObjectViews, colours, each};
use candle_core::{DType, Result, Tensor, Var};
use std::sync::Arc;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::rays::cast_ray;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::genvs::reference::Reference;
use viewfuse_field::genvs::{
    Architecture, Estimate, Genvs as Field, GenvsOptions, LAST_LENGTH, cast_block, ray_length, test_networks,
};
use viewfuse_field::learned::default_near_far;
use viewfuse_job::progress::Silent;
use viewfuse_nn::checkpoint::TensorShape;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Of the largest number. Some 60 layers lie one behind the other, and the sum of n rounded products is off by some
/// sqrt(n) 2^-24 of their size, n being 576 for most: 60 * 24 * 6e-8.
const ROUNDING: f64 = 8.6e-5;

fn target(side: u32, angle: f32) -> CameraBlock {
    orbit(side).camera(angle, 0.35).expect("a camera off the pole").block(0)
}

/// Photographs as both objects, and a target of each, as a step's views.
fn views(sources: &SourceImages, targets: &[CameraBlock], object_count: usize) -> ObjectViews {
    let side = targets[0].height as usize;
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let shown = |image: &SourceImage| -> Vec<f32> {
        let texels = image.texels.iter();
        texels.flat_map(|texel| [0, 1, 2].map(|channel| 2.0 * (texel[channel] + 1.0 - texel[3]) - 1.0)).collect()
    };
    let pictures: Vec<f32> = (0..object_count).flat_map(|_| sources.images.iter().flat_map(shown)).collect();
    let truth = shown(&sources.images[0]).repeat(object_count * targets.len());
    ObjectViews {
        pictures: tensor(pictures, &[object_count * cameras.len(), side, side, 3], DType::F64),
        cameras: vec![cameras.iter().map(|camera| camera.block(0)).collect(); object_count],
        near_far: vec![default_near_far(&cameras); object_count],
        sources: vec![cameras; object_count],
        // Where nothing is weighted by pose, no pose of a target is asked for.
        target_cameras: Vec::new(),
        targets: vec![targets.to_vec(); object_count],
        truth: tensor(truth, &[object_count * targets.len(), side, side, 3], DType::F64),
    }
}

/// The small member, with a denoiser whose estimate is this.
fn small(estimate: Estimate) -> Architecture {
    let mut architecture = Architecture::small();
    architecture.denoiser.iter_mut().for_each(|denoiser| denoiser.estimate = estimate);
    architecture
}

#[test]
fn the_graph_is_the_renderers() {
    for estimate in [Estimate::Published, Estimate::FromColours] {
        assert_graph_is_the_renderers(estimate);
    }
}

fn assert_graph_is_the_renderers(estimate: Estimate) {
    let made = test_networks::deterministic(&small(estimate));
    let network = Genvs::frozen(&made, 64, DType::F64).expect("a network");
    let field = Field::new(made, GenvsOptions::default()).expect("a network");
    let (sources, target) = (photographs(3, 64), target(64, 2.0));
    let mut reference = Reference::new(&field, &Cpu, &sources, &Silent).expect("sources");
    let views = views(&sources, &[target], 1);
    let weights = [0.5_f32, 0.2, 0.3];

    let volumes = network.volumes(&views.pictures).expect("volumes");
    let second = volumes.narrow(0, 1, 1).expect("a volume");
    assert_close(&reference.volume(1).expect("a volume"), &second, ROUNDING);

    let samples = CoarseBlock { seed: [0, 0], sample_count: 64, jitter: 0.0 };
    let features = network.features(&volumes, &tensor(weights.to_vec(), &[1, 3], DType::F64), &views, &samples);
    let features = features.expect("features");
    let rendered = reference.features(&weights, &target, views.near_far[0], ray_length(&target)).expect("features");
    assert_close(&rendered, &features, 4.0 * ROUNDING);

    for level in [0.05, 1.0, 80.0] {
        let noisy = (noise(&[1, 64, 64, 3], 3) * f64::from(level)).expect("noise");
        let denoised = network.denoised(&noisy, &features, &[Preconditioning::at(level)]).expect("a picture");
        let plain = |tensor: &Tensor| numbers::<f32>(&tensor.to_dtype(DType::F32).expect("numbers"));
        let said = reference.denoised(&plain(&noisy), &plain(&features), [64, 64], level).expect("a picture");
        assert_close(&said, &denoised, 2.0 * ROUNDING);
    }
}

#[test]
fn convolutions_and_norms_have_their_gradients() {
    let input = [2, 3, 4, 8];
    let images = variable(&input, 10);
    let (filters, shared, separate) = (variable(&[5, 9, 8], 9), variable(&[5], 11), variable(&[2, 5], 12));
    for (biases, has_own_biases, rectifies) in
        [(&shared, false, true), (&separate, true, true), (&separate, true, false)]
    {
        let operation = || {
            let (window, out_channels) = (Window::same(3), 5);
            Apply(Convolution { input, out_channels, window, has_own_biases, rectifies, differentiates_input: true })
        };
        assert_gradients(&[("images", &images), ("filters", &filters), ("biases", biases)], 1.0e-6, 1.0e-6, || {
            mixed(&images.apply_op3(&filters, biases, operation())?)
        });
    }
    let (weights, biases) = (variable(&[8], 13), variable(&[8], 14));
    for silu in [false, true] {
        let operation = || Apply(Normalise { input, group_count: 2, variance_floor: 1.0e-6, silu });
        assert_gradients(&[("images", &images), ("weights", &weights), ("biases", &biases)], 1.0e-6, 1.0e-6, || {
            mixed(&images.apply_op3(&weights, &biases, operation())?)
        });
    }
}

fn march_volumes(inclusive: bool, is_frozen: bool) -> MarchVolumes {
    let sources = photographs(2, 8);
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let near_far @ [near, far] = default_near_far(&cameras);
    let object_rays = |angle: f32| {
        let target = target(8, angle);
        let cast = cast_block(&target, near_far, 6);
        SampledRays {
            cameras: cameras.iter().map(|camera| camera.block(0)).collect(),
            rays: (0..16).map(|pixel| cast_ray(&cast, pixel)).collect(),
            near_far,
            length_scale: ray_length(&target) / (far - near),
        }
    };
    MarchVolumes {
        sizes: MarchSizes { volume: [8, 8, 4], features: 3, width: 5 },
        objects_rays: Arc::new(vec![object_rays(2.0), object_rays(1.0)]),
        samples: CoarseBlock { seed: [1, 2], sample_count: 6, jitter: 1.0 },
        last_length: LAST_LENGTH,
        inclusive,
        is_frozen,
    }
}

#[test]
fn marching_has_its_gradient() {
    for inclusive in [true, false] {
        let operation = march_volumes(inclusive, false);
        assert_eq!(operation.shape(), [32, 3]);
        let volumes = variable(&[4, 8, 8, 4 * 3], 20);
        let (weights, parameters) = (variable(&[2, 2], 21), variable(&[operation.sizes.parameter_count()], 22));
        let all = [("volumes", &volumes), ("weights", &weights), ("parameters", &parameters)];
        assert_gradients(&all, 1.0e-7, 1.0e-5, || {
            mixed(&volumes.apply_op3(&weights, &parameters, Apply(operation.clone()))?)
        });
        // With the network left as it is, the weights' gradient is the same.
        let of_weights = |operation: MarchVolumes| -> Result<Vec<f64>> {
            let seen = volumes.apply_op3(&weights, &parameters, Apply(operation))?;
            let gradients = mixed(&seen)?.backward()?;
            gradients.get(&weights).expect("a gradient").flatten_all()?.to_vec1()
        };
        let whole = of_weights(operation.clone()).expect("gradients");
        assert_eq!(of_weights(march_volumes(inclusive, true)).expect("gradients"), whole);
    }
}

#[test]
fn the_loss_has_its_gradient() {
    let mut architecture = Architecture::narrow(32, 4);
    architecture.denoiser.iter_mut().for_each(|denoiser| denoiser.estimate = Estimate::FromColours);
    let made = test_networks::deterministic(&architecture);
    let network = Genvs { is_frozen: false, ..Genvs::frozen(&made, 32, DType::F64).expect("a network") };
    let views = views(&photographs(2, 32), &[target(32, 2.0), target(32, 0.5)], 2);
    let samples = CoarseBlock { seed: [1, 2], sample_count: 4, jitter: 1.0 };
    let weights = variable(&[2, 2], 30);
    let value = || loss(&network, &views, &weights, &samples, 0.25, &Draw { seed: 1, step: 2 });
    // Every seventh parameter: each costs the loss twice, and every operation has its own test.
    let mut all: Vec<(&str, &Var)> = network.parameters.iter().step_by(7).collect();
    all.push(("weights", &weights));
    // A short step: between its ends no rectification may turn.
    assert_gradients(&all, 1.0e-8, 1.0e-3, value);
}

#[test]
fn a_new_denoiser_shows_the_colours_and_leaves_the_volumes() {
    let old = test_networks::deterministic(&Architecture::narrow(32, 4));
    let network = Genvs::continued(&old, 32, Some(Estimate::FromColours), DType::F32, 1).expect("a network");
    let kept = Genvs::continued(&old, 32, None, DType::F32, 1).expect("a network");
    for (name, variable) in kept.parameters.iter() {
        let new = network.parameters.get(name).expect("the same names");
        let is_same = numbers::<f32>(variable) == numbers::<f32>(new);
        assert!(is_same || name.starts_with("denoiser."), "{name} changed");
        assert!(!is_same || !name.ends_with("enc.32x32_conv.weight"), "the denoiser is the old one");
    }
    // Its last layer is zero: where noise hides everything, the estimate is what the features show.
    let features = noise(&[1, 32, 32, 16], 4).to_dtype(DType::F32).expect("features");
    let noisy = (noise(&[1, 32, 32, 3], 3) * 80.0).and_then(|all| all.to_dtype(DType::F32)).expect("noise");
    let denoised = network.denoised(&noisy, &features, &[Preconditioning::at(80.0)]).expect("a picture");
    let shown = colours(&features).and_then(|all| all.to_dtype(DType::F64)).expect("colours");
    // c_skip is 4e-5 there, times noise of up to 4 deviations of 80.
    assert_close(&numbers::<f32>(&denoised), &shown, 5.0e-3);
}

#[test]
fn levels_scale_each_image_by_its_own() {
    let images = noise(&[2, 2, 2, 3], 5);
    let scaled = images.broadcast_mul(&each([2.0, -1.0].into_iter(), &images).expect("scales")).expect("images");
    let halves = |tensor: &Tensor, factor: f64, index| {
        (tensor.narrow(0, index, 1).expect("an image") * factor).and_then(|one| one.flatten_all()).expect("an image")
    };
    for (index, factor) in [(0, 2.0), (1, -1.0)] {
        let [found, expected] = [(&scaled, 1.0), (&images, factor)]
            .map(|(tensor, factor)| halves(tensor, factor, index).to_vec1::<f64>().expect("numbers"));
        assert_eq!(found, expected);
    }
}

#[test]
fn an_average_stands_in_for_the_parameters_and_goes_again() {
    let shape = TensorShape { name: "it".to_owned(), shape: vec![2] };
    let parameters = Parameters::new(&[shape], DType::F64, |_| Ok(vec![1.0, 2.0])).expect("parameters");
    let value = || parameters.get("it").and_then(|it| it.to_vec1::<f64>()).expect("numbers");
    let average = Average::new(&parameters, 0.999).expect("an average");
    parameters.iter().for_each(|(_, it)| it.set(&noise(&[2], 3)).expect("the same shape"));
    let last = value();
    average.step(&parameters, 0).expect("a step");
    // A tenth of the first values is left by the first step.
    let expected = [0.1 + 0.9 * last[0], 0.2 + 0.9 * last[1]];
    let during = average.during(&parameters, || Ok::<_, candle_core::Error>(value())).expect("work");
    assert!(during.iter().zip(expected).all(|(rate, expected)| (rate - expected).abs() < 1.0e-12), "{during:?}");
    assert_eq!(value(), last);
}

#[test]
fn noise_and_features_begin_in_groups_of_their_own() {
    let network = Genvs::new(Architecture::narrow(32, 16), DType::F32, 1).expect("a network");
    let taps = |name: &str| -> Vec<[usize; 2]> {
        let weights = network.parameters.get(&format!("denoiser.model.{name}.weight")).expect("a tensor");
        let [_, inputs, height, width] = *weights.dims() else { panic!("{:?}", weights.dims()) };
        let values: Vec<f32> = numbers(weights);
        let set = values.iter().enumerate().filter(|(_, value)| **value != 0.0);
        set.map(|(index, _)| index / (height * width)).map(|pair| [pair / inputs, pair % inputs]).collect()
    };
    // One input each; of 19, three are the noisy picture's.
    for name in ["enc.32x32_conv", "enc.16x16_aux_residual"] {
        let taps = taps(name);
        assert_eq!(taps.len(), 16, "{name}: {taps:?}");
        assert!(taps.iter().all(|[output, input]| (*output < 4) == (*input < 3)), "{name}: {taps:?}");
    }
    // The last shortcut takes what the first convolution kept, whose channels come last.
    let last: Vec<[usize; 2]> = (0..16).map(|channel| [channel, 16 + channel]).collect();
    assert_eq!(taps("dec.32x32_block1.skip"), last);
}
