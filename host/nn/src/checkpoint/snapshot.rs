//! Networks written by Python's own `pickle`, such as the snapshots of EDM's training (`network-snapshot-*.pkl`):
//! one pickle, in which the storage of each tensor is a byte string that is a whole file of `torch.save`'s old format.
//!
//! Source: NVlabs/edm, `training/training_loop.py` and `torch_utils/persistence.py`; PyTorch, `torch/storage.py`.

use super::Element;
use super::error::{Problem, shortened};
use super::input::Input;
use super::legacy;
use super::location::{TensorLocation, TensorLocations};
use super::pickle::{Id, Pickle, Value};
use super::state_dict::{self, NO_STORAGE, StateDict, Storage};
use std::collections::HashMap;
use std::fs::File;

/// A storage in the file.
struct Stored {
    /// Its name in messages.
    key: String,
    element: Option<Element>,
    count: u64,
    /// Offset and bytes of its elements.
    start: u64,
    available: u64,
}

/// Opens the file.
pub(super) fn open(file: &File, length: u64) -> Result<(StateDict, TensorLocations), Problem> {
    let pickle = Pickle::read(&mut Input::new(file, 0, length)?)?;
    let mut storages = HashMap::new();
    for value in pickle.values() {
        if let Some((start, length)) = nested(&pickle, value)
            && !storages.contains_key(&start)
        {
            storages.insert(start, read(file, start, length)?);
        }
    }
    if storages.is_empty() {
        return Err(Problem::NoCheckpoint(
            "a pickle that torch.save did not write and that holds no tensors of PyTorch; in PyTorch, load it and save \
             its state_dict with torch.save"
                .to_owned(),
        ));
    }
    let stored =
        |id: Id| nested(&pickle, pickle.value(id)).and_then(|(start, _)| storages.get(&start)).ok_or(NO_STORAGE);
    let found = state_dict::find(&pickle, &|id| {
        let Stored { key, element, count, .. } = stored(id)?;
        Ok(Storage { key, element: *element, count: *count })
    });
    let found = found.map_err(Problem::Content)?;
    let mut places = TensorLocations::new();
    for (name, claim) in &found.claims {
        let name_short = shortened(name);
        let Stored { key, element, count, start, available } =
            stored(claim.storage).map_err(|what| Problem::Content(format!("tensor '{name_short}': {what}")))?;
        let storage = Storage { key, element: *element, count: *count };
        places.insert(name.clone(), TensorLocation::of(&name_short, claim, storage, *start, *available)?);
    }
    Ok((found, places))
}

/// Offset and length of the byte string from which a call would load a storage.
fn nested(pickle: &Pickle, value: &Value) -> Option<(u64, u64)> {
    let Value::Object(object) = value else { return None };
    if pickle.global(object.callable) != Some(("torch.storage", "_load_from_bytes")) {
        return None;
    }
    match *pickle.value(*pickle.sequence(object.arguments)?.first()?) {
        Value::Bytes { start, length } => Some((start, length)),
        _ => None,
    }
}

/// The storage of a byte string.
fn read(file: &File, start: u64, length: u64) -> Result<Stored, Problem> {
    let wrong = |what: String| Problem::Content(format!("the storage in bytes {start} to {}: {what}", start + length));
    let opened = || -> Result<Stored, Problem> {
        let mut input = Input::new(file, start, start + length)?;
        let pickle = legacy::description(&mut input)?;
        let Storage { key, element, count } = state_dict::storage(&pickle, pickle.root()).map_err(Problem::Content)?;
        let places = legacy::lay_out(&pickle, &mut input, start + length)?;
        let &(start, available) =
            places.get(key).ok_or_else(|| Problem::Content(format!("does not hold '{}'", shortened(key))))?;
        Ok(Stored { key: format!("{} at byte {start}", shortened(key)), element, count, start, available })
    };
    opened().map_err(|problem| match problem {
        Problem::Content(what) => wrong(what),
        problem => problem,
    })
}
