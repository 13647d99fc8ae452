//! The stack machine of pickles. Every opcode builds a value, moves values on the stack, or fills a value; none has
//! another effect.

use super::super::input::Input;
use super::{Fault, Id, LONGEST_TEXTS, MAX_VALUES, Object, Span, Value};
use std::collections::HashMap;

/// The most bytes of the name of a module or class.
const LONGEST_NAME: usize = 4096;

/// The stack machine.
pub(super) struct Machine {
    pub(super) values: Vec<Value>,
    pub(super) texts: String,
    pub(super) wide: Vec<u8>,
    stack: Vec<Id>,
    /// Heights of the stack at the marks that are open.
    marks: Vec<u32>,
    memo: HashMap<u32, Id>,
}

/// Values that exist from the start, so that single-byte opcodes do not each build a new one.
const NONE: Id = Id(0);
const FALSE: Id = Id(1);
const TRUE: Id = Id(2);
const EMPTY: Id = Id(3);

impl Machine {
    pub(super) fn new() -> Machine {
        Machine {
            values: vec![Value::None, Value::Bool(false), Value::Bool(true), Value::Tuple(Vec::new())],
            texts: String::new(),
            wide: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
        }
    }

    /// Executes one opcode; the last one returns the result.
    pub(super) fn step(&mut self, input: &mut Input<'_>) -> Result<Option<Id>, Fault> {
        let opcode = input.byte()?;
        match opcode {
            0x80 => match input.byte()? {
                2..=5 => {}
                protocol => return Err(Fault::Protocol(protocol)),
            },
            // A frame only tells how much Python may read ahead.
            0x95 => _ = input.array::<8>()?,
            b'.' => return self.pop(opcode).map(Some),
            // Numbers, texts and constants.
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
            // Lists, tuples, sets and dictionaries, made or filled.
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
            // The stack and the memo.
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
            // Objects, named, called or filled.
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
                // Attributes of other values, such as integers, are not read.
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

    /// Height of the stack at the innermost open mark, below which no value may be taken.
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

    /// Reads this many bytes, if the limit of all texts allows it.
    fn take(&self, input: &mut Input<'_>, length: u64) -> Result<Vec<u8>, Fault> {
        let room = LONGEST_TEXTS - self.texts.len() - self.wide.len();
        if length > room as u64 {
            // A length beyond the end of the file is damage.
            input.check(length)?;
            return Err(Fault::TooMany("bytes of text", LONGEST_TEXTS as u64));
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
                _ => return Err(Fault::TooMany("bytes of a name", LONGEST_NAME as u64)),
            }
        }
        if line.len() > LONGEST_TEXTS - self.texts.len() - self.wide.len() {
            return Err(Fault::TooMany("bytes of text", LONGEST_TEXTS as u64));
        }
        self.keep(&line)
    }
}

/// Both ends are below [`LONGEST_TEXTS`].
fn span(start: usize, end: usize) -> Span {
    Span { start: start as u32, length: (end - start) as u32 }
}

fn bounded(what: &'static str, count: usize) -> Result<(), Fault> {
    if count < MAX_VALUES { Ok(()) } else { Err(Fault::TooMany(what, MAX_VALUES as u64)) }
}
