//! From a source image to its volume: a residual trunk at output stride 16, spatial pyramid pooling, and a decoder with
//! learned upsampling and skip connections up to the image's own size.
//!
//! Source: `genvs_encoder.py`; DeepLabV3+ (Chen et al. 2018) on ResNet-34, its batch norms and dropout switched off.

use super::architecture::ASPP_RATES;
use super::image::{Image, Scratch, Size, enlarge};
use super::layers::{Addend, Convolution, Depthwise, Loader, Transposed, Way};
use crate::FieldError;
use std::ops::Range;
use viewfuse_core::network::normalise::MeanBlock;
use viewfuse_core::network::resample::PoolBlock;
use viewfuse_device::Device;

/// Rows and columns of images are multiples of this: the trunk's output stride.
pub(super) const SIDE_STEP: u32 = 16;

/// A basic block: two convolutions, and one beside them where sizes change.
struct Block<D: Device> {
    first: Convolution<D>,
    second: Convolution<D>,
    beside: Option<Convolution<D>>,
}

/// A convolution of every channel by itself, then one of single pixels.
struct Separable<D: Device> {
    depthwise: Depthwise<D>,
    pointwise: Convolution<D>,
}

/// Three convolutions.
type Stage<D> = [Convolution<D>; 3];

/// The encoder's layers on a device.
pub(super) struct Encoder<D: Device> {
    stem: Convolution<D>,
    levels: Vec<Vec<Block<D>>>,
    pyramid_plain: Convolution<D>,
    pyramid_dilated: Vec<Separable<D>>,
    pyramid_pooled: Convolution<D>,
    pyramid_project: Convolution<D>,
    pyramid_last: Separable<D>,
    deep: [Stage<D>; 3],
    deep_up: [Transposed<D>; 2],
    near: Convolution<D>,
    fused: Separable<D>,
    head_up: [Transposed<D>; 2],
    head: [Stage<D>; 2],
    volume: Convolution<D>,
}

impl<D: Device> Encoder<D> {
    /// Reads it, for images of at least `side` rows and columns. `features` is how many a node of the volume has.
    ///
    /// # Errors
    /// If the checkpoint cannot be read, or the device has no room.
    pub(super) fn load(loader: &Loader<'_, D>, side: u32, features: usize) -> Result<Encoder<D>, FieldError<D::Error>> {
        let block = |name: String, side: u32| {
            let beside = format!("{name}.downsample.0");
            // The first convolution may step by 2, or have gaps: no convolution of a large image.
            Ok::<_, FieldError<D::Error>>(Block {
                first: loader.convolution(&format!("{name}.conv1"), side)?,
                second: loader.convolution(&format!("{name}.conv2"), side)?,
                beside: loader.has(&format!("{beside}.weight")).then(|| loader.convolution(&beside, 0)).transpose()?,
            })
        };
        let level = |level: usize| {
            // Only the first level has windows at every pixel, without gaps, throughout.
            let side = if level == 1 { side / 4 } else { 0 };
            let names = (0..).map(|index| format!("encoder.layer{level}.{index}"));
            names.take_while(|name| loader.has(&format!("{name}.conv1.weight"))).map(|name| block(name, side)).collect()
        };
        let separable = |name: &str| {
            Ok::<_, FieldError<D::Error>>(Separable {
                depthwise: loader.depthwise(&format!("{name}.0"))?,
                pointwise: loader.convolution(&format!("{name}.1"), 0)?,
            })
        };
        let stage = |name: &str, side: u32| {
            let layer = |index: usize| loader.convolution(&format!("{name}.{index}"), side);
            Ok::<_, FieldError<D::Error>>([layer(0)?, layer(2)?, layer(4)?])
        };
        let (up, head) = ("decoder.modified_up", "volume_head.up");
        let transposed = |name: &str| loader.transposed_convolution(&format!("{name}.0"));
        let pyramid = "decoder.aspp.0";
        Ok(Encoder {
            stem: loader.convolution("encoder.conv1", 0)?,
            levels: (1..=4).map(level).collect::<Result<_, _>>()?,
            pyramid_plain: loader.convolution(&format!("{pyramid}.convs.0.0"), 0)?,
            pyramid_dilated: (1..=ASPP_RATES.len())
                .map(|index| separable(&format!("{pyramid}.convs.{index}.0")))
                .collect::<Result<_, _>>()?,
            pyramid_pooled: loader.convolution(&format!("{pyramid}.convs.4.1"), 0)?,
            pyramid_project: loader.convolution(&format!("{pyramid}.project.0"), 0)?,
            pyramid_last: separable("decoder.aspp.1")?,
            deep: [
                stage(&format!("{up}.stage1"), side / 16)?,
                stage(&format!("{up}.stage2"), side / 8)?,
                stage(&format!("{up}.stage3"), side / 4)?,
            ],
            deep_up: [transposed(&format!("{up}.upconv1"))?, transposed(&format!("{up}.upconv2"))?],
            near: loader.convolution("decoder.block1.0", 0)?,
            fused: separable("decoder.block2.0")?,
            head_up: [transposed(&format!("{head}.upconv1"))?, transposed(&format!("{head}.upconv2"))?],
            head: [stage(&format!("{head}.stage1"), side / 2)?, stage(&format!("{head}.stage2"), side)?],
            volume: loader.changed_convolution("volume_head.reshape_conv", 0, |window| {
                // Published: [feature][depth]. A point looks up all features of a node: they lie together.
                let depths = window.columns / features;
                window.reordered(|column| column % features * depths + column / features)
            })?,
        })
    }

