//! The header of a PLY file: which elements follow, and where each property of an element is.
//!
//! Read are the headers of binary little-endian files whose rows have a fixed length: what scanners, reconstructions
//! and programs for Gaussians write. A crate for the format would add two more to every build and name neither property
//! nor element in its errors; of the format only the header's grammar is needed, because rows of fixed length are
//! slices.

use std::path::Path;

use crate::scene::{FileFault, FilePlace, PlyFault, SceneError, SceneFault};

/// Most bytes of a header: 62 properties of a Gaussian take two thousand.
const MAX_HEADER: usize = 64 << 10;

/// What every file begins with.
const MAGIC: &str = "ply";
/// The format that is read and written.
const FORMAT: &str = "binary_little_endian 1.0";

/// The type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlyType {
    /// A whole number of so many bytes.
    Whole(usize),
    /// `float`: 4 bytes.
    Float,
    /// `double`: 8 bytes.
    Double,
}

impl PlyType {
    fn named(name: &str) -> Option<PlyType> {
        Some(match name {
            "char" | "uchar" | "int8" | "uint8" => PlyType::Whole(1),
            "short" | "ushort" | "int16" | "uint16" => PlyType::Whole(2),
            "int" | "uint" | "int32" | "uint32" => PlyType::Whole(4),
            "float" | "float32" => PlyType::Float,
            "double" | "float64" => PlyType::Double,
            _ => return None,
        })
    }

    /// Bytes of a value.
    pub fn size(self) -> usize {
        match self {
            PlyType::Whole(size) => size,
            PlyType::Float => 4,
            PlyType::Double => 8,
        }
    }
}

/// A property of an element: a column of its rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlyProperty {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: PlyType,
    /// Where it begins in a row, in bytes.
    pub offset: usize,
}

/// An element: so many rows of the same properties.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlyElement {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// The properties in the order of a row.
    pub properties: Vec<PlyProperty>,
    /// Bytes of a row; `None` where a property is a list.
    pub row_size: Option<usize>,
}

impl PlyElement {
    /// The property of this name.
    pub fn property(&self, name: &str) -> Option<&PlyProperty> {
        self.properties.iter().find(|property| property.name == name)
    }
}

/// The elements of a header, and where the first row begins.
#[derive(Debug)]
pub(crate) struct PlyHeader<'a> {
    path: &'a Path,
    /// In the order of the file.
    pub(crate) elements: Vec<PlyElement>,
    /// What `comment` and `obj_info` say, each with its line.
    pub(crate) comments: Vec<(usize, String)>,
    length: usize,
}

