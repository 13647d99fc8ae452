//! Writing safetensors, one tensor after another.
//!
//! Format: <https://github.com/huggingface/safetensors>. Tensors are in the order of decreasing element size, then of
//! their names, as the crate of that name writes them, so that every element is aligned.

use super::error::shortened;
use super::location::element_count;
use super::{Checkpoint, CheckpointError, Element};
use safetensors::tensor::TensorInfo;
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::Path;
use viewfuse_core::half_precision::{f16_bits, f16_value};
use viewfuse_job::files::WholeFile;
use viewfuse_job::progress::Progress;

/// The least number that is not rounded to one in half precision, but to infinity.
const TOO_LARGE: f32 = 65520.0;
/// The least number in half precision with all of its bits.
const MIN_NORMAL: f64 = 6.103515625e-5;

/// The key of the metadata.
const METADATA: &str = "__metadata__";
/// Headers are padded with spaces to a multiple of this.
const ALIGNMENT: usize = 8;

/// The precision in which floating point numbers are written. Integers are written unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Unchanged.
    Kept,
    /// Half precision (f16), rounded to nearest.
    Half,
}

/// The result of writing.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Name, type, shape and bytes of each tensor, in the order of the file.
    pub tensors: Vec<(String, Element, Vec<usize>, u64)>,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Largest relative rounding error of values that are normal numbers in half precision.
    pub relative_error: f64,
    /// The number of smaller values.
    pub tiny_count: u64,
    /// Their largest absolute rounding error.
    pub tiny_error: f64,
}

/// An entry of the header.
#[derive(Serialize)]
#[serde(untagged)]
enum Entry<'a> {
    Metadata(&'a BTreeMap<String, String>),
    Tensor(TensorInfo),
}

impl Checkpoint {
    /// Writes it as safetensors, completely or not at all, with its metadata. At most one piece of a tensor is in
    /// memory.
    ///
    /// # Errors
    /// [`CheckpointError`] if a tensor cannot be read, holds a NaN or an infinity or a number that the precision cannot
    /// hold, or if the file cannot be written, or if the work is cancelled.
    pub fn write_safetensors(
        &self,
        path: &Path,
        precision: Precision,
        progress: &dyn Progress,
    ) -> Result<Written, CheckpointError> {
        let target = |element: Element| match precision {
            Precision::Half if element.is_float() => Element::F16,
            _ => element,
        };
        let mut tensors: Vec<(String, Element, Vec<usize>, u64)> = Vec::new();
        for (name, shape) in self.shapes() {
            if name == METADATA {
                let what = format!("a tensor is called '{METADATA}', a name that safetensors reserve");
                return Err(CheckpointError::Content(self.path().to_path_buf(), what));
            }
            let element = target(self.element(name).unwrap_or(Element::F32));
            let bytes = element_count(shape).unwrap_or(0) * element.size() as u64;
            tensors.push((name.clone(), element, shape.clone(), bytes));
        }
        tensors.sort_by_key(|(_, element, _, _)| Reverse(element.size()));
        let header = header(&tensors, self.metadata()).map_err(|error| {
            let what = format!("its names cannot be written as JSON: {error}");
            CheckpointError::Content(self.path().to_path_buf(), what)
        })?;
        let mut file = WholeFile::create(path).map_err(CheckpointError::Write)?;
        let mut write = |bytes: &[u8]| file.write(bytes).map_err(CheckpointError::Write);
        write(&(header.len() as u64).to_le_bytes())?;
        write(&header)?;
        let bytes = 8 + header.len() as u64 + tensors.iter().map(|(_, _, _, bytes)| bytes).sum::<u64>();
        let mut written = Written { tensors, bytes, relative_error: 0.0, tiny_count: 0, tiny_error: 0.0 };
        progress.expect(written.tensors.len());
        for index in 0..written.tensors.len() {
            progress.check().map_err(CheckpointError::Interrupted)?;
            let (name, target) = (written.tensors[index].0.clone(), written.tensors[index].1);
            let mut done = 0;
            self.read(&name, |element, bytes| {
                if element.is_float()
                    && let Some((at, value)) = element.values(bytes).enumerate().find(|(_, value)| !value.is_finite())
                {
                    return Err(self.not_finite(&name, done + at as u64, value));
                }
                if element == target {
                    write(bytes)?;
                } else {
                    write(&self.halved(&name, done, element.values(bytes), &mut written)?)?;
                }
                done += (bytes.len() / element.size()) as u64;
                Ok(())
            })?;
            progress.step();
        }
        file.finish().map_err(CheckpointError::Write)?;
        Ok(written)
    }

    /// Values in half precision; the first is element `done` of the tensor.
    fn halved(
        &self,
        name: &str,
        done: u64,
        values: impl Iterator<Item = f64>,
        written: &mut Written,
    ) -> Result<Vec<u8>, CheckpointError> {
        let mut bytes = Vec::new();
        for (at, value) in values.enumerate() {
            // f16_bits would take what is too large, and infinity, to the largest number.
            if !((value as f32).abs() < TOO_LARGE) {
                return Err(CheckpointError::Value {
                    path: self.path().to_path_buf(),
                    tensor: shortened(name),
                    index: done + at as u64,
                    value,
                    problem: "which f16 cannot hold (at most 65504); convert without rounding to it",
                });
            }
            let bits = f16_bits(value as f32);
            let error = (f64::from(f16_value(bits)) - value).abs();
            if value.abs() >= MIN_NORMAL {
                written.relative_error = written.relative_error.max(error / value.abs());
            } else if value != 0.0 {
                written.tiny_count += 1;
                written.tiny_error = written.tiny_error.max(error);
            }
            bytes.extend((bits as u16).to_le_bytes());
        }
        Ok(bytes)
    }
}

fn header(
    tensors: &[(String, Element, Vec<usize>, u64)],
    metadata: &BTreeMap<String, String>,
) -> Result<Vec<u8>, serde_json::Error> {
    let mut entries = BTreeMap::new();
    if !metadata.is_empty() {
        entries.insert(METADATA, Entry::Metadata(metadata));
    }
    let mut start = 0;
    for (name, element, shape, bytes) in tensors {
        let end = start + *bytes as usize;
        let info = TensorInfo { dtype: element.safetensors(), shape: shape.clone(), data_offsets: (start, end) };
        entries.insert(name.as_str(), Entry::Tensor(info));
        start = end;
    }
    let mut header = serde_json::to_vec(&entries)?;
    header.resize(header.len().next_multiple_of(ALIGNMENT), b' ');
    Ok(header)
}
