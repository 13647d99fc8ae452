//! Changes of an input: bits, bytes, numbers and words with a meaning, pieces cut out, doubled or taken from elsewhere.

/// Random numbers: SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below a limit; 0 if there is none.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    /// One of a list that is not empty.
    pub(crate) fn of<'a, T: ?Sized>(&mut self, list: &[&'a T]) -> &'a T {
        list[self.below(list.len())]
    }
}

/// Numbers at the ends of ranges, as bytes.
const NUMBERS: [u64; 10] = [
    0,
    1,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    i64::MAX as u64,
    u64::MAX,
    // As a float: infinity.
    0x7ff0_0000_0000_0000,
];

/// Numbers at the ends of ranges, as words.
const WORDS: [&str; 20] = [
    "0", "-0", "-1", "1", "0.5", "1e-320", "1e30", "1e38", "1e39", "1e300", "1e308", "1e400", "-1e308", "nan", "inf",
    "2147483648", "4294967296", "18446744073709551615", "1000000000000000000", "\u{1b}",
];

/// A run of digits, if there is one behind a place.
fn number_at(bytes: &[u8], from: usize) -> Option<std::ops::Range<usize>> {
    let is_part = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
    let start = from + bytes[from..].iter().position(u8::is_ascii_digit)?;
    let end = start + bytes[start..].iter().position(|byte| !is_part(byte)).unwrap_or(bytes.len() - start);
    Some(start..end)
}

/// One to four changes; `other` is an input to take pieces from, `words` belong to the format.
pub(crate) fn changed(bytes: &[u8], other: &[u8], words: &[&str], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(bytes.len());
        let length = random.below(48).min(bytes.len() - at);
        match random.below(10) {
            0 | 1 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            2 if !bytes.is_empty() => bytes[at] = random.below(256) as u8,
            3 => {
                let number = NUMBERS[random.below(NUMBERS.len())];
                let width = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
                let little = random.below(2) == 0;
                for place in 0..width {
                    let shift = if little { place } else { width - 1 - place };
                    bytes[at + place] = (number >> (8 * shift)) as u8;
                }
            }
            4 | 5 => {
                let list = if random.below(2) == 0 || words.is_empty() { &WORDS[..] } else { words };
                let word = random.of(list);
                let place = if random.below(3) > 0 { number_at(&bytes, at) } else { None };
                bytes.splice(place.unwrap_or(at..at), word.bytes());
            }
            6 => drop(bytes.drain(at..at + length)),
            7 => {
                let piece = bytes[at..at + length].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            8 => bytes.truncate(at.max(1)),
            _ => {
                let from = random.below(other.len());
                let piece = other[from..(from + length).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    // Sizes stay those of small files.
    bytes.truncate(LONGEST);
    bytes
}

/// Most bytes of an input.
pub(crate) const LONGEST: usize = 64 << 10;
