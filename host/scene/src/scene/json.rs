//! Looking keys up in a JSON file, with the full name of the key in every error.

use std::fmt;
use std::path::Path;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use super::error::SceneError;
use super::fault::Place;

/// An object of a JSON file and its place.
#[derive(Clone, Debug)]
pub(super) struct Object<'a> {
    path: &'a Path,
    /// Put before a key: empty at the top, `frames[3].` in a frame.
    prefix: String,
    entries: &'a Map<String, Value>,
}

/// Parses a file's text. A key that stands in an object twice is an error.
pub(super) fn parse(path: &Path, text: &str) -> Result<Value, SceneError> {
    let parsed = serde_json::from_str::<Unrepeated>(text).map(|Unrepeated(value)| value);
    parsed.map_err(|error| {
        let (line, column) = (error.line(), error.column());
        // The parser appends the place, which our message has in front, where editors expect it.
        let said = error.to_string();
        let reason = said.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&said).to_string();
        SceneError::Json { path: path.to_path_buf(), line, column, reason }
    })
}

impl<'a> Object<'a> {
    /// The object that a value must be; `key` is empty for the whole file.
    pub(super) fn new(path: &'a Path, key: &str, value: &'a Value) -> Result<Object<'a>, SceneError> {
        let Value::Object(entries) = value else {
            let key = if key.is_empty() { "the whole file" } else { key };
            return Err(wrong_type(path, key.to_string(), "an object"));
        };
        let prefix = if key.is_empty() { String::new() } else { format!("{key}.") };
        Ok(Object { path, prefix, entries })
    }

    /// The key's full name.
    pub(super) fn full(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    /// A value; `null` counts as absent.
    pub(super) fn get(&self, key: &str) -> Option<&'a Value> {
        self.entries.get(key).filter(|value| !value.is_null())
    }

    /// A required value.
    pub(super) fn required(&self, key: &str) -> Result<&'a Value, SceneError> {
        self.get(key).ok_or_else(|| SceneError::MissingKey { path: self.path.to_path_buf(), key: self.full(key) })
    }

    /// A number, if there is one.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>, SceneError> {
        self.get(key).map(|value| number(self.path, &self.full(key), value)).transpose()
    }

    /// A required text.
    pub(super) fn text(&self, key: &str) -> Result<&'a str, SceneError> {
        let value = self.required(key)?;
        value.as_str().ok_or_else(|| wrong_type(self.path, self.full(key), "a text"))
    }

    /// A required array.
    pub(super) fn array(&self, key: &str) -> Result<&'a [Value], SceneError> {
        array(self.path, &self.full(key), self.required(key)?)
    }

    /// The 16 numbers of a required array of 4 rows of 4 numbers.
    pub(super) fn matrix(&self, key: &str) -> Result<[f64; 16], SceneError> {
        let name = self.full(key);
        let rows = of_length(self.path, &name, self.array(key)?, "rows")?;
        let mut matrix = [0.0; 16];
        for (row, values) in rows.iter().enumerate() {
            let name = format!("{name}[{row}]");
            let values = of_length(self.path, &name, array(self.path, &name, values)?, "numbers")?;
            for (column, value) in values.iter().enumerate() {
                matrix[4 * row + column] = number(self.path, &format!("{name}[{column}]"), value)?;
            }
        }
        Ok(matrix)
    }
}

/// JSON has no NaN and the parser refuses numbers beyond f64, so that a number is finite here.
fn number(path: &Path, key: &str, value: &Value) -> Result<f64, SceneError> {
    value.as_f64().ok_or_else(|| wrong_type(path, key.to_string(), "a number"))
}

fn array<'a>(path: &Path, key: &str, value: &'a Value) -> Result<&'a [Value], SceneError> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| wrong_type(path, key.to_string(), "an array"))
}

fn of_length<'a>(path: &Path, key: &str, values: &'a [Value], of: &'static str) -> Result<&'a [Value; 4], SceneError> {
    values.try_into().map_err(|_| SceneError::WrongCount {
        path: path.to_path_buf(),
        place: Place::Key(key.to_string()),
        of,
        expected: 4,
        found: values.len(),
    })
}

fn wrong_type(path: &Path, key: String, expected: &'static str) -> SceneError {
    SceneError::WrongType { path: path.to_path_buf(), key, expected }
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
