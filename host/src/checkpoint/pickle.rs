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

use super::input::Input;
use std::collections::HashMap;
use std::io;

/// Opcodes that one pickle may have. A `state_dict` takes about 40 a tensor.
pub const MOST_STEPS: u64 = 4_000_000;
/// Values that one pickle may build, and places on its stack and in its memo.
pub const MOST_VALUES: usize = 500_000;
/// Bytes of all its texts together.
pub const LONGEST_TEXTS: usize = 16 << 20;
/// Bytes of the name of a module or class.
const LONGEST_NAME: usize = 4096;
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

/// The stack machine.
struct Machine {
    values: Vec<Value>,
    texts: String,
    wide: Vec<u8>,
    stack: Vec<Id>,
    /// Heights of the stack at the marks that are open.
    marks: Vec<u32>,
    memo: HashMap<u32, Id>,
}

/// Values that every pickle has from the start, so that a file's every byte does not make another.
const NONE: Id = Id(0);
const FALSE: Id = Id(1);
const TRUE: Id = Id(2);
const EMPTY: Id = Id(3);

impl Machine {
    fn new() -> Machine {
        Machine {
            values: vec![Value::None, Value::Bool(false), Value::Bool(true), Value::Tuple(Vec::new())],
            texts: String::new(),
            wide: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
        }
    }

    /// Does what one opcode says; gives the result after the last.
    fn step(&mut self, input: &mut Input<'_>) -> Result<Option<Id>, Fault> {
        let opcode = input.byte()?;
        match opcode {
            0x80 => match input.byte()? {
                2..=5 => {}
                protocol => return Err(Fault::Protocol(protocol)),
            },
            // A frame only tells how much Python may read ahead.
            0x95 => _ = input.array::<8>()?,
            b'.' => return self.pop(opcode).map(Some),
            b'N' => self.push(NONE)?,
            0x88 => self.push(TRUE)?,
            0x89 => self.push(FALSE)?,
            b')' => self.push(EMPTY)?,
            b'J' => self.add(Value::Int(i32::from_le_bytes(input.array()?).into()))?,
            b'K' => self.add(Value::Int(input.byte()?.into()))?,
            b'M' => self.add(Value::Int(u16::from_le_bytes(input.array()?).into()))?,
            b'G' => self.add(Value::Float(f64::from_be_bytes(input.array()?)))?,
            0x8a => self.integer(input, 1)?,
            0x8b => self.integer(input, 4)?,
            0x8c => self.text(input, 1)?,
            b'X' => self.text(input, 4)?,
            0x8d => self.text(input, 8)?,
            b'U' => self.old_text(input, 1)?,
            b'T' => self.old_text(input, 4)?,
            b'C' => self.bytes(input, 1)?,
            b'B' => self.bytes(input, 4)?,
            0x8e | 0x96 => self.bytes(input, 8)?,
            b']' => self.add(Value::List(Vec::new()))?,
            b'}' => self.add(Value::Dict(Vec::new()))?,
            0x8f => self.add(Value::Set(Vec::new()))?,
            0x85..=0x87 => {
                let elements = self.pop_last(opcode, usize::from(opcode - 0x84))?;
                self.add(Value::Tuple(elements))?;
            }
            b't' => {
                let elements = self.pop_marked(opcode)?;
                self.add(Value::Tuple(elements))?;
            }
            0x91 => {
                let elements = self.pop_marked(opcode)?;
                self.add(Value::Set(elements))?;
            }
            b'a' => {
                let elements = self.pop_last(opcode, 1)?;
                self.append(opcode, &elements)?;
            }
            b'e' | 0x90 => {
                let elements = self.pop_marked(opcode)?;
                self.append(opcode, &elements)?;
            }
            b's' => {
                let pairs = self.pop_last(opcode, 2)?;
                self.set_items(opcode, &pairs)?;
            }
            b'u' => {
                let pairs = self.pop_marked(opcode)?;
                self.set_items(opcode, &pairs)?;
            }
            b'(' => {
                bounded("marks", self.marks.len())?;
                self.marks.push(self.stack.len() as u32);
            }
            b'0' => _ = self.pop(opcode)?,
            b'1' => _ = self.pop_marked(opcode)?,
            b'2' => {
                let top = self.top(opcode)?;
                self.push(top)?;
            }
            b'h' => self.recall(input.byte()?.into())?,
            b'j' => self.recall(u32::from_le_bytes(input.array()?))?,
            b'q' => self.remember(opcode, input.byte()?.into())?,
            b'r' => self.remember(opcode, u32::from_le_bytes(input.array()?))?,
            0x94 => self.remember(opcode, self.memo.len() as u32)?,
            b'c' => {
                let module = self.line(input)?;
                let name = self.line(input)?;
                self.add(Value::Global { module, name })?;
            }
            0x93 => {
                let (name, module) = (self.pop(opcode)?, self.pop(opcode)?);
                let text = |id: Id| match self.values[id.0 as usize] {
                    Value::Text(span) => Ok(span),
                    _ => Err(Fault::Kind(opcode)),
                };
                let (module, name) = (text(module)?, text(name)?);
                self.add(Value::Global { module, name })?;
            }
            b'Q' => {
                let identity = self.pop(opcode)?;
                self.add(Value::Persistent(identity))?;
            }
            // A class's `__new__` is a call like another.
            b'R' | 0x81 => {
                let (arguments, callable) = (self.pop(opcode)?, self.pop(opcode)?);
                self.call(callable, arguments, None)?;
            }
            0x92 => {
                let (named, arguments, callable) = (self.pop(opcode)?, self.pop(opcode)?, self.pop(opcode)?);
                self.call(callable, arguments, Some(named))?;
            }
            b'b' => {
                let state = self.pop(opcode)?;
                let top = self.top(opcode)?;
                // Attributes of anything else, of an integer say, would change nothing that is asked for here.
                if let Value::Object(object) = &mut self.values[top.0 as usize] {
                    object.state = Some(state);
                }
            }
            _ => return Err(Fault::Opcode(opcode)),
        }
        Ok(None)
    }

