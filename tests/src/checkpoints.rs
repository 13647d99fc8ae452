//! Checkpoints made by hand, byte by byte: right ones, and all that PyTorch would never write; and changed ones.

use std::path::PathBuf;
use tempfile::TempDir;
use viewfuse::nn::checkpoint::{Checkpoint, TensorShape};

/// A tensor as a `state_dict` describes it. Every field can lie.
#[derive(Clone, Debug)]
pub struct Claim {
    /// Its name.
    pub name: String,
    /// The class of its storage, `FloatStorage` for example.
    pub class: &'static str,
    /// The key of its storage.
    pub key: String,
    /// How many elements the storage is said to have.
    pub count: i64,
    /// The storage.
    pub bytes: Vec<u8>,
    /// The tensor's first element in it.
    pub first: i64,
    /// Its shape.
    pub shape: Vec<i64>,
    /// Its strides.
    pub strides: Vec<i64>,
}

impl Claim {
    /// A tensor of `f32`, row-major, in a storage of its own.
    pub fn new(name: &str, shape: &[i64], values: &[f32]) -> Claim {
        let strides = (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()).collect();
        Claim {
            name: name.to_owned(),
            class: "FloatStorage",
            key: name.to_owned(),
            count: values.len() as i64,
            bytes: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            first: 0,
            shape: shape.to_vec(),
            strides,
        }
    }
}

/// A pickle in the making.
#[derive(Clone, Debug, Default)]
pub struct Pickle(pub Vec<u8>);

impl Pickle {
    /// Begins one of protocol 2, as `torch.save` does.
    pub fn new() -> Pickle {
        Pickle(b"\x80\x02".to_vec())
    }

    /// Adds opcodes as they are.
    pub fn raw(mut self, bytes: &[u8]) -> Pickle {
        self.0.extend_from_slice(bytes);
        self
    }

    /// Pushes a text.
    pub fn text(self, text: &str) -> Pickle {
        self.raw(b"X").raw(&(text.len() as u32).to_le_bytes()).raw(text.as_bytes())
    }

    /// Pushes an integer.
    pub fn int(self, value: i64) -> Pickle {
        self.raw(b"\x8a\x08").raw(&value.to_le_bytes())
    }

    /// Pushes a class or function.
    pub fn global(self, module: &str, name: &str) -> Pickle {
        self.raw(format!("c{module}\n{name}\n").as_bytes())
    }

    /// Pushes a tuple of integers.
    pub fn tuple(self, values: &[i64]) -> Pickle {
        values.iter().fold(self.raw(b"("), |pickle, &value| pickle.int(value)).raw(b"t")
    }

    /// Pushes a tensor.
    pub fn tensor(self, claim: &Claim) -> Pickle {
        self.global("torch._utils", "_rebuild_tensor_v2")
            .raw(b"(")
            .storage(claim)
            .int(claim.first)
            .tuple(&claim.shape)
            .tuple(&claim.strides)
            .raw(b"\x89ccollections\nOrderedDict\n)RtR")
    }

    /// Pushes a tensor whose storage is a file within this file.
    pub fn nested_tensor(self, claim: &Claim) -> Pickle {
        let storage = legacy(&Pickle::new().storage(claim).end(), std::slice::from_ref(claim));
        self.global("torch._utils", "_rebuild_tensor_v2")
            .raw(b"(")
            .global("torch.storage", "_load_from_bytes")
            .bytes(&storage)
            .raw(b"\x85R")
            .int(claim.first)
            .tuple(&claim.shape)
            .tuple(&claim.strides)
            .raw(b"\x89ccollections\nOrderedDict\n)RtR")
    }

    /// Pushes a storage that stands outside.
    fn storage(self, claim: &Claim) -> Pickle {
        let named = self.raw(b"(").text("storage").global("torch", claim.class).text(&claim.key);
        named.text("cpu").int(claim.count).raw(b"tQ")
    }

    /// Pushes bytes.
    pub fn bytes(self, bytes: &[u8]) -> Pickle {
        self.raw(b"B").raw(&(bytes.len() as u32).to_le_bytes()).raw(bytes)
    }

    /// Pushes a module with these parameters, whose storages are files within this file, and with these modules in it.
    pub fn module(self, parameters: &[Claim], modules: &[(&str, Pickle)]) -> Pickle {
        let start = self.global("nets", "Net").raw(b")\x81}(").text("training").raw(b"\x88").text("_parameters");
        let filled = parameters
            .iter()
            .fold(start.raw(b"}("), |pickle, claim| pickle.text(&claim.name).nested_tensor(claim))
            .raw(b"u");
        let between = filled.text("_buffers").raw(b"}").text("_modules").raw(b"}(");
        modules.iter().fold(between, |pickle, (name, module)| pickle.text(name).raw(&module.0)).raw(b"uub")
    }

    /// Pushes a `state_dict`.
    pub fn state_dict(self, claims: &[Claim]) -> Pickle {
        let start = self.global("collections", "OrderedDict").raw(b")R(");
        claims.iter().fold(start, |pickle, claim| pickle.text(&claim.name).tensor(claim)).raw(b"u")
    }

