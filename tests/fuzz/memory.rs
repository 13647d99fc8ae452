//! The memory of the process, counted: how much is taken at once, and the largest piece.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Nothing takes more than this: a larger process is refused memory, and ends. The machine stays usable.
const MAX_BYTES: usize = 3 << 30;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
static PEAK_ALLOCATION: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, counted.
pub(crate) struct Counting;

/// Counts a piece; whether it may be taken.
fn take(size: usize) -> bool {
    let now = NOW.fetch_add(size, Ordering::Relaxed).saturating_add(size);
    PEAK.fetch_max(now, Ordering::Relaxed);
    PEAK_ALLOCATION.fetch_max(size, Ordering::Relaxed);
    if now > MAX_BYTES {
        NOW.fetch_sub(size, Ordering::Relaxed);
    }
    now <= MAX_BYTES
}

fn give_back(size: usize) {
    NOW.fetch_sub(size, Ordering::Relaxed);
}

/// What an allocation gave, which is not counted if it failed.
fn counted(memory: *mut u8, size: usize) -> *mut u8 {
    if memory.is_null() {
        give_back(size);
    }
    memory
}

#[expect(unsafe_code, reason = "an allocator is an unsafe trait")]
// SAFETY: everything is the system allocator's, or null, which an allocator may return.
unsafe impl GlobalAlloc for Counting {
    /// # Safety
    /// As the trait says.
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        match take(layout.size()) {
            // SAFETY: the caller's promise is the same.
            true => counted(unsafe { System.alloc(layout) }, layout.size()),
            false => std::ptr::null_mut(),
        }
    }

    /// # Safety
    /// As the trait says.
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        match take(layout.size()) {
            // SAFETY: the caller's promise is the same.
            true => counted(unsafe { System.alloc_zeroed(layout) }, layout.size()),
            false => std::ptr::null_mut(),
        }
    }

    /// # Safety
    /// As the trait says.
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        give_back(layout.size());
        // SAFETY: the caller's promise is the same; all memory is the system's.
        unsafe { System.dealloc(memory, layout) }
    }

    /// # Safety
    /// As the trait says.
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both exist while one is copied to the other.
        if !take(size) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promise is the same; all memory is the system's.
        let moved = counted(unsafe { System.realloc(memory, layout, size) }, size);
        if !moved.is_null() {
            give_back(layout.size());
        }
        moved
    }
}

/// Counts from here on; returns what is taken now.
pub(crate) fn start() -> usize {
    let now = NOW.load(Ordering::Relaxed);
    PEAK.store(now, Ordering::Relaxed);
    PEAK_ALLOCATION.store(0, Ordering::Relaxed);
    now
}

/// Most bytes taken at once since [`start`], and the largest piece.
pub(crate) fn since_start() -> [usize; 2] {
    [PEAK.load(Ordering::Relaxed), PEAK_ALLOCATION.load(Ordering::Relaxed)]
}
