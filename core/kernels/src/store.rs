//! Writing elements by index, wherever they lie: the counterpart of [`Fetch`](viewfuse_core::fetch::Fetch).

use glam::Vec4;

/// Numbered elements that can be written.
pub trait Store<T> {
    /// Writes the element at `index`, which exists.
    fn store(&mut self, index: usize, value: T);
}

/// Numbers that can be written one by one, or four next to one another.
pub trait StoreFours: Store<f32> {
    /// Writes the elements `index` to `index + 3`, which exist; `index` is a multiple of four.
    fn store_four(&mut self, index: usize, values: Vec4) {
        self.store(index, values.x);
        self.store(index + 1, values.y);
        self.store(index + 2, values.z);
        self.store(index + 3, values.w);
    }
}

impl<T> Store<T> for [T] {
    #[inline(always)]
    fn store(&mut self, index: usize, value: T) {
        self[index] = value;
    }
}

/// A part of an array, with the indices that its elements have in the whole.
pub struct Part<'a, T> {
    /// The elements.
    pub values: &'a mut [T],
    /// The index of the first one.
    pub first: usize,
}

impl<T> Store<T> for Part<'_, T> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: T) {
        self.values[index - self.first] = value;
    }
}