    /// Its bytes, ended.
    pub fn end(self) -> Vec<u8> {
        self.raw(b".").0
    }
}

/// The pickle of a `state_dict`.
pub fn state_dict(claims: &[Claim]) -> Vec<u8> {
    Pickle::new().state_dict(claims).end()
}

/// A file as PyTorch has written it since 1.6.
pub fn archive(pickle: &[u8], claims: &[Claim]) -> Vec<u8> {
    let mut entries = vec![
        ("archive/data.pkl".to_owned(), pickle.to_vec()),
        ("archive/byteorder".to_owned(), b"little".to_vec()),
        ("archive/version".to_owned(), b"3\n".to_vec()),
    ];
    for claim in claims {
        let name = format!("archive/data/{}", claim.key);
        if entries.iter().all(|(other, _)| *other != name) {
            entries.push((name, claim.bytes.clone()));
        }
    }
    zip(&entries, 0)
}

/// A zip archive whose entries say that they are compressed by `method`, and are not.
pub fn zip(entries: &[(String, Vec<u8>)], method: u16) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in entries {
        let start = file.len() as u32;
        let mut facts = Vec::new();
        facts.extend(20u16.to_le_bytes());
        facts.extend([0; 2]);
        facts.extend(method.to_le_bytes());
        facts.extend([0; 8]);
        facts.extend((content.len() as u32).to_le_bytes());
        facts.extend((content.len() as u32).to_le_bytes());
        facts.extend((name.len() as u16).to_le_bytes());
        facts.extend([0; 2]);
        file.extend(b"PK\x03\x04");
        file.extend(&facts);
        file.extend(name.as_bytes());
        file.extend(content);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&facts);
        directory.extend([0; 10]);
        directory.extend(start.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, count) = (file.len() as u32, entries.len() as u16);
    file.extend(&directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    file.extend(count.to_le_bytes());
    file.extend(count.to_le_bytes());
    file.extend((directory.len() as u32).to_le_bytes());
    file.extend(start.to_le_bytes());
    file.extend([0; 2]);
    file
}

/// A file as PyTorch wrote it before 1.6.
pub fn legacy(pickle: &[u8], claims: &[Claim]) -> Vec<u8> {
    legacy_of(true, pickle, claims)
}

/// The same from a machine of this byte order.
pub fn legacy_of(little_endian: bool, pickle: &[u8], claims: &[Claim]) -> Vec<u8> {
    let order: &[u8] = if little_endian { b"\x88" } else { b"\x89" };
    let mut file = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.".to_vec();
    file.extend(b"\x80\x02M\xe9\x03.");
    file.extend(Pickle::new().raw(b"}").text("little_endian").raw(order).raw(b"s").end());
    file.extend(pickle);
    let mut storages: Vec<&Claim> = Vec::new();
    for claim in claims {
        if storages.iter().all(|other| other.key != claim.key) {
            storages.push(claim);
        }
    }
    let keys = storages.iter().fold(Pickle::new().raw(b"]("), |pickle, claim| pickle.text(&claim.key));
    file.extend(keys.raw(b"e").end());
    for claim in storages {
        file.extend(claim.count.to_le_bytes());
        file.extend(&claim.bytes);
    }
    file
}

/// A file as EDM's training writes it: a network with these parameters, and something beside it.
pub fn snapshot(claims: &[Claim]) -> Vec<u8> {
    let table = Pickle::new().raw(b"}(").text("ema").module(claims, &[]);
    table.text("dataset_kwargs").raw(b"}u").end()
}

/// A safetensors file with this header.
pub fn safetensors(header: &str, content: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes(), header.as_bytes(), content].concat()
}

/// A checkpoint with its tensors changed.
pub fn changed(made: &Checkpoint, change: impl FnOnce(&mut Vec<(TensorShape, Vec<f32>)>)) -> Checkpoint {
    let tensor = |(name, shape): (&String, &Vec<usize>)| {
        (TensorShape { name: name.clone(), shape: shape.clone() }, made.tensor(name).expect("values"))
    };
    let mut tensors = made.shapes().iter().map(tensor).collect();
    change(&mut tensors);
    Checkpoint::in_memory("changed", tensors, made.metadata().clone())
}

/// Times this, every weight of a made network is finite still; what becomes of numbers that meet several of them is
/// not.
pub const LARGE: f32 = 1.9e38;

/// A checkpoint with all numbers of the tensors of which this is true multiplied; there is one.
#[track_caller]
pub fn multiplied(made: &Checkpoint, is_one: impl Fn(&str) -> bool, factor: f32) -> Checkpoint {
    changed(made, |tensors| {
        let chosen: Vec<_> = tensors.iter_mut().filter(|(tensor, _)| is_one(&tensor.name)).collect();
        assert!(!chosen.is_empty(), "none of these tensors");
        chosen.into_iter().flat_map(|(_, values)| values).for_each(|value| *value *= factor);
    })
}

/// A file with these bytes, in a folder that goes away.
pub fn file(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint");
    std::fs::write(&path, bytes).expect("a file");
    (folder, path)
}
