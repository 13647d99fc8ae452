//! Memory between two pages that nobody may touch: a step over either end of it ends the process.
#![expect(unsafe_code, reason = "pages are protected")]

use region::{Allocation, Protection};

/// What words hold that belong to no array.
const EMPTY: u32 = 0xa5a5_a5a5;

/// Pages between two that may not be touched, with an array that begins or ends exactly there.
pub(crate) struct Guarded {
    memory: Allocation,
    page: usize,
    words: usize,
    /// Where the array is.
    first: usize,
    length: usize,
}

impl Guarded {
    /// Room for so many words.
    pub(crate) fn new(words: usize) -> Guarded {
        let page = region::page::size();
        let inside = (4 * words).next_multiple_of(page).max(page);
        let memory = region::alloc(inside + 2 * page, Protection::READ_WRITE).expect("memory");
        let start = memory.as_ptr::<u8>();
        for guard in [start, start.wrapping_add(page + inside)] {
            // SAFETY: the page is one of this allocation, and nothing lies in it.
            unsafe { region::protect(guard, page, Protection::NONE) }.expect("a page that nobody may touch");
        }
        let mut guarded = Guarded { memory, page, words: inside / 4, first: 0, length: 0 };
        guarded.inside().fill(EMPTY);
        guarded
    }

    fn inside(&mut self) -> &mut [u32] {
        let start = self.memory.as_mut_ptr::<u8>().wrapping_add(self.page).cast::<u32>();
        // SAFETY: the words between the two pages, which this value owns; a page's start is aligned.
        unsafe { std::slice::from_raw_parts_mut(start, self.words) }
    }

    /// Lays an array at the first page's end or, else, before the last page.
    pub(crate) fn lay(&mut self, array: &[u32], is_first: bool) {
        let (first, length) = (self.first, self.length);
        self.inside()[first..first + length].fill(EMPTY);
        self.first = if is_first { 0 } else { self.words - array.len() };
        self.length = array.len();
        self.array().copy_from_slice(array);
    }

    /// The array.
    pub(crate) fn array(&mut self) -> &mut [u32] {
        let (first, length) = (self.first, self.length);
        &mut self.inside()[first..first + length]
    }

    /// Where the array begins.
    pub(crate) fn pointer(&mut self) -> *mut u32 {
        self.array().as_mut_ptr()
    }

    /// Whether nothing was written beside the array.
    pub(crate) fn is_empty_beside(&mut self) -> bool {
        let (first, end) = (self.first, self.first + self.length);
        let inside = self.inside();
        inside[..first].iter().chain(&inside[end..]).all(|word| *word == EMPTY)
    }
}
