//! From a source image to its volume: a residual trunk at output stride 16, spatial pyramid pooling, and a decoder with
//! learned upsampling and skip connections up to the image's own size.
//!
//! Source: `genvs_encoder.py`; DeepLabV3+ (Chen et al. 2018) on ResNet-34, its batch norms and dropout switched off.

use super::architecture::{self, ASPP_RATES};
use crate::FieldError;
use std::ops::Range;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_nn::convolution::{
    Convolution, ConvolutionOptions, DepthwiseConvolution, Residual, TransposedConvolution,
};
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::loader::Loader;
use viewfuse_nn::pool::global_average_pool;
use viewfuse_nn::resample::{concatenate, upsample};
use viewfuse_nn::resnet::{ResNet, ResNetLayer};
use viewfuse_nn::scratch::Scratch;

/// Rows and columns of images are multiples of this: the trunk's output stride.
pub(super) const SIDE_STEP: u32 = 16;

const PLAIN: ConvolutionOptions = ConvolutionOptions::PLAIN;
const RELU: ConvolutionOptions = ConvolutionOptions::RELU;

/// A depthwise convolution, then a rectified 1x1 convolution.
struct SeparableConvolution<D: Device> {
    depthwise: DepthwiseConvolution<D>,
    pointwise: Convolution<D>,
}

/// Three convolutions.
type Stage<D> = [Convolution<D>; 3];

/// The encoder's layers on a device.
pub(super) struct Encoder<D: Device> {
    trunk: ResNet<Convolution<D>>,
    aspp: Aspp<D>,
    /// `decoder.modified_up`.
    stages: [Stage<D>; 3],
    upconvs: [TransposedConvolution<D>; 2],
    /// `decoder.block1` and `decoder.block2`.
    high_resolution: Convolution<D>,
    fused: SeparableConvolution<D>,
    /// `volume_head.up`.
    head_stages: [Stage<D>; 2],
    head_upconvs: [TransposedConvolution<D>; 2],
    /// `volume_head.reshape_conv`.
    volume: Convolution<D>,
}

/// Atrous spatial pyramid pooling (`decoder.aspp`): convolutions of several dilations and the mean of the whole image,
/// concatenated, then a 1x1 convolution.
struct Aspp<D: Device> {
    plain: Convolution<D>,
    dilated: Vec<SeparableConvolution<D>>,
    pooled: Convolution<D>,
    project: Convolution<D>,
    last: SeparableConvolution<D>,
}

impl<D: Device> Encoder<D> {
    /// Loads it, for images of at least `side` rows and columns.
    pub(super) fn load(
        loader: &Loader<'_, D>,
        sizes: &architecture::Encoder,
        side: u32,
    ) -> Result<Encoder<D>, FieldError> {
        let trunk = ResNet::new(sizes.stem_channels, &sizes.levels).try_map(|layer: &ResNetLayer| {
            // Only the first level has stride 1 and no dilation throughout.
            loader.convolution(&format!("encoder.{}", layer.name), if layer.level == 1 { side / 4 } else { 0 })
        })?;
        let stage = |name: &str, side: u32| {
            let layer = |index: usize| loader.convolution(&format!("{name}.{index}"), side);
            Ok::<_, FieldError>([layer(0)?, layer(2)?, layer(4)?])
        };
        let (up, head) = ("decoder.modified_up", "volume_head.up");
        let upconv = |name: String| loader.transposed_convolution(&format!("{name}.0"));
        Ok(Encoder {
            trunk,
            aspp: Aspp::load(loader)?,
            stages: [
                stage(&format!("{up}.stage1"), side / 16)?,
                stage(&format!("{up}.stage2"), side / 8)?,
                stage(&format!("{up}.stage3"), side / 4)?,
            ],
            upconvs: [upconv(format!("{up}.upconv1"))?, upconv(format!("{up}.upconv2"))?],
            high_resolution: loader.convolution("decoder.block1.0", 0)?,
            fused: SeparableConvolution::load(loader, "decoder.block2.0")?,
            head_stages: [stage(&format!("{head}.stage1"), side / 2)?, stage(&format!("{head}.stage2"), side)?],
            head_upconvs: [upconv(format!("{head}.upconv1"))?, upconv(format!("{head}.upconv2"))?],
            volume: loader.changed_convolution("volume_head.reshape_conv", 0, |weights| {
                // Published: [feature][depth]. A look-up reads all features of a node, so here they are adjacent.
                let (features, depths) = (sizes.feature_count, sizes.volume_depth);
                weights.with_outputs_reordered(|column| column % features * depths + column / features)
            })?,
        })
    }

