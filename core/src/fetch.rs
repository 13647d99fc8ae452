//! Reading elements by index, wherever they lie.
//!
//! Functions read through [`Fetch`], so that one body serves a slice in memory, an array, and what a device binds.

/// Numbered elements that can be read.
pub trait Fetch<T> {
    /// The element at `index`, which exists.
    fn fetch(&self, index: usize) -> T;
}

impl<T: Copy> Fetch<T> for [T] {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        self[index]
    }
}

impl<T: Copy, const N: usize> Fetch<T> for [T; N] {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        self[index]
    }
}

/// Elements counted from `first` on.
#[derive(Clone, Copy)]
pub struct StartingAt<'a, F: ?Sized> {
    /// All elements.
    pub all: &'a F,
    /// The index of the one that is number 0.
    pub first: usize,
}

impl<T, F: Fetch<T> + ?Sized> Fetch<T> for StartingAt<'_, F> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        self.all.fetch(self.first + index)
    }
}
