//! The `state_dict` in a pickle of PyTorch: its tensors, and the storage and offset of each.
//!
//! Only a few names have a meaning here: `collections.OrderedDict`, the functions of `torch._utils` that put a tensor
//! or a parameter together, `torch.Size`, and the classes of storages. All other names (optimizers, schedulers,
//! classes of other projects, `os.system`) are ignored. The network itself, as an object, may take the place of a
//! `state_dict`: see [`modules`].

use super::element::Element;
use super::error::shortened;
use super::modules;
use super::pickle::{Id, Pickle, Value};
use std::collections::{BTreeMap, HashSet};

/// Keys under which training scripts put the `state_dict`.
pub const PLACES: [&str; 5] = ["state_dict", "model", "model_state_dict", "net", "ema"];
/// A word in names of a moving average.
const AVERAGED: &str = "ema";
/// The prefix that `DataParallel` adds to every name.
const PARALLEL_PREFIX: &str = "module.";
/// The most tensors of a checkpoint.
pub(super) const MAX_TENSORS: usize = 50_000;
/// The most axes of a tensor: PyTorch's own limit.
pub(super) const MAX_AXES: usize = 64;
/// The most settings beside the tensors, and the most bytes of each.
const MAX_SETTINGS: usize = 64;
const LONGEST_SETTING: usize = 1024;

/// The description of a file's tensors.
#[derive(Debug)]
pub(super) struct StateDict {
    /// The key of the `state_dict`, if it is not the whole pickle.
    pub(super) place: Option<&'static str>,
    /// The prefix that was removed from every name.
    pub(super) prefix: &'static str,
    /// The tensors by name.
    pub(super) claims: BTreeMap<String, Claim>,
    /// Numbers and short texts beside it.
    pub(super) settings: BTreeMap<String, String>,
}

/// A tensor as the pickle describes it, not yet checked against the file.
#[derive(Debug)]
pub(super) struct Claim {
    /// The value that describes its storage: see [`storage`].
    pub(super) storage: Id,
    /// The type of its elements.
    pub(super) element: Element,
    /// Its first element in the storage.
    pub(super) first: u64,
    /// Its shape.
    pub(super) shape: Vec<usize>,
    /// Strides along each axis, in elements of the storage.
    pub(super) strides: Vec<usize>,
}

/// A storage as the pickle describes it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Storage<'a> {
    /// Its key among the storages.
    pub(super) key: &'a str,
    /// The type of its elements; bytes if it has none.
    pub(super) element: Option<Element>,
    /// Its element count.
    pub(super) count: u64,
}

impl Storage<'_> {
    /// Bytes of one element.
    pub(super) fn element_size(&self) -> u64 {
        self.element.map_or(1, |element| element.size() as u64)
    }
}

/// Reads the value that describes a tensor's storage.
pub(super) type StorageOf<'a> = dyn Fn(Id) -> Result<Storage<'a>, String> + 'a;

