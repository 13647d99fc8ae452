//! Arrays in a device's memory.

use crate::error::VulkanError;
use crate::handle::{Handle, Memory};
use crate::kernel::Layout;
use ash::vk;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use viewfuse_core::pages::MOST_PAGES;

/// An array of `T` in a device's memory. What no allocation of the device can hold lies in several chunks of a page each.
pub struct Buffer<T> {
    pub(crate) array: Arc<Array>,
    kind: PhantomData<fn(T) -> T>,
}

impl<T> Buffer<T> {
    pub(crate) fn new(array: Array) -> Buffer<T> {
        Buffer { array: Arc::new(array), kind: PhantomData }
    }

    /// How many elements there are.
    pub fn len(&self) -> usize {
        self.array.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The array without its type, to be bound to a kernel.
    pub fn bind(&self) -> Bound<'_> {
        Bound(&self.array)
    }
}

/// An array that is to be bound to a kernel.
#[derive(Clone, Copy)]
pub struct Bound<'a>(pub(crate) &'a Arc<Array>);

/// Memory of an array, and when it was last used.
pub(crate) struct Array {
    /// At least one.
    pub(crate) chunks: Vec<Memory>,
    /// Elements of every chunk but the last.
    pub(crate) chunk_len: usize,
    /// Elements in all.
    pub(crate) len: usize,
    /// Bytes of an element.
    pub(crate) stride: usize,
    /// The stretch between two barriers in which it was last read.
    pub(crate) read_in: Stretch,
    /// The same for writing.
    pub(crate) written_in: Stretch,
}

impl Array {
    /// Handles of one device mean nothing to another.
    pub(crate) fn check_owner(&self, handle: &Handle) -> Result<(), VulkanError> {
        let owner = self.chunks[0].owner();
        match std::ptr::eq(owner, handle) {
            true => Ok(()),
            false => Err(VulkanError::OtherDevice { device: handle.name.clone(), owner: owner.name.clone() }),
        }
    }

    /// Where elements from `first` on lie: the chunk, the byte in it, and how many elements follow there.
    pub(crate) fn place(&self, first: usize) -> (&Memory, u64, usize) {
        let chunk = (first / self.chunk_len).min(self.chunks.len() - 1);
        let start = chunk * self.chunk_len;
        let end = if chunk + 1 == self.chunks.len() { self.len } else { start + self.chunk_len };
        (&self.chunks[chunk], ((first - start) * self.stride) as u64, end - first)
    }
}

/// The byte range of a binding.
pub(crate) struct Range {
    pub(crate) buffer: vk::Buffer,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

/// The ranges that an array is bound as: itself, or its pages; pages that it does not have are its first one again.
pub(crate) fn ranges(array: &Array, layout: Layout, page_shift: u32) -> Vec<Range> {
    let page_len = match (layout, page_shift) {
        (Layout::Whole | Layout::One, _) | (_, 0) => array.len,
        (Layout::Pages, shift) => 1 << shift,
    };
    let binding_count = if layout == Layout::Pages { MOST_PAGES } else { 1 };
    (0..binding_count)
        .map(|page| {
            let first = if page * page_len < array.len { page * page_len } else { 0 };
            let (memory, offset, there) = array.place(first);
            // An empty array still binds something.
            let len = page_len.min(there).max(1);
            Range { buffer: memory.buffer, offset, bytes: (len * array.stride) as u64 }
        })
        .collect()
}

/// A stretch of commands between two barriers, by number; 0 is none.
#[derive(Debug, Default)]
pub(crate) struct Stretch(AtomicU64);

impl Stretch {
    pub(crate) fn set(&self, stretch: u64) {
        self.0.store(stretch, Ordering::Relaxed);
    }

    pub(crate) fn is(&self, stretch: u64) -> bool {
        self.0.load(Ordering::Relaxed) == stretch
    }
}
