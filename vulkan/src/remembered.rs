//! What a device remembers from one process to the next: compiled pipelines, the fastest forms, and which forms of
//! rounded factors it is trusted with.
//!
//! ```text
//! head       magic, the modules' checksum, vendor, device, driver's version, cache UUID
//! lengths    of the forms, of the verdicts and of the pipelines
//! forms      text, a line a class
//! verdicts   text, a line a form that was tried
//! pipelines  the data of a VkPipelineCache
//! checksum   CRC-32 of all before it: against damage, not against malice
//! ```
//!
//! Numbers are little-endian. Data of another device, driver or module, and damaged data, is ignored: everything is
//! made anew. The pipelines' own header is looked at, too, because not every driver does.

use crate::adapter::Identity;
use crate::forms::Choices;
use crate::gpu::Gpu;
use crate::pipelines::{MATRICES, MODULE, SUBGROUPS};
use crate::verdicts::Verdicts;

const MAGIC: &[u8; 16] = b"viewfuse device\x03";
/// Bytes of the head, of the lengths and of a checksum.
const HEAD: usize = 16 + 4 + 4 * 3 + 16;
const LENGTHS: usize = 12;
const CHECKSUM: usize = 4;
/// Bytes of the header of a pipeline cache, and its version.
const CACHE_HEADER: usize = 32;
const CACHE_VERSION: u32 = 1;

impl Identity {
    fn head(&self) -> Vec<u8> {
        let mut head = MAGIC.to_vec();
        let mut modules = crc32fast::Hasher::new();
        modules.update(MODULE);
        modules.update(SUBGROUPS);
        modules.update(MATRICES);
        head.extend(modules.finalize().to_le_bytes());
        for number in [self.vendor, self.device, self.driver] {
            head.extend(number.to_le_bytes());
        }
        head.extend(self.cache);
        head
    }

    /// Whether data has the header of this device's pipeline caches.
    fn has_header(&self, data: &[u8]) -> bool {
        let number = |at: usize| data.get(at..at + 4)?.try_into().ok().map(u32::from_ne_bytes);
        let numbers = [CACHE_HEADER as u32, CACHE_VERSION, self.vendor, self.device];
        (0..4).all(|index| number(4 * index) == Some(numbers[index])) && data.get(16..CACHE_HEADER) == Some(&self.cache)
    }
}

impl Gpu {
    /// Takes what [`Gpu::remembered`] gave to an earlier process, before the first dispatch. Returns whether it was
    /// taken: data of another device or driver, of another version of the kernels, and damaged data, is ignored.
    pub fn recall(&self, remembered: &[u8]) -> bool {
        let Some((choices, verdicts, pipelines)) = decode(&self.handle.identity(), remembered) else { return false };
        let mut state = self.lock();
        state.choices = choices;
        // Verdicts are on the device's own units.
        if !self.has_stand_ins {
            state.verdicts = verdicts;
        }
        if !pipelines.is_empty() {
            self.pipelines.recall(pipelines);
        }
        true
    }

    /// Whether the device remembers more than it recalled. It compiles nothing more ahead.
    pub fn has_new_memories(&self) -> bool {
        self.ahead.stop();
        let state = self.lock();
        state.choices.has_new() || (state.verdicts.has_new() && !self.has_stand_ins) || self.pipelines.has_new()
    }

    /// What the device remembers, and what others did that wrote `kept` in the meantime: [`Gpu::remembered`] of another
    /// process, or anything else, which is ignored then.
    pub fn remembered(&self, kept: &[u8]) -> Vec<u8> {
        self.ahead.stop();
        let (identity, state) = (self.handle.identity(), &mut *self.lock());
        let mut verdicts = if self.has_stand_ins { Verdicts::default() } else { state.verdicts.clone() };
        if let Some((choices, others, pipelines)) = decode(&identity, kept) {
            state.choices.merge(choices);
            verdicts.merge(others);
            self.pipelines.merge(pipelines);
        }
        encode(&identity, &state.choices, &verdicts, &self.pipelines.cached())
    }
}