    /// The last layer's input, for an image (red, green, blue in `[-1, 1]`) whose rows and columns are multiples of
    /// [`SIDE_STEP`].
    pub(super) fn encode(
        &self,
        scratch: &mut Scratch<'_, D>,
        image: &[f32],
        size: Size,
    ) -> Result<Image<D>, DeviceError> {
        let input = Image::upload(scratch.device(), size, image)?;
        let levels = self.trunk.run(scratch, &input, SIDE_STEP)?;
        let levels = <[Image<D>; 5]>::try_from(levels);
        let [half, quarter, eighth, sixteenth, deepest] =
            levels.unwrap_or_else(|_| unreachable!("the stem and four levels"));
        let aspp = self.aspp.run(scratch, &deepest)?;
        let wide = concatenate(scratch, &[&sixteenth, &deepest, &aspp])?;
        for image in [sixteenth, deepest, aspp] {
            scratch.recycle(image);
        }
        let [stage1, stage2, stage3] = &self.stages;
        let x = run_stage(scratch, stage1, wide)?;
        let x = run_up(scratch, &self.upconvs[0], stage2, x, &eighth)?;
        let x = run_up(scratch, &self.upconvs[1], stage3, x, &quarter)?;
        let high_resolution = self.high_resolution.run(scratch, RELU, &quarter, Residual::None)?;
        let wide = concatenate(scratch, &[&x, &high_resolution])?;
        let fused = self.fused.run(scratch, PLAIN, &wide)?;
        for image in [x, high_resolution, wide, eighth, quarter] {
            scratch.recycle(image);
        }
        let x = run_up(scratch, &self.head_upconvs[0], &self.head_stages[0], fused, &half)?;
        scratch.recycle(half);
        let x = run_up(scratch, &self.head_upconvs[1], &self.head_stages[1], x, &input)?;
        scratch.recycle(input);
        Ok(x)
    }

    /// Size of the volume `[row][column][depth][feature]` of an image: depths and features are its channels.
    pub(super) fn volume_size(&self, image: Size) -> Size {
        image.with_channels(self.volume.channels)
    }

    /// The last layer: some rows of the volume from the result of [`Encoder::encode`].
    pub(super) fn fill_rows(
        &self,
        device: &D,
        deep: &Image<D>,
        rows: Range<u32>,
        volume: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        self.volume.run_rows(device, RELU, deep, rows, volume)
    }
}

impl<D: Device> Aspp<D> {
    fn load(loader: &Loader<'_, D>) -> Result<Aspp<D>, FieldError> {
        let branch = |index: usize| format!("decoder.aspp.0.convs.{index}");
        let dilated = 1..=ASPP_RATES.len();
        let pooled = format!("{}.1", branch(ASPP_RATES.len() + 1));
        Ok(Aspp {
            plain: loader.convolution(&format!("{}.0", branch(0)), 0)?,
            dilated: dilated
                .map(|index| SeparableConvolution::load(loader, &format!("{}.0", branch(index))))
                .collect::<Result<_, _>>()?,
            pooled: loader.convolution(&pooled, 0)?,
            project: loader.convolution("decoder.aspp.0.project.0", 0)?,
            last: SeparableConvolution::load(loader, "decoder.aspp.1")?,
        })
    }

