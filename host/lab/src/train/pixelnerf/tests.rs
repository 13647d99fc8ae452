//! The graph says what the renderer says, and its gradients are difference quotients.

use super::super::attention::{Attention, Embedding};
use super::super::batch::{Batch, SourceDraw, Targets};
use super::super::compositing::{coarse_depths, fine_depths, merged, points, weights as sample_weights};
use super::super::draw::Draw;
use super::super::gradient_check::{
    assert_close, assert_gradients, mixed, noise, numbers, orbit, photographs, scene, tensor, variable,
};
use super::super::images::{enlarge, max_pool};
use super::super::operations::{Apply, PointNetwork, PointNetworkSizes, Points, RectifiedDensity};
use super::{PixelNerf, PointInputs, SampleCounts};
use candle_core::{DType, Tensor, Var};
use std::sync::Arc;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_core::pose::Pose;
use viewfuse_core::rays::{CastBlock, RayPoint, TargetRay, cast_ray};
use viewfuse_device::cpu::Cpu;
use viewfuse_field::learned::default_near_far;
use viewfuse_field::pixelnerf::reference::Reference;
use viewfuse_field::pixelnerf::{Architecture, Pass, PixelNerf as Field, PixelNerfOptions};
use viewfuse_kernels::pixelnerf::EmbedBlock;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_weighting::attention::AttentionModel;
use viewfuse_weighting::sources::SourcePoses;

fn architecture(width: usize) -> Architecture {
    Architecture { has_fine: false, pixel_centre: 0.5, ..Architecture::small(width) }
}

/// A network with random numbers everywhere, also where training begins with zeros.
fn network(width: usize) -> PixelNerf {
    let network = PixelNerf::new(architecture(width), DType::F64, 3).expect("a network");
    for (index, (name, variable)) in network.parameters.iter().enumerate() {
        let share = if name.ends_with("fc_1.weight") || name.ends_with("bias") { 0.1 } else { 0.02 };
        let moved = (noise(variable.dims(), 50 + index as u32) * share).and_then(|noise| variable.as_tensor() + noise);
        variable.set(&moved.expect("numbers")).expect("the same shape");
    }
    network
}

/// Rays of a target through the middle of its picture.
fn rays(side: u32, angle: f32, near_far: [f32; 2], count: u32) -> Vec<TargetRay> {
    let camera = orbit(side).camera(angle, 0.35).expect("a camera off the pole").block(0);
    let cast = CastBlock { camera, near: near_far[0], far: near_far[1], pixel_centre: 0.5, along_axis: 0 };
    (0..count).map(|ray| cast_ray(&cast, side * side / 2 + ray)).collect()
}

#[test]
fn the_graph_is_the_renderers() {
    let network = network(32);
    let (tensors, metadata) = network.checkpoint().expect("tensors");
    let file = Checkpoint::in_memory("made", tensors, metadata);
    let field = Field::new(&file, PixelNerfOptions::default()).expect("a network");
    let sources = photographs(3, 64);
    let mut reference = Reference::new(&field, &Cpu, &sources).expect("sources");
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let blocks = vec![cameras.iter().map(|camera| camera.block(0)).collect::<Vec<CameraBlock>>()];
    let shown = |texel: &[f32; 4]| [0, 1, 2].map(|channel| 2.0 * (texel[channel] + 1.0 - texel[3]) - 1.0);
    let pictures: Vec<f32> = sources.images.iter().flat_map(|image| image.texels.iter().flat_map(shown)).collect();
    let pictures = tensor(pictures, &[3, 64, 64, 3], DType::F64);

    let weights = [0.5_f32, 0.2, 0.3];
    let rays = rays(64, 2.0, default_near_far(&cameras), 40);
    let depths = coarse_depths(&rays, 24, |ray, sample| ((7 * ray + 3 * sample) % 10) as f32 / 10.0);
    let places = points(&rays, &depths);
    let unit: Vec<RayPoint> = places.iter().map(|point| RayPoint { length: 1.0, ..*point }).collect();
    let said = reference.radiance(Pass::Coarse, &weights, &unit).expect("samples");

    let grids = network.grids(&pictures).expect("grids");
    let parameters = network.point_parameters().expect("parameters");
    let view_weights = tensor(weights.to_vec(), &[1, 3], DType::F64);
    let seen = PointInputs { cameras: &blocks, grids: &grids, weights: &view_weights, parameters: &parameters };
    let raw = network.raw(&seen, std::slice::from_ref(&places)).expect("samples");
    let colours = super::logistic(&raw.narrow(1, 0, 3).expect("colours")).expect("colours");
    let densities = raw.narrow(1, 3, 1).and_then(|raw| raw.relu()).expect("densities");
    let all = Tensor::cat(&[colours, densities], 1).expect("samples");
    // Some 20 layers, each a sum of at most 600 rounded products: 20 * 24 * 6e-8.
    assert_close(said.as_flattened(), &all, 2.9e-5);

    // And what is seen of the rays: exponentials are good to a few roundings more.
    let lengths = tensor(places.iter().map(|point| point.length).collect(), &[40, 24], DType::F64);
    let shares = sample_weights(&super::density(&raw, &lengths).expect("densities"), &lengths).expect("weights");
    let rendered = reference.render_rays(Pass::Coarse, &weights, &rays, &depths).expect("rays");
    assert_close(&rendered.weights, &shares, 1.0e-4);
}

