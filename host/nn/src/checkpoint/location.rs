//! The position of a tensor's elements in a file.

use super::element::Element;
use super::error::Problem;
use super::state_dict::{Claim, Storage};
use std::collections::BTreeMap;

/// The most memory of one tensor as `f32`, in bytes.
pub const MAX_TENSOR_BYTES: u64 = 4 << 30;
/// The most memory of all tensors of a file as `f32`, in bytes.
pub const MAX_TOTAL_BYTES: u64 = 16 << 30;
/// The most elements of a tensor whose storage has fewer.
const MAX_REPEATED: u64 = 1 << 20;

/// The tensors of a file by name.
pub(super) type TensorLocations = BTreeMap<String, TensorLocation>;

/// A tensor in a file: every element lies inside it.
#[derive(Clone, Debug)]
pub(super) struct TensorLocation {
    /// The type of its elements.
    pub(super) element: Element,
    /// Offset in the file of its first.
    pub(super) start: u64,
    /// Its shape.
    pub(super) shape: Vec<usize>,
    /// Steps along each axis, in elements; `None` for row-major order without gaps.
    pub(super) strides: Option<Vec<usize>>,
    /// Elements from its first to its last, those between that are not its own included.
    pub(super) extent: u64,
}

/// The number of elements of a shape, if it does not overflow.
pub(super) fn element_count(shape: &[usize]) -> Option<u64> {
    shape.iter().try_fold(1u64, |product, &length| product.checked_mul(length as u64))
}

/// Checks the size of a tensor of this shape against the limits, and returns the number of its elements. For the check,
/// an axis of length 0 counts as 1.
pub(super) fn check_size(name: &str, shape: &[usize]) -> Result<u64, Problem> {
    let bytes = shape.iter().fold(4u128, |product, &length| product.saturating_mul(length.max(1) as u128));
    if bytes > MAX_TENSOR_BYTES.into() {
        let what = format!("tensor '{name}' of shape {shape:?}");
        return Err(Problem::TooLarge { what, bytes, limit: MAX_TENSOR_BYTES });
    }
    Ok(element_count(shape).unwrap_or(0))
}

impl TensorLocation {
    /// The place of a tensor whose storage takes the bytes from `start`, of which there are `available`. `name` is for
    /// messages.
    pub(super) fn of(
        name: &str,
        claim: &Claim,
        storage: Storage<'_>,
        start: u64,
        available: u64,
    ) -> Result<TensorLocation, Problem> {
        let count = check_size(name, &claim.shape)?;
        let wrong = |what: String| Problem::Content(format!("tensor '{name}': {what}"));
        let key = super::error::shortened(storage.key);
        let stored = storage.count.checked_mul(storage.element_size()).filter(|&bytes| bytes <= available);
        let stored = stored.ok_or_else(|| {
            wrong(format!(
                "storage '{key}' is to hold {} elements of {} bytes, but there are {available} bytes; the file is cut \
                 off or damaged",
                storage.count,
                storage.element_size()
            ))
        })?;
        // Steps of 0 are fine in small, but would let a file of a few bytes claim gigabytes.
        if count > storage.count.max(MAX_REPEATED) {
            let (shape, stored) = (&claim.shape, storage.count);
            return Err(wrong(format!("shape {shape:?} has more elements than the {stored} of storage '{key}'")));
        }
        let steps = claim.shape.iter().zip(&claim.strides);
        let last = steps.clone().try_fold(0u64, |last, (&length, &stride)| {
            (length as u64).saturating_sub(1).checked_mul(stride as u64)?.checked_add(last)
        });
        let size = claim.element.size() as u64;
        let extent = if count == 0 { Some(0) } else { last.and_then(|last| last.checked_add(1)) };
        let end = extent.and_then(|extent| extent.checked_add(claim.first)?.checked_mul(size));
        let (Some(extent), Some(_)) = (extent, end.filter(|&end| end <= stored)) else {
            return Err(wrong(format!(
                "shape {:?} with strides {:?} from element {} reaches beyond storage '{key}' of {stored} bytes; the \
                 file is damaged",
                claim.shape, claim.strides, claim.first
            )));
        };
        let mut expected = 1;
        let contiguous = steps.rev().all(|(&length, &stride)| {
            let fits = length <= 1 || stride == expected;
            expected *= length.max(1);
            fits
        });
        Ok(TensorLocation {
            element: claim.element,
            start: start + claim.first * size,
            shape: claim.shape.clone(),
            strides: (count > 0 && !contiguous).then(|| claim.strides.clone()),
            extent,
        })
    }

    /// Its number of elements.
    pub(super) fn count(&self) -> u64 {
        element_count(&self.shape).unwrap_or(0)
    }
}
