//! Steps of training, with Adam (Kingma and Ba, ICLR 2015).

use super::candidates::Candidates;
use super::network::{Network, Parts};
use candle_core::{Device, Result, Tensor};
use std::f64::consts::PI;
use viewfuse_core::random::threefry_2x32;

/// Pictures of a step, and pixels of each.
const PICTURES: usize = 3;
const PIXELS: u32 = 192;
/// Learning rate after the first steps; it falls along a cosine.
const RATE: f64 = 3.0e-3;
const WARM_UP: f64 = 20.0;
/// Decay of the means of gradients and of their squares.
const DECAYS: [f64; 2] = [0.9, 0.99];

/// How a refinement is trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Learning {
    /// Cost of the mean square of the logits, as a share of the field's error.
    pub(crate) caution: f64,
    /// Steps.
    pub(crate) steps: u32,
    /// Of the parameters and all draws.
    pub(crate) seed: u64,
}

/// Trains on pictures. The loss is the mean square error as a share of the field's, so that each picture counts alike.
pub(crate) fn train(parts: Parts, learning: &Learning, pictures: &[&Candidates]) -> Result<Network> {
    let network = Network::new(parts, learning.seed)?;
    let zeros = || network.variables.iter().map(|variable| variable.zeros_like()).collect::<Result<Vec<_>>>();
    let (mut means, mut squares) = (zeros()?, zeros()?);
    for step in 0..learning.steps {
        let gradients = loss(&network, learning, pictures, step)?.backward()?;
        let progress = f64::from(step) / f64::from(learning.steps);
        let rate = RATE * (f64::from(step + 1) / WARM_UP).min(1.0) * 0.5 * (1.0 + (PI * progress).cos());
        let [first, second] = DECAYS.map(|decay| 1.0 - decay.powi(step as i32 + 1));
        for (index, variable) in network.variables.iter().enumerate() {
            // Without the graph that it was computed by, which the means would keep alive.
            let Some(gradient) = gradients.get(variable).map(Tensor::detach) else { continue };
            means[index] = ((&means[index] * DECAYS[0])? + (&gradient * (1.0 - DECAYS[0]))?)?;
            squares[index] = ((&squares[index] * DECAYS[1])? + (gradient.sqr()? * (1.0 - DECAYS[1]))?)?;
            let root = ((&squares[index] / second)?.sqrt()? + 1.0e-8)?;
            variable.set(&(variable.as_tensor() - ((&means[index] * (rate / first))? / root)?)?)?;
        }
    }
    Ok(network)
}

/// The loss of a step.
pub(crate) fn loss(network: &Network, learning: &Learning, pictures: &[&Candidates], step: u32) -> Result<Tensor> {
    let draw = |picture: usize, index: u32| {
        let word = threefry_2x32([learning.seed as u32, step], [picture as u32, index])[0];
        move |count: usize| ((u64::from(word) * count as u64) >> 32) as u32
    };
    let mut sum = Tensor::zeros((), candle_core::DType::F32, &Device::Cpu)?;
    for place in 0..PICTURES {
        let picture = pictures[draw(place, u32::MAX)(pictures.len()) as usize];
        let indices: Vec<u32> = (0..PIXELS).map(|index| draw(place, index)(picture.seen.len())).collect();
        let indices: Vec<u32> = indices.into_iter().filter(|pixel| picture.seen[*pixel as usize]).collect();
        let count = indices.len();
        let pixels = picture.pixels.select(&Tensor::from_vec(indices, count, &Device::Cpu)?)?;
        let refined = network.refine(&pixels)?;
        let error = ((refined.colours - &pixels.truth)?.sqr()?.mean_all()? / picture.error)?;
        sum = ((sum + error)? + (refined.square * learning.caution)?)?;
    }
    sum / PICTURES as f64
}
