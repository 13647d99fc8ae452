//! Kernels of networks at the sizes of a render: linear layers of the published PixelNeRF and of the included one,
//! look-ups in its grids, fusion, compositing; a convolution and an attention's product of a GeNVS.

use super::{Operations, Work};
use crate::dispatch::*;
use crate::poses::{numbers, random};
use crate::ray_inputs::{camera, point};
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_device::{Device, DeviceError, Layer, LayerShape, Precision};
use viewfuse_kernels::network::attend::MatrixBlock;
use viewfuse_kernels::network::convolve::ConvolveBlock;
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::pixelnerf::GatherBlock;

const F32: f64 = size_of::<f32>() as f64;

pub(super) fn works<D: Device>(device: &D) -> Result<Vec<Work<'_>>, DeviceError> {
    let mut works = vec![
        gather(device, 16_384, 64, 32)?,
        convolve(device, 64, 64)?,
        linear(device, [2046, 512, 512])?,
        linear(device, [16_384, 64, 64])?,
        linear(device, [16_384, 64, 4])?,
        matrix_product(device, [1024, 64, 1024])?,
        fuse(device, 3, 16_384, 64)?,
        composite(device, 8192, 96)?,
    ];
    // What fills a GPU would take a processor seconds; and images of few pixels, which do not fill one.
    if !device.is_software() {
        works.push(linear(device, [32_768, 512, 512])?);
        for [side, channels] in [[128, 128], [32, 256], [16, 512]] {
            works.push(convolve(device, side, channels)?);
        }
    }
    // By matrix units, where there are some. What stands in for them on a processor would take seconds.
    let count = if device.is_software() { [1, 1] } else { [LINEARS.len(), CONVOLUTIONS.len()] };
    let (linears, convolutions) = (&LINEARS[..count[0]], &CONVOLUTIONS[..count[1]]);
    for precision in device.precisions() {
        for sizes in linears {
            works.push(rounded_linear(device, *sizes, precision)?);
        }
        for [side, channels] in convolutions {
            works.push(rounded_convolve(device, *side, *channels, precision)?);
        }
    }
    Ok(works)
}

/// Rows, inner indices and columns of linear layers in forms of rounded factors.
const LINEARS: [[u32; 3]; 3] = [[16_384, 64, 64], [2046, 512, 512], [32_768, 512, 512]];
/// Sides and channels of convolutions, likewise.
const CONVOLUTIONS: [[u32; 2]; 4] = [[64, 64], [128, 128], [32, 256], [16, 512]];

/// [`linear`] in another precision.
fn rounded_linear<D: Device>(device: &D, sizes: [u32; 3], precision: Precision) -> Result<Work<'_>, DeviceError> {
    let exact = linear(device, sizes)?;
    let [row_count, inner_count, column_count] = sizes;
    let [rows, inner, columns] = sizes.map(|size| size as usize);
    let shape = LayerShape { inner_count: inner, column_count: columns, has_wide_images: false };
    let layer = Layer::new(device, &shape, &values(1, inner * columns), &values(2, columns))?;
    let block = LinearBlock { row_count, inner_count, column_count, relu_inputs: 1, ..LinearBlock::default() };
    let (inputs, mut outputs) = (device.upload(&values(3, rows * inner))?, device.zeros(rows * columns)?);
    let run = move || device.linear_in(precision, &block, &inputs, &layer.weights, &layer.bias, None, &mut outputs);
    Ok(Work { form: precision.form(), run: Box::new(run), ..exact })
}

/// [`convolve`] in another precision.
fn rounded_convolve<D: Device>(
    device: &D,
    side: u32,
    channels: u32,
    precision: Precision,
) -> Result<Work<'_>, DeviceError> {
    let (exact, block) = (convolve(device, side, channels)?, windows(side, channels));
    let (inner, columns, image) = (block.patch_len() as usize, channels as usize, (side * side * channels) as usize);
    let shape = LayerShape { inner_count: inner, column_count: columns, has_wide_images: false };
    let layer = Layer::new(device, &shape, &values(4, inner * columns), &values(5, columns))?;
    let (inputs, mut outputs) = (device.upload(&values(6, image))?, device.zeros(image)?);
    let run = move || device.convolve_in(precision, &block, &inputs, &layer.weights, &layer.bias, None, &mut outputs);
    Ok(Work { form: precision.form(), run: Box::new(run), ..exact })
}

fn values(seed: u64, count: usize) -> Vec<f32> {
    let random = &mut random(90, seed, 1);
    numbers(count, || random.range(-0.5, 0.5))
}

fn linear<D: Device>(device: &D, sizes: [u32; 3]) -> Result<Work<'_>, DeviceError> {
    let [row_count, inner_count, column_count] = sizes;
    let [rows, inner, columns] = sizes.map(|size| size as usize);
    let shape = LayerShape { inner_count: inner, column_count: columns, has_wide_images: false };
    let linear = Linear {
        block: LinearBlock { row_count, inner_count, column_count, relu_inputs: 1, ..LinearBlock::default() },
        weights: LayerWeights { shape, values: values(1, inner * columns) },
        bias: values(2, columns),
        inputs: values(3, rows * inner),
        residual: None,
        outputs: Output::Zeros(rows * columns),
    };
    let size = format!("{row_count}x{inner_count}x{column_count}");
    let bytes = F32 * (rows * inner + inner * columns + rows * columns) as f64;
    Work::new(device, linear, size, Operations::Fused(2.0 * (rows * inner * columns) as f64), bytes)
}

