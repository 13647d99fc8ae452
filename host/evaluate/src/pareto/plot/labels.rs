//! Labels next to points: each is at the first place around its point where it covers nothing.

/// A rectangle in pixels, its ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Space {
    pub(super) left: i32,
    pub(super) right: i32,
    pub(super) top: i32,
    pub(super) bottom: i32,
}

impl Space {
    /// A square.
    pub(super) fn around([x, y]: [i32; 2], reach: i32) -> Space {
        Space { left: x - reach, right: x + reach, top: y - reach, bottom: y + reach }
    }

    /// The approximate size of a line of text: letters of a common font are on average 0.56 as wide as high.
    pub(super) fn of_text([left, top]: [i32; 2], words: &str, size: i32) -> Space {
        let width = (0.56 * f64::from(size) * words.chars().count() as f64).ceil() as i32;
        Space { left, right: left + width, top, bottom: top + size }
    }

    pub(super) fn middle(&self) -> [i32; 2] {
        [(self.left + self.right) / 2, (self.top + self.bottom) / 2]
    }

    /// Its point nearest to another.
    pub(super) fn nearest(&self, [x, y]: [i32; 2]) -> (i32, i32) {
        (x.clamp(self.left, self.right), y.clamp(self.top, self.bottom))
    }

    /// Whether it is so far from its point that it needs a leader line.
    pub(super) fn is_far(&self, at: [i32; 2], ring: i32) -> bool {
        let (x, y) = self.nearest(at);
        (x - at[0]).abs().max((y - at[1]).abs()) > 2 * ring
    }

    /// Area of the intersection of two rectangles.
    fn common(&self, other: &Space) -> i64 {
        let width = self.right.min(other.right) - self.left.max(other.left) + 1;
        let height = self.bottom.min(other.bottom) - self.top.max(other.top) + 1;
        i64::from(width.max(0)) * i64::from(height.max(0))
    }

    fn moved(&self, [x, y]: [i32; 2]) -> Space {
        Space { left: self.left + x, right: self.right + x, top: self.top + y, bottom: self.bottom + y }
    }
}

/// The occupied parts of an area.
pub(super) struct Labels {
    area: Space,
    taken: Vec<Space>,
}

impl Labels {
    /// An empty area of this width and height.
    pub(super) fn new([width, height]: [i32; 2]) -> Labels {
        Labels { area: Space { left: 0, right: width - 1, top: 0, bottom: height - 1 }, taken: Vec::new() }
    }

    /// Labels must not cover this.
    pub(super) fn avoid(&mut self, space: Space) {
        self.taken.push(space);
    }

    /// Finds a place for words near a point that has a ring around it. If none is free, the one that covers least.
    pub(super) fn place(&mut self, at: [i32; 2], words: &str, size: i32, ring: i32) -> Space {
        let text = Space::of_text([0, 0], words, size);
        let (width, height) = (text.right, text.bottom);
        let candidates = (1..=8).flat_map(|distance| {
            let gap = ring * distance - ring + ring / 2 + 5;
            let (right, left, middle) = (gap, -gap - width, -width / 2);
            let (below, above, level) = (gap, -gap - height, -height / 2);
            [
                [right, level],
                [left, level],
                [middle, above],
                [middle, below],
                [right, above],
                [left, above],
                [right, below],
                [left, below],
            ]
        });
        let places = candidates.map(|[x, y]| text.moved([at[0] + x, at[1] + y]));
        let all = i64::from(width + 1) * i64::from(height + 1);
        let covered = |place: &Space| {
            let outside = all - place.common(&self.area);
            4 * outside + self.taken.iter().map(|taken| place.common(taken)).sum::<i64>()
        };
        // The first of equally good ones, that is the nearest.
        let best = places.min_by_key(covered).unwrap_or(text);
        self.taken.push(best);
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_a_crowd_do_not_touch_each_other() {
        let points: Vec<[i32; 2]> = (0..12).map(|index| [300 + 9 * index, 200 + 5 * (index % 3)]).collect();
        let mut labels = Labels::new([800, 500]);
        points.iter().for_each(|point| labels.avoid(Space::around(*point, 5)));
        let places: Vec<Space> = points.iter().map(|point| labels.place(*point, "all, 24+6+6", 13, 8)).collect();
        for (index, place) in places.iter().enumerate() {
            assert!(places[..index].iter().all(|other| place.common(other) == 0), "{places:?}");
            assert!(points.iter().all(|point| place.common(&Space::around(*point, 5)) == 0), "{places:?}");
        }
    }

    #[test]
    fn a_label_stays_inside() {
        for at in [[0, 0], [799, 0], [0, 499], [799, 499]] {
            let place = Labels::new([800, 500]).place(at, "a long enough setting", 13, 8);
            assert!(place.left >= 0 && place.right < 800 && place.top >= 0 && place.bottom < 500, "{place:?}");
        }
        let alone = Labels::new([800, 500]).place([400, 250], "alone", 13, 8);
        assert!(alone.left > 400 && !alone.is_far([400, 250], 8), "{alone:?}");
    }
}