fn encode(identity: &Identity, choices: &Choices, verdicts: &Verdicts, pipelines: &[u8]) -> Vec<u8> {
    let texts = [choices.text(), verdicts.text()];
    let pipelines = if identity.has_header(pipelines) { pipelines } else { &[] };
    let mut bytes = identity.head();
    for length in [texts[0].len(), texts[1].len(), pipelines.len()] {
        bytes.extend((length as u32).to_le_bytes());
    }
    texts.iter().for_each(|text| bytes.extend(text.as_bytes()));
    bytes.extend(pipelines);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

fn decode<'a>(identity: &Identity, bytes: &'a [u8]) -> Option<(Choices, Verdicts, &'a [u8])> {
    let (content, sum) = bytes.split_last_chunk::<CHECKSUM>()?;
    if crc32fast::hash(content).to_le_bytes() != *sum || !content.starts_with(&identity.head()) {
        return None;
    }
    let length = |at: usize| Some(u32::from_le_bytes(content.get(at..at + 4)?.try_into().ok()?) as usize);
    let (choices_len, verdicts_len, pipelines_len) = (length(HEAD)?, length(HEAD + 4)?, length(HEAD + 8)?);
    let (choices, rest) = content.get(HEAD + LENGTHS..)?.split_at_checked(choices_len)?;
    let (verdicts, pipelines) = rest.split_at_checked(verdicts_len)?;
    let choices = Choices::parse(std::str::from_utf8(choices).ok()?)?;
    let verdicts = Verdicts::parse(std::str::from_utf8(verdicts).ok()?)?;
    let is_whole = pipelines.len() == pipelines_len && (pipelines.is_empty() || identity.has_header(pipelines));
    is_whole.then_some((choices, verdicts, pipelines))
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: Identity = Identity { vendor: 7, device: 8, driver: 9, cache: [3; 16] };

    fn pipelines() -> Vec<u8> {
        let mut data: Vec<u8> = [32, 1, 7, 8].iter().flat_map(|number: &u32| number.to_ne_bytes()).collect();
        data.extend([3; 16]);
        data.extend(0..100);
        data
    }

    fn choices() -> Choices {
        Choices::parse("convolve 14 6 7 subgroup\nlinear 9 6 7 single\n").expect("choices")
    }

    fn verdicts() -> Verdicts {
        Verdicts::parse("linear half true\nconvolve two_halves false\n").expect("verdicts")
    }

    #[test]
    fn what_is_remembered_is_recalled() {
        for data in [pipelines(), Vec::new()] {
            let bytes = encode(&IDENTITY, &choices(), &verdicts(), &data);
            assert_eq!(decode(&IDENTITY, &bytes), Some((choices(), verdicts(), &data[..])));
        }
        // A cache without the right header is not kept.
        let bytes = encode(&IDENTITY, &choices(), &verdicts(), &[1; 100]);
        assert_eq!(decode(&IDENTITY, &bytes), Some((choices(), verdicts(), &[][..])));
    }

    #[test]
    fn damaged_data_is_ignored() {
        let bytes = encode(&IDENTITY, &choices(), &verdicts(), &pipelines());
        for length in 0..bytes.len() {
            assert_eq!(decode(&IDENTITY, &bytes[..length]), None, "{length} bytes");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert_eq!(decode(&IDENTITY, &damaged), None, "byte {at}");
        }
    }

    #[test]
    fn another_device_driver_or_module_recalls_nothing() {
        let bytes = encode(&IDENTITY, &choices(), &verdicts(), &pipelines());
        let others = [
            Identity { vendor: 1, ..IDENTITY },
            Identity { device: 1, ..IDENTITY },
            Identity { driver: 1, ..IDENTITY },
            Identity { cache: [1; 16], ..IDENTITY },
        ];
        for other in others {
            assert_eq!(decode(&other, &bytes), None);
        }
        // Other kernels: the modules' checksum stands behind the magic.
        let mut other = bytes[..bytes.len() - CHECKSUM].to_vec();
        other[MAGIC.len()] ^= 1;
        other.extend(crc32fast::hash(&other).to_le_bytes());
        assert_eq!(decode(&IDENTITY, &other), None);
        // A right frame around another device's pipelines.
        let mut foreign = pipelines();
        foreign[8] = 1;
        assert!(!IDENTITY.has_header(&foreign) && IDENTITY.has_header(&pipelines()));
    }
}