    /// What the last layer makes a volume of, for an image (red, green, blue in `[-1, 1]`) whose rows and columns are
    /// multiples of [`SIDE_STEP`].
    ///
    /// # Errors
    /// If the device is lost or has no room.
    pub(super) fn encode(
        &self,
        device: &D,
        scratch: &mut Scratch<'_, D>,
        image: &[f32],
        size: Size,
    ) -> Result<Image<D>, D::Error> {
        let given = scratch.uploaded(size, image)?;
        let stem = Way { stride: 2, padding: Some(3), relu: true, ..Way::PLAIN };
        let half = self.stem.run(scratch, device, stem, &given, Addend::None)?;
        let [quarter, eighth, sixteenth, deepest] = self.trunk(device, scratch, &half)?;
        let pyramid = self.pyramid(device, scratch, &deepest)?;
        let wide = side_by_side(device, scratch, &[&sixteenth, &deepest, &pyramid])?;
        for image in [sixteenth, deepest, pyramid] {
            scratch.give(image);
        }
        let [stage1, stage2, stage3] = &self.deep;
        let x = run_stage(device, scratch, stage1, wide)?;
        let x = rise(device, scratch, &self.deep_up[0], stage2, x, &eighth)?;
        let x = rise(device, scratch, &self.deep_up[1], stage3, x, &quarter)?;
        let near = self.near.run(scratch, device, Way::RELU, &quarter, Addend::None)?;
        let wide = side_by_side(device, scratch, &[&x, &near])?;
        let fused = run_separable(device, scratch, &self.fused, &wide)?;
        for image in [x, near, wide, eighth, quarter] {
            scratch.give(image);
        }
        let x = rise(device, scratch, &self.head_up[0], &self.head[0], fused, &half)?;
        scratch.give(half);
        let x = rise(device, scratch, &self.head_up[1], &self.head[1], x, &given)?;
        scratch.give(given);
        Ok(x)
    }

    /// Size of the volume `[row][column][depth][feature]` of an image: depths and features are its channels.
    pub(super) fn volume_size(&self, image: Size) -> Size {
        image.with_channels(self.volume.channels)
    }

    /// The last layer: some rows of the volume from what [`Encoder::encode`] made.
    ///
    /// # Errors
    /// If the device is lost.
    pub(super) fn fill_rows(
        &self,
        device: &D,
        deep: &Image<D>,
        rows: Range<u32>,
        volume: &mut Image<D>,
    ) -> Result<(), D::Error> {
        self.volume.run_rows(device, Way::RELU, deep, rows, volume)
    }

    /// The trunk's four levels.
    fn trunk(&self, device: &D, scratch: &mut Scratch<'_, D>, stem: &Image<D>) -> Result<[Image<D>; 4], D::Error> {
        let mut x = pooled(device, scratch, stem)?;
        let mut levels = Vec::new();
        for (level, blocks) in self.levels.iter().enumerate() {
            for (index, block) in blocks.iter().enumerate() {
                let stride = if matches!(level, 1 | 2) && index == 0 { 2 } else { 1 };
                // The fourth level would halve the image once more; its windows have gaps instead.
                let way = Way { stride, dilation: if level == 3 { 2 } else { 1 }, ..Way::RELU };
                let next = run_block(device, scratch, block, way, &x)?;
                // The first block of a level reads the level before.
                if index > 0 || level == 0 {
                    scratch.give(x);
                } else {
                    levels.push(x);
                }
                x = next;
            }
        }
        levels.push(x);
        Ok(<[Image<D>; 4]>::try_from(levels).unwrap_or_else(|_| unreachable!("a level for each of four")))
    }

