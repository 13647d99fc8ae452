//! Memory that the caller lends for the length of a call.

use crate::status::Status;
use viewfuse_core::fetch::Fetch;

/// Floats to read. No reference is made to them: they may overlap with what is written.
pub(crate) struct Input {
    first: *const f32,
    count: usize,
}

impl Input {
    /// # Safety
    /// Unless it is null or misaligned, `first` starts `count` floats that may be read as long as this value lives.
    pub(crate) unsafe fn new(first: *const f32, count: usize) -> Result<Input, Status> {
        checked(first, count)?;
        Ok(Input { first, count })
    }
}

impl Fetch<f32> for Input {
    /// The float at `index`; 0 beyond the end, which no caller here reaches.
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        if index < self.count {
            // SAFETY: `index` is one of the `count` floats that the maker of this value vouched for.
            unsafe { self.first.add(index).read() }
        } else {
            0.0
        }
    }
}

/// Floats to write.
pub(crate) struct Output {
    first: *mut f32,
    count: usize,
}

impl Output {
    /// # Safety
    /// Unless it is null or misaligned, `first` starts `count` floats that may be written as long as this value lives.
    pub(crate) unsafe fn new(first: *mut f32, count: usize) -> Result<Output, Status> {
        checked(first, count)?;
        Ok(Output { first, count })
    }

    /// Writes the float at `index`; nothing beyond the end, which no caller here reaches.
    #[inline(always)]
    pub(crate) fn store(&mut self, index: usize, value: f32) {
        if index < self.count {
            // SAFETY: `index` is one of the `count` floats that the maker of this value vouched for.
            unsafe { self.first.add(index).write(value) }
        }
    }
}

/// A value of a plain struct.
///
/// # Safety
/// Unless it is null or misaligned, `place` may be read, and every bit pattern is a valid `T`.
pub(crate) unsafe fn read<T: Copy>(place: *const T) -> Result<T, Status> {
    checked(place, 1)?;
    // SAFETY: neither null nor misaligned; the caller vouches for the rest.
    Ok(unsafe { place.read() })
}

/// Stores a value of a plain struct.
///
/// # Safety
/// Unless it is null or misaligned, `place` may be written.
pub(crate) unsafe fn write<T: Copy>(place: *mut T, value: T) -> Result<(), Status> {
    checked(place, 1)?;
    // SAFETY: neither null nor misaligned; the caller vouches for the rest.
    unsafe { place.write(value) };
    Ok(())
}

/// Whether `count` values can lie there: the pointer is one, and their bytes can be counted.
pub(crate) fn checked<T>(first: *const T, count: usize) -> Result<(), Status> {
    if first.is_null() || !first.is_aligned() {
        return Err(Status::Pointer);
    }
    if count > isize::MAX as usize / size_of::<T>() { Err(Status::Count) } else { Ok(()) }
}
