//! Files of network parameters: named tensors.
//!
//! Opening a file reads what it says about its tensors, not the tensors: names and shapes are checked against an
//! architecture before anything large is allocated. Read are safetensors, what PyTorch's `torch.save` writes, in its zip
//! archives and in its older format, and networks that Python's `pickle` wrote, as the snapshots of EDM's training are;
//! which of them it is, the content decides. No code in a file is ever executed: see [`pickle`].
//!
//! A `state_dict`, or a network itself, is looked for at the top of the file and under [`PLACES`]; a `module.` in front
//! of every name, from training on several GPUs, is taken off.
//!
//! Memory: opening takes at most [`OPENING_BYTES`], and at most a fixed multiple of what the file says about its
//! tensors; reading takes what [`Checkpoint::byte_estimate`] says, which is known before and limited by
//! [`LARGEST_TENSOR_BYTES`] and [`LARGEST_TOTAL_BYTES`].

mod archive;
mod check;
mod element;
mod error;
pub mod input;
mod kind;
mod legacy;
mod modules;
pub mod pickle;
mod place;
mod safe;
mod sizes;
mod snapshot;
mod state_dict;
mod write;

pub use element::Element;
pub use error::CheckpointError;
pub use kind::Kind;
pub use place::{LARGEST_TENSOR_BYTES, LARGEST_TOTAL_BYTES};
pub use sizes::{LARGEST_SIZE, Sizes};
pub use state_dict::PLACES;
pub use write::{Precision, Written};

use error::{Problem, shortened};
use place::{CHUNK_BYTES, Place, Places, element_count};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Memory that opening a file takes at most, in bytes: for the pickles that are there at once.
pub const OPENING_BYTES: u64 = 3 * pickle::PICKLE_BYTES;

/// A tensor that an architecture has.
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

/// Where the values are.
#[derive(Debug)]
enum Content {
    /// Nowhere: they are computed whenever they are asked for.
    Computed(Formula),
    /// In the file, which readers use one after another: they move its cursor.
    File(Mutex<File>, Places),
}

/// What computes the values of a tensor.
type Values = dyn Fn(&TensorShape) -> Vec<f32> + Send + Sync;
struct Formula(Box<Values>);

impl std::fmt::Debug for Formula {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Formula")
    }
}