/// A convolution of 3x3 that keeps size and channels.
fn windows(side: u32, channels: u32) -> ConvolveBlock {
    ConvolveBlock {
        in_height: side,
        in_width: side,
        in_channels: channels,
        in_pitch: channels,
        enlarge: 1,
        out_height: side,
        out_width: side,
        out_channels: channels,
        out_pitch: channels,
        size: 3,
        stride: 1,
        dilation: 1,
        padding: 1,
        scale: 1.0,
        ..ConvolveBlock::default()
    }
}

fn convolve<D: Device>(device: &D, side: u32, channels: u32) -> Result<Work<'_>, DeviceError> {
    let block = windows(side, channels);
    let (inner, columns) = (block.patch_len() as usize, channels as usize);
    let image = (side * side * channels) as usize;
    let shape = LayerShape { inner_count: inner, column_count: columns, has_wide_images: side >= 32 };
    let convolve = Convolve {
        block,
        weights: LayerWeights { shape, values: values(4, inner * columns) },
        bias: values(5, columns),
        inputs: values(6, image),
        residual: None,
        outputs: Output::Zeros(image),
    };
    let size = format!("{side}x{side}, {channels} channels, 3x3");
    // Of the definition: an algorithm with fewer products may have a share above 1.
    let operations = 2.0 * (image * inner) as f64;
    Work::new(device, convolve, size, Operations::Fused(operations), F32 * (2 * image + inner * columns) as f64)
}

fn matrix_product<D: Device>(device: &D, sizes: [u32; 3]) -> Result<Work<'_>, DeviceError> {
    let [row_count, inner_count, column_count] = sizes;
    let [rows, inner, columns] = sizes.map(|size| size as usize);
    let block = MatrixBlock {
        row_count,
        inner_count,
        column_count,
        left_pitch: inner_count,
        // Transposed, as keys are.
        right_row_pitch: 1,
        right_column_pitch: inner_count,
        scale: 0.125,
        ..MatrixBlock::default()
    };
    let (left, right) = (values(7, rows * inner), values(8, inner * columns));
    let product = MatrixProduct { block, left, right, outputs: Output::Zeros(rows * columns) };
    let size = format!("{row_count}x{inner_count}x{column_count}");
    let bytes = F32 * (rows * inner + inner * columns + rows * columns) as f64;
    Work::new(device, product, size, Operations::Fused(2.0 * (rows * inner * columns) as f64), bytes)
}

fn gather<D: Device>(device: &D, point_count: u32, channels: u32, side: u32) -> Result<Work<'_>, DeviceError> {
    let random = &mut random(91, 1, 1);
    let views = vec![camera(random)];
    let points: Vec<_> = (0..point_count).map(|_| point(random, &views)).collect();
    let block = GatherBlock {
        point_count,
        channel_count: channels,
        height: side,
        width: side,
        pixel_centre: 0.5,
        ..GatherBlock::default()
    };
    let (count, nodes) = ((point_count * channels) as usize, (side * side * channels) as usize);
    let (grid, residual) = (values(9, nodes), Some(values(10, count)));
    let gather = GatherLatents { block, views, points, grid, residual, gathered: Output::Zeros(count) };
    let size = format!("{point_count} points, {channels} channels of {side}x{side}");
    Work::new(
        device,
        gather,
        size,
        Operations::Uncounted,
        F32 * (2 * count + nodes) as f64 + 32.0 * f64::from(point_count),
    )
}

fn fuse<D: Device>(device: &D, view_count: u32, point_count: u32, channel_count: u32) -> Result<Work<'_>, DeviceError> {
    let count = point_count * channel_count;
    let block = FuseBlock { view_count, stride: count, channel_count, weight_stride: view_count };
    let fuse = FuseViews {
        block,
        element_count: count,
        weights: values(11, (point_count * view_count) as usize),
        latents: values(12, (view_count * count) as usize),
        fused: Output::Zeros(count as usize),
    };
    let size = format!("{view_count} views, {point_count} points, {channel_count} channels");
    let bytes = F32 * f64::from((view_count + 1) * count + point_count * view_count);
    Work::new(device, fuse, size, Operations::Fused(2.0 * f64::from(view_count * count)), bytes)
}

fn composite<D: Device>(device: &D, ray_count: u32, sample_count: u32) -> Result<Work<'_>, DeviceError> {
    let block = CompositeBlock { background: [1.0; 3], empty_depth: 2.0, sample_count };
    let count = (ray_count * sample_count) as usize;
    let random = &mut random(92, 1, 1);
    let composite = Composite {
        block,
        ray_count,
        samples: (0..count).map(|_| [0; 4].map(|_| 0.1 * random.unit() as f32)).collect(),
        sample_depths: (0..count as u32).map(|at| 1.0 + (at % sample_count) as f32 / sample_count as f32).collect(),
        colours: Output::Zeros(ray_count as usize),
        depths: Output::Zeros(ray_count as usize),
    };
    let bytes = F32 * f64::from(ray_count) * (5.0 * f64::from(sample_count) + 5.0);
    Work::new(device, composite, format!("{ray_count} rays, {sample_count} samples"), Operations::Uncounted, bytes)
}
