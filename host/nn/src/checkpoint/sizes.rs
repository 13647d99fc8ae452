//! Reading the sizes of a network off the shapes of its tensors.

use super::{Checkpoint, CheckpointError};

/// The largest size in an architecture. Larger ones are a mistake, or an attempt to fill the memory.
pub const MAX_SIZE: usize = 1 << 14;

/// A checkpoint's shapes, from which the sizes of a network are read.
#[derive(Clone, Copy, Debug)]
pub struct Sizes<'a> {
    checkpoint: &'a Checkpoint,
    family: &'static str,
}

impl<'a> Sizes<'a> {
    /// The sizes of this checkpoint, which should be of the family of this name.
    pub fn new(checkpoint: &'a Checkpoint, family: &'static str) -> Sizes<'a> {
        Sizes { checkpoint, family }
    }

    /// The checkpoint.
    pub fn checkpoint(&self) -> &'a Checkpoint {
        self.checkpoint
    }

    /// The error that it is not of the family, for this reason.
    pub fn refuse(&self, detail: String) -> CheckpointError {
        let detail = format!("is no {}: {detail}", self.family);
        CheckpointError::Tensors(self.checkpoint.path().to_path_buf(), detail)
    }

    /// The shape of an optional tensor.
    pub fn shape(&self, name: &str) -> Option<&'a [usize]> {
        self.checkpoint.shapes().get(name).map(Vec::as_slice)
    }

    /// One extent of a required tensor with this number of dimensions.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not, or if the extent is not from 1 to [`MAX_SIZE`].
    pub fn size(&self, name: &str, dimensions: usize, axis: usize) -> Result<usize, CheckpointError> {
        let Some(shape) = self.shape(name) else {
            return Err(self.refuse(format!("it has no tensor {name}")));
        };
        if shape.len() != dimensions {
            return Err(self.refuse(format!("{name} has the shape {shape:?} instead of {dimensions} dimensions")));
        }
        match shape.get(axis).copied().unwrap_or(0) {
            size @ 1..=MAX_SIZE => Ok(size),
            size => Err(self.refuse(format!(
                "{name} has the size {size} on axis {axis}; sizes from 1 to {MAX_SIZE} are supported"
            ))),
        }
    }

    /// The number of tensors with numbered names, counted from 0.
    pub fn count(&self, name: impl Fn(usize) -> String) -> usize {
        (0..).take_while(|index| self.shape(&name(*index)).is_some()).count()
    }

    /// An optional number of the metadata.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is not a finite number.
    pub fn number(&self, key: &str, otherwise: f32) -> Result<f32, CheckpointError> {
        self.number_that(key, otherwise, |_| true, "a number")
    }

    /// An optional number of the metadata that `fits`: `what` says which do.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is another.
    pub fn number_that(
        &self,
        key: &str,
        otherwise: f32,
        fits: impl FnOnce(f32) -> bool,
        what: &str,
    ) -> Result<f32, CheckpointError> {
        let Some(text) = self.checkpoint.metadata().get(key) else { return Ok(otherwise) };
        match text.parse::<f32>() {
            Ok(number) if number.is_finite() && fits(number) => Ok(number),
            _ => Err(self.refuse(format!("its metadata says {key} = '{text}', which is not {what}"))),
        }
    }
}