#[test]
fn new_levels_change_nothing_at_first() {
    let old = network(8);
    let (tensors, metadata) = old.checkpoint().expect("tensors");
    let file = Checkpoint::in_memory("made", tensors, metadata);
    let same = PixelNerf::continued(&file, 1, DType::F64, 5).expect("a network");
    let new = PixelNerf::continued(&file, 4, DType::F64, 5).expect("a network");
    assert_eq!([&same, &new].map(|network| network.architecture.levels.len()), [2, 4]);
    assert!(new.parameters.get("encoder.model.layer4.0.conv1.weight").is_ok());
    let pictures = noise(&[1, 32, 32, 3], 7);
    let grids = |network: &PixelNerf| numbers::<f64>(&network.grids(&pictures).expect("grids"));
    assert_eq!(grids(&same), grids(&new));
    // The written file is read as it was trained.
    let (tensors, metadata) = new.checkpoint().expect("tensors");
    let read = Architecture::of(&Checkpoint::in_memory("made", tensors, metadata)).expect("a network");
    assert_eq!(read, new.architecture);
}

fn point_network(is_frozen: bool) -> PointNetwork {
    let sources = photographs(2, 8);
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let blocks: Vec<CameraBlock> = cameras.iter().map(|camera| camera.block(0)).collect();
    let near_far = default_near_far(&cameras);
    let places = |angle: f32| {
        let rays = rays(8, angle, near_far, 6);
        points(&rays, &coarse_depths(&rays, 12, |_, _| 0.5))
    };
    // One point lies behind the first view: the weights of the others count for it alone.
    let mut all = vec![places(2.0), places(1.0)];
    all[0][5].position = (cameras[0].pose.centre_world() * 1.5).into();
    let embed = EmbedBlock { point_count: 0, frequency_count: 2, frequency: 1.5 };
    let points = Arc::new(Points::new(&[blocks.clone(), blocks], &all, &embed, [4, 4], 0.5));
    let sizes = PointNetworkSizes { embedded_len: 18, width: 7, block_count: 4, injected_count: 2 };
    PointNetwork { sizes, points, node_count: 16, is_frozen }
}

#[test]
fn the_point_network_has_its_gradient() {
    let sizes = point_network(false).sizes;
    let grids = variable(&[4, 4, 4, 14], 20);
    let weights = Var::from_tensor(&tensor(vec![0.7, 0.3, 0.4, 0.6], &[2, 2], DType::F64)).expect("weights");
    let parameters = (noise(&[sizes.parameter_count()], 22) * 0.5).expect("numbers");
    let parameters = Var::from_tensor(&parameters).expect("parameters");
    let all = [("grids", &grids), ("weights", &weights), ("parameters", &parameters)];
    assert_gradients(&all, 1.0e-7, 1.0e-5, || {
        mixed(&grids.apply_op3(&weights, &parameters, Apply(point_network(false)))?)
    });
    // With the network left as it is, the weights' gradient is the same.
    let of_weights = |is_frozen: bool, grids: &Tensor, parameters: &Tensor| -> Vec<f64> {
        let raw = grids.apply_op3(&weights, parameters, Apply(point_network(is_frozen))).expect("samples");
        let gradients = mixed(&raw).and_then(|sum| sum.backward()).expect("gradients");
        numbers(gradients.get(&weights).expect("a gradient"))
    };
    // Only what is asked for may be differentiated then.
    let frozen = of_weights(true, &grids.as_detached_tensor(), &parameters.as_detached_tensor());
    assert_eq!(frozen, of_weights(false, &grids, &parameters));
}

