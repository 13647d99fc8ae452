//! Safetensors: a length, a JSON header, and the tensors' bytes without gaps. The crate of that name reads the header
//! and checks that the byte ranges fit their shapes, are contiguous and do not overlap.

use super::element::Element;
use super::error::{Problem, shortened};
use super::input::Input;
use super::location::{TensorLocation, TensorLocations, check_size};
use super::state_dict::{MAX_AXES, MAX_TENSORS};
use safetensors::tensor::Metadata;
use std::collections::BTreeMap;
use std::fs::File;

/// The most bytes of a header; a tensor takes about 100.
const LONGEST_HEADER: u64 = 16 << 20;

/// Opens the file: its tensors and its metadata.
pub(super) fn open(file: &File, length: u64) -> Result<(TensorLocations, BTreeMap<String, String>), Problem> {
    let mut input = Input::new(file, 0, length)?;
    let header_length = input.length(8)?;
    if input.check(header_length).is_err() {
        return Err(Problem::Content(format!(
            "its header is to take {header_length} bytes, but the file has {length}; it is cut off or damaged"
        )));
    }
    if header_length > LONGEST_HEADER {
        return Err(Problem::TooLarge {
            what: "its header".to_owned(),
            bytes: header_length.into(),
            limit: LONGEST_HEADER,
        });
    }
    let header = input.take(header_length)?;
    let header: Metadata = serde_json::from_slice(&header)
        .map_err(|error| Problem::Content(format!("its header is not one of safetensors: {error}")))?;
    let start = input.position();
    let missing = (start + header.data_len() as u64).abs_diff(length);
    if missing > 0 {
        return Err(Problem::Content(format!(
            "its tensors take {} bytes behind byte {start}, but the file has {length} bytes; it is cut off or damaged",
            header.data_len()
        )));
    }
    let mut places = TensorLocations::new();
    for (name, info) in header.tensors() {
        let short = shortened(&name);
        let wrong = |what: String| Problem::Content(format!("tensor '{short}': {what}"));
        let element = Element::of_safetensors(info.dtype)
            .ok_or_else(|| wrong(format!("elements of type {:?} are not read", info.dtype)))?;
        if info.shape.len() > MAX_AXES || places.len() == MAX_TENSORS {
            return Err(wrong(format!("more than {MAX_AXES} axes, or more than {MAX_TENSORS} tensors")));
        }
        let extent = check_size(&short, &info.shape)?;
        let start = start + info.data_offsets.0 as u64;
        places.insert(name, TensorLocation { element, start, shape: info.shape.clone(), strides: None, extent });
    }
    Ok((places, header.metadata().clone().unwrap_or_default().into_iter().collect()))
}
