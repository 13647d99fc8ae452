//! Calls of the denoiser for one picture after the other of the same size.

use super::super::architecture::COLOUR_CHANNELS;
use super::Denoiser;
use viewfuse_core::schedule::Preconditioning;
use viewfuse_device::{Device, DeviceError, Recorded};
use viewfuse_kernels::genvs::DenoiserInputBlock;
use viewfuse_nn::image::{Image, Size};
use viewfuse_nn::scratch::Scratch;

/// Channels of a picture.
const PICTURE_CHANNELS: u32 = COLOUR_CHANNELS as u32;

/// Calls that read and write the same images. All layers are recorded where the device can repeat them, for the most
/// part in the second call: the first one makes the images between layers, and measures kernels.
pub(in crate::genvs) struct Calls<'a, 'd, D: Device> {
    denoiser: &'a Denoiser<D>,
    scratch: &'a mut Scratch<'d, D>,
    inputs: Image<D>,
    shifts: D::Buffer<f32>,
    /// The output of the last call, and the layers that make the next one in the same image.
    made: Option<(Image<D>, Option<Recorded<'d>>)>,
}

impl<'a, 'd, D: Device> Calls<'a, 'd, D> {
    /// For a condition of this size. Rows and columns are multiples of two to the number of halvings. The precision is
    /// that of the scratch buffers.
    pub(in crate::genvs) fn new(
        denoiser: &'a Denoiser<D>,
        scratch: &'a mut Scratch<'d, D>,
        size: Size,
    ) -> Result<Calls<'a, 'd, D>, DeviceError> {
        let inputs = scratch.image(size.with_channels(PICTURE_CHANNELS + size.channels))?;
        let shifts = scratch.device().zeros(denoiser.embedding.shift_count())?;
        Ok(Calls { denoiser, scratch, inputs, shifts, made: None })
    }

    /// The network's output (red, green, blue a pixel) for a noisy picture `[row][column][3]` and a condition
    /// `[row][column][channel]`.
    pub(in crate::genvs) fn run(
        &mut self,
        noisy: &D::Buffer<f32>,
        condition: &Image<D>,
        at: &Preconditioning,
    ) -> Result<&Image<D>, DeviceError> {
        let Calls { denoiser, scratch, inputs, shifts, made } = self;
        let (device, size) = (scratch.device(), condition.size);
        let block = DenoiserInputBlock {
            picture_channels: PICTURE_CHANNELS,
            condition_channels: size.channels,
            scale: at.input,
        };
        device.denoiser_input(&block, size.pixel_count(), noisy, &condition.values, &mut inputs.values)?;
        denoiser.embedding.shifts(device, at.noise, shifts)?;
        let made = match made.take() {
            Some((output, Some(layers))) => {
                layers.again()?;
                (output, Some(layers))
            }
            before => {
                before.into_iter().for_each(|(output, _)| scratch.recycle(output));
                device.recorded(|| denoiser.run(scratch, inputs, shifts))?
            }
        };
        Ok(&self.made.insert(made).0)
    }

    /// Gives its images back.
    pub(in crate::genvs) fn end(self) {
        let Calls { scratch, inputs, made, .. } = self;
        made.into_iter().map(|(output, _)| output).chain([inputs]).for_each(|image| scratch.recycle(image));
    }
}
