//! NumPy's `.npy`: 64-bit numbers in C order.

/// The bytes of an array of this shape, `numbers` in row-major order.
pub(super) fn npy(shape: &[usize], numbers: &[f64]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}", sides.join(", "));
    // Magic, version and length take 10 bytes; with a line's end the header fills a multiple of 64.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{header:<width$}\n", width = length - 1).into_bytes());
    bytes.extend(numbers.iter().copied().flat_map(f64::to_le_bytes));
    bytes
}
