//! Arrays as NumPy's files (`.npy`, version 1), little-endian and row-major.

/// A type of element that is written.
pub trait Element: Copy {
    /// NumPy's name of the type, with the byte order.
    const KIND: &'static str;

    /// Appends its bytes.
    fn put(self, bytes: &mut Vec<u8>);
}

impl Element for f32 {
    const KIND: &'static str = "<f4";

    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Element for f64 {
    const KIND: &'static str = "<f8";

    fn put(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

/// The bytes of a `.npy` file with an array of this shape. The values' number should be the product of the shape:
/// readers refuse a file with another.
pub fn npy<E: Element>(shape: &[usize], values: &[E]) -> Vec<u8> {
    // A tuple of one has a comma.
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let sides = if shape.len() > 1 { sides.trim_end_matches(", ") } else { sides.trim_end() };
    let header = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({sides}), }}", E::KIND);
    // Magic, version and length take 10 bytes; with a line's end the header fills a multiple of 64.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{header:<width$}\n", width = length - 1).into_bytes());
    values.iter().for_each(|value| value.put(&mut bytes));
    bytes
}