/// Finds the `state_dict`.
///
/// # Errors
/// The problem, with the key or tensor.
pub(super) fn find(pickle: &Pickle, storage_of: &StorageOf<'_>) -> Result<StateDict, String> {
    let root = pickle.root();
    let holds_tensors = |id: Id| {
        entries(pickle, id).is_some_and(|table| table.iter().any(|&(_, value)| tensor_call(pickle, value).is_some()))
            || modules::is_module(pickle, id)
    };
    let table = entries(pickle, root).unwrap_or_default();
    // Python takes the last of several values of one key.
    let at =
        |place: &str| table.iter().rev().find(|&&(key, _)| pickle.text(key) == Some(place)).map(|(_, value)| *value);
    let mut places = PLACES.iter().filter_map(|&place| Some((place, at(place).filter(|value| holds_tensors(*value))?)));
    let inner = places.next();
    // The same table may stand under two keys.
    let other = inner.and_then(|(first, found)| {
        let is_averaged =
            |key: &&str| key.split(|letter: char| !letter.is_ascii_alphabetic()).any(|word| word == AVERAGED);
        let averaged = table.iter().filter_map(|(key, _)| pickle.text(*key)).filter(is_averaged);
        // Under a name of its own in the average's state, perhaps.
        let inner = |value: Id| entries(pickle, value).unwrap_or_default().into_iter().map(|(_, value)| value);
        let holds = |value: Id| holds_tensors(value) || inner(value).any(holds_tensors);
        let mut others = PLACES.into_iter().chain(averaged).filter(|place| *place != first);
        others.find(|place| at(place).is_some_and(|value| value != found && holds(value)))
    });
    if let (Some((first, _)), Some(other)) = (inner, other) {
        return Err(format!(
            "holds tensors under '{first}' and others under '{}', so it is not clear which are meant; {RESAVE}",
            shortened(other)
        ));
    }
    let (place, found) = match (holds_tensors(root), inner) {
        (true, Some((place, _))) => {
            return Err(format!(
                "holds tensors at its top and also under '{place}', so it is not clear which are meant; {RESAVE}"
            ));
        }
        (true, None) => (None, root),
        (false, Some((place, inner))) => (Some(place), inner),
        (false, None) => return Err(no_tensors(pickle)),
    };
    let mut claims = BTreeMap::new();
    let mut keep = |name: &str, claim: Claim| {
        if name.is_empty() {
            return Err("holds a tensor without a name".to_owned());
        }
        if claims.insert(name.to_owned(), claim).is_some() {
            return Err(format!("holds two tensors called '{}'", shortened(name)));
        }
        if claims.len() > MAX_TENSORS {
            return Err(format!("holds more than {MAX_TENSORS} tensors, which no network here has"));
        }
        Ok(())
    };
    if modules::is_module(pickle, found) {
        modules::each_tensor(pickle, found, &mut |name, value| match claim(pickle, value, name, storage_of)? {
            Some(claim) => keep(name, claim),
            None => Err(format!("holds '{}' in place of a tensor", shortened(name))),
        })?;
    } else {
        for (key, value) in entries(pickle, found).unwrap_or_default() {
            let name = pickle.text(key);
            match claim(pickle, value, name.unwrap_or("?"), storage_of)? {
                Some(claim) => keep(name.ok_or("holds a tensor under a key that is not a text")?, claim)?,
                None if holds_tensors(value) || is_numpys(pickle, value) => return Err(beside(name.unwrap_or("?"))),
                None => {}
            }
        }
    }
    let mut prefix = "";
    if claims.keys().all(|name| name.len() > PARALLEL_PREFIX.len() && name.starts_with(PARALLEL_PREFIX)) {
        prefix = PARALLEL_PREFIX;
        claims = claims.into_iter().map(|(name, claim)| (name[prefix.len()..].to_owned(), claim)).collect();
    }
    Ok(StateDict { place, prefix, claims, settings: settings(pickle, &table) })
}

/// The message for what would be lost beside the tensors of a table.
fn beside(name: &str) -> String {
    format!("holds tensors and beside them '{}', which are others or an array of numpy; {RESAVE}", shortened(name))
}

/// Whether a value is an array of numpy.
fn is_numpys(pickle: &Pickle, id: Id) -> bool {
    let callable = pickle.object(id).and_then(|object| pickle.global(object.callable));
    callable.is_some_and(|(module, name)| module.starts_with("numpy.") && name == "_reconstruct")
}

const RESAVE: &str = "in PyTorch, save model.state_dict() and use that file";

/// The storages that a pickle names anywhere, those of optimizers included.
///
/// # Errors
/// As [`storage`].
pub(super) fn storages(pickle: &Pickle) -> Result<Vec<Storage<'_>>, String> {
    let persistent = pickle.values().iter().filter_map(|value| match value {
        Value::Persistent(identity) => Some(*identity),
        _ => None,
    });
    persistent.map(|identity| identified(pickle, identity)).collect()
}

/// A storage outside of its pickle.
///
/// # Errors
/// The problem.
pub(super) fn storage(pickle: &Pickle, id: Id) -> Result<Storage<'_>, String> {
    match *pickle.value(id) {
        Value::Persistent(identity) => identified(pickle, identity),
        _ => Err(NO_STORAGE.to_owned()),
    }
}

/// The message for a value that should describe a storage and does not.
pub(super) const NO_STORAGE: &str = "has no storage; the file is damaged, or it is no file of torch.save";

