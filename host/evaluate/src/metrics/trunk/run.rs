//! A trunk on a device.

use super::{Convolution, Step, tensors};
use crate::metrics::MetricError;
use std::rc::Rc;
use viewfuse_device::Device;
use viewfuse_field::finite::check_finite;
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};
use viewfuse_nn::convolution::{Convolution as Layer, ConvolutionOptions, Residual};
use viewfuse_nn::image::{HostImage, Image};
use viewfuse_nn::loader::Tensors;
use viewfuse_nn::pool::{average_pool, l2_pool};
use viewfuse_nn::resample::concatenate;
use viewfuse_nn::scratch::Scratch;
use viewfuse_nn::weights::ConvolutionWeights;

/// Added to variances by Inception's batch norms.
const BATCH_NORM_EPSILON: f64 = 1.0e-3;

/// A trunk with its parameters on a device.
pub struct Trunk<D: Device> {
    steps: Vec<Step<LoadedConvolution<D>>>,
}

/// A convolution with its parameters on a device, and how it is run.
struct LoadedConvolution<D: Device> {
    layer: Layer<D>,
    options: ConvolutionOptions,
}

impl<D: Device> Trunk<D> {
    /// Reads these steps of pictures of three channels from a checkpoint, which must have exactly their tensors and
    /// perhaps others that `optional` accepts.
    ///
    /// # Errors
    /// [`MetricError::Checkpoint`] with the tensors that are missing, unexpected or of another shape;
    /// [`MetricError::Device`].
    pub fn load(
        device: &D,
        checkpoint: &Checkpoint,
        steps: &[Step<Convolution>],
        optional: impl Fn(&str) -> bool,
    ) -> Result<Trunk<D>, MetricError> {
        checkpoint.check(&tensors(steps, 3).0, optional)?;
        Ok(Trunk { steps: load(device, checkpoint, steps)? })
    }

    /// The images at the taps, in order.
    ///
    /// # Errors
    /// [`MetricError::Small`] if a window is larger than its image; [`MetricError::NotFinite`];
    /// [`MetricError::Device`].
    pub fn taps(&self, device: &D, input: &HostImage) -> Result<Vec<HostImage>, MetricError> {
        let mut run = Run { scratch: Scratch::new(device), input, taps: Vec::new() };
        let image = input.upload(device)?;
        run.steps(&self.steps, Rc::new(image))?;
        Ok(run.taps)
    }
}

/// Uploads the parameters of steps to a device.
fn load<D: Device>(
    device: &D,
    checkpoint: &Checkpoint,
    steps: &[Step<Convolution>],
) -> Result<Vec<Step<LoadedConvolution<D>>>, MetricError> {
    let step = |step: &Step<Convolution>| {
        Ok(match step {
            Step::Convolve(convolution) => Step::Convolve(LoadedConvolution::load(device, checkpoint, convolution)?),
            Step::MaxPool(pool) => Step::MaxPool(*pool),
            Step::AveragePool { count_include_pad } => Step::AveragePool { count_include_pad: *count_include_pad },
            Step::L2Pool => Step::L2Pool,
            Step::Concatenate(branches) => {
                let branches = branches.iter().map(|branch| load(device, checkpoint, branch));
                Step::Concatenate(branches.collect::<Result<_, _>>()?)
            }
            Step::Tap => Step::Tap,
        })
    };
    steps.iter().map(step).collect()
}

impl<D: Device> LoadedConvolution<D> {
    fn load(
        device: &D,
        checkpoint: &Checkpoint,
        convolution: &Convolution,
    ) -> Result<LoadedConvolution<D>, MetricError> {
        let weights = weights(checkpoint, convolution)?;
        // Windows of one row or one column have become squares, which begin so much further out.
        let [above, left] = convolution.window.map(|length| (weights.size - length) / 2);
        let padding = convolution.padding[0] + above;
        debug_assert_eq!(padding, convolution.padding[1] + left, "{}", convolution.name);
        let (stride, padding) = (convolution.stride as u32, Some(padding as u32));
        let options = ConvolutionOptions { stride, padding, ..ConvolutionOptions::RELU };
        // Scores must be exact: no device may use another algorithm for large images.
        let layer = weights.load(device, 0)?;
        Ok(LoadedConvolution { layer, options })
    }
}

fn weights(checkpoint: &Checkpoint, convolution: &Convolution) -> Result<ConvolutionWeights, CheckpointError> {
    let name = &convolution.name;
    let tensors = Tensors { checkpoint, prefix: "" };
    if !convolution.has_batch_norm {
        return tensors.convolution(name);
    }
    tensors.convolution_with_norm(&format!("{name}.conv"), &format!("{name}.bn"), BATCH_NORM_EPSILON)
}

/// The state of one picture.
struct Run<'a, D: Device> {
    /// Images are not returned to it: those at the taps are downloaded with their whole buffers, and a reused buffer
    /// may be twice as long as its image.
    scratch: Scratch<'a, D>,
    input: &'a HostImage,
    taps: Vec<HostImage>,
}

impl<D: Device> Run<'_, D> {
    fn steps(
        &mut self,
        steps: &[Step<LoadedConvolution<D>>],
        mut image: Rc<Image<D>>,
    ) -> Result<Rc<Image<D>>, MetricError> {
        for step in steps {
            image = match step {
                Step::Convolve(LoadedConvolution { layer, options }) => {
                    layer.out_size(*options, image.size).ok_or_else(|| self.small())?;
                    Rc::new(layer.run(&mut self.scratch, *options, &image, Residual::None)?)
                }
                Step::MaxPool(pool) => {
                    pool.out_size(image.size).ok_or_else(|| self.small())?;
                    Rc::new(pool.run(&mut self.scratch, &image)?)
                }
                Step::AveragePool { count_include_pad } => {
                    self.on_host(&image, |image| average_pool(image, *count_include_pad))?
                }
                Step::L2Pool => self.on_host(&image, l2_pool)?,
                Step::Concatenate(branches) => {
                    let outputs = branches.iter().map(|branch| self.steps(branch, image.clone()));
                    let outputs: Vec<Rc<Image<D>>> = outputs.collect::<Result<_, _>>()?;
                    let outputs: Vec<&Image<D>> = outputs.iter().map(AsRef::as_ref).collect();
                    Rc::new(concatenate(&mut self.scratch, &outputs)?)
                }
                Step::Tap => {
                    let tapped = self.download(&image)?;
                    let tap = format!("tap {}", self.taps.len());
                    check_finite(&tapped.values, "running a metric's network", &tap)?;
                    self.taps.push(tapped);
                    image
                }
            };
        }
        Ok(image)
    }

    fn on_host(
        &self,
        image: &Image<D>,
        step: impl FnOnce(&HostImage) -> HostImage,
    ) -> Result<Rc<Image<D>>, MetricError> {
        let output = step(&self.download(image)?);
        Ok(Rc::new(output.upload(self.scratch.device())?))
    }

    fn download(&self, image: &Image<D>) -> Result<HostImage, MetricError> {
        Ok(image.download(self.scratch.device())?)
    }

    fn small(&self) -> MetricError {
        MetricError::Small { width: self.input.width, height: self.input.height }
    }
}
