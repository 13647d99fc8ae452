//! The format of `torch.save` before PyTorch 1.6: pickles one after another (a magic number, a version, the machine,
//! the description, the keys of the storages), then each storage as its number of elements (`i64`) and their bytes.

use super::error::{Problem, shortened};
use super::input::Input;
use super::location::{TensorLocation, TensorLocations};
use super::pickle::{Pickle, Value};
use super::state_dict::{self, StateDict};
use std::collections::HashMap;
use std::fs::File;

/// The magic number 0x1950a86a20f9469cfc6c as pickles hold it.
pub(super) const MAGIC: [u8; 10] = [0x6c, 0xfc, 0x9c, 0x46, 0xf9, 0x20, 0x6a, 0xa8, 0x50, 0x19];
/// The only version.
const VERSION: i64 = 1001;

/// Opens the file.
pub(super) fn open(file: &File, length: u64) -> Result<(StateDict, TensorLocations), Problem> {
    let mut input = Input::new(file, 0, length)?;
    let pickle = description(&mut input)?;
    let storages = lay_out(&pickle, &mut input, length)?;
    let found = state_dict::find(&pickle, &|id| state_dict::storage(&pickle, id)).map_err(Problem::Content)?;
    let mut places = TensorLocations::new();
    for (name, claim) in &found.claims {
        let wrong = |what: String| Problem::Content(format!("tensor '{}': {what}", shortened(name)));
        let storage = state_dict::storage(&pickle, claim.storage).map_err(wrong)?;
        let &(start, available) = storages
            .get(storage.key)
            .ok_or_else(|| wrong(format!("the file does not hold its storage '{}'", shortened(storage.key))))?;
        places.insert(name.clone(), TensorLocation::of(&shortened(name), claim, storage, start, available)?);
    }
    Ok((found, places))
}

/// The description, behind the header of this format.
pub(super) fn description(input: &mut Input<'_>) -> Result<Pickle, Problem> {
    let magic = Pickle::read(input)?;
    if magic.wide(magic.root()) != Some(&MAGIC) {
        return Err(Problem::Content("does not begin as files of torch.save do".to_owned()));
    }
    drop(magic);
    let version = Pickle::read(input)?;
    if version.integer(version.root()) != Some(VERSION) {
        return Err(Problem::Content(format!("is of another version than {VERSION} of PyTorch's old format")));
    }
    drop(version);
    check_machine(&Pickle::read(input)?)?;
    Ok(Pickle::read(input)?)
}

/// Rejects another byte order.
fn check_machine(machine: &Pickle) -> Result<(), Problem> {
    let Value::Dict(facts) = machine.value(machine.root()) else {
        return Err(Problem::Content("does not state the byte order of its numbers".to_owned()));
    };
    let little = facts.iter().find(|&&(key, _)| machine.text(key) == Some("little_endian"));
    match little.map(|&(_, value)| machine.value(value)) {
        Some(Value::Bool(true)) => Ok(()),
        _ => Err(Problem::Content(
            "has numbers in big-endian byte order, which is not read; save it again on a usual machine".to_owned(),
        )),
    }
}

/// Offset and length in the file of each storage that a description names. `input` is behind the description, in
/// front of the list of the storages' keys; the storages end at offset `end`.
pub(super) fn lay_out<'a>(
    pickle: &'a Pickle,
    input: &mut Input<'_>,
    end: u64,
) -> Result<HashMap<&'a str, (u64, u64)>, Problem> {
    let keys = Pickle::read(input)?;
    let mut described = HashMap::new();
    for storage in state_dict::storages(pickle).map_err(Problem::Content)? {
        let size = (storage.count, storage.element_size());
        if described.insert(storage.key, size).is_some_and(|before| before != size) {
            return Err(Problem::Content(format!("describes storage '{}' in two ways", shortened(storage.key))));
        }
    }
    let keys: Option<Vec<&str>> =
        keys.sequence(keys.root()).and_then(|list| list.iter().map(|&key| keys.text(key)).collect());
    let keys = keys.ok_or_else(|| Problem::Content("has no list of its storages".to_owned()))?;
    let mut places = HashMap::new();
    for key in keys {
        let wrong = |what: String| Problem::Content(format!("storage '{}': {what}", shortened(key)));
        let (&name, &(count, size)) = described
            .get_key_value(key)
            .ok_or_else(|| wrong("is in the file but not described; the file is damaged".to_owned()))?;
        let begin = input.position();
        let cut_off = |_| {
            wrong(format!(
                "{count} elements of {size} bytes do not fit between byte {begin} and byte {end}, where it ends; it is \
                 cut off or damaged"
            ))
        };
        let stored = i64::from_le_bytes(input.array().map_err(cut_off)?);
        if u64::try_from(stored) != Ok(count) {
            return Err(wrong(format!("has {stored} elements, {count} by its description; the file is damaged")));
        }
        let bytes = count.saturating_mul(size);
        let start = input.position();
        input.skip(bytes).map_err(cut_off)?;
        if places.insert(name, (start, bytes)).is_some() {
            return Err(wrong("is in the file twice".to_owned()));
        }
    }
    Ok(places)
}