/// The identity of a storage: `('storage', class, key, device, element count)`.
fn identified(pickle: &Pickle, identity: Id) -> Result<Storage<'_>, String> {
    let unknown = || "refers to something stored outside its description that is no storage of tensors".to_owned();
    let fields = pickle.sequence(identity).ok_or_else(unknown)?;
    // A network as an object names the source text of its classes.
    if fields.first().is_some_and(|tag| pickle.text(*tag) == Some("module")) {
        return Err(format!("holds a whole network as PyTorch wrote it before 1.6; {RESAVE}"));
    }
    let [tag, class, key, _device, count, view @ ..] = fields else { return Err(unknown()) };
    if pickle.text(*tag) != Some("storage") {
        return Err(unknown());
    }
    let (_, class) = pickle.global(*class).ok_or_else(unknown)?;
    let key = pickle.text(*key).ok_or_else(unknown)?;
    let element = Element::of_storage(class);
    if element.is_none() && class != "UntypedStorage" {
        return Err(format!("storage '{}' is of a kind that is not read: torch.{}", shortened(key), shortened(class)));
    }
    if view.iter().any(|&view| !matches!(pickle.value(view), Value::None)) {
        return Err(format!("storage '{}' is part of another, as before PyTorch 0.4; {RESAVE}", shortened(key)));
    }
    let count = pickle.integer(*count).and_then(|count| u64::try_from(count).ok());
    let count = count.ok_or_else(|| format!("storage '{}' has no sensible length", shortened(key)))?;
    Ok(Storage { key, element, count })
}

/// The pairs of a `dict`, of an `OrderedDict`, or of another class with items.
fn entries(pickle: &Pickle, id: Id) -> Option<Vec<(Id, Id)>> {
    if let Value::Dict(pairs) = pickle.value(id) {
        return Some(pairs.clone());
    }
    let object = pickle.object(id)?;
    let ordered = pickle.global(object.callable) == Some(("collections", "OrderedDict"));
    if !ordered {
        return (!object.items.is_empty()).then(|| object.items.clone());
    }
    // Python 2 gives the pairs with the call, Python 3 sets them afterwards.
    let given = pickle.sequence(object.arguments).and_then(|arguments| pickle.sequence(*arguments.first()?));
    let pairs = given.unwrap_or_default().iter().filter_map(|&pair| match pickle.sequence(pair)? {
        &[key, value] => Some((key, value)),
        _ => None,
    });
    Some(pairs.chain(object.items.iter().copied()).collect())
}

/// The call that builds a tensor, its arguments and the function's name, without the calls that make it a parameter or
/// one of another class, as buffers are and tensors with attributes.
fn tensor_call(pickle: &Pickle, id: Id) -> Option<(Id, &str)> {
    let call = |id: Id| {
        let object = pickle.object(id)?;
        let (arguments, (module, name)) = match pickle.global(object.callable)? {
            ("torch._tensor", "_rebuild_from_type_v2") => match pickle.sequence(object.arguments)? {
                [function, _class, arguments, ..] => (*arguments, pickle.global(*function)?),
                _ => return None,
            },
            function => (object.arguments, function),
        };
        (module == "torch._utils" && name.starts_with("_rebuild_")).then_some((arguments, name))
    };
    match call(id)? {
        (arguments, "_rebuild_parameter" | "_rebuild_parameter_with_state") => {
            call(*pickle.sequence(arguments)?.first()?)
        }
        tensor => Some(tensor),
    }
}

/// Whether values are to be negated or conjugated when they are read (the last argument of PyTorch's functions).
fn is_turned(pickle: &Pickle, metadata: Option<&Id>) -> bool {
    let table = metadata.and_then(|metadata| entries(pickle, *metadata)).unwrap_or_default();
    table.iter().any(|(key, value)| {
        matches!(pickle.text(*key), Some("neg" | "conj")) && !matches!(pickle.value(*value), Value::Bool(false))
    })
}

