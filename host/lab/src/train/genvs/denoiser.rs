//! The denoiser's network, as [`viewfuse_field::genvs`] runs it: a U-Net of residual blocks with group norm and
//! self-attention, conditioned on the noise level, whose encoder receives the halved input again at every level.

use super::super::images::dims4;
use super::super::operations::Window;
use super::layers::{Layers, convolved};
use candle_core::{D, Result, Tensor};
use std::f64::consts::FRAC_1_SQRT_2;
use viewfuse_core::math::{exp, ln, sin_cos};
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_field::genvs::{Architecture, Block, COLOUR_CHANNELS, Denoiser, DenoiserStep, Resampling};
use viewfuse_nn::checkpoint::TensorShape;

/// The prefix of its tensors' names; the architecture's own names have it already.
const PREFIX: &str = "denoiser.model.";
/// Channels of a group of the norms, except in very wide layers.
const GROUP: usize = 4;
/// Ratio of the highest frequency of the embedding to the lowest.
const FREQUENCY_RATIO: f32 = 10_000.0;

/// The network's output `[image][row][column][3]` for its scaled input `[image][row][column][channel]` and the noise
/// levels of the images as [`viewfuse_core::schedule::Preconditioning::noise`].
pub(super) fn run(layers: Layers<'_>, sizes: &Denoiser, inputs: &Tensor, levels: &[f32]) -> Result<Tensor> {
    let waves: Vec<f32> = levels.iter().flat_map(|level| waves(*level, sizes.noise_channels)).collect();
    let waves = Tensor::from_vec(waves, (levels.len(), sizes.noise_channels), inputs.device())?;
    let embedded = silu(&layers.linear(&format!("{PREFIX}map_layer0"), &waves.to_dtype(inputs.dtype())?)?)?;
    let embedded = silu(&layers.linear(&format!("{PREFIX}map_layer1"), &embedded)?)?;
    let mut kept: Vec<Tensor> = Vec::new();
    let mut x = inputs.clone();
    let mut residual = inputs.clone();
    for step in sizes.down() {
        match step {
            DenoiserStep::Convolution(layer) => x = layers.convolved(&layer.name, &x, Window::same(3), false)?,
            DenoiserStep::Block(layer) => x = block(layers, &layer, &x, &embedded)?,
            DenoiserStep::Residual(layer) => {
                residual = halved(&layers.convolved(&layer.name, &residual, Window::same(3), false)?)?;
                x = ((residual + x)? * FRAC_1_SQRT_2)?;
                residual = x.clone();
                kept.pop();
            }
        }
        kept.push(x.clone());
    }
    for level in sizes.up() {
        if level.joined_channels > 0 {
            let Some(joined) = kept.pop() else { candle_core::bail!("{} has nothing to join", level.name) };
            x = Tensor::cat(&[x, joined], 3)?;
        }
        x = block(layers, &level, &x, &embedded)?;
    }
    let (norm, convolution) = sizes.exit();
    layers.convolved(&convolution.name, &layers.normalised(&norm, &x, true)?, Window::same(3), false)
}

/// Initial values of layers that copy their inputs: the first convolution, those of the halved inputs, and the
/// shortcuts of blocks; `None` for other tensors.
///
/// As published, the features are scaled down with the noisy picture, at the largest noise level to an eightieth,
/// beside noise of variance 1. If layers mix both at random, short runs do not learn to use the features. Here noise
/// and features start in separate groups of [`GROUP`] channels, and stay so on all shortcuts; the last block's shortcut
/// copies the inputs. The first group of features, which has the colours, starts large enough to remain after the last
/// norm at the largest level, so that the last convolution can read the colours from the first step on.
pub(super) fn handed_on(architecture: &Architecture, tensor: &TensorShape) -> Option<Vec<f32>> {
    let sizes = architecture.denoiser.as_ref()?;
    let name = tensor.name.strip_suffix(".weight")?;
    let &[outputs, inputs, height, width] = tensor.shape.as_slice() else { return None };
    let blocks = sizes.up();
    let last = blocks.last()?;
    let is_last = name.strip_suffix(".skip") == Some(&last.name);
    let is_convolution = name.ends_with("_conv") && !name.ends_with("_aux_conv") || name.ends_with("_aux_residual");
    let takes_inputs = is_convolution && inputs == sizes.in_channels && outputs > GROUP;
    if !(is_convolution || name.ends_with(".skip")) {
        return None;
    }
    let largest = NoiseSchedule::published().level(0, 2);
    let mut values = vec![0.0; outputs * inputs * height * width];
    for output in 0..outputs {
        let (input, value) = match () {
            () if is_last => (inputs - last.joined_channels + output % last.joined_channels, 1.0),
            () if takes_inputs && output < GROUP => (output % COLOUR_CHANNELS, 1.0),
            () if takes_inputs => {
                let feature = (output - GROUP) % (inputs - COLOUR_CHANNELS);
                (COLOUR_CHANNELS + feature, if feature < GROUP { largest } else { 1.0 })
            }
            () => (output % inputs, 1.0),
        };
        values[((output * inputs + input) * height + height / 2) * width + width / 2] = value;
    }
    Some(values)
}