impl<'a> PlyHeader<'a> {
    /// # Errors
    /// [`SceneFault::Ply`] with the line of the first thing that is not a header's.
    pub(crate) fn read(path: &'a Path, bytes: &[u8]) -> Result<PlyHeader<'a>, SceneError> {
        let failed = |line, fault| FilePlace::line(path, line).fault(SceneFault::Ply(fault));
        let (mut elements, mut length, mut has_format) = (Vec::<PlyElement>::new(), 0, false);
        let mut comments = Vec::new();
        let mut line = 0;
        loop {
            line += 1;
            let rest = &bytes[length..bytes.len().min(MAX_HEADER)];
            let text = rest.iter().position(|byte| *byte == b'\n').map(|end| &rest[..end]);
            let Some(text) = text else {
                let fault = if line == 1 { PlyFault::Magic } else { PlyFault::NoEnd };
                return Err(failed(line, fault));
            };
            length += text.len() + 1;
            let text = String::from_utf8_lossy(text);
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            match words[..] {
                [MAGIC] if line == 1 => {}
                _ if line == 1 => return Err(failed(line, PlyFault::Magic)),
                [] => {}
                ["comment" | "obj_info", ref words @ ..] => comments.push((line, words.join(" "))),
                ["format", ref format @ ..] if format.join(" ") == FORMAT => has_format = true,
                ["format", ref format @ ..] => return Err(failed(line, PlyFault::Format(excerpt(&format.join(" "))))),
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| failed(line, PlyFault::Line(excerpt(&text))))?;
                    let name = excerpt(name);
                    elements.push(PlyElement { name, count, properties: Vec::new(), row_size: Some(0) });
                }
                ["property", ref property @ ..] => {
                    let place = elements.last_mut().ok_or(PlyFault::NoElement);
                    place.and_then(|element| add(element, property)).map_err(|fault| failed(line, fault))?;
                }
                ["end_header"] if has_format => return Ok(PlyHeader { path, elements, comments, length }),
                _ => return Err(failed(line, PlyFault::Line(excerpt(&text)))),
            }
        }
    }

    /// The element of this name with its rows, one after the other. What follows it is not looked at.
    ///
    /// # Errors
    /// [`SceneError`] if there is no such element, if a list stands in it or before it, or if the file is too short.
    pub(crate) fn rows<'b>(&self, bytes: &'b [u8], name: &'static str) -> Result<(&PlyElement, &'b [u8]), SceneError> {
        let fault = |fault| FilePlace::file(self.path).fault(SceneFault::Ply(fault));
        let mut rest = &bytes[self.length..];
        for element in &self.elements {
            let Some(size) = element.row_size else { return Err(fault(PlyFault::List(element.name.clone()))) };
            let room = rest.len() / size.max(1);
            let count = usize::try_from(element.count).ok().filter(|count| *count <= room);
            let Some(count) = count else {
                let no_room = FileFault::NoRoom("rows", element.count, room);
                return Err(FilePlace::key(self.path, format!("element {}", element.name)).fault(no_room));
            };
            let (rows, behind) = rest.split_at(count * size);
            if element.name == name {
                return Ok((element, rows));
            }
            rest = behind;
        }
        Err(fault(PlyFault::NoSuchElement(name)))
    }

    /// Bytes behind the rows of all elements; none where an element has lists.
    pub(crate) fn surplus(&self, bytes: &[u8]) -> u64 {
        let sizes = self.elements.iter().map(|element| Some(element.count.saturating_mul(element.row_size? as u64)));
        let all: Option<u64> = sizes.sum();
        all.map_or(0, |all| ((bytes.len() - self.length) as u64).saturating_sub(all))
    }
}

/// The header of a file with one element, to be followed by its rows: `properties` are types and names. Comments stand
/// behind the properties: strict readers take the third line for the element's.
pub fn header<'a>(
    element: &str,
    count: usize,
    properties: impl IntoIterator<Item = (&'a str, String)>,
    comments: &[String],
) -> Vec<u8> {
    let mut text = format!("{MAGIC}\nformat {FORMAT}\nelement {element} {count}\n");
    for (kind, name) in properties {
        text.push_str(&format!("property {kind} {name}\n"));
    }
    comments.iter().for_each(|comment| text.push_str(&format!("comment {comment}\n")));
    text.push_str("end_header\n");
    text.into_bytes()
}

/// Adds the property of a line, of which these are the words behind the first.
fn add(element: &mut PlyElement, words: &[&str]) -> Result<(), PlyFault> {
    match *words {
        ["list", _, _, _] => element.row_size = None,
        [kind, name] => {
            let kind = PlyType::named(kind).ok_or_else(|| PlyFault::Type(excerpt(kind)))?;
            if element.property(name).is_some() {
                return Err(PlyFault::Twice(excerpt(name)));
            }
            let offset = element.properties.last().map_or(0, |last| last.offset + last.kind.size());
            element.properties.push(PlyProperty { name: name.to_owned(), kind, offset });
            element.row_size = element.row_size.map(|size| size + kind.size());
        }
        _ => return Err(PlyFault::Line(excerpt(&format!("property {}", words.join(" "))))),
    }
    Ok(())
}

/// The beginning of a text from a file, for a message.
fn excerpt(text: &str) -> String {
    text.chars().take(40).collect()
}
