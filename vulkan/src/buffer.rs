//! Arrays in a device's memory.

use crate::error::VulkanError;
use crate::handle::{Handle, Memory};
use crate::kernel::Layout;
use ash::vk;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use viewfuse_kernels::pages::MAX_PAGES;

/// An array of `T` in a device's memory. An array that is too large for one allocation is stored in several chunks of a
/// page each.
pub struct Buffer<T> {
    pub(crate) array: Arc<Array>,
    kind: PhantomData<fn(T) -> T>,
}

impl<T> Buffer<T> {
    pub(crate) fn new(array: Array) -> Buffer<T> {
        Buffer { array: Arc::new(array), kind: PhantomData }
    }

    /// The number of elements.
    pub fn len(&self) -> usize {
        self.array.len
    }

    /// Whether it has no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The array without its type, to be bound to a kernel.
    pub fn bind(&self) -> Bound<'_> {
        Bound(&self.array)
    }
}

/// Values of an array on their way to the host; see [`Gpu::download_later`](crate::Gpu::download_later).
pub struct Coming<T> {
    /// On the host, of one chunk.
    pub(crate) array: Arc<Array>,
    /// The last submission that writes there.
    pub(crate) submission: u64,
    pub(crate) kind: PhantomData<fn() -> T>,
}

/// An array as an argument of a kernel.
#[derive(Clone, Copy)]
pub struct Bound<'a>(pub(crate) &'a Arc<Array>);

/// Memory of an array, and its last use.
pub(crate) struct Array {
    /// At least one.
    pub(crate) chunks: Vec<Memory>,
    /// Elements of every chunk but the last.
    pub(crate) chunk_len: usize,
    /// Elements in all.
    pub(crate) len: usize,
    /// Bytes of an element.
    pub(crate) stride: usize,
    /// The interval between two barriers in which it was last read.
    pub(crate) read_in: Stretch,
    /// The interval in which it was last written.
    pub(crate) written_in: Stretch,
    pub(crate) halves: Halves,
}

/// The numbers of an array as f16, from when a form needed them until the array is written.
#[derive(Default)]
pub(crate) struct Halves {
    version: AtomicU64,
    kept: Mutex<Option<(u64, Arc<Array>)>>,
}

impl Halves {
    /// Which writing of the array was the last.
    pub(crate) fn version(&self) -> u64 {
        self.version.load(Ordering::Relaxed)
    }

    /// The array is written: what is kept is not its own any more.
    pub(crate) fn outdate(&self) {
        self.version.fetch_add(1, Ordering::Relaxed);
    }

    /// Those of the array's present version.
    pub(crate) fn get(&self) -> Option<Arc<Array>> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.as_ref().filter(|(version, _)| *version == self.version()).map(|(_, array)| array.clone())
    }

    /// Keeps those of a version.
    pub(crate) fn keep(&self, version: u64, array: &Arc<Array>) {
        *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = Some((version, array.clone()));
    }
}

impl Array {
    pub(crate) fn new(chunks: Vec<Memory>, chunk_len: usize, len: usize, stride: usize) -> Array {
        let (read_in, written_in, halves) = Default::default();
        Array { chunks, chunk_len, len, stride, read_in, written_in, halves }
    }

    /// The array's device: handles are not valid on another one.
    pub(crate) fn check_owner(&self, handle: &Handle) -> Result<(), VulkanError> {
        let owner = self.chunks[0].owner();
        match std::ptr::eq(owner, handle) {
            true => Ok(()),
            false => Err(VulkanError::OtherDevice(handle.name.clone(), owner.name.clone())),
        }
    }

    /// The location of the elements from `first` on: the chunk, the byte in it, and how many elements follow there.
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

/// The bound ranges of an array: itself, or its pages; the first page takes the place of missing ones.
pub(crate) fn ranges(array: &Array, layout: Layout, page_shift: u32) -> impl Iterator<Item = Range> {
    let page_len = match (layout, page_shift) {
        (Layout::Whole | Layout::One, _) | (_, 0) => array.len,
        (Layout::Pages, shift) => 1 << shift,
    };
    let binding_count = if layout == Layout::Pages { MAX_PAGES } else { 1 };
    (0..binding_count).map(move |page| {
        let first = if page * page_len < array.len { page * page_len } else { 0 };
        let (memory, offset, there) = array.place(first);
        // An empty array still binds something.
        let len = page_len.min(there).max(1);
        Range { buffer: memory.buffer, offset, bytes: (len * array.stride) as u64 }
    })
}

/// The number of an interval of commands between two barriers; 0 is none.
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
