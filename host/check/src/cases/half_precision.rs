//! [`Kernel::PackF16`] and [`Kernel::PackFactors`]: numbers from far below to far above the range of half precision,
//! odd and even counts of them. An independent implementation packs and reads half precision here.

use super::*;
use crate::half::{from_half, nearest};

/// What rounds to infinity.
const TO_INFINITY: f64 = 65520.0;
/// NaN is compared as this, which no number in half precision is.
const NOT_A_NUMBER: f32 = 131_072.0;

/// Two in a word, the lower half first.
pub(super) fn packed(numbers: &[f32]) -> Vec<u32> {
    let bits = |number: Option<&f32>| number.map_or(0, |number| u32::from(nearest(f64::from(*number))));
    numbers.chunks(2).map(|pair| bits(pair.first()) | bits(pair.get(1)) << 16).collect()
}

/// Both numbers of each word.
pub(super) fn unpacked(words: &[u32]) -> Vec<f32> {
    let bits = words.iter().flat_map(|word| [*word as u16, (*word >> 16) as u16]);
    bits.map(|bits| from_half(bits) as f32).collect()
}

/// Increases the numbers by 1 %.
pub(super) fn increase_packed(words: &mut Vec<u32>) {
    let mut numbers = unpacked(words);
    increase(&mut numbers);
    *words = packed(&numbers);
}

/// Numbers, with one behind those that count, which must not be taken along.
fn of_all_magnitudes(random: &mut Random, number_count: u32) -> Vec<f32> {
    let number = || {
        let power = random.range(-30.0, 18.0).exp2();
        match random.below(4) {
            // Between two numbers in half precision, as near to one as to the other.
            0 if power < TO_INFINITY => from_half(nearest(power)) * (1.0 + 0.5_f64.powi(11)),
            0 => f64::INFINITY,
            _ => random.normal() * power,
        }
    };
    let mut numbers = numbers(number_count as usize, number);
    numbers.push(77.0);
    numbers
}

/// An even and an odd count of numbers, with the numbers and space for their words and one more.
fn inputs(random: &mut Random, size: u32) -> [(u32, Vec<f32>, Output<u32>); 2] {
    [2 * size, 2 * size - 1].map(|number_count| {
        let words = Output::Zeros(word_count(number_count) as usize + 1);
        (number_count, of_all_magnitudes(random, number_count), words)
    })
}

/// Both numbers of each word that a device wrote.
fn read_words<D: Device>(device: &D, words: Option<&D::Buffer<u32>>) -> Result<Vec<f32>, DeviceError> {
    words.map_or(Ok(Vec::new()), |words| Ok(unpacked(&device.download(words)?)))
}

impl Case for PackF16 {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-4 };
    const REASON: &'static str = "the nearest number in half precision, of two the even one: exact";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("numbers", |case| increase(&mut case.numbers))];

    fn inputs(seed: u64, size: u32) -> Vec<PackF16> {
        let dispatch = |(number_count, numbers, words)| PackF16 { number_count, numbers, words };
        inputs(&mut random(41, seed, size), size).map(dispatch).into()
    }

    fn read_one<D: Device>(device: &D, (_, words): &Self::Loaded<D>, index: usize) -> Result<Vec<f32>, DeviceError> {
        read_words(device, words[index].as_ref())
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let numbers = &self.numbers[..self.number_count as usize];
        let behind = 2 + numbers.len() % 2;
        decided(numbers.iter().map(|number| Bounded::from(from_half(nearest(f64::from(*number))) as f32)), behind)
    }
}

impl Case for PackFactors {
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = PackF16::LIMITS;
    const REASON: &'static str = PackF16::REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("numbers", |case| increase(&mut case.numbers))];

    fn inputs(seed: u64, size: u32) -> Vec<PackFactors> {
        let dispatch = |(number_count, numbers, words)| PackFactors { number_count, numbers, words };
        inputs(&mut random(64, seed, size), size).map(dispatch).into()
    }

    fn read_one<D: Device>(device: &D, (_, words): &Self::Loaded<D>, index: usize) -> Result<Vec<f32>, DeviceError> {
        let numbers = read_words(device, words[index].as_ref())?;
        Ok(numbers.into_iter().map(|number| if number.is_nan() { NOT_A_NUMBER } else { number }).collect())
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let numbers = &self.numbers[..self.number_count as usize];
        let behind = 2 + numbers.len() % 2;
        let expected = |number: &f32| {
            let is_too_large = number.abs() > 65_504.0;
            if is_too_large { NOT_A_NUMBER } else { from_half(nearest(f64::from(*number))) as f32 }
        };
        decided(numbers.iter().map(expected).map(Bounded::from), behind)
    }
}
