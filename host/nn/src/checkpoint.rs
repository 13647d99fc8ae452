//! Files of network parameters: named tensors.
//!
//! Opening a file reads the names and shapes of its tensors, not the values, so that they are checked against an
//! architecture before large memory is allocated. The formats are safetensors, PyTorch's `torch.save` (zip archives and
//! the older format), and networks that Python's `pickle` wrote, such as the snapshots of EDM's training. The format is
//! recognised by the content. No code in a file is ever executed: see [`pickle`].
//!
//! A `state_dict`, or a network itself, is searched at the top of the file and under [`PLACES`]; a `module.` in front
//! of every name, from training on several GPUs, is removed.
//!
//! Memory: opening takes at most [`OPENING_BYTES`], and at most a fixed multiple of the file's description of its
//! tensors. Reading takes [`Checkpoint::byte_estimate`], which is known before and limited by
//! [`MAX_TENSOR_BYTES`] and [`MAX_TOTAL_BYTES`].

mod archive;
mod check;
mod element;
mod error;
pub mod input;
mod kind;
mod legacy;
mod location;
mod modules;
pub mod pickle;
mod published;
mod safe;
mod sizes;
mod snapshot;
mod state_dict;
mod values;
mod write;

pub use element::Element;
pub use error::CheckpointError;
pub use kind::Kind;
pub use location::{MAX_TENSOR_BYTES, MAX_TOTAL_BYTES};
pub use sizes::{MAX_SIZE, Sizes};
pub use state_dict::PLACES;
pub use write::{Precision, Written};

use bytemuck::allocation::try_zeroed_vec;
use error::{Problem, shortened};
use location::{TensorLocation, TensorLocations, element_count};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use values::{Fault, PIECE_BYTES};

/// The most memory that opening a file takes, in bytes: for the pickles that are in memory at once.
pub const OPENING_BYTES: u64 = 3 * pickle::PICKLE_BYTES;

/// A tensor of an architecture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorShape {
    /// Its name in a `state_dict`.
    pub name: String,
    /// Its shape as in PyTorch.
    pub shape: Vec<usize>,
}

/// An opened checkpoint.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    origin: String,
    shapes: BTreeMap<String, Vec<usize>>,
    metadata: BTreeMap<String, String>,
    content: Content,
}

/// The source of the values.
#[derive(Debug)]
enum Content {
    /// They are computed at each read.
    Computed(Formula),
    /// The file.
    File(File, TensorLocations),
}

/// Computes the values of a tensor.
type Values = dyn Fn(&TensorShape) -> Vec<f32> + Send + Sync;
struct Formula(Box<Values>);

impl std::fmt::Debug for Formula {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Formula")
    }
}

impl Checkpoint {
    /// Opens a file: reads the names, shapes and offsets of its tensors.
    ///
    /// # Errors
    /// [`CheckpointError`] if it cannot be read, is not a checkpoint, is damaged, or describes tensors that are
    /// too large or lie outside the file.
    pub fn open(path: &Path) -> Result<Checkpoint, CheckpointError> {
        let opened = || -> Result<Checkpoint, Problem> {
            // A pipe would be waited for when it is opened.
            let facts = fs::metadata(path)?;
            if !facts.is_file() {
                return Err(Problem::NoCheckpoint("not a file".to_owned()));
            }
            let file = File::open(path)?;
            let kind = Kind::of(&file)?;
            let mut origin = kind.name().to_owned();
            let (places, mut metadata) = match kind {
                Kind::Safetensors => safe::open(&file, facts.len())?,
                Kind::TorchZip | Kind::TorchLegacy | Kind::Snapshot => {
                    let (found, places) = match kind {
                        Kind::TorchZip => archive::open(&file, facts.len())?,
                        Kind::Snapshot => snapshot::open(&file, facts.len())?,
                        _ => legacy::open(&file, facts.len())?,
                    };
                    origin.extend(found.place.map(|place| format!("; under '{place}'")));
                    if !found.prefix.is_empty() {
                        origin.push_str(&format!("; without the '{}' in front of every name", found.prefix));
                    }
                    (places, found.settings)
                }
            };
            for (key, value) in published::metadata(path) {
                metadata.entry(key).or_insert(value);
            }
            let total = places.values().map(|place| 4 * u128::from(place.count())).sum();
            if total > MAX_TOTAL_BYTES.into() {
                return Err(Problem::TooLarge {
                    what: format!("all its {} tensors", places.len()),
                    bytes: total,
                    limit: MAX_TOTAL_BYTES,
                });
            }
            let shapes = places.iter().map(|(name, place)| (name.clone(), place.shape.clone())).collect();
            let content = Content::File(file, places);
            Ok(Checkpoint { path: path.to_path_buf(), origin, shapes, metadata, content })
        };
        opened().map_err(|problem| problem.of(path))
    }

