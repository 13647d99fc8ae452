//! The number of windows of a convolution or a pool along a side of an image.

/// Positions of windows on an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Windows {
    /// Rows and columns of a window, the gaps of a dilated one included, at least 1.
    pub(crate) reach: u32,
    /// Pixels from one window to the next.
    pub(crate) stride: u32,
    /// Rows and columns outside of the image on each of its sides.
    pub(crate) padding: u32,
    /// Whether a last window may reach over the padding (PyTorch's `ceil_mode`).
    pub(crate) ceil_mode: bool,
}

impl Windows {
    /// The number of windows along a side of this length; `None` if none fits.
    pub(crate) fn count(&self, side: u32) -> Option<u32> {
        let free = (side + 2 * self.padding).checked_sub(self.reach)?;
        Some(1 + if self.ceil_mode { free.div_ceil(self.stride) } else { free / self.stride })
    }

    /// The same, but at least one: where none fits, one that reaches over the padding.
    pub(crate) fn count_at_least_one(&self, side: u32) -> u32 {
        self.count(side).unwrap_or(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_those_of_pytorch() {
        let windows = Windows { reach: 3, stride: 2, padding: 0, ceil_mode: false };
        assert_eq!([2, 3, 4, 5, 6].map(|side| windows.count(side)), [None, Some(1), Some(1), Some(2), Some(2)]);
        let ceil = Windows { ceil_mode: true, ..windows };
        assert_eq!([2, 3, 4, 5, 6].map(|side| ceil.count(side)), [None, Some(1), Some(2), Some(2), Some(3)]);
        assert_eq!(Windows { reach: 7, padding: 3, ..windows }.count(128), Some(64));
        assert_eq!((windows.count_at_least_one(1), windows.count_at_least_one(5)), (1, 2));
    }
}
