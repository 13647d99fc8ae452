//! Python pickles as data: a pickle is a program for a stack machine, and here that program only ever builds values.
//!
//! What Python would import, call or set up stays a description of itself: a [`Value::Global`] is a name, and every
//! call of one is a [`Value::Object`] that remembers what was to be called with what. Nothing is looked up, so nothing
//! can be executed; who reads the values gives meaning to the few names that it knows.
//!
//! Read are the opcodes that Python writes at protocols 2 to 5, without out-of-band buffers and without the registry of
//! extensions. Values live in one list and refer to each other by number, as Python's do by address: what is shared in
//! the pickle is shared here, cycles do no harm, and neither reading nor dropping recurses. Texts are copied out of the
//! file once; the contents of `bytes`, which can be large, stay in it. The constants below bound the rest.
//!
//! Source: CPython's `Lib/pickletools.py` and `Lib/pickle.py`.

mod machine;

use super::input::Input;
use machine::Machine;
use std::io;

/// Opcodes that one pickle may have. A `state_dict` takes about 40 a tensor.
pub const MOST_STEPS: u64 = 4_000_000;
/// Values that one pickle may build, and places on its stack and in its memo.
pub const MOST_VALUES: usize = 500_000;
/// Bytes of all its texts together.
pub const LONGEST_TEXTS: usize = 16 << 20;
/// Memory that reading one pickle takes at most, in bytes: of the above, with lists that double when they are full.
pub const PICKLE_BYTES: u64 = 256 << 20;

/// Why a pickle was not read.
#[derive(Debug, thiserror::Error)]
#[error("byte {at}: {fault}")]
pub struct PickleError {
    /// Offset in the file of the opcode at fault.
    pub at: u64,
    /// What is wrong there.
    pub fault: Fault,
}

/// What is wrong with a pickle.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The operating system did not let us read it.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// It ends before its last opcode.
    #[error("the pickle ends too early; the file is cut off or damaged")]
    Ends,
    /// No opcode of those that are read.
    #[error("opcode 0x{0:02x} is not one that torch.save writes; the file is damaged or made by something else")]
    Opcode(u8),
    /// A protocol from the future, or one that Python 3 does not write by default.
    #[error("pickle protocol {0} is not read (2 to 5 are)")]
    Protocol(u8),
    /// Fewer values than the opcode takes.
    #[error("opcode 0x{0:02x} finds too few values on the stack; the file is damaged")]
    Stack(u8),
    /// Values of a kind that the opcode does not take.
    #[error("opcode 0x{0:02x} finds values that it does not apply to; the file is damaged")]
    Kind(u8),
    /// A value that was never remembered.
    #[error("memo {0} was never set; the file is damaged")]
    Memo(u32),
    /// A text that is not UTF-8.
    #[error("a text is not UTF-8; the file is damaged")]
    Text,
    /// More than is ever needed.
    #[error("more than {limit} {what}, which no checkpoint needs; the file is damaged or malicious")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How much is allowed.
        limit: u64,
    },
}

impl From<io::Error> for Fault {
    fn from(cause: io::Error) -> Fault {
        if cause.kind() == io::ErrorKind::UnexpectedEof { Fault::Ends } else { Fault::Io(cause) }
    }
}

/// The number of a value in its pickle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Id(u32);

/// A piece of the pickle's texts.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    start: u32,
    length: u32,
}