    fn run(&self, scratch: &mut Scratch<'_, D>, image: &Image<D>) -> Result<Image<D>, DeviceError> {
        let device = scratch.device();
        let channels = self.plain.channels;
        let branch_count = self.dilated.len() as u32 + 2;
        let mut wide = scratch.channel_slice(image.size.with_channels(channels), channels * branch_count, 0)?;
        self.plain.run_into(scratch, RELU, image, Residual::None, &mut wide)?;
        for (branch, (separable, dilation)) in (1..).zip(self.dilated.iter().zip(ASPP_RATES)) {
            wide = wide.channel_slice(branch * channels, channels);
            let options = ConvolutionOptions { dilation: dilation as u32, ..PLAIN };
            separable.run_into(scratch, options, image, &mut wide)?;
        }
        let mean = global_average_pool(scratch, image)?;
        let pooled = self.pooled.run(scratch, RELU, &mean, Residual::None)?;
        upsample(device, &pooled, (branch_count - 1) * channels, &mut wide)?;
        let wide = wide.channel_slice(0, channels * branch_count);
        let mixed = self.project.run(scratch, RELU, &wide, Residual::None)?;
        let last = self.last.run(scratch, PLAIN, &mixed)?;
        for image in [mean, pooled, wide, mixed] {
            scratch.recycle(image);
        }
        Ok(last)
    }
}

impl<D: Device> SeparableConvolution<D> {
    fn load(loader: &Loader<'_, D>, name: &str) -> Result<SeparableConvolution<D>, FieldError> {
        Ok(SeparableConvolution {
            depthwise: loader.depthwise_convolution(&format!("{name}.0"))?,
            pointwise: loader.convolution(&format!("{name}.1"), 0)?,
        })
    }

    /// Runs it into a new image; the options are the depthwise convolution's.
    fn run(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
    ) -> Result<Image<D>, DeviceError> {
        let inside = self.depthwise.run(scratch, options, image)?;
        let output = self.pointwise.run(scratch, RELU, &inside, Residual::None)?;
        scratch.recycle(inside);
        Ok(output)
    }

    /// Runs it into an image of the right size.
    fn run_into(
        &self,
        scratch: &mut Scratch<'_, D>,
        options: ConvolutionOptions,
        image: &Image<D>,
        output: &mut Image<D>,
    ) -> Result<(), DeviceError> {
        let inside = self.depthwise.run(scratch, options, image)?;
        self.pointwise.run_into(scratch, RELU, &inside, Residual::None, output)?;
        scratch.recycle(inside);
        Ok(())
    }
}

/// A step of a decoder: the image doubled by a transposed convolution, concatenated behind the skipped one, through a
/// stage.
fn run_up<D: Device>(
    scratch: &mut Scratch<'_, D>,
    upconv: &TransposedConvolution<D>,
    stage: &Stage<D>,
    image: Image<D>,
    skip: &Image<D>,
) -> Result<Image<D>, DeviceError> {
    let (across, above) = (skip.size.channels, upconv.channels);
    let mut wide = scratch.image(skip.size.with_channels(across + above))?;
    upsample(scratch.device(), skip, 0, &mut wide)?;
    let mut wide = wide.channel_slice(across, above);
    upconv.run_into(scratch.device(), &image, &mut wide)?;
    scratch.recycle(image);
    run_stage(scratch, stage, wide.channel_slice(0, across + above))
}

fn run_stage<D: Device>(
    scratch: &mut Scratch<'_, D>,
    stage: &Stage<D>,
    mut image: Image<D>,
) -> Result<Image<D>, DeviceError> {
    for layer in stage {
        let next = layer.run(scratch, RELU, &image, Residual::None)?;
        scratch.recycle(image);
        image = next;
    }
    Ok(image)
}
