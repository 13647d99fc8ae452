//! Looking keys up in a JSON file, with the full name of the key in every error.

use std::fmt;
use std::path::Path;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use super::error::SceneError;
use super::fault::{FaultLocation, FileFault, FilePlace};

/// An object of a JSON file and its place.
#[derive(Clone, Debug)]
pub(crate) struct Object<'a> {
    path: &'a Path,
    /// Put before a key: empty at the top, `frames[3].` in a frame.
    prefix: String,
    entries: &'a Map<String, Value>,
}

/// Parses a file's text. A key that stands in an object twice is an error.
pub(crate) fn parse(path: &Path, text: &str) -> Result<Value, SceneError> {
    let parsed = serde_json::from_str::<Unrepeated>(text).map(|Unrepeated(value)| value);
    parsed.map_err(|error| {
        let (line, column) = (error.line(), error.column());
        // The parser appends the place, which our message has in front, where editors expect it.
        let said = error.to_string();
        let reason = said.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&said).to_string();
        let place = FilePlace { path: path.to_path_buf(), location: FaultLocation::Column(line, column) };
        place.fault(FileFault::Json(reason))
    })
}

impl<'a> Object<'a> {
    /// The object that a value must be; `key` is empty for the whole file.
    pub(crate) fn new(path: &'a Path, key: &str, value: &'a Value) -> Result<Object<'a>, SceneError> {
        let Value::Object(entries) = value else {
            let key = if key.is_empty() { "the whole file" } else { key };
            return Err(wrong_type(path, key.to_string(), "an object"));
        };
        let prefix = if key.is_empty() { String::new() } else { format!("{key}.") };
        Ok(Object { path, prefix, entries })
    }

    /// The key's full name.
    pub(crate) fn full(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    /// A value; `null` counts as absent.
    pub(crate) fn get(&self, key: &str) -> Option<&'a Value> {
        self.entries.get(key).filter(|value| !value.is_null())
    }

    /// All keys with their values.
    pub(super) fn entries(&self) -> impl Iterator<Item = (&'a str, &'a Value)> + use<'a> {
        self.entries.iter().map(|(key, value)| (key.as_str(), value))
    }

    pub(super) fn required(&self, key: &str) -> Result<&'a Value, SceneError> {
        self.get(key).ok_or_else(|| self.missing(key))
    }

    /// The error for a required key that is missing.
    pub(crate) fn missing(&self, key: &str) -> SceneError {
        FilePlace::file(self.path).fault(FileFault::MissingKey(self.full(key)))
    }

    /// A number, if there is one.
    pub(crate) fn number(&self, key: &str) -> Result<Option<f64>, SceneError> {
        self.get(key).map(|value| number(self.path, &self.full(key), value)).transpose()
    }

    pub(crate) fn required_number(&self, key: &str) -> Result<f64, SceneError> {
        self.number(key)?.ok_or_else(|| self.missing(key))
    }

    /// A required text.
    pub(crate) fn text(&self, key: &str) -> Result<&'a str, SceneError> {
        let value = self.required(key)?;
        value.as_str().ok_or_else(|| wrong_type(self.path, self.full(key), "a text"))
    }

    /// A required array.
    pub(crate) fn array(&self, key: &str) -> Result<&'a [Value], SceneError> {
        array(self.path, &self.full(key), self.required(key)?)
    }

    /// A required array of this many rows of 4 numbers.
    pub(crate) fn rows<const N: usize>(&self, key: &str) -> Result<[[f64; 4]; N], SceneError> {
        let name = self.full(key);
        let mut rows = [[0.0; 4]; N];
        let values = of_length::<N>(self.path, &name, self.array(key)?, "rows")?;
        for (row, (numbers, values)) in rows.iter_mut().zip(values).enumerate() {
            let name = format!("{name}[{row}]");
            *numbers = all_numbers(self.path, &name, array(self.path, &name, values)?)?;
        }
        Ok(rows)
    }

    /// A required array of this many numbers.
    pub(crate) fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], SceneError> {
        all_numbers(self.path, &self.full(key), self.array(key)?)
    }
}

fn all_numbers<const N: usize>(path: &Path, key: &str, values: &[Value]) -> Result<[f64; N], SceneError> {
    let mut numbers = [0.0; N];
    for (index, (number_out, value)) in
        numbers.iter_mut().zip(of_length::<N>(path, key, values, "numbers")?).enumerate()
    {
        *number_out = number(path, &format!("{key}[{index}]"), value)?;
    }
    Ok(numbers)
}

/// JSON has no NaN and the parser refuses numbers beyond f64, so that a number is finite here.
fn number(path: &Path, key: &str, value: &Value) -> Result<f64, SceneError> {
    value.as_f64().ok_or_else(|| wrong_type(path, key.to_string(), "a number"))
}

fn array<'a>(path: &Path, key: &str, value: &'a Value) -> Result<&'a [Value], SceneError> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| wrong_type(path, key.to_string(), "an array"))
}

fn of_length<'a, const N: usize>(
    path: &Path,
    key: &str,
    values: &'a [Value],
    of: &'static str,
) -> Result<&'a [Value; N], SceneError> {
    let fault = || FileFault::WrongCount { of, expected: N, found: values.len() };
    values.try_into().map_err(|_| FilePlace::key(path, key).fault(fault()))
}

fn wrong_type(path: &Path, key: String, expected: &'static str) -> SceneError {
    FilePlace::file(path).fault(FileFault::WrongType(key, expected))
}

/// A value in whose objects no key stands twice: parsers keep one of the two, not all the same one.
struct Unrepeated(Value);

impl<'de> Deserialize<'de> for Unrepeated {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Unrepeated, D::Error> {
        deserializer.deserialize_any(UnrepeatedVisitor).map(Unrepeated)
    }
}

struct UnrepeatedVisitor;

impl<'de> Visitor<'de> for UnrepeatedVisitor {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Unrepeated(value)) = sequence.next_element()? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format_args!("the key {key:?} stands twice in one object")));
            }
            let Unrepeated(value) = entries.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}
