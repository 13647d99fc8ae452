//! A mean and how well it is known.

/// A mean with its confidence interval of 95 %, by Student's distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The mean; NaN of no values.
    pub mean: f64,
    /// Half the width of the interval around it; `None` where fewer than two values, or an infinite one, tell nothing.
    pub half_width: Option<f64>,
}

impl Interval {
    /// Of values that are independent of each other: scenes, not targets of one scene. Sums run in the values' order.
    pub fn of(values: &[f64]) -> Interval {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let half_width = quantile(values.len().saturating_sub(1)) * (variance / count).sqrt();
        Interval { mean, half_width: Some(half_width).filter(|half| half.is_finite()) }
    }

    /// Whether 0 lies outside: of a difference, whether it is more than chance. Without a width it is not known: `false`.
    pub fn excludes_zero(&self) -> bool {
        self.half_width.is_some_and(|half_width| self.mean.abs() > half_width)
    }
}

/// The 0.975 quantile of Student's distribution; infinite for 0 degrees of freedom. To 4e-4 (Abramowitz and Stegun
/// 26.7.5).
fn quantile(freedom: usize) -> f64 {
    const NORMAL: f64 = 1.959_963_984_540_054;
    match freedom {
        0 => f64::INFINITY,
        1 => 12.706_205,
        2 => 4.302_653,
        3 => 3.182_446,
        4 => 2.776_445,
        _ => {
            let (z, n) = (NORMAL, freedom as f64);
            let square = z * z;
            let first = (square + 1.0) * z / 4.0;
            let second = ((5.0 * square + 16.0) * square + 3.0) * z / 96.0;
            let third = (((3.0 * square + 19.0) * square + 17.0) * square - 15.0) * z / 384.0;
            let fourth =
                ((((79.0 * square + 776.0) * square + 1482.0) * square - 1920.0) * square - 945.0) * z / 92_160.0;
            z + (first + (second + (third + fourth / n) / n) / n) / n
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Interval, quantile};

    #[test]
    fn quantiles_are_those_of_tables() {
        for (freedom, expected) in [(1, 12.7062), (4, 2.7764), (5, 2.5706), (10, 2.2281), (30, 2.0423), (1000, 1.9623)]
        {
            assert!((quantile(freedom) - expected).abs() < 4.0e-4, "{freedom}: {}", quantile(freedom));
        }
    }

    #[test]
    fn few_values_have_no_interval() {
        assert!(Interval::of(&[]).mean.is_nan());
        assert_eq!(Interval::of(&[3.0]), Interval { mean: 3.0, half_width: None });
        assert_eq!(Interval::of(&[3.0, f64::INFINITY]).half_width, None);
        assert_eq!(Interval::of(&[3.0, 3.0]).half_width, Some(0.0));
        // 2.776445 * sqrt(2.5 / 5).
        let five = Interval::of(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((five.half_width.expect("an interval") - 1.963_243).abs() < 1.0e-5 && five.mean == 3.0);
    }
}
