//! Volumes from pictures, as [`viewfuse_field::genvs`] encodes them: a residual trunk at output stride 16, spatial
//! pyramid pooling, and a decoder up to the pictures' own size.

use super::super::images::{dims4, max_pool};
use super::super::operations::Window;
use super::layers::{Layers, convolved};
use candle_core::{Result, Tensor};
use viewfuse_field::genvs::{ASPP_RATES, Encoder};
use viewfuse_nn::resnet::has_shortcut;

/// Volumes `[image][row][column][depth and feature]` of pictures `[image][row][column][3]` in `[-1, 1]`.
pub(super) fn volumes(layers: Layers<'_>, sizes: &Encoder, pictures: &Tensor) -> Result<Tensor> {
    let half = layers.plain("encoder.conv1", pictures, Window { size: 7, stride: 2, padding: 3, dilation: 1 }, true)?;
    let [quarter, eighth, sixteenth, deepest] = trunk(layers, sizes, &half)?;
    let pyramid = pyramid(layers, &deepest)?;
    let x = stage(layers, "decoder.modified_up.stage1", &Tensor::cat(&[&sixteenth, &deepest, &pyramid], 3)?)?;
    let x = rise(layers, "decoder.modified_up", [1, 2], &x, &eighth)?;
    let x = rise(layers, "decoder.modified_up", [2, 3], &x, &quarter)?;
    let near = layers.plain("decoder.block1.0", &quarter, Window::same(1), true)?;
    let x = layers.separable("decoder.block2.0", &Tensor::cat(&[&x, &near], 3)?, 1)?;
    let x = rise(layers, "volume_head.up", [1, 1], &x, &half)?;
    let x = rise(layers, "volume_head.up", [2, 2], &x, pictures)?;
    // Published: [feature][depth]. A look-up reads all features of a node, so here they are adjacent.
    let Encoder { feature_count, volume_depth, .. } = *sizes;
    let reordered = |leaf: &str| -> Result<Tensor> {
        let given = layers.get(&format!("volume_head.reshape_conv.{leaf}"))?;
        given.reshape((feature_count, volume_depth, ()))?.transpose(0, 1)?.contiguous()
    };
    let weights = reordered("weight")?.reshape((feature_count * volume_depth, (), 1, 1))?;
    convolved(&x, [&weights, &reordered("bias")?.flatten_all()?], Window::same(1), true)
}

/// The four levels.
fn trunk(layers: Layers<'_>, sizes: &Encoder, stem: &Tensor) -> Result<[Tensor; 4]> {
    let mut image = max_pool(stem)?;
    let mut channels = sizes.stem_channels;
    let mut levels = Vec::new();
    for (level, sizes) in (1..).zip(&sizes.levels) {
        for block in 0..sizes.block_count {
            let name = format!("encoder.layer{level}.{block}");
            let stride = if matches!(level, 2 | 3) && block == 0 { 2 } else { 1 };
            // The fourth level would halve the image once more; its windows are dilated instead.
            let dilation = if level == 4 { 2 } else { 1 };
            let window = Window { padding: dilation, dilation, ..Window::same(3) };
            let inside = layers.plain(&format!("{name}.conv1"), &image, Window { stride, ..window }, true)?;
            let inside = layers.plain(&format!("{name}.conv2"), &inside, window, false)?;
            let beside = match block == 0 && has_shortcut(level, channels, sizes.channels) {
                true => {
                    let window = Window { stride, ..Window::same(1) };
                    layers.plain(&format!("{name}.downsample.0"), &image, window, false)?
                }
                false => image,
            };
            image = (inside + beside)?.relu()?;
            channels = sizes.channels;
        }
        levels.push(image.clone());
    }
    match <[Tensor; 4]>::try_from(levels) {
        Ok(levels) => Ok(levels),
        Err(levels) => candle_core::bail!("a trunk of {} levels instead of 4", levels.len()),
    }
}

/// Convolutions of several dilations and the mean of the whole image, concatenated, then a 1x1 convolution.
fn pyramid(layers: Layers<'_>, image: &Tensor) -> Result<Tensor> {
    let pyramid = "decoder.aspp.0";
    let [count, height, width, _] = dims4(image)?;
    let mut wide = vec![layers.plain(&format!("{pyramid}.convs.0.0"), image, Window::same(1), true)?];
    for (branch, dilation) in (1..).zip(ASPP_RATES) {
        wide.push(layers.separable(&format!("{pyramid}.convs.{branch}.0"), image, dilation)?);
    }
    let mean = image.mean_keepdim((1, 2))?;
    let pooled = layers.plain(&format!("{pyramid}.convs.4.1"), &mean, Window::same(1), true)?;
    let channels = pooled.dim(3)?;
    wide.push(pooled.broadcast_as((count, height, width, channels))?.contiguous()?);
    let mixed = layers.plain(&format!("{pyramid}.project.0"), &Tensor::cat(&wide, 3)?, Window::same(1), true)?;
    layers.separable("decoder.aspp.1", &mixed, 1)
}

/// A step of the decoder: the upsampled image, concatenated behind the skip connection's, through a stage.
fn rise(layers: Layers<'_>, name: &str, [up, next]: [usize; 2], image: &Tensor, skip: &Tensor) -> Result<Tensor> {
    let doubled = layers.doubled(&format!("{name}.upconv{up}.0"), image)?;
    stage(layers, &format!("{name}.stage{next}"), &Tensor::cat(&[skip, &doubled], 3)?)
}

/// Three convolutions.
fn stage(layers: Layers<'_>, name: &str, image: &Tensor) -> Result<Tensor> {
    let first = layers.convolved(&format!("{name}.0"), image, Window::same(3), true)?;
    let second = layers.convolved(&format!("{name}.2"), &first, Window::same(3), true)?;
    layers.convolved(&format!("{name}.4"), &second, Window::same(3), true)
}
