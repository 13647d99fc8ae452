//! NaN and infinity are reported at the stage that produced them, not in the picture at the end.

use super::error::FieldError;
pub use super::error::NotFinite;
use viewfuse_device::Device;
use viewfuse_kernels::finite::{ALL_FINITE, FINITE_RUN};

/// Checks all values of a stage's result.
///
/// # Errors
/// [`NotFinite`] with the first value that is not finite.
pub fn check_finite(values: &[f32], stage: &str, tensor: &str) -> Result<(), NotFinite> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            Err(NotFinite { stage: stage.to_owned(), tensor: tensor.to_owned(), index, value: values[index] })
        }
    }
}

/// Checks the first `count` values of a stage's result on the device. Only if one is not finite, the tensor is
/// downloaded to report that value.
///
/// # Errors
/// [`FieldError::NotFinite`] with the first value that is not finite; [`FieldError::Device`] if the device is lost.
pub fn check_finite_on<D: Device>(
    device: &D,
    buffer: &D::Buffer<f32>,
    count: u32,
    stage: &str,
    tensor: &str,
) -> Result<(), FieldError> {
    let mut firsts = device.zeros(count.div_ceil(FINITE_RUN) as usize)?;
    device.find_non_finite(&count, buffer, &mut firsts)?;
    if device.download(&firsts)?.iter().any(|first| *first != ALL_FINITE) {
        check_finite(&device.download(buffer)?[..count as usize], stage, tensor)?;
    }
    Ok(())
}

/// Downloads a stage's result, and checks all its values.
///
/// # Errors
/// [`FieldError::NotFinite`] with the first value that is not finite; [`FieldError::Device`] if the device is lost.
pub fn download_finite<D: Device>(
    device: &D,
    buffer: &D::Buffer<f32>,
    stage: &str,
    tensor: &str,
) -> Result<Vec<f32>, FieldError> {
    let values = device.download(buffer)?;
    check_finite(&values, stage, tensor)?;
    Ok(values)
}