#[test]
fn images_have_their_gradients() {
    for sides in [[4, 6], [5, 3]] {
        let [height, width] = sides;
        // Rectified, as in the trunk; away from zero, where there is no slope.
        let images =
            Var::from_tensor(&(noise(&[2, height, width, 3], 4).abs().expect("numbers") + 0.1).expect("numbers"));
        let images = images.expect("images");
        assert_gradients(&[("images", &images)], 1.0e-7, 1.0e-6, || mixed(&max_pool(&images)?));
        assert_gradients(&[("images", &images)], 1.0e-6, 1.0e-6, || mixed(&enlarge(&images, 9, 7)?));
        let pooled = max_pool(&images).expect("images");
        assert_eq!(pooled.dims(), [2, height.div_ceil(2), width.div_ceil(2), 3]);
    }
}

#[test]
fn a_density_at_zero_can_only_rise() {
    let densities = Var::from_tensor(&tensor(vec![2.0, -1.0, -1.0, 3.0], &[4], DType::F64)).expect("densities");
    let operation = RectifiedDensity { shape: vec![4] };
    let rectified = densities.apply_op1(Apply(operation)).expect("densities");
    assert_eq!(rectified.to_vec1::<f64>().expect("numbers"), [2.0, 0.0, 0.0, 3.0]);
    let by = tensor(vec![1.0, 1.0, -1.0, -1.0], &[4], DType::F64);
    let gradients = (rectified * by).and_then(|all| all.sum_all()?.backward()).expect("gradients");
    let found = gradients.get(&densities).expect("a gradient").to_vec1::<f64>().expect("numbers");
    assert_eq!(found, [1.0, 0.0, -0.1, -1.0]);
}

#[test]
fn weights_of_samples_have_their_gradients_and_sum_up() {
    let densities =
        Var::from_tensor(&(noise(&[3, 5], 8).abs().expect("numbers") + 0.1).expect("numbers")).expect("densities");
    let lengths = (noise(&[3, 5], 9).abs().expect("numbers") * 0.2).expect("numbers");
    assert_gradients(&[("densities", &densities)], 1.0e-7, 1.0e-6, || mixed(&sample_weights(&densities, &lengths)?));
    let weights = sample_weights(&densities, &lengths).and_then(|all| all.sum(1)?.to_vec1::<f64>()).expect("sums");
    let depths = (densities.as_tensor() * &lengths).and_then(|all| all.sum(1)?.to_vec1::<f64>()).expect("depths");
    for (sum, depth) in weights.iter().zip(depths) {
        assert!((sum - (1.0 - (-depth).exp())).abs() < 1.0e-12, "{sum} of {depth}");
    }
}

#[test]
fn fine_samples_lie_where_weights_are() {
    let rays = vec![TargetRay { near: 1.0, far: 2.0, ..TargetRay::default() }];
    let depths = coarse_depths(&rays, 4, |_, _| 0.5);
    assert_eq!(depths, [1.125, 1.375, 1.625, 1.875]);
    let fine = fine_depths(&rays, 4, &[0.0, 0.0, 1.0, 0.0], 8, |_, _| 0.5);
    let (order, all) = merged(std::slice::from_ref(&depths), std::slice::from_ref(&fine), 1);
    let all = &all[0];
    assert_eq!(all.len(), 12);
    assert!(all.is_sorted());
    assert_eq!(all.iter().filter(|depth| (1.5..1.75).contains(*depth)).count(), 9, "{all:?}");
    let both = [depths, fine].concat();
    assert_eq!(order.iter().map(|number| both[*number as usize]).collect::<Vec<f32>>(), *all);
}

#[test]
fn samples_of_two_passes_are_numbered_over_objects_and_rays() {
    // Two objects with two rays each, two samples a ray in the first pass and one in the second.
    let first = [vec![1.0, 3.0, 1.0, 3.0], vec![2.0, 4.0, 2.0, 4.0]];
    let second = [vec![2.0, 0.5], vec![5.0, 3.0]];
    let (order, depths) = merged(&first, &second, 2);
    assert_eq!(order, [0, 8, 1, 9, 2, 3, 4, 5, 10, 6, 11, 7]);
    assert_eq!(depths, [vec![1.0, 2.0, 3.0, 0.5, 1.0, 3.0], vec![2.0, 4.0, 5.0, 2.0, 3.0, 4.0]]);
}