fn block(layers: Layers<'_>, sizes: &Block, image: &Tensor, embedded: &Tensor) -> Result<Tensor> {
    let name = |leaf: &str| format!("{}.{leaf}", sizes.name);
    let resampled = |image: Tensor| match sizes.resampling {
        Resampling::None => Ok(image),
        Resampling::Down => halved(&image),
        Resampling::Up => doubled(&image),
    };
    let inside = resampled(layers.normalised(&name("norm0"), image, true)?)?;
    let biases = layers.linear(&name("affine"), embedded)?.broadcast_add(&layers.get(&name("conv0.bias"))?)?;
    let inside = convolved(&inside, [&layers.get(&name("conv0.weight"))?, &biases], Window::same(3), false)?;
    let inside = layers.normalised(&name("norm1"), &inside, true)?;
    let inside = layers.convolved(&name("conv1"), &inside, Window::same(3), false)?;
    let beside = match sizes.has_skip() {
        // Channels are mixed at the lower resolution: doubling and halving do not depend on channels.
        true if sizes.resampling == Resampling::Up => {
            resampled(layers.convolved(&name("skip"), image, Window::same(1), false)?)?
        }
        true => layers.convolved(&name("skip"), &resampled(image.clone())?, Window::same(1), false)?,
        false => image.clone(),
    };
    let sum = ((inside + beside)? * FRAC_1_SQRT_2)?;
    if sizes.has_attention { attended(layers, sizes, &sum) } else { Ok(sum) }
}

/// The image plus its self-attention.
fn attended(layers: Layers<'_>, sizes: &Block, image: &Tensor) -> Result<Tensor> {
    let name = |leaf: &str| format!("{}.{leaf}", sizes.name);
    let [count, height, width, channels] = dims4(image)?;
    let normalised = layers.normalised(&name("norm2"), image, false)?;
    // Published: query, key and value of a channel are adjacent.
    let triples = layers.convolved(&name("qkv"), &normalised, Window::same(1), false)?;
    let triples = triples.reshape((count, height * width, channels, 3))?;
    let part = |index: usize| triples.narrow(3, index, 1)?.squeeze(3)?.contiguous();
    let (queries, keys, values) = (part(0)?, part(1)?, part(2)?);
    let scores = (queries.matmul(&keys.t()?)? * (channels as f64).powf(-0.5))?;
    let shares = scores.broadcast_sub(&scores.max_keepdim(D::Minus1)?.detach())?.exp()?;
    let shares = shares.broadcast_div(&shares.sum_keepdim(D::Minus1)?)?;
    let attended = shares.matmul(&values)?.reshape((count, height, width, channels))?;
    let attended = layers.convolved(&name("proj"), &attended, Window::same(1), false)?;
    (attended + image)? * FRAC_1_SQRT_2
}

/// The mean of every 2x2 pixels.
fn halved(images: &Tensor) -> Result<Tensor> {
    let [count, height, width, channels] = dims4(images)?;
    let pairs = images.reshape((count, height / 2, 2, width * channels))?;
    let rows = (pairs.narrow(2, 0, 1)? + pairs.narrow(2, 1, 1)?)?;
    let pairs = rows.reshape((count, height / 2, width / 2, 2, channels))?;
    let sums = (pairs.narrow(3, 0, 1)? + pairs.narrow(3, 1, 1)?)?;
    sums.squeeze(3)? * 0.25
}

/// Every pixel four times.
fn doubled(images: &Tensor) -> Result<Tensor> {
    let [count, height, width, channels] = dims4(images)?;
    let pixels = images.reshape((count * height, 1, width, 1, channels))?;
    // Side by side, then above one another.
    let wide = Tensor::cat(&[&pixels, &pixels], 3)?.reshape((count * height, 1, 2 * width * channels))?;
    Tensor::cat(&[&wide, &wide], 1)?.reshape((count, 2 * height, 2 * width, channels))
}

/// `x / (1 + e^-x)`.
fn silu(values: &Tensor) -> Result<Tensor> {
    values / (values.neg()?.exp()? + 1.0)?
}

/// Sines, then cosines, of the number times frequencies from 1 down to 1 / [`FREQUENCY_RATIO`], evenly spaced in their
/// logarithms, both included.
fn waves(noise: f32, count: usize) -> Vec<f32> {
    let half = count / 2;
    let last = half.saturating_sub(1).max(1) as f32;
    let pair = |index: usize| sin_cos(noise * exp(-ln(FREQUENCY_RATIO) * (index as f32 / last)));
    let (sines, cosines): (Vec<f32>, Vec<f32>) = (0..half).map(pair).unzip();
    [sines, cosines].concat()
}