/// A Python value.
#[derive(Debug)]
pub enum Value {
    /// `None`.
    None,
    /// `bool`.
    Bool(bool),
    /// `int` of at most 64 bits.
    Int(i64),
    /// `int` of more: its bytes, the least significant first, as [`Pickle::wide`] gives them.
    Wide(Span),
    /// `float`.
    Float(f64),
    /// `str`: see [`Pickle::text`].
    Text(Span),
    /// `bytes`, `bytearray`, or a `str` of Python 2 that is no text: where they stand in the file.
    Bytes {
        /// Offset of the first byte in the file.
        start: u64,
        /// Their number.
        length: u64,
    },
    /// `tuple`.
    Tuple(Vec<Id>),
    /// `list`.
    List(Vec<Id>),
    /// `set` or `frozenset`.
    Set(Vec<Id>),
    /// `dict`, in the order of insertion; a key can appear twice, and Python takes the last.
    Dict(Vec<(Id, Id)>),
    /// The name of a class or function: see [`Pickle::global`].
    Global {
        /// Its module.
        module: Span,
        /// Its name there.
        name: Span,
    },
    /// Something that is stored outside the pickle under this identity.
    Persistent(Id),
    /// What Python would get by a call.
    Object(Box<Object>),
}

/// What Python would get by a call, and do with it afterwards.
#[derive(Debug)]
pub struct Object {
    /// What would be called.
    pub callable: Id,
    /// With which arguments.
    pub arguments: Id,
    /// And with which named ones.
    pub named: Option<Id>,
    /// What would become its attributes.
    pub state: Option<Id>,
    /// What would be set in it as in a dict.
    pub items: Vec<(Id, Id)>,
    /// What would be added to it as to a list.
    pub elements: Vec<Id>,
}

/// The values of one pickle.
#[derive(Debug)]
pub struct Pickle {
    values: Vec<Value>,
    texts: String,
    wide: Vec<u8>,
    root: Id,
}

impl Pickle {
    /// Reads one pickle; `input` then stands behind it.
    ///
    /// # Errors
    /// [`PickleError`].
    pub fn read(input: &mut Input<'_>) -> Result<Pickle, PickleError> {
        let mut machine = Machine::new();
        for _ in 0..MOST_STEPS {
            let at = input.position();
            if let Some(root) = machine.step(input).map_err(|fault| PickleError { at, fault })? {
                return Ok(Pickle { values: machine.values, texts: machine.texts, wide: machine.wide, root });
            }
        }
        let fault = Fault::TooMany { what: "opcodes", limit: MOST_STEPS };
        Err(PickleError { at: input.position(), fault })
    }

    /// The value that the whole pickle stands for.
    pub fn root(&self) -> Id {
        self.root
    }

    /// All values, in the order in which they were built.
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// A value. An [`Id`] of another pickle gives `None` of Python, or another value.
    pub fn value(&self, id: Id) -> &Value {
        self.values.get(id.0 as usize).unwrap_or(&Value::None)
    }

    /// A text.
    pub fn text(&self, id: Id) -> Option<&str> {
        match *self.value(id) {
            Value::Text(span) => Some(self.span(span)),
            _ => None,
        }
    }

    /// Module and name of a class or function.
    pub fn global(&self, id: Id) -> Option<(&str, &str)> {
        match *self.value(id) {
            Value::Global { module, name } => Some((self.span(module), self.span(name))),
            _ => None,
        }
    }

    /// An integer of at most 64 bits.
    pub fn integer(&self, id: Id) -> Option<i64> {
        match *self.value(id) {
            Value::Int(value) => Some(value),
            _ => None,
        }
    }

    /// The bytes of an integer of more than 64 bits, the least significant first, two's complement.
    pub fn wide(&self, id: Id) -> Option<&[u8]> {
        match *self.value(id) {
            Value::Wide(Span { start, length }) => self.wide.get(start as usize..(start + length) as usize),
            _ => None,
        }
    }

    /// What is in a tuple or list.
    pub fn sequence(&self, id: Id) -> Option<&[Id]> {
        match self.value(id) {
            Value::Tuple(elements) | Value::List(elements) => Some(elements),
            _ => None,
        }
    }

    /// What Python would get by a call.
    pub fn object(&self, id: Id) -> Option<&Object> {
        match self.value(id) {
            Value::Object(object) => Some(object),
            _ => None,
        }
    }

    fn span(&self, Span { start, length }: Span) -> &str {
        self.texts.get(start as usize..(start + length) as usize).unwrap_or_default()
    }
}