#[test]
fn points_without_a_gradient_are_omitted_from_the_backward_pass() {
    let network = point_network(false);
    let count = 2 * network.points.point_count;
    let mut gradient = vec![0.0_f64; 4 * count];
    gradient[4 * 3 + 1] = 1.0;
    gradient[4 * 5] = -1.0e-3;
    gradient[4 * (count - 1) + 2] = 1.0e-9;
    // The mean is 1 / 144; a ten thousandth of it is above 1e-9 and below 1e-3.
    assert_eq!(network.with_gradient(&gradient), [vec![3, 5], vec![]]);
    gradient[4 * (count - 1) + 2] = f64::NAN;
    assert_eq!(network.with_gradient(&gradient)[1].len(), network.points.point_count, "NaN shows itself");
}

#[test]
fn the_loss_has_its_gradient() {
    let network = network(8);
    // No density at zero, where part of the gradient passes against the slope.
    let bias = network.parameters.iter().find(|(name, _)| name.ends_with("lin_out.bias")).expect("a bias").1;
    bias.set(&tensor(vec![0.1, -0.2, 0.3, 4.0], &[4], DType::F64)).expect("the same shape");
    let scenes = [scene(16, 5)];
    let draw = Draw { seed: 1, step: 2 };
    let batch = Batch::of(&scenes, &[0, 0], &draw, 9, SourceDraw::whole(2), Targets::One, DType::F64).expect("a batch");
    let weights = Var::from_tensor(&tensor(vec![0.7, 0.3, 0.4, 0.6], &[2, 2], DType::F64)).expect("weights");
    let value = || {
        let colours = network.render(&batch, &weights, &draw, SampleCounts { coarse: 6, fine: 0 })?;
        (colours - &batch.truth)?.sqr()?.mean_all()
    };
    let mut all: Vec<(&str, &Var)> = network.parameters.iter().collect();
    all.push(("weights", &weights));
    assert_gradients(&all, 1.0e-6, 1.0e-3, value);
}

#[test]
fn a_batch_is_a_function_of_seed_and_step() {
    let scenes = [scene(16, 6), scene(16, 7)];
    let batch = |step: u32| {
        let draw = Draw { seed: 5, step };
        Batch::of(&scenes, &[0, 1], &draw, 20, SourceDraw::whole(3), Targets::Many, DType::F32).expect("a batch")
    };
    let truth = |step: u32| numbers::<f32>(&batch(step).truth);
    assert_eq!(truth(1), truth(1));
    assert_ne!(truth(1), truth(2));
    for step in 0..50 {
        let batch = batch(step);
        for (sources, rays) in batch.sources.iter().zip(&batch.rays) {
            for ray in rays {
                // A ray begins where its target stands: at no source.
                assert!(sources.iter().all(|source| source.pose.centre_world().to_array() != ray.origin));
            }
        }
    }
}

#[test]
fn attention_is_the_cores_and_has_its_gradient() {
    let cameras: Vec<Pose> = photographs(5, 8).images.iter().map(|image| image.camera.pose).collect();
    for embedding in [Embedding::Fourier, Embedding::Flat] {
        let attention = Attention::new(embedding, DType::F64, 3).expect("parameters");
        // Away from where training begins, where all weights are nearly equal.
        for (index, (_, variable)) in attention.parameters.iter().enumerate() {
            let moved =
                (noise(variable.dims(), 60 + index as u32) * 0.2).and_then(|noise| variable.as_tensor() + noise);
            variable.set(&moved.expect("numbers")).expect("the same shape");
        }
        let (sources, target) = (&cameras[..4], cameras[4]);
        let weights = attention.weights(&[sources.to_vec()], &[target]).expect("weights");
        let values = attention.parameters.values().expect("values");
        let mut read = |name: &str, _: &[usize]| -> std::result::Result<Vec<f32>, ()> {
            let found = values.iter().find(|(tensor, _)| tensor.name == name);
            Ok(found.expect("a tensor of this name").1.clone())
        };
        let model = match embedding {
            Embedding::Fourier => AttentionModel::fourier(&mut read),
            Embedding::Flat => AttentionModel::flat(&mut read),
        };
        let poses = SourcePoses::new(sources).expect("sources");
        let expected = model.expect("a model").weigh(&poses, &target);
        // Logits of some 10 are off by roundings of their products' sizes: 10 * 2^-20.
        assert_close(&expected.values()[..4], &weights, 1.0e-5);
        let all: Vec<(&str, &Var)> = attention.parameters.iter().collect();
        assert_gradients(&all, 1.0e-6, 1.0e-4, || mixed(&attention.weights(&[sources.to_vec()], &[target])?));
    }
}
