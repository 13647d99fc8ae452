//! Medians.

use std::cmp::Ordering;

/// The median by this order, of an even number the larger one of the middle two; `None` of no values.
pub fn upper_median<T: Copy>(values: impl IntoIterator<Item = T>, order: impl FnMut(&T, &T) -> Ordering) -> Option<T> {
    let mut values: Vec<T> = values.into_iter().collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// The median, of an even number the mean of the middle two; `None` of no values. NaN counts as the greatest or, with
/// its sign set, as the least.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        count if count % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians() {
        let both = |values: &[f64]| [upper_median(values.iter().copied(), f64::total_cmp), median(values.to_vec())];
        assert_eq!(both(&[]), [None, None]);
        assert_eq!(both(&[3.0]), [Some(3.0); 2]);
        assert_eq!(both(&[9.0, 1.0, 2.0]), [Some(2.0); 2]);
        assert_eq!(both(&[4.0, 1.0, 9.0, 2.0]), [Some(4.0), Some(3.0)]);
    }
}