fn claim(pickle: &Pickle, id: Id, name: &str, storage_of: &StorageOf<'_>) -> Result<Option<Claim>, String> {
    let Some((arguments, function)) = tensor_call(pickle, id) else { return Ok(None) };
    let wrong = |what: &str| format!("tensor '{}': {what}", shortened(name));
    if !matches!(function, "_rebuild_tensor" | "_rebuild_tensor_v2" | "_rebuild_tensor_v3") {
        return Err(wrong(&format!("is of a kind that is not read (torch._utils.{})", shortened(function))));
    }
    let malformed = || wrong("is not described as PyTorch does; the file is damaged");
    let [from, first, shape, strides, more @ ..] = pickle.sequence(arguments).ok_or_else(malformed)? else {
        return Err(malformed());
    };
    let metadata = if function == "_rebuild_tensor_v3" { more.get(3) } else { more.get(2) };
    if is_turned(pickle, metadata) {
        return Err(wrong(
            "is to be negated or conjugated when it is read: save what its resolve_neg() and resolve_conj() give",
        ));
    }
    let stored = storage_of(*from).map_err(|what| wrong(&what))?;
    let element = match (function, more) {
        ("_rebuild_tensor_v3", [_, _, element, ..]) => {
            let (_, element) = pickle.global(*element).ok_or_else(malformed)?;
            Element::of_torch(element).ok_or_else(|| wrong(&format!("torch.{} is not read", shortened(element))))?
        }
        _ => stored.element.ok_or_else(malformed)?,
    };
    if stored.element.is_some_and(|of_storage| of_storage != element) {
        return Err(malformed());
    }
    let first = pickle.integer(*first).and_then(|first| u64::try_from(first).ok()).ok_or_else(malformed)?;
    let shape = axes(pickle, *shape).ok_or_else(malformed)?;
    let strides = axes(pickle, *strides).ok_or_else(malformed)?;
    if shape.len() != strides.len() {
        return Err(malformed());
    }
    Ok(Some(Claim { storage: *from, element, first, shape, strides }))
}

/// A tuple of numbers, or a `torch.Size` of one.
fn axes(pickle: &Pickle, id: Id) -> Option<Vec<usize>> {
    let numbers = match pickle.object(id) {
        Some(object) if pickle.global(object.callable) == Some(("torch", "Size")) => {
            pickle.sequence(*pickle.sequence(object.arguments)?.first()?)?
        }
        _ => pickle.sequence(id)?,
    };
    if numbers.len() > MAX_AXES {
        return None;
    }
    numbers.iter().map(|&number| usize::try_from(pickle.integer(number)?).ok()).collect()
}

/// Numbers and short texts beside the tensors: epochs, losses, the name of an experiment.
fn settings(pickle: &Pickle, root: &[(Id, Id)]) -> BTreeMap<String, String> {
    let setting = |&(key, value): &(Id, Id)| {
        let key = pickle.text(key).filter(|key| key.len() <= LONGEST_SETTING)?;
        let value = match pickle.value(value) {
            Value::Bool(value) => value.to_string(),
            Value::Int(value) => value.to_string(),
            Value::Float(value) => value.to_string(),
            Value::Text(_) => pickle.text(value).filter(|text| text.len() <= LONGEST_SETTING)?.to_owned(),
            _ => return None,
        };
        Some((key.to_owned(), value))
    };
    root.iter().filter_map(setting).take(MAX_SETTINGS).collect()
}

/// Why there is no `state_dict` in a pickle.
fn no_tensors(pickle: &Pickle) -> String {
    match (entries(pickle, pickle.root()), pickle.object(pickle.root())) {
        (Some(table), _) => format!("holds no tensors in the expected places: {}", keys_of(pickle, &table)),
        (None, Some(object)) => {
            format!("holds an object ({}), not a table of named tensors; {RESAVE}", modules::class_of(pickle, object))
        }
        (None, None) => format!("holds no table of named tensors; {RESAVE}"),
    }
}

fn keys_of(pickle: &Pickle, root: &[(Id, Id)]) -> String {
    let mut seen = HashSet::new();
    let keys = root.iter().filter_map(|&(key, _)| pickle.text(key)).filter(|key| seen.insert(*key)).take(8);
    let keys: Vec<String> = keys.map(|key| format!("'{}'", shortened(key))).collect();
    let looked = format!("at its top and under {}", PLACES.map(|place| format!("'{place}'")).join(", "));
    if keys.is_empty() { looked } else { format!("{looked} (it has {})", keys.join(", ")) }
}