    /// Windows of several reaches and the mean of the whole image, side by side, mixed.
    fn pyramid(&self, device: &D, scratch: &mut Scratch<'_, D>, image: &Image<D>) -> Result<Image<D>, D::Error> {
        let channels = self.pyramid_plain.channels;
        let branch_count = self.pyramid_dilated.len() as u32 + 2;
        let part = image.size.with_channels(channels);
        let wide = scratch.image(part.with_channels(channels * branch_count))?;
        let mut wide = wide.seen_as(0, channels);
        self.pyramid_plain.run_into(device, Way::RELU, image, Addend::None, &mut wide)?;
        for (branch, (separable, dilation)) in (1..).zip(self.pyramid_dilated.iter().zip(ASPP_RATES)) {
            wide = wide.seen_as(branch * channels, channels);
            let inside =
                separable.depthwise.run(scratch, device, Way { dilation: dilation as u32, ..Way::PLAIN }, image)?;
            separable.pointwise.run_into(device, Way::RELU, &inside, Addend::None, &mut wide)?;
            scratch.give(inside);
        }
        let mut mean = scratch.image(Size { height: 1, width: 1, channels: image.size.channels })?;
        let block = MeanBlock { pixel_count: image.size.pixel_count(), channels: image.size.channels };
        device.channel_means(&block, &image.values, &mut mean.values)?;
        let pooled = self.pyramid_pooled.run(scratch, device, Way::RELU, &mean, Addend::None)?;
        enlarge(device, &pooled, (branch_count - 1) * channels, &mut wide)?;
        let wide = wide.seen_as(0, channels * branch_count);
        let mixed = self.pyramid_project.run(scratch, device, Way::RELU, &wide, Addend::None)?;
        let last = run_separable(device, scratch, &self.pyramid_last, &mixed)?;
        for image in [mean, pooled, wide, mixed] {
            scratch.give(image);
        }
        Ok(last)
    }
}

/// Images of one size in a new one, one's channels behind the other's.
fn side_by_side<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    images: &[&Image<D>],
) -> Result<Image<D>, D::Error> {
    let channels = images.iter().map(|image| image.size.channels).sum();
    let mut wide = scratch.image(images[0].size.with_channels(channels))?;
    let mut first_channel = 0;
    for image in images {
        // To the same size: a copy.
        enlarge(device, image, first_channel, &mut wide)?;
        first_channel += image.size.channels;
    }
    Ok(wide)
}

/// A step up: the image doubled by a transposed convolution, beside the skipped one, through a stage.
fn rise<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    up: &Transposed<D>,
    stage: &Stage<D>,
    image: Image<D>,
    skip: &Image<D>,
) -> Result<Image<D>, D::Error> {
    let (own, above) = (skip.size.channels, up.channels);
    let mut wide = scratch.image(skip.size.with_channels(own + above))?;
    enlarge(device, skip, 0, &mut wide)?;
    let mut wide = wide.seen_as(own, above);
    up.run_into(device, &image, &mut wide)?;
    scratch.give(image);
    run_stage(device, scratch, stage, wide.seen_as(0, own + above))
}

fn run_stage<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    stage: &Stage<D>,
    mut image: Image<D>,
) -> Result<Image<D>, D::Error> {
    for layer in stage {
        let next = layer.run(scratch, device, Way::RELU, &image, Addend::None)?;
        scratch.give(image);
        image = next;
    }
    Ok(image)
}

fn run_separable<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    separable: &Separable<D>,
    image: &Image<D>,
) -> Result<Image<D>, D::Error> {
    let inside = separable.depthwise.run(scratch, device, Way::PLAIN, image)?;
    let output = separable.pointwise.run(scratch, device, Way::RELU, &inside, Addend::None)?;
    scratch.give(inside);
    Ok(output)
}

/// Two convolutions; what came in, or its own convolution, is added before the second one's rectification.
fn run_block<D: Device>(
    device: &D,
    scratch: &mut Scratch<'_, D>,
    block: &Block<D>,
    way: Way,
    image: &Image<D>,
) -> Result<Image<D>, D::Error> {
    let inside = block.first.run(scratch, device, way, image, Addend::None)?;
    let beside = Way { stride: way.stride, ..Way::PLAIN };
    let beside =
        block.beside.as_ref().map(|layer| layer.run(scratch, device, beside, image, Addend::None)).transpose()?;
    let addend = Addend::Image(beside.as_ref().unwrap_or(image));
    let output = block.second.run(scratch, device, Way { stride: 1, ..way }, &inside, addend)?;
    scratch.give(inside);
    if let Some(beside) = beside {
        scratch.give(beside);
    }
    Ok(output)
}

/// The largest of windows of 3x3, every second one.
fn pooled<D: Device>(device: &D, scratch: &mut Scratch<'_, D>, image: &Image<D>) -> Result<Image<D>, D::Error> {
    let size = image.size.halved();
    let block = PoolBlock {
        in_height: image.size.height,
        in_width: image.size.width,
        out_height: size.height,
        out_width: size.width,
        channels: size.channels,
        size: 3,
        stride: 2,
        padding: 1,
    };
    let mut output = scratch.image(size)?;
    device.max_pool(&block, &image.values, &mut output.values)?;
    Ok(output)
}
