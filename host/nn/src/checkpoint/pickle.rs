//! Python pickles as data: a pickle is a program for a stack machine, and this machine only builds values.
//!
//! Imports, calls and object states are kept as descriptions: a [`Value::Global`] is a name, and every call of one is a
//! [`Value::Object`] with the function's name and its arguments. No name is resolved, so no code can be executed; the
//! reader of the values interprets the few names that it knows.
//!
//! The supported opcodes are those that Python writes at protocols 2 to 5, without out-of-band buffers and without the
//! registry of extensions. Values are in one list and refer to each other by index, as Python's do by address: shared
//! values are shared here, cycles are allowed, and neither reading nor dropping recurses. Texts are copied from the
//! file once; the contents of `bytes`, which can be large, stay in the file. The constants below limit the rest.
//!
//! Source: CPython's `Lib/pickletools.py` and `Lib/pickle.py`.

mod machine;

use super::input::Input;
use machine::Machine;
use std::io;

/// The most opcodes of a pickle. A `state_dict` takes about 40 a tensor.
pub const MAX_STEPS: u64 = 4_000_000;
/// The most values of a pickle, and the most entries of its stack and its memo.
pub const MAX_VALUES: usize = 500_000;
/// The most bytes of all its texts together.
pub const LONGEST_TEXTS: usize = 16 << 20;
/// The most memory for reading one pickle, in bytes: for the limits above, with lists that double when they are full.
pub const PICKLE_BYTES: u64 = 256 << 20;

/// Why a pickle could not be read.
#[derive(Debug, thiserror::Error)]
#[error("byte {at}: {fault}")]
pub struct PickleError {
    /// Offset in the file of the opcode at fault.
    pub at: u64,
    /// The problem.
    pub fault: Fault,
}

/// A problem with a pickle.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The operating system reported an error while reading it.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// It ends before its last opcode.
    #[error("the pickle ends too early; the file is cut off or damaged")]
    Ends,
    /// An unsupported opcode.
    #[error("opcode 0x{0:02x} is not one that torch.save writes; the file is damaged or made by something else")]
    Opcode(u8),
    /// An unsupported protocol: a newer one, or one that Python 3 does not write by default.
    #[error("pickle protocol {0} is not read (2 to 5 are)")]
    Protocol(u8),
    /// Fewer values than the opcode takes.
    #[error("opcode 0x{0:02x} finds too few values on the stack; the file is damaged")]
    Stack(u8),
    /// Values of a kind that the opcode does not take.
    #[error("opcode 0x{0:02x} finds values that it does not apply to; the file is damaged")]
    Kind(u8),
    /// A memo entry that was never set.
    #[error("memo {0} was never set; the file is damaged")]
    Memo(u32),
    /// A text is not UTF-8.
    #[error("a text is not UTF-8; the file is damaged")]
    Text,
    /// The limit of a quantity is exceeded.
    #[error("more than {1} {0}, which no checkpoint needs; the file is damaged or malicious")]
    TooMany(&'static str, u64),
}

impl From<io::Error> for Fault {
    fn from(cause: io::Error) -> Fault {
        if cause.kind() == io::ErrorKind::UnexpectedEof { Fault::Ends } else { Fault::Io(cause) }
    }
}

/// The number of a value in its pickle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Id(u32);

/// A range of the pickle's texts.
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
    /// `bytes`, `bytearray`, or a `str` of Python 2 that is not a text: its range in the file.
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
    /// A value that is stored outside the pickle under this identity.
    Persistent(Id),
    /// The result of a call.
    Object(Box<Object>),
}

/// The result of a call, with the state that Python would set afterwards.
#[derive(Debug)]
pub struct Object {
    /// The function or class.
    pub callable: Id,
    /// Its arguments.
    pub arguments: Id,
    /// Its keyword arguments.
    pub named: Option<Id>,
    /// The state from which its attributes would be set.
    pub state: Option<Id>,
    /// Items that would be set as in a dict.
    pub items: Vec<(Id, Id)>,
    /// Elements that would be appended as to a list.
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
    /// Reads one pickle; `input` is then behind it.
    ///
    /// # Errors
    /// [`PickleError`].
    pub fn read(input: &mut Input<'_>) -> Result<Pickle, PickleError> {
        let mut machine = Machine::new();
        for _ in 0..MAX_STEPS {
            let at = input.position();
            if let Some(root) = machine.step(input).map_err(|fault| PickleError { at, fault })? {
                return Ok(Pickle { values: machine.values, texts: machine.texts, wide: machine.wide, root });
            }
        }
        let fault = Fault::TooMany("opcodes", MAX_STEPS);
        Err(PickleError { at: input.position(), fault })
    }

    /// The value of the whole pickle.
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

    /// The elements of a tuple or list.
    pub fn sequence(&self, id: Id) -> Option<&[Id]> {
        match self.value(id) {
            Value::Tuple(elements) | Value::List(elements) => Some(elements),
            _ => None,
        }
    }

    /// The result of a call.
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
