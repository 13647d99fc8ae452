//! Reading and writing elements by index in several pages: a buffer that is longer than a device can bind at once lies
//! in up to four [`Pages`] of equal length, a power of two.

use crate::store::Store;
use viewfuse_core::fetch::Fetch;

/// How many pages a buffer can have.
pub const MAX_PAGES: usize = 4;

/// A buffer in pages of `2^shift` elements; with `shift` 0 everything is on the first page. Unused pages may be any
/// buffer, also the first one again.
#[derive(Clone, Copy)]
pub struct Pages<'a, T> {
    /// Page 0.
    pub a: &'a [T],
    /// Page 1.
    pub b: &'a [T],
    /// Page 2.
    pub c: &'a [T],
    /// Page 3.
    pub d: &'a [T],
    /// Binary logarithm of a page's length, or 0.
    pub shift: u32,
}

impl<T: Copy> Fetch<T> for Pages<'_, T> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> T {
        if self.shift == 0 {
            return self.a[index];
        }
        let (page, at) = place(index, self.shift);
        match page {
            0 => self.a[at],
            1 => self.b[at],
            2 => self.c[at],
            _ => self.d[at],
        }
    }
}

/// [`Pages`] that are written.
pub struct PagesMut<'a, T> {
    /// Page 0.
    pub a: &'a mut [T],
    /// Page 1.
    pub b: &'a mut [T],
    /// Page 2.
    pub c: &'a mut [T],
    /// Page 3.
    pub d: &'a mut [T],
    /// Binary logarithm of a page's length, or 0.
    pub shift: u32,
}

impl<T: Copy> Store<T> for PagesMut<'_, T> {
    #[inline(always)]
    fn store(&mut self, index: usize, value: T) {
        if self.shift == 0 {
            self.a[index] = value;
            return;
        }
        let (page, at) = place(index, self.shift);
        match page {
            0 => self.a[at] = value,
            1 => self.b[at] = value,
            2 => self.c[at] = value,
            _ => self.d[at] = value,
        }
    }
}

#[inline(always)]
fn place(index: usize, shift: u32) -> (usize, usize) {
    (index >> shift, index & ((1 << shift) - 1))
}