    fn push(&mut self, id: Id) -> Result<(), Fault> {
        bounded("values on the stack", self.stack.len())?;
        self.stack.push(id);
        Ok(())
    }

    fn add(&mut self, value: Value) -> Result<(), Fault> {
        bounded("values", self.values.len())?;
        let id = Id(self.values.len() as u32);
        self.values.push(value);
        self.push(id)
    }

    fn call(&mut self, callable: Id, arguments: Id, named: Option<Id>) -> Result<(), Fault> {
        let object = Object { callable, arguments, named, state: None, items: Vec::new(), elements: Vec::new() };
        self.add(Value::Object(Box::new(object)))
    }

    /// Height of the stack below which the innermost open mark forbids to go.
    fn floor(&self) -> usize {
        self.marks.last().map_or(0, |&mark| mark as usize)
    }

    fn top(&self, opcode: u8) -> Result<Id, Fault> {
        self.stack[self.floor()..].last().copied().ok_or(Fault::Stack(opcode))
    }

    fn pop(&mut self, opcode: u8) -> Result<Id, Fault> {
        let top = self.top(opcode)?;
        self.stack.pop();
        Ok(top)
    }

    fn pop_last(&mut self, opcode: u8, count: usize) -> Result<Vec<Id>, Fault> {
        match self.stack.len().checked_sub(count).filter(|&start| start >= self.floor()) {
            Some(start) => Ok(self.stack.drain(start..).collect()),
            None => Err(Fault::Stack(opcode)),
        }
    }

    fn pop_marked(&mut self, opcode: u8) -> Result<Vec<Id>, Fault> {
        let mark = self.marks.pop().ok_or(Fault::Stack(opcode))?;
        // Not `split_off(mark)`: at mark 0 that gives the stack away with its whole capacity.
        Ok(self.stack.drain(mark as usize..).collect())
    }

    fn append(&mut self, opcode: u8, more: &[Id]) -> Result<(), Fault> {
        let top = self.top(opcode)?;
        match &mut self.values[top.0 as usize] {
            Value::List(elements) | Value::Set(elements) => elements.extend(more),
            Value::Object(object) => object.elements.extend(more),
            _ => return Err(Fault::Kind(opcode)),
        }
        Ok(())
    }

