//! The memory that uploads pass through: a ring of parts, so that the host fills one of them while the device still
//! copies from the others, and nobody waits for an upload.

use crate::handle::Memory;
use std::ops::Range;

/// Parts of the ring.
const PARTS: usize = 4;
/// Less than this is not divided.
const MIN_DIVIDED: usize = 1 << 12;
/// What is uploaded begins at multiples of this.
const ALIGNMENT: usize = 16;

/// The ring of uploads.
pub(crate) struct Ring {
    pub(crate) memory: Memory,
    pub(crate) places: Places,
}

/// What of a ring is in use.
pub(crate) struct Places {
    part_bytes: usize,
    part: usize,
    /// The first byte of the part that is free.
    free: usize,
    /// The last submission that copies from each part; 0 for none.
    copied_in: Vec<u64>,
}

impl Places {
    /// Of a ring of so many bytes, none in use.
    pub(crate) fn new(bytes: usize) -> Places {
        let parts = if bytes < MIN_DIVIDED { 1 } else { PARTS };
        let part_bytes = if parts == 1 { bytes } else { bytes / parts / ALIGNMENT * ALIGNMENT };
        Places { part_bytes, part: 0, free: 0, copied_in: vec![0; parts] }
    }

    /// A place for the first of so many bytes, at most a part of them, and the submission that must be done before they
    /// are written.
    pub(crate) fn take(&mut self, bytes: usize) -> (Range<usize>, u64) {
        let bytes = bytes.min(self.part_bytes);
        let mut copied_in = 0;
        if self.free + bytes > self.part_bytes {
            self.part = (self.part + 1) % self.copied_in.len();
            self.free = 0;
            copied_in = self.copied_in[self.part];
        }
        let first = self.part * self.part_bytes + self.free;
        self.free = (self.free + bytes).next_multiple_of(ALIGNMENT);
        (first..first + bytes, copied_in)
    }

    /// The place that was taken last is copied from in this submission.
    pub(crate) fn copied(&mut self, submission: u64) {
        self.copied_in[self.part] = submission;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_written_again_when_its_last_copy_is_done() {
        let mut places = Places::new(MIN_DIVIDED);
        let mut take = |bytes: usize, submission: u64| {
            let taken = places.take(bytes);
            places.copied(submission);
            taken
        };
        assert_eq!(take(100, 1), (0..100, 0));
        assert_eq!(take(900, 2), (112..1012, 0), "beside what is there");
        assert_eq!(take(100, 2), (1024..1124, 0), "in the next part");
        assert_eq!(take(5000, 3), (2048..3072, 0), "at most a part");
        assert_eq!(take(1024, 4), (3072..4096, 0));
        assert_eq!(take(1, 5), (0..1, 2), "after the last of the first part");
        assert_eq!(take(1024, 6), (1024..2048, 2));
        assert_eq!(take(1024, 7), (2048..3072, 3));
    }

    #[test]
    fn little_memory_is_one_part() {
        let mut places = Places::new(30);
        assert_eq!(places.take(40), (0..30, 0));
        places.copied(7);
        assert_eq!(places.take(8), (0..8, 7));
        assert_eq!(places.take(14), (16..30, 0));
    }
}