    /// A checkpoint that was computed, not read. `label` takes the place of its path in messages.
    pub fn in_memory(
        label: &str,
        tensors: impl IntoIterator<Item = (TensorShape, Vec<f32>)>,
        metadata: BTreeMap<String, String>,
    ) -> Checkpoint {
        let (shapes, values): (Vec<_>, BTreeMap<_, _>) =
            tensors.into_iter().map(|(tensor, values)| (tensor.clone(), (tensor.name, values))).unzip();
        let values = move |tensor: &TensorShape| values.get(&tensor.name).cloned().unwrap_or_default();
        Checkpoint::computed(label, shapes, metadata, values)
    }

    /// A checkpoint without values of its own: `values` computes a tensor each time that it is read. `label` takes the
    /// place of its path in messages.
    pub fn computed(
        label: &str,
        tensors: impl IntoIterator<Item = TensorShape>,
        metadata: BTreeMap<String, String>,
        values: impl Fn(&TensorShape) -> Vec<f32> + Send + Sync + 'static,
    ) -> Checkpoint {
        Checkpoint {
            path: PathBuf::from(label),
            origin: "computed".to_owned(),
            shapes: tensors.into_iter().map(|TensorShape { name, shape }| (name, shape)).collect(),
            metadata,
            content: Content::Computed(Formula(Box::new(values))),
        }
    }

    /// Its path, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The kind of file, and where in it the tensors were found, for messages.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// Names and shapes of its tensors.
    pub fn shapes(&self) -> &BTreeMap<String, Vec<usize>> {
        &self.shapes
    }

    /// The element type of a tensor in the file.
    pub fn element(&self, name: &str) -> Option<Element> {
        match &self.content {
            Content::Computed(_) => self.shapes.get(name).map(|_| Element::F32),
            Content::File(_, places) => places.get(name).map(|place| place.element),
        }
    }

    /// Other values of the file: the metadata of safetensors, the numbers and short texts beside the `state_dict` of
    /// PyTorch's files.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// Adds to its metadata what the file does not say, or says otherwise.
    pub fn set(&mut self, key: &str, value: &str) {
        self.metadata.insert(key.to_owned(), value.to_owned());
    }

    /// Memory for reading and keeping these tensors, in bytes: 4 for every element, and the buffers for reading the
    /// largest of them. Missing names count 0.
    pub fn byte_estimate<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> u64 {
        let (mut kept, mut working) = (0u64, 0);
        for name in names {
            let count = self.shapes.get(name).and_then(|shape| element_count(shape)).unwrap_or(0);
            kept = kept.saturating_add(count.saturating_mul(4));
            working = working.max(match &self.content {
                Content::Computed(_) => count.saturating_mul(4),
                Content::File(_, places) => places.get(name).map_or(0, TensorLocation::working_bytes),
            });
        }
        kept.saturating_add(working)
    }

    /// Checks that it has exactly these tensors; others are allowed if `optional` accepts them.
    ///
    /// # Errors
    /// [`CheckpointError::Tensors`] with those that are missing, unexpected, of another shape, or no floating point
    /// numbers, as quantised ones are.
    pub fn check(&self, expected: &[TensorShape], optional: impl Fn(&str) -> bool) -> Result<(), CheckpointError> {
        let of_integers = || {
            let found = expected.iter().find_map(|tensor| {
                let element = self.element(&tensor.name).filter(|element| !element.is_float());
                element.map(|element| (&tensor.name, element.name()))
            });
            found.map(|(name, element)| {
                format!("tensor '{name}' holds numbers of type {element}, where weights are floating point")
            })
        };
        match check::compare(&self.shapes, expected, optional).or_else(of_integers) {
            None => Ok(()),
            Some(detail) => Err(CheckpointError::Tensors(self.path.clone(), detail)),
        }
    }

