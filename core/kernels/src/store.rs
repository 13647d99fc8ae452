//! Writing elements by index, wherever they lie: the counterpart of [`Fetch`](viewfuse_core::fetch::Fetch).

/// Numbered elements that can be written.
pub trait Store<T> {
    /// Writes the element at `index`, which exists.
    fn store(&mut self, index: usize, value: T);
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
