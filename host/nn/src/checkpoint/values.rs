//! Reading a tensor's elements.

use super::element::Element;
use super::location::TensorLocation;
use bytemuck::cast_slice_mut;
use std::fs::File;
use std::io;
use std::sync::{Mutex, PoisonError};
use viewfuse_device::parallel::for_each_part;
use viewfuse_device::queue;

/// Elements that a core reads before it takes the next.
const PART: usize = 1 << 16;
/// Bytes that are read at once.
pub(super) const PIECE_BYTES: usize = 1 << 16;

/// Why a tensor is refused.
pub(super) enum Fault {
    /// It could not be read.
    Unreadable(io::Error),
    /// An element is not finite in `f32`: its index, and what it is.
    NotFinite(u64, f64),
}

impl TensorLocation {
    /// Memory for reading it, beside the result, in bytes.
    pub(super) fn working_bytes(&self) -> u64 {
        let window = self.strides.as_ref().map_or(0, |_| self.extent * self.element.size() as u64);
        let cores = self.count().div_ceil(PART as u64).clamp(1, queue::width() as u64);
        window + cores * PIECE_BYTES as u64
    }

    /// Begins to read it.
    pub(super) fn elements<'a>(&'a self, file: &'a File) -> io::Result<Elements<'a>> {
        let mut window = vec![0; self.strides.as_ref().map_or(0, |_| self.extent as usize * self.element.size())];
        read_exact_at(file, &mut window, self.start)?;
        Ok(Elements { place: self, file, window })
    }
}

/// The elements of a tensor, row-major.
pub(super) struct Elements<'a> {
    place: &'a TensorLocation,
    file: &'a File,
    /// Of a tensor with strides, what lies from its first element to its last.
    window: Vec<u8>,
}

impl Elements<'_> {
    /// Reads those from number `first` on, as the file holds them: as many as `bytes` has room for.
    pub(super) fn read(&self, first: usize, bytes: &mut [u8]) -> io::Result<()> {
        let TensorLocation { shape, start, element, .. } = self.place;
        let size = element.size();
        let Some(strides) = &self.place.strides else {
            return read_exact_at(self.file, bytes, start + (first * size) as u64);
        };
        let mut rest = first;
        let mut index = vec![0; shape.len()];
        for (index, length) in index.iter_mut().zip(shape).rev() {
            (*index, rest) = (rest % length, rest / length);
        }
        let mut at: usize = index.iter().zip(strides).map(|(index, stride)| index * stride).sum();
        for bytes in bytes.chunks_exact_mut(size) {
            bytes.copy_from_slice(&self.window[at * size..(at + 1) * size]);
            for axis in (0..index.len()).rev() {
                index[axis] += 1;
                at += strides[axis];
                if index[axis] < shape[axis] {
                    break;
                }
                at -= index[axis] * strides[axis];
                index[axis] = 0;
            }
        }
        Ok(())
    }

    /// Rounds all of them to `f32`, on all cores; `values` has their number. Of several faults the first one in the
    /// tensor is returned.
    pub(super) fn round(&self, values: &mut [f32]) -> Result<(), Fault> {
        let first_fault = Mutex::new(None);
        for_each_part(values, PART, &|part, values| {
            let Err(fault) = self.round_part(part * PART, values) else { return };
            let mut first_fault = first_fault.lock().unwrap_or_else(PoisonError::into_inner);
            if first_fault.as_ref().is_none_or(|(known, _)| part < *known) {
                *first_fault = Some((part, fault));
            }
        });
        let first_fault = first_fault.into_inner().unwrap_or_else(PoisonError::into_inner);
        first_fault.map_or(Ok(()), |(_, fault)| Err(fault))
    }

    fn round_part(&self, first: usize, values: &mut [f32]) -> Result<(), Fault> {
        let element = self.place.element;
        // Nearly all elements of all checkpoints are where they are needed at once.
        if element == Element::F32 {
            self.read(first, cast_slice_mut(values)).map_err(Fault::Unreadable)?;
            values.iter_mut().for_each(|value| *value = f32::from_bits(u32::from_le(value.to_bits())));
            return match values.iter().position(|value| !value.is_finite()) {
                None => Ok(()),
                Some(index) => Err(Fault::NotFinite((first + index) as u64, values[index].into())),
            };
        }
        let at_once = PIECE_BYTES / element.size();
        let mut bytes = vec![0; at_once.min(values.len()) * element.size()];
        for (first, values) in (first..).step_by(at_once).zip(values.chunks_mut(at_once)) {
            let bytes = &mut bytes[..values.len() * element.size()];
            self.read(first, bytes).map_err(Fault::Unreadable)?;
            for ((index, value), exact) in (first..).zip(values).zip(element.values(bytes)) {
                *value = exact as f32;
                if !value.is_finite() {
                    return Err(Fault::NotFinite(index as u64, exact));
                }
            }
        }
        Ok(())
    }
}

/// Reads all of `bytes` from a place of a file, wherever others read.
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, at);
    #[cfg(windows)]
    {
        let (mut bytes, mut at) = (bytes, at);
        while !bytes.is_empty() {
            let count = std::os::windows::fs::FileExt::seek_read(file, bytes, at)?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            (bytes, at) = (&mut bytes[count..], at + count as u64);
        }
        Ok(())
    }
}
