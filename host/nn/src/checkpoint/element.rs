//! Element types of tensors, and their values as numbers.

use safetensors::Dtype;
use viewfuse_core::half_precision::f16_value;

/// The type of a tensor's elements, little-endian where they take more than a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// 64-bit floating point.
    F64,
    /// 32-bit floating point.
    F32,
    /// 16-bit floating point of IEEE 754.
    F16,
    /// bfloat16: the upper half of a 32-bit floating point number.
    Bf16,
    /// Signed integer of 64 bits.
    I64,
    /// Signed integer of 32 bits.
    I32,
    /// Signed integer of 16 bits.
    I16,
    /// Signed integer of 8 bits.
    I8,
    /// Unsigned integer of 8 bits.
    U8,
    /// Boolean: a byte that is 0 or not.
    Bool,
}

/// All of them: PyTorch's name of the type and of a storage of it, and the type in safetensors.
const ALL: [(Element, &str, &str, Dtype); 10] = [
    (Element::F64, "float64", "DoubleStorage", Dtype::F64),
    (Element::F32, "float32", "FloatStorage", Dtype::F32),
    (Element::F16, "float16", "HalfStorage", Dtype::F16),
    (Element::Bf16, "bfloat16", "BFloat16Storage", Dtype::BF16),
    (Element::I64, "int64", "LongStorage", Dtype::I64),
    (Element::I32, "int32", "IntStorage", Dtype::I32),
    (Element::I16, "int16", "ShortStorage", Dtype::I16),
    (Element::I8, "int8", "CharStorage", Dtype::I8),
    (Element::U8, "uint8", "ByteStorage", Dtype::U8),
    (Element::Bool, "bool", "BoolStorage", Dtype::BOOL),
];

impl Element {
    /// Bytes of one.
    pub fn size(self) -> usize {
        match self {
            Element::F64 | Element::I64 => 8,
            Element::F32 | Element::I32 => 4,
            Element::F16 | Element::Bf16 | Element::I16 => 2,
            Element::I8 | Element::U8 | Element::Bool => 1,
        }
    }

    /// PyTorch's name, `float32` for example.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// Whether it is a floating point type, which can hold infinity and NaN.
    pub fn is_float(self) -> bool {
        matches!(self, Element::F64 | Element::F32 | Element::F16 | Element::Bf16)
    }

    pub(super) fn of_torch(name: &str) -> Option<Element> {
        ALL.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    pub(super) fn of_storage(class: &str) -> Option<Element> {
        ALL.iter().find(|row| row.2 == class).map(|row| row.0)
    }

    pub(super) fn of_safetensors(dtype: Dtype) -> Option<Element> {
        ALL.iter().find(|row| row.3 == dtype).map(|row| row.0)
    }

    pub(super) fn safetensors(self) -> Dtype {
        self.row().3
    }

    /// The list is in the order of the declaration; a test checks that.
    fn row(self) -> &'static (Element, &'static str, &'static str, Dtype) {
        &ALL[self as usize]
    }

    /// The elements of these bytes in `f64`, which is exact for all types but large 64-bit integers. An incomplete last
    /// element is omitted.
    pub(super) fn values(self, bytes: &[u8]) -> impl Iterator<Item = f64> {
        bytes.chunks_exact(self.size()).map(move |element| self.value(element))
    }

    fn value(self, bytes: &[u8]) -> f64 {
        let byte = |at: usize| bytes.get(at).copied().unwrap_or(0);
        let four = [byte(0), byte(1), byte(2), byte(3)];
        let eight = [byte(0), byte(1), byte(2), byte(3), byte(4), byte(5), byte(6), byte(7)];
        match self {
            Element::F64 => f64::from_le_bytes(eight),
            Element::F32 => f32::from_le_bytes(four).into(),
            Element::F16 => f16_value(u16::from_le_bytes([byte(0), byte(1)]).into()).into(),
            Element::Bf16 => f32::from_le_bytes([0, 0, byte(0), byte(1)]).into(),
            Element::I64 => i64::from_le_bytes(eight) as f64,
            Element::I32 => i32::from_le_bytes(four).into(),
            Element::I16 => i16::from_le_bytes([byte(0), byte(1)]).into(),
            Element::I8 => i8::from_le_bytes([byte(0)]).into(),
            Element::U8 => byte(0).into(),
            Element::Bool => f64::from(byte(0) != 0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_in_the_order_of_the_declaration() {
        for row in &ALL {
            assert_eq!(row.0.row().0, row.0);
        }
    }
}