    fn set_items(&mut self, opcode: u8, more: &[Id]) -> Result<(), Fault> {
        let top = self.top(opcode)?;
        let (pairs, rest) = more.as_chunks::<2>();
        let pairs = pairs.iter().map(|&[key, value]| (key, value));
        match &mut self.values[top.0 as usize] {
            Value::Dict(items) if rest.is_empty() => items.extend(pairs),
            Value::Object(object) if rest.is_empty() => object.items.extend(pairs),
            _ => return Err(Fault::Kind(opcode)),
        }
        Ok(())
    }

    fn remember(&mut self, opcode: u8, number: u32) -> Result<(), Fault> {
        bounded("remembered values", self.memo.len())?;
        let top = self.top(opcode)?;
        self.memo.insert(number, top);
        Ok(())
    }

    fn recall(&mut self, number: u32) -> Result<(), Fault> {
        let id = *self.memo.get(&number).ok_or(Fault::Memo(number))?;
        self.push(id)
    }

    fn integer(&mut self, input: &mut Input<'_>, width: usize) -> Result<(), Fault> {
        let length = input.length(width)?;
        if length <= 8 {
            let mut bytes = [0; 8];
            input.exact(&mut bytes[..length as usize])?;
            // The sign stands in the highest bit of those that are there.
            let shift = 64 - 8 * length as u32;
            let value = if length == 0 { 0 } else { (i64::from_le_bytes(bytes) << shift) >> shift };
            return self.add(Value::Int(value));
        }
        let start = self.wide.len();
        let bytes = self.take(input, length)?;
        self.wide.extend(bytes);
        self.add(Value::Wide(span(start, self.wide.len())))
    }

    fn text(&mut self, input: &mut Input<'_>, width: usize) -> Result<(), Fault> {
        let length = input.length(width)?;
        let bytes = self.take(input, length)?;
        let span = self.keep(&bytes)?;
        self.add(Value::Text(span))
    }

    /// A `str` of Python 2: mostly text, sometimes the bytes of an array.
    fn old_text(&mut self, input: &mut Input<'_>, width: usize) -> Result<(), Fault> {
        let length = input.length(width)?;
        let start = input.position();
        let bytes = self.take(input, length)?;
        match self.keep(&bytes) {
            Ok(span) => self.add(Value::Text(span)),
            Err(_) => self.add(Value::Bytes { start, length }),
        }
    }

    /// Reads this many bytes, if texts may still grow by as many.
    fn take(&self, input: &mut Input<'_>, length: u64) -> Result<Vec<u8>, Fault> {
        let room = LONGEST_TEXTS - self.texts.len() - self.wide.len();
        if length > room as u64 {
            // A length that the file cannot hold tells of damage, whatever it is.
            input.check(length)?;
            return Err(Fault::TooMany { what: "bytes of text", limit: LONGEST_TEXTS as u64 });
        }
        Ok(input.take(length)?)
    }

    fn keep(&mut self, bytes: &[u8]) -> Result<Span, Fault> {
        let start = self.texts.len();
        self.texts.push_str(std::str::from_utf8(bytes).map_err(|_| Fault::Text)?);
        Ok(span(start, self.texts.len()))
    }

    fn bytes(&mut self, input: &mut Input<'_>, width: usize) -> Result<(), Fault> {
        let length = input.length(width)?;
        let start = input.position();
        input.skip(length)?;
        self.add(Value::Bytes { start, length })
    }

    /// Text up to the end of the line: part of a name.
    fn line(&mut self, input: &mut Input<'_>) -> Result<Span, Fault> {
        let mut line = Vec::new();
        loop {
            match input.byte()? {
                b'\n' => break,
                byte if line.len() < LONGEST_NAME => line.push(byte),
                _ => return Err(Fault::TooMany { what: "bytes of a name", limit: LONGEST_NAME as u64 }),
            }
        }
        if line.len() > LONGEST_TEXTS - self.texts.len() - self.wide.len() {
            return Err(Fault::TooMany { what: "bytes of text", limit: LONGEST_TEXTS as u64 });
        }
        self.keep(&line)
    }
}

/// Both ends are below [`LONGEST_TEXTS`].
fn span(start: usize, end: usize) -> Span {
    Span { start: start as u32, length: (end - start) as u32 }
}

fn bounded(what: &'static str, count: usize) -> Result<(), Fault> {
    if count < MOST_VALUES { Ok(()) } else { Err(Fault::TooMany { what, limit: MOST_VALUES as u64 }) }
}