impl Checkpoint {
    /// Opens a file: reads the names, shapes and places of its tensors.
    ///
    /// # Errors
    /// [`CheckpointError`] if it cannot be read, is no checkpoint, is damaged, or claims tensors that are absurdly
    /// large or lie outside the file.
    pub fn open(path: &Path) -> Result<Checkpoint, CheckpointError> {
        let opened = || -> Result<Checkpoint, Problem> {
            let file = File::open(path)?;
            let facts = file.metadata()?;
            if !facts.is_file() {
                return Err(Problem::NoCheckpoint("not a file".to_owned()));
            }
            let kind = Kind::of(&file)?;
            let mut origin = kind.name().to_owned();
            let (places, metadata) = match kind {
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
            let total = places.values().map(|place| 4 * u128::from(place.count())).sum();
            if total > LARGEST_TOTAL_BYTES.into() {
                return Err(Problem::TooLarge {
                    what: format!("all its {} tensors", places.len()),
                    bytes: total,
                    limit: LARGEST_TOTAL_BYTES,
                });
            }
            let shapes = places.iter().map(|(name, place)| (name.clone(), place.shape.clone())).collect();
            let content = Content::File(Mutex::new(file), places);
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

    /// The file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What kind of file it is, and where in it the tensors were, for messages.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// Names and shapes of its tensors.
    pub fn shapes(&self) -> &BTreeMap<String, Vec<usize>> {
        &self.shapes
    }

    /// The type in which it holds the elements of a tensor.
    pub fn element(&self, name: &str) -> Option<Element> {
        match &self.content {
            Content::Computed(_) => self.shapes.get(name).map(|_| Element::F32),
            Content::File(_, places) => places.get(name).map(|place| place.element),
        }
    }

    /// What else the file says: of safetensors its metadata, of PyTorch's files the numbers and short texts that stand
    /// beside the `state_dict`.
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// Memory that reading these tensors and keeping all of them takes, in bytes: 4 for every element, and what reading
    /// the most demanding of them needs beside. Names that it does not have take nothing.
    pub fn byte_estimate<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> u64 {
        let (mut kept, mut working) = (0u64, 0);
        for name in names {
            let count = self.shapes.get(name).and_then(|shape| element_count(shape)).unwrap_or(0);
            kept = kept.saturating_add(count.saturating_mul(4));
            working = working.max(match &self.content {
                Content::Computed(_) => count.saturating_mul(4),
                Content::File(_, places) => places.get(name).map_or(0, Place::working_bytes),
            });
        }
        kept.saturating_add(working)
    }

    /// Checks that it has exactly these tensors, and perhaps others that `optional` accepts.
    ///
    /// # Errors
    /// [`CheckpointError::Tensors`] with those that are missing, unexpected, or of another shape.
    pub fn check(&self, expected: &[TensorShape], optional: impl Fn(&str) -> bool) -> Result<(), CheckpointError> {
        match check::compare(&self.shapes, expected, optional) {
            None => Ok(()),
            Some(detail) => Err(CheckpointError::Tensors { path: self.path.clone(), detail }),
        }
    }

    /// The values of a tensor, flat and row-major, all of them finite. Integers beyond 2^24 are rounded.
    ///
    /// # Errors
    /// [`CheckpointError`] if there is none of that name, if it cannot be read, or if it holds a NaN, an infinity, or
    /// a number beyond `f32`.
    pub fn tensor(&self, name: &str) -> Result<Vec<f32>, CheckpointError> {
        let count = self.shapes.get(name).and_then(|shape| element_count(shape)).unwrap_or(0);
        let mut values = Vec::new();
        values.try_reserve_exact(count as usize).map_err(|_| CheckpointError::Content {
            path: self.path.clone(),
            what: format!("tensor '{}' takes {} bytes, which this machine does not have", shortened(name), 4 * count),
        })?;
        self.read(name, |element, bytes| {
            for value in element.values(bytes) {
                let number = value as f32;
                if !number.is_finite() {
                    return Err(self.not_finite(name, values.len() as u64, value));
                }
                values.push(number);
            }
            Ok(())
        })?;
        Ok(values)
    }

    /// Hands out a tensor's elements as it holds them, row-major, in pieces of whole elements.
    fn read(
        &self,
        name: &str,
        mut take: impl FnMut(Element, &[u8]) -> Result<(), CheckpointError>,
    ) -> Result<(), CheckpointError> {
        let none = || CheckpointError::NoTensor { path: self.path.clone(), tensor: shortened(name) };
        match &self.content {
            Content::Computed(Formula(compute)) => {
                let shape = self.shapes.get(name).ok_or_else(none)?;
                let values = compute(&TensorShape { name: name.to_owned(), shape: shape.clone() });
                if element_count(shape) != Some(values.len() as u64) {
                    return Err(CheckpointError::Content {
                        path: self.path.clone(),
                        what: format!(
                            "tensor '{}' has {} values, not those of its shape",
                            shortened(name),
                            values.len()
                        ),
                    });
                }
                values.chunks(CHUNK_BYTES / 4).try_for_each(|chunk| {
                    let bytes: Vec<u8> = chunk.iter().flat_map(|value| value.to_le_bytes()).collect();
                    take(Element::F32, &bytes)
                })
            }
            Content::File(file, places) => {
                let place = places.get(name).ok_or_else(none)?;
                let file = file.lock().unwrap_or_else(PoisonError::into_inner);
                let read = place.read(&file, |bytes| take(place.element, bytes).map_err(ReadError::Checkpoint));
                read.map_err(|error| match error {
                    ReadError::Checkpoint(error) => error,
                    ReadError::Problem(problem) => problem.of(&self.path),
                })
            }
        }
    }

    fn not_finite(&self, name: &str, index: u64, value: f64) -> CheckpointError {
        let problem = if value.is_finite() { "which f32 cannot hold" } else { "not a finite number" };
        CheckpointError::Value { path: self.path.clone(), tensor: shortened(name), index, value, problem }
    }
}

/// What can end the reading of a tensor: the file, or who takes its pieces.
enum ReadError {
    Problem(Problem),
    Checkpoint(CheckpointError),
}

impl From<Problem> for ReadError {
    fn from(problem: Problem) -> ReadError {
        ReadError::Problem(problem)
    }
}