    /// The values of a tensor, flat and row-major, all of them finite. Integers beyond 2^24 are rounded.
    ///
    /// # Errors
    /// [`CheckpointError`] if there is none of that name, if it cannot be read, or if it holds a NaN, an infinity, or
    /// a number beyond `f32`.
    pub fn tensor(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        match &self.content {
            Content::Computed(formula) => {
                let values = self.by_formula(formula, name)?;
                match values.iter().position(|number| !number.is_finite()) {
                    None => Ok(values),
                    Some(index) => Err(self.not_finite(name, index as u64, values[index].into())),
                }
            }
            Content::File(file, places) => {
                let place = places.get(name).ok_or_else(|| self.no_tensor(name))?;
                let mut values = try_zeroed_vec(place.count() as usize).map_err(|()| {
                    let (name, bytes) = (shortened(name), 4 * place.count());
                    let what = format!("tensor '{name}' takes {bytes} bytes, which this machine does not have");
                    CheckpointError::Content(self.path.clone(), what)
                })?;
                let elements = place.elements(file).map_err(|cause| Problem::from(cause).of(&self.path))?;
                elements.round(&mut values).map_err(|fault| match fault {
                    Fault::Unreadable(cause) => Problem::from(cause).of(&self.path),
                    Fault::NotFinite(index, value) => self.not_finite(name, index, value),
                })?;
                Ok(values)
            }
        }
    }

    /// Hands out a tensor's elements as it holds them, row-major, in pieces of whole elements.
    fn read(
        &self,
        name: &str,
        mut take: impl FnMut(Element, &[u8]) -> Result<(), CheckpointError>,
    ) -> Result<(), CheckpointError> {
        match &self.content {
            Content::Computed(formula) => {
                self.by_formula(formula, name)?.chunks(PIECE_BYTES / 4).try_for_each(|piece| {
                    let bytes: Vec<u8> = piece.iter().flat_map(|value| value.to_le_bytes()).collect();
                    take(Element::F32, &bytes)
                })
            }
            Content::File(file, places) => {
                let place = places.get(name).ok_or_else(|| self.no_tensor(name))?;
                let failed = |cause| Problem::from(cause).of(&self.path);
                let (elements, count) = (place.elements(file).map_err(failed)?, place.count() as usize);
                let size = place.element.size();
                let mut bytes = vec![0; PIECE_BYTES.min(count * size)];
                for first in (0..count).step_by(PIECE_BYTES / size) {
                    let piece = &mut bytes[..PIECE_BYTES.min((count - first) * size)];
                    elements.read(first, piece).map_err(failed)?;
                    take(place.element, piece)?;
                }
                Ok(())
            }
        }
    }

    /// The values of a tensor of a network that a formula makes.
    fn by_formula(&self, Formula(compute): &Formula, name: &str) -> Result<Vec<f32>, CheckpointError> {
        let shape = self.shapes.get(name).ok_or_else(|| self.no_tensor(name))?;
        let values = compute(&TensorShape { name: name.to_owned(), shape: shape.clone() });
        if element_count(shape) != Some(values.len() as u64) {
            let what = format!("tensor '{}' has {} values, not those of its shape", shortened(name), values.len());
            return Err(CheckpointError::Content(self.path.clone(), what));
        }
        Ok(values)
    }

    fn no_tensor(&self, name: &str) -> CheckpointError {
        CheckpointError::NoTensor(self.path.clone(), shortened(name))
    }

    fn not_finite(&self, name: &str, index: u64, value: f64) -> CheckpointError {
        let problem = if value.is_finite() { "which f32 cannot hold" } else { "not a finite number" };
        CheckpointError::Value { path: self.path.clone(), tensor: shortened(name), index, value, problem }
    }
}
