//! Helpers of the training tests: toy photographs, random draws, comparison, and gradients compared with difference
//! quotients.

use super::scenes::TrainingScene;
use crate::scenes::{Orbit, sources, toy};
use candle_core::{DType, Device, Result, Tensor, Var};
use std::path::PathBuf;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::random::normal;
use viewfuse_field::learned::default_near_far;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::unit::RigUnit;

pub(super) fn orbit(side: u32) -> Orbit {
    let pinhole = Pinhole::new([1.025 * side as f32; 2], [0.5 * side as f32; 2], side, side).expect("intrinsics");
    Orbit { radius: 1.3, pinhole }
}

pub(super) fn photographs(count: u32, side: u32) -> SourceImages {
    let cameras = orbit(side).spiral(count, [-0.4, 0.8]).expect("cameras off the pole");
    sources(&toy::lorry(), &cameras)
}

/// A training scene of toy photographs.
pub(super) fn scene(side: u32, count: u32) -> TrainingScene {
    let sources = photographs(count, side);
    let pictures: Vec<image::RgbImage> = sources
        .images
        .iter()
        .map(|image| {
            let values = image.texels.iter().flat_map(|[r, g, b, a]| [r, g, b].map(|c| ((c + 1.0 - a) * 255.0) as u8));
            image::RgbImage::from_raw(side, side, values.collect()).expect("as many pixels")
        })
        .collect();
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    TrainingScene {
        path: PathBuf::from("made"),
        blocks: cameras.iter().map(|camera| camera.block(0)).collect(),
        bounds: vec![[2, 2, side - 3, side - 3]; count as usize],
        near_far: default_near_far(&cameras),
        unit: RigUnit::WORLD,
        cameras,
        pictures,
    }
}

pub(super) fn tensor(values: Vec<f32>, shape: &[usize], dtype: DType) -> Tensor {
    Tensor::from_vec(values, shape, &Device::Cpu).and_then(|tensor| tensor.to_dtype(dtype)).expect("a tensor")
}

/// All numbers of a tensor of this type.
pub(super) fn numbers<T: candle_core::WithDType>(tensor: &Tensor) -> Vec<T> {
    tensor.flatten_all().and_then(|all| all.to_vec1()).expect("numbers")
}

pub(super) fn noise(shape: &[usize], seed: u32) -> Tensor {
    let count: usize = shape.iter().product();
    tensor((0..count as u32).map(|index| normal([seed, 7], index, 0)).collect(), shape, DType::F64)
}

/// That every actual number is the expected one but for a share of the largest.
pub(super) fn assert_close(actual: &[f32], expected: &Tensor, share: f64) {
    let expected: Vec<f64> = numbers(expected);
    assert_eq!(actual.len(), expected.len());
    let largest = expected.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let spread = expected.iter().fold(0.0_f64, |most, value| most.max((value - expected[0]).abs()));
    assert!(spread > 0.01 * largest, "everything is {largest}");
    for (index, (actual, expected)) in actual.iter().zip(&expected).enumerate() {
        let error = (f64::from(*actual) - expected).abs();
        assert!(error <= share * largest, "number {index}: {actual} instead of {expected}, of at most {largest}");
    }
}

/// That the gradient of each variable is the slope along a random direction of it, by central differences. `error` is a
/// share of the slope, or of the largest slope where that is more than a thousand times as large.
pub(super) fn assert_gradients(variables: &[(&str, &Var)], step: f64, error: f64, value: impl Fn() -> Result<Tensor>) {
    let number = |tensor: Tensor| tensor.to_scalar::<f64>().expect("a number");
    let gradients = value().and_then(|value| value.backward()).expect("gradients");
    let gradients: Vec<(f64, f64)> = variables
        .iter()
        .enumerate()
        .map(|(index, (name, variable))| {
            let direction = noise(variable.dims(), 100 + index as u32);
            let gradient = gradients.get(variable).unwrap_or_else(|| panic!("{name} has no gradient"));
            let slope = (gradient * &direction).and_then(|products| products.sum_all()).map(number).expect("a slope");
            let kept = variable.copy().expect("a copy");
            let at = |distance: f64| {
                let moved = (&kept + (&direction * distance).expect("a direction")).expect("a place");
                variable.set(&moved).and_then(|()| value()).map(number).expect("a value")
            };
            let difference = (at(step) - at(-step)) / (2.0 * step);
            variable.set(&kept).expect("the same shape");
            (slope, difference)
        })
        .collect();
    let largest = gradients.iter().fold(0.0_f64, |most, (_, difference)| most.max(difference.abs()));
    assert!(largest > 0.0, "nothing changes anything");
    for ((name, _), (slope, difference)) in variables.iter().zip(&gradients) {
        let allowed = error * difference.abs().max(1.0e-3 * largest);
        assert!((slope - difference).abs() <= allowed, "{name}: gradient {slope}, slope {difference}");
    }
}

/// A number that every number of a tensor matters for, each in its own way.
pub(super) fn mixed(tensor: &Tensor) -> Result<Tensor> {
    (tensor * noise(tensor.dims(), 1))?.sum_all()
}

pub(super) fn variable(shape: &[usize], seed: u32) -> Var {
    Var::from_tensor(&noise(shape, seed)).expect("a variable")
}
